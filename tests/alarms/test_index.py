"""The index finds every alarm by id, point, machine and event, in the order in which they were taken in."""

from dataclasses import replace

from app.alarms.index import AlarmIndex
from app.plant.definitions import Alarm
from app.tags.database import Tag, TagDatabase
from tests.alarms.conftest import BLOCKED, HOT, LOST, TRIP, Plot, plant

JAM = Alarm("jam", "alarm.jam.label", "", 2, event=7, event_clear=8)


def filled(plot: Plot, *alarms: Alarm) -> tuple[AlarmIndex, TagDatabase]:
    tags, made = TagDatabase(plot.clock), plant(*alarms, machines=("m1", "m2"))
    tags.configure(Tag(point.name, point.id, "hall") for point in made.points.values())
    index = AlarmIndex(tags)
    index.fill(made.equipment)
    return index, tags


async def test_who_reads_a_point_comes_once_and_in_order(plot: Plot) -> None:
    index, tags = filled(plot, TRIP, HOT, BLOCKED, LOST)
    order = [watch.id for watch in index]
    assert [watch.index for watch in index] == list(range(8))
    readers = {"m1.status": ["m1.trip", "m1.blocked", "m1.communication"], "m1.t": ["m1.hot"]}
    for name, wanted in readers.items():
        assert [watch.id for watch in index.readers([tags.handle(name)])] == wanted
    every = [tags.handle(name) for name in ("m2.status", "m1.t", "m1.status", "m2.t", "m1.t")]
    assert [watch.id for watch in index.readers(every)] == order
    assert index.readers([10_000]) == []


async def test_the_lost_communication_is_the_root_of_its_machine_only(plot: Plot) -> None:
    index, _ = filled(plot, TRIP, LOST)
    assert [index.root(id).id for id in ("m1", "m2")] == ["m1.communication", "m2.communication"]  # type: ignore[union-attr]
    assert index.root("m3") is None
    assert [watch.id for watch in index.members("m2")] == ["m2.trip", "m2.communication"]
    assert list(index.members("m3")) == []


async def test_an_event_finds_what_it_raises_and_what_it_ends(plot: Plot) -> None:
    index, _ = filled(plot, JAM, replace(JAM, key="late", event=8, event_clear=0))
    found = {code: [watch.id for watch in index.of_event("m1", code)] for code in (6, 7, 8)}
    assert found == {6: [], 7: ["m1.jam"], 8: ["m1.jam", "m1.late"]}
    assert list(index.of_event("m3", 7)) == []


async def test_a_sentence_that_ends_what_was_reported_is_listened_to_once(plot: Plot) -> None:
    index, tags = filled(plot, HOT)
    watch = index.of_system("sys.stop_unconfirmed.m1", "stop_unconfirmed", "m1")
    index.add(watch)
    status = tags.handle("m1.status")
    assert index.readers([status]) == []
    for _ in range(2):
        index.listen(watch, "status == 0")
        assert index.readers([status]) == [watch]
    assert (watch.area, watch.type) == ("drives", "fan")


async def test_cleared_it_gives_back_what_was_there_and_knows_nothing(plot: Plot) -> None:
    index, tags = filled(plot, TRIP, LOST)
    old = index.take(AlarmIndex(tags))
    assert list(old) == ["m1.trip", "m1.communication", "m2.trip", "m2.communication"]
    assert (list(index), index.root("m1"), list(index.members("m1"))) == ([], None, [])
    assert index.readers(range(len(tags.tags))) == []
