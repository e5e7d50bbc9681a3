"""When alarms come and go: delays, limits, lost data, suppression while a device is silent."""

from dataclasses import replace

from app.alarms.lifecycle import AlarmState
from app.tags.quality import COMM_FAILURE
from tests.alarms.conftest import ANA, HOT, LOST, TRIP, Plot


async def test_shorter_than_the_on_delay_is_no_alarm_and_no_record(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, on_delay=10.0))
    plot.put(t=71.0)
    plot.wait(9.9)
    plot.put(t=60.0)
    plot.wait(10)
    assert engine.list.active() == []
    assert await plot.records() == []


async def test_raise_time_is_when_it_first_was_true_and_annunciation_comes_after_the_delay(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, on_delay=10.0))
    began = plot.clock.micros()
    plot.put(t=71.0)
    assert engine.evaluation.due == plot.clock.monotonic() + 10
    plot.wait(10)
    (one,) = engine.list.active()
    assert (one.state, one.first_true, one.annunciated) == (AlarmState.UNACKNOWLEDGED, began, began + 10_000_000)
    (record,) = await plot.records()
    assert (record.first_true, record.time, record.value, record.limit, record.unit) == (
        began,
        began + 10_000_000,
        71.0,
        70.0,
        "°C",
    )
    assert record.text == "Vruće: 71.0 > 70.0"


async def test_the_off_delay_keeps_an_alarm(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, off_delay=5.0))
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.put(t=60.0)
    plot.wait(4.9)
    plot.put(t=71.0)
    plot.put(t=60.0)
    plot.wait(4.9)
    assert plot.letters == "C"
    plot.wait(0.2)
    assert plot.letters == ""


async def test_high_and_very_high_are_two_alarms(plot: Plot) -> None:
    engine = await plot.begin(HOT, replace(HOT, key="very_hot", limit=80.0, priority=1))
    plot.put(t=81.0)
    assert [one.key for one in engine.list.active()] == ["very_hot", "hot"]
    await engine.acknowledge([engine.list.active()[1].occurrence], ANA)
    assert [(one.key, str(one.state)) for one in engine.list.active()] == [("very_hot", "B"), ("hot", "C")]


async def test_data_that_vanish_never_end_an_alarm_and_the_lost_link_is_told_once(plot: Plot) -> None:
    engine = await plot.begin(HOT, LOST)
    plot.put(t=71.0, status=1)
    plot.put(quality=COMM_FAILURE, t=71.0, status=1)
    assert [(one.key, str(one.state), one.known) for one in engine.list.active()] == [("hot", "B", False)]
    plot.wait(3)
    assert [one.key for one in engine.list.active()] == ["communication"]
    assert [(one.key, str(one.state), one.rule) for one in engine.list.hidden()] == [("hot", "H", "communication")]
    plot.put(quality=COMM_FAILURE, t=0.0, status=0, after=1)
    plot.wait(60)
    assert (await plot.story()).count("RAISED AB") == 2
    assert "RTN" not in " ".join(await plot.story())


async def test_garbage_raises_nothing(plot: Plot) -> None:
    engine = await plot.begin(HOT, TRIP)
    plot.put(quality=COMM_FAILURE, t=999.0, status=4)
    plot.wait(60)
    assert engine.list.active() == []
    assert await plot.records() == []


async def test_when_the_device_answers_again_its_alarms_come_back_after_their_delay(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, on_delay=2.0), LOST)
    plot.put(t=71.0, status=1)
    plot.wait(2)
    hot = engine.list.active()[0].occurrence
    plot.put(quality=COMM_FAILURE, t=71.0, status=1)
    plot.wait(3)
    plot.put(t=72.0, status=1)
    plot.wait(5)
    assert [one.key for one in engine.list.active()] == ["communication"], "the link is back, the rest is judged anew"
    plot.wait(2)
    assert {one.key for one in engine.list.active()} == {"communication", "hot"}
    assert next(one for one in engine.list.active() if one.key == "hot").occurrence > hot


async def test_what_raises_while_its_device_is_silent_is_written_down_silently(plot: Plot) -> None:
    engine = await plot.begin(replace(HOT, value="t"), LOST)
    plot.put(t=60.0, status=1)
    plot.put(quality=COMM_FAILURE, status=1)
    plot.wait(3)
    told = engine.annunciations.count
    plot.put(t=75.0)
    assert engine.annunciations.count == told
    assert [(one.event, one.before, one.after, one.silent) for one in await plot.records()][-2:] == [
        ("SUPPRESSED", "A", "H", False),
        ("RAISED", "H", "H", True),
    ]


async def test_a_chattering_alarm_is_one_row_with_its_count(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    for _ in range(5):
        plot.put(t=71.0, after=5)
        plot.put(t=60.0, after=5)
    (one,) = engine.list.active()
    assert (one.count, one.chattering) == (5, True)
    assert [line.split()[0] for line in await plot.story()] == ["RAISED", "RTN"] * 5
    await engine.acknowledge([one.occurrence], ANA)
    plot.put(t=71.0, after=3600)
    assert (engine.list.active()[0].count, engine.list.active()[0].chattering) == (1, False)
