"""Lost events are told with the two between which they are missing."""

import random

import pytest

from app.clock import ManualClock
from app.db import Database
from app.historian.event_gaps import Gap, Place, gaps
from app.historian.events import Delivery, Events, store
from tests.historian.rings import BEGIN, SECOND, Event, Ring


def deliver(history: Database, equipment: str, told: list[Event], lost: int = 0) -> None:
    history.run(lambda connection: store(connection, Delivery(equipment, told, lost), (), BEGIN))


def found(history: Database, equipment: str = "", most: int = 100) -> list[Gap]:
    return history.run(lambda connection: gaps(connection, equipment, None, None, most))


def place(one: Event | None) -> Place | None:
    return one and Place(one.boot, one.sequence, one.time)


@pytest.mark.parametrize("seed", range(10))
def test_each_gap_lies_between_its_neighbours(history: Database, seed: int) -> None:
    """Of two machines at once, over restarts and clocks that are set back, however deliveries are cut."""
    chance = random.Random(seed)
    rings, last, wanted = {"c1": Ring(), "c2": Ring(sequence=500)}, dict[str, Event](), list[Gap]()
    for _ in range(60):
        name = chance.choice(list(rings))
        ring = rings[name]
        lost = chance.choice([0, 0, 1, 7])
        ring.sequence += lost
        if chance.random() < 0.1:
            ring.boot += 1
        if chance.random() < 0.1:
            ring.time -= 3600 * SECOND
        first = ring.tell(1)
        for _ in range(chance.randrange(3)):
            ring.tell(2)
        told = ring.drain()
        deliver(history, name, told, lost)
        if lost:
            wanted.append(Gap(name, lost, first.time, place(last.get(name)), place(first)))
        last[name] = told[-1]
    key = [(one.noticed, one.equipment) for one in wanted]
    assert len(set(key)) == len(key)
    wanted.sort(key=lambda one: one.equipment)
    wanted.sort(key=lambda one: -one.noticed)
    assert found(history) == wanted
    assert found(history, "c2") == [one for one in wanted if one.equipment == "c2"]
    assert found(history, most=3) == wanted[:3]


async def test_a_loss_after_which_nothing_came_has_no_end(history: Database) -> None:
    clock = ManualClock()
    made, ring = Events(history, clock), Ring()
    made._machines = frozenset({"c1"})
    last = ring.tell(1)
    await made.take("c1", ring.drain())
    clock.advance(50)
    await made.take("c1", (), 4)
    (gap,) = found(history)
    assert (gap.count, gap.before, gap.noticed) == (4, None, clock.micros())
    assert gap.after == (place(last) if last.time <= clock.micros() else None)


def test_nothing_is_before_the_first_event_that_ever_came(history: Database) -> None:
    ring = Ring(sequence=40)
    first = ring.tell(1)
    deliver(history, "c1", ring.drain(), 9)
    assert found(history) == [Gap("c1", 9, first.time, None, place(first))]


def test_a_gap_is_found_by_the_time_of_what_comes_after_it(history: Database) -> None:
    ring = Ring()
    for _ in range(5):
        ring.sequence += 2
        ring.tell(1, after=60)
        deliver(history, "c1", ring.drain(), 2)
    span = (BEGIN + 100 * SECOND, BEGIN + 250 * SECOND)
    assert [one.count for one in history.run(lambda connection: gaps(connection, "", *span))] == [2, 2, 2]
