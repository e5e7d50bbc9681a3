"""Of events that were taken, only those are acknowledged that are stored."""

import pytest

from app.links.host_event import HostEvent
from app.links.taken_events import TakenEvents
from app.plant.events import Ring, RingPosition

RING = Ring(object(), 0, 1, 0)


def event(sequence: int, ring: Ring = RING) -> HostEvent:
    return HostEvent(sequence, 1000 * sequence, 0, 1, 0, 0.0, (), 1, ring)


def mark(sequence: int, ring: Ring | None = RING) -> RingPosition:
    return RingPosition(1, sequence, 1000 * sequence, ring)


@pytest.mark.parametrize(
    ("stored", "last", "left"),
    [(None, None, 5), (0, None, 5), (1, 1, 4), (3, 3, 2), (5, 5, 0), (9, 5, 0)],
)
def test_what_is_behind_the_mark_waits_and_the_rest_is_stored(stored: int | None, last: int | None, left: int) -> None:
    taken = TakenEvents()
    taken.add(event(n) for n in range(1, 6))
    taken.stored_up_to(None if stored is None else mark(stored))
    assert (taken.stored, len(taken)) == (last, left)


def test_numbers_wrap() -> None:
    taken = TakenEvents()
    taken.add([event(2**32 - 1), event(1), event(2)])
    taken.stored_up_to(mark(1))
    assert (taken.stored, len(taken)) == (1, 1)


def test_a_mark_of_the_ring_before_stores_nothing_of_the_next() -> None:
    after, taken = Ring(RING.reader, 1, 2, 3), TakenEvents()
    taken.add([event(1, after), event(2, after)])
    taken.stored_up_to(mark(50))
    assert (taken.stored, len(taken)) == (None, 2)


def test_where_the_taker_stores_nothing_waits() -> None:
    taken = TakenEvents()
    taken.add([event(1), event(2)])
    taken.all_stored(7)
    assert (taken.stored, len(taken)) == (7, 0)
