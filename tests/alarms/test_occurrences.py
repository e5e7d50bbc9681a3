"""An acknowledgement meets the occurrence that the person saw, and no other."""

from dataclasses import replace

from tests.alarms.conftest import ANA, HOT, Plot

IVO = replace(ANA, id=8, name="ivo", display="Ivo Ban")


async def test_a_late_acknowledgement_never_meets_the_next_occurrence(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    first = engine.list.active()[0]
    plot.put(t=60.0)
    plot.put(t=71.0)
    second = engine.list.active()[0]
    assert second.count == 2
    assert second.occurrence != first.occurrence
    (answer,) = await engine.acknowledge([first.occurrence], ANA)
    assert answer.outcome == "gone"
    assert plot.letters == "B"


async def test_the_second_of_two_acknowledgements_says_by_whom(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    occurrence = engine.list.active()[0].occurrence
    first, second = await engine.acknowledge([occurrence], ANA), await engine.acknowledge([occurrence], IVO)
    assert (first[0].outcome, second[0].outcome, second[0].by) == ("done", "already", "Ana Kos")
    plot.put(t=60.0)
    assert (await engine.acknowledge([occurrence], IVO))[0].by == "Ana Kos", "also when it is over"
    assert (await plot.story()).count("ACK BC") == 1


async def test_occurrences_are_never_numbered_twice(plot: Plot) -> None:
    engine = await plot.begin(HOT)
    plot.put(t=71.0)
    first = engine.list.active()[0].occurrence
    await engine.acknowledge([first], ANA)
    plot.put(t=60.0)
    await engine.journal.flush()
    again = await plot.begin(HOT)
    plot.put(t=71.0)
    assert again.list.active()[0].occurrence > first
