"""All alarms of a plant at work: the stories of reference/alarms.md section 12 against a real database."""

from tests.alarms.conftest import ANA, HOT, Plot


async def test_acknowledging_ends_the_sound_and_says_who_in_the_journal(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    assert plot.count("sound") == 3
    (answer,) = await engine.acknowledge([engine.list.active()[0].occurrence], ANA, "I go and look")
    assert (answer.outcome, answer.by) == ("done", "Ana Kos")
    assert plot.letters == "C"
    assert plot.count("sound") == 0
    last = (await plot.records())[-1]
    assert (last.event, last.person, last.address, last.comment, last.roles) == (
        "ACK",
        "ana",
        "10.0.0.7",
        "I go and look",
        "operator",
    )


async def test_a_returned_alarm_stays_until_it_is_acknowledged(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    plot.put(t=60.0, after=5)
    assert plot.letters == "D"
    assert engine.list.active()[0].symbol == "rtn"
    assert plot.count("sound") == 0, "silenced on return"
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    assert plot.letters == ""


async def test_an_acknowledged_alarm_goes_by_itself(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    await engine.acknowledge([engine.list.active()[0].occurrence], ANA)
    plot.put(t=60.0)
    assert plot.letters == ""
    assert await plot.story() == ["RAISED AB", "ACK BC", "RTN CA"]


async def test_texts_of_parameters_stay_data(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    engine.system.report("task_down", None, True, {"task": "<img onerror=alert(1)>"})
    plot.wait(1)
    assert engine.list.active()[0].params == {"task": "<img onerror=alert(1)>"}
    assert (await plot.records())[0].parameters == {"task": "<img onerror=alert(1)>"}
