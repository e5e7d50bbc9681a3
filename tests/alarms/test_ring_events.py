"""Alarms that events of a device raise: their own time and order, once, whatever is lost, late or delivered again."""

import itertools
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest

from app.alarms.conditions import EVENT_LATE
from app.alarms.lifecycle import AlarmState, Life
from app.clock import ManualClock
from app.db import Database
from app.plant.definitions import Alarm
from app.tags.quality import COMM_FAILURE
from tests.alarms.conftest import ANA, LOST, Plot
from tests.historian.rings import SECOND, Ring
from tests.virtual import inline

PASSED = Alarm("passed", "alarm.hot.label", "", 3, event=10, source=2)
"""Momentary."""
HELD = Alarm("held", "alarm.trip.label", "", 2, event=20, event_clear=21)
"""From one event to another."""
STOPPED = Alarm("stopped", "alarm.trip.label", "status == 4", 2, event=22, event_clear=23)
"""With a value that says whether it stands."""
JAM = replace(STOPPED, key="jam", expression="status in (4, 5)", event=24, event_clear=25)


@pytest.fixture
async def plot(tmp_path: Path) -> AsyncIterator[Plot]:
    database = Database(tmp_path / "pogon.db", "pogon", inline)
    database.migrate()
    yield Plot(database, ManualClock())
    database.close()


class Line:
    """A machine whose events arrive when the test says so; now is 10 s after the ring began."""

    def __init__(self, plot: Plot) -> None:
        self.plot = plot
        self.ring = Ring(time=plot.clock.micros())
        plot.clock.advance(10)

    def deliver(self, lost: int = 0) -> None:
        self.plot.engine.ring.take("m1", self.ring.drain(), lost)


async def test_an_event_raises_with_its_own_time_value_and_products(plot: Plot) -> None:
    engine = await plot.begin(PASSED)
    line = Line(plot)
    event = line.ring.tell(10, 7, source=2, value=2.125, second=6, other=1.5)
    line.deliver()
    (one,) = engine.list.active()
    assert (one.state, one.first_true, one.value) == (AlarmState.RETURNED, event.time, 2.125)
    assert dict(one.params) == {
        "product": 7,
        "products": "7",
        "second": 6,
        "source": 2,
        "second_value": 1.5,
        "event": 1,
    }
    assert await plot.story() == ["RAISED AB", "RTN BD"]
    raised, over = await plot.records()
    assert (raised.time, over.time, raised.value) == (event.time, event.time, 2.125)
    assert raised.text == "Vruće: 2.1 > {limit}"
    await engine.acknowledge([one.occurrence], ANA)
    assert plot.letters == ""


async def test_another_source_is_another_alarm(plot: Plot) -> None:
    engine = await plot.begin(PASSED, replace(PASSED, key="three", source=3), replace(PASSED, key="any", source=None))
    line = Line(plot)
    line.ring.tell(10, 7, source=3, value=1.0)
    line.deliver()
    assert sorted(one.key for one in engine.list.active()) == ["any", "three"]


async def test_each_event_is_an_occurrence_and_acknowledging_the_first_never_meets_the_second(plot: Plot) -> None:
    engine = await plot.begin(PASSED)
    line = Line(plot)
    line.ring.tell(10, 7, source=2, value=2.0)
    line.deliver()
    (first,) = engine.list.active()
    line.ring.tell(10, 8, source=2, value=3.0)
    line.deliver()
    (second,) = engine.list.active()
    assert second.occurrence != first.occurrence
    assert (second.params["product"], second.count) == (8, 2)
    (answer,) = await engine.acknowledge([first.occurrence], ANA)
    assert answer.outcome == "gone"
    assert plot.letters == "D"


@pytest.mark.parametrize("alarm", [PASSED, HELD, STOPPED], ids=lambda alarm: alarm.key)
async def test_one_row_names_all_products_that_nobody_has_acknowledged_yet(plot: Plot, alarm: Alarm) -> None:
    engine = await plot.begin(alarm)
    line = Line(plot)
    plot.put(status=4)

    def named(*products: int) -> str:
        for product in products:
            line.ring.tell(alarm.event, product, source=2, value=2.0)
        line.deliver()
        (one,) = engine.list.active()
        assert one.params["product"] == products[-1]
        return str(one.params["products"])

    assert named(7) == "7"
    assert named(8) == "7, 8"
    assert named(7) == "8, 7", "lost again at the next sensor"
    assert named(9, 10) == "8, 7, 9, 10"
    assert named(11) == "…, 9, 10, 11"
    assert named(12) == "…, 10, 11, 12"
    (one,) = engine.list.active()
    assert one.count == 7
    await engine.acknowledge([one.occurrence], ANA)
    acknowledged = [record for record in await plot.records() if record.event == "ACK"]
    assert '"products":"…, 10, 11, 12"' in acknowledged[0].params, "he took care of all that he saw"
    assert named(13) == "13", "the others are taken care of"


async def test_a_restart_forgets_none_of_the_products_that_nobody_has_acknowledged(plot: Plot) -> None:
    engine = await plot.begin(PASSED)
    line = Line(plot)
    line.ring.tell(10, 7, source=2, value=2.0)
    line.deliver()
    await engine.journal.flush()
    engine = await plot.begin(PASSED)
    line.ring.tell(10, 8, source=2, value=2.0)
    line.deliver()
    assert [one.params["products"] for one in engine.list.active()] == ["7, 8"]


async def test_an_event_without_a_product_names_none(plot: Plot) -> None:
    engine = await plot.begin(PASSED)
    line = Line(plot)
    line.ring.tell(10, source=2, value=2.0)
    line.deliver()
    assert [one.params["products"] for one in engine.list.active()] == ["–"]
    line.ring.tell(10, 8, source=2, value=2.0)
    line.deliver()
    assert [one.params["products"] for one in engine.list.active()] == ["8"]


async def test_order_within_a_stop_comes_from_the_ring_not_from_polling(plot: Plot) -> None:
    engine = await plot.begin(STOPPED, JAM, HELD)
    line = Line(plot)
    plot.put(status=4)  # polled first, and all in one scan
    line.ring.tell(20, after=0.001)
    line.ring.tell(24, after=0.0)  # the same microsecond: the ring still knows
    line.ring.tell(22, after=0.002)
    line.deliver()
    order = {one.key: (one.ordinal, one.uncertain) for one in engine.list.active()}
    assert order == {"held": (1, False), "jam": (2, False), "stopped": (3, False)}
    plot.wait(5)
    assert {one.key: one.ordinal for one in engine.list.active()} == {"held": 1, "jam": 2, "stopped": 3}, (
        "nothing doubled"
    )


async def test_the_next_stop_counts_from_one(plot: Plot) -> None:
    engine = await plot.begin(PASSED, HELD)
    line = Line(plot)
    line.ring.tell(10, 1, source=2, value=2.0)
    line.deliver()
    plot.clock.advance(120)  # it still waits for somebody, but that was another stop
    line.ring.time += 120 * SECOND
    line.ring.tell(20)
    line.deliver()
    assert {one.key: one.ordinal for one in engine.list.active()} == {"passed": 1, "held": 1}


async def test_the_clearing_event_ends_it_at_its_own_time(plot: Plot) -> None:
    engine = await plot.begin(HELD)
    line = Line(plot)
    line.ring.tell(20)
    over = line.ring.tell(21)
    line.deliver()
    (one,) = engine.list.active()
    assert (one.state, one.returned) == (AlarmState.RETURNED, over.time)


async def test_a_value_older_than_the_event_does_not_end_it_and_a_false_one_does(plot: Plot) -> None:
    engine = await plot.begin(STOPPED)
    line = Line(plot)
    plot.put(status=0)
    line.ring.tell(22)
    line.deliver()
    plot.put(status=1)  # still from before
    assert plot.letters == "B"
    plot.put(status=4)
    plot.wait(60)
    assert plot.letters == "B"
    plot.put(status=0)
    assert plot.letters == "D"
    (one,) = engine.list.active()
    assert one.count == 1


async def test_an_event_that_no_value_ever_bears_out_is_over_after_two_seconds(plot: Plot) -> None:
    await plot.begin(STOPPED)
    line = Line(plot)
    plot.put(status=0)
    line.ring.tell(22)
    line.deliver()
    plot.wait(EVENT_LATE - 0.1)
    assert plot.letters == "B"
    plot.wait(0.2)
    assert plot.letters == "D"


async def test_a_lost_event_is_raised_by_its_value_two_seconds_later(plot: Plot) -> None:
    engine = await plot.begin(STOPPED)
    plot.put(status=4)
    plot.wait(EVENT_LATE - 0.1)
    assert plot.letters == ""
    plot.wait(0.1)
    (one,) = engine.list.active()
    assert (one.state, one.params["product"], one.params["event"]) == (AlarmState.UNACKNOWLEDGED, "–", 0)


@pytest.mark.parametrize("over", [False, True])
async def test_a_late_event_explains_what_its_value_has_raised_and_doubles_nothing(plot: Plot, over: bool) -> None:
    engine = await plot.begin(STOPPED)
    line = Line(plot)
    event = line.ring.tell(22, 5, value=1.0, after=9.9)
    plot.put(status=4)
    plot.wait(3)
    if over:
        plot.put(status=0)
    (before,) = engine.list.active()
    line.deliver()
    (after,) = engine.list.active()
    assert (after.occurrence, after.state, after.count) == (before.occurrence, before.state, 1)
    assert (after.first_true, after.params["product"], after.value) == (event.time, 5, 1.0)
    assert [line.split()[0] for line in await plot.story()].count("RAISED") == 1
    if not over:
        line.ring.time = plot.clock.micros()
        line.ring.tell(23, after=0)
        line.deliver()
        assert plot.letters == "D"


async def test_an_event_while_it_waits_for_its_delay_raises_at_once_and_once(plot: Plot) -> None:
    await plot.begin(STOPPED)
    line = Line(plot)
    plot.put(status=4)
    plot.wait(1)
    line.ring.tell(22)
    line.deliver()
    assert plot.letters == "B"
    plot.wait(10)
    assert await plot.story() == ["RAISED AB"]


async def test_a_second_event_while_it_stands_is_a_second_occurrence(plot: Plot) -> None:
    engine = await plot.begin(STOPPED)
    line = Line(plot)
    plot.put(status=4)
    line.ring.tell(22, 1)
    line.deliver()
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    line.ring.tell(22, 2)
    line.deliver()
    (one,) = engine.list.active()
    assert (one.state, one.params["product"]) == (AlarmState.UNACKNOWLEDGED, 2)
    assert await plot.story() == ["RAISED AB", "ACK BC", "RTN CA", "RAISED AB"]


async def test_delivered_again_nothing_happens(plot: Plot) -> None:
    engine = await plot.begin(PASSED, HELD)
    line = Line(plot)
    line.ring.tell(20)
    line.ring.tell(10, 1, source=2, value=1.0)
    events = list(line.ring.events)
    line.deliver()
    story, revision = await plot.story(), engine.list.revision
    engine.ring.take("m1", events)
    engine.ring.take("m1", events[1:])
    assert (await plot.story(), engine.list.revision) == (story, revision)


@pytest.mark.parametrize("shift", [-3600, 2, 86_400])
async def test_delivered_again_after_a_restart_and_a_clock_that_was_set_nothing_happens(plot: Plot, shift: int) -> None:
    engine = await plot.begin(PASSED)
    line = Line(plot)
    for product in (1, 2, 3):
        line.ring.tell(10, product, source=2, value=1.0)
    told = list(line.ring.events)
    line.deliver()
    await engine.journal.flush()
    engine = await plot.begin(PASSED)
    story = await plot.story()
    plot.clock.step_wall(shift)
    met = replace(line.ring.which, reader=object())
    engine.ring.take("m1", [replace(one, time=one.time + shift * 1_000_000, ring=met) for one in told])
    assert await plot.story() == story
    line.ring.tell(10, 4, source=2, value=1.0)
    engine.ring.take("m1", line.ring.drain())
    assert len(await plot.story()) > len(story)


async def test_a_server_that_was_killed_raises_nothing_old_and_misses_nothing_new(plot: Plot) -> None:
    engine = await plot.begin(PASSED, HELD, STOPPED)
    line = Line(plot)
    plot.put(status=4)
    line.ring.tell(22, 3)
    line.ring.tell(20)
    line.ring.tell(10, 1, source=2, value=1.0)
    events = list(line.ring.events)
    line.deliver()
    await engine.journal.settle()
    for one in engine.list.active():
        await engine.acknowledge([one.occurrence], ANA)
    # killed: no close
    engine = await plot.begin(PASSED, HELD, STOPPED)
    mark = engine.journal.last_event("m1")
    assert mark is not None
    assert (mark.boot, mark.sequence) == (1, 3)
    assert sorted(f"{one.key} {one.state}" for one in engine.list.active()) == ["held C", "stopped C"]
    line.ring.tell(21)
    engine.ring.take("m1", [*events, *line.ring.drain()])
    assert [f"{one.key} {one.state}" for one in engine.list.active()] == ["stopped C"], (
        "the event ended what came before"
    )
    plot.put(status=0)
    assert plot.letters == ""


async def test_what_happened_while_the_server_was_down_is_raised_with_its_time(plot: Plot) -> None:
    engine = await plot.begin(PASSED)
    line = Line(plot)
    line.ring.tell(30)
    line.deliver()
    await engine.journal.flush()
    plot.clock.advance(3600)
    engine = await plot.begin(PASSED)
    event = line.ring.tell(10, 5, source=2, value=1.0)
    line.deliver()
    assert [one.first_true for one in engine.list.active()] == [event.time]


async def test_a_machine_met_for_the_first_time_does_not_tell_its_past(plot: Plot) -> None:
    engine = await plot.begin(PASSED)
    ring = Ring(time=plot.clock.micros())
    ring.tell(10, 1, source=2, value=1.0)
    plot.clock.advance(3600)
    engine.ring.take("m1", ring.drain())
    assert engine.list.active() == []
    ring.time = plot.clock.micros()
    ring.tell(10, 2, source=2, value=1.0, after=0)
    engine.ring.take("m1", ring.drain())
    assert [one.params["product"] for one in engine.list.active()] == [2]


async def test_lost_events_are_told_counted_and_what_only_they_could_end_is_not_known(plot: Plot) -> None:
    engine = await plot.begin(HELD)
    line = Line(plot)
    line.ring.tell(20)
    line.deliver()
    line.ring.sequence += 5
    line.ring.tell(30)
    line.deliver(lost=5)
    found = {one.key: one for one in engine.list.active()}
    assert found["events_lost"].params == {"count": 5}
    assert found["held"].known is False
    line.ring.sequence += 2
    line.ring.tell(21)
    line.deliver(lost=9)  # the link counts from what the history has: only two are new to the alarms
    found = {one.key: one for one in engine.list.active()}
    assert found["events_lost"].params == {"count": 7}
    assert (found["held"].known, found["held"].state) == (True, AlarmState.RETURNED)
    await engine.acknowledge([found["events_lost"].occurrence], ANA)
    assert [one.key for one in engine.list.active()] == ["held"]


async def test_what_a_device_tells_is_not_hidden_by_the_communication_that_was_lost(plot: Plot) -> None:
    engine = await plot.begin(LOST, PASSED, STOPPED)
    line = Line(plot)
    plot.put(status=0)
    line.ring.tell(10, 1, source=2, value=1.0)
    line.deliver()
    plot.put(quality=COMM_FAILURE, status=None)
    plot.wait(3)
    assert sorted(f"{one.key} {one.state}" for one in engine.list.active()) == ["communication B", "passed D"], (
        "it happened"
    )
    line.ring.tell(22, 4)
    plot.put(status=4)  # it answers again; the alarm of the communication stays for its off-delay
    line.deliver()
    assert {one.key: str(one.state) for one in engine.list.active()}["stopped"] == "B"
    plot.wait(6)
    assert {one.key: str(one.state) for one in engine.list.active()}["stopped"] == "B"


async def test_a_reload_in_mid_stop_changes_nothing(plot: Plot) -> None:
    engine = await plot.begin(HELD, STOPPED)
    line = Line(plot)
    plot.put(status=0)
    line.ring.tell(20)
    line.ring.tell(22)
    line.deliver()
    before = [(one.key, one.state, one.occurrence) for one in engine.list.active()]
    plot.configure(plot.plant)
    assert [(one.key, one.state, one.occurrence) for one in engine.list.active()] == before
    plot.wait(3)
    assert {one.key: str(one.state) for one in engine.list.active()} == {"held": "B", "stopped": "D"}


LIVES = [
    Life(active, acked, latched, shelved, suppressed, out)
    for active, acked, latched, shelved, suppressed, out in itertools.product((False, True), repeat=6)
    if not (active and latched)
]
AFTER_EVENT = {"A": "B", "B": "B", "C": "B", "D": "B", "E": "B", "F": "B", "G": "G", "H": "H", "I": "I"}
AFTER_CLEAR = {"A": "A", "B": "D", "C": "A", "D": "D", "E": "E", "F": "F", "G": "G", "H": "H", "I": "I"}
AFTER_MOMENT = {"A": "D", "B": "D", "C": "D", "D": "D", "E": "D", "F": "D", "G": "G", "H": "H", "I": "I"}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("life", LIVES, ids=lambda life: str(life))
@pytest.mark.parametrize(("code", "wanted"), [(20, AFTER_EVENT), (21, AFTER_CLEAR), (10, AFTER_MOMENT)])
async def test_every_state_takes_every_event(plot: Plot, life: Life, code: int, wanted: dict[str, str]) -> None:
    """State × event: what is hidden stays hidden and goes on silently, what is shown is raised or ended."""
    engine = await plot.begin(PASSED if code == 10 else HELD)
    (watch,) = (one for one in engine._index if one.alarm.event)
    watch.life = life
    watch.delay.restart(life.active)
    watch.condition.raised = life.active  # type: ignore[union-attr, attr-defined]
    watch.event = 1 if life.active else 0
    before = life.state
    line = Line(plot)
    line.ring.tell(code, 4, source=2, value=1.0)
    line.deliver()
    assert str(watch.life.state) == wanted[str(before)]
    if before in "GHI" and code == 20:
        assert watch.life.active, "the condition goes on while it is hidden"
    if code != 20:
        assert not watch.life.active
    assert all(record.silent for record in await plot.records()) or before not in "GHI"
