"""Which events of a ring are new: by number, and by what its reader knows of the ring; never by a time."""

from dataclasses import dataclass

import pytest

from app.plant.events import Ring, RingPosition, begins_again, earlier, is_new

READER, OTHER = object(), object()
FIRST, SECOND = Ring(READER, 0, 3, 5), Ring(READER, 1, 3, 5)


@dataclass(frozen=True)
class Event:
    boot: int
    sequence: int
    ring: Ring
    time: int = 0
    code: int = 1
    source: int = 0
    value: float = 0.0
    snapshot: tuple[int, ...] = ()
    request: int = 0


@pytest.mark.parametrize("later", [-86_400_000_000, -1, 0, 1, 999_999, 1_000_001, 86_400_000_000])
@pytest.mark.parametrize(
    ("boot", "sequence", "ring", "new", "again"),
    [
        # the reader of the mark goes on
        (3, 6, FIRST, True, False),
        (4, 6, FIRST, True, False),
        (3, 5, FIRST, False, False),
        (3, 1, FIRST, False, False),
        (3, 1, SECOND, True, True),
        (3, 5, SECOND, True, True),
        (3, 9, SECOND, True, True),
        # another reader: of the mark only its numbers are known
        (3, 5, Ring(OTHER, 0, 3, 5), False, False),
        (3, 4, Ring(OTHER, 0, 3, 9), False, False),
        (4, 4, Ring(OTHER, 0, 4, 5), False, False),
        (3, 6, Ring(OTHER, 7, 3, 9), True, False),
        (3, 4, Ring(OTHER, 0, 3, 4), True, True),
        (1, 1, Ring(OTHER, 0, 1, 9), True, True),
        (1, 6, Ring(OTHER, 0, 2, 6), True, True),
    ],
)
def test_an_event_is_new_or_known_whatever_the_clocks_say(
    boot: int, sequence: int, ring: Ring, new: bool, again: bool, later: int
) -> None:
    mark = RingPosition(3, 5, 1_000_000_000, FIRST)
    event = Event(boot, sequence, ring, mark.time + later)
    assert (is_new(event, mark), begins_again(event, mark)) == (new, again)
    if ring.reader is OTHER:
        mark = RingPosition(3, 5, 1_000_000_000)
        assert (is_new(event, mark), begins_again(event, mark)) == (new, again), "from a file"


def test_everything_is_new_to_who_knows_nothing() -> None:
    assert is_new(Event(1, 1, FIRST), None)


@pytest.mark.parametrize(
    ("boots", "number", "new"),
    [(65_535, 2**32 - 1, False), (65_535, 1, True), (0, 2**32 - 1, False), (0, 2, True)],
)
def test_numbers_and_boots_wrap(boots: int, number: int, new: bool) -> None:
    mark = RingPosition(65_535, 2**32 - 1, 0)
    event = Event(boots, number, Ring(OTHER, 0, boots, max(number % (2**32 - 1), 0) or 2**32 - 1))
    assert (is_new(event, mark), begins_again(event, mark)) == (new, False)


@pytest.mark.parametrize(
    ("back", "front"),
    [
        (RingPosition(3, 5, 9), RingPosition(3, 6, 1)),
        (RingPosition(3, 5, 9), RingPosition(3, 6, 1, FIRST)),
        (RingPosition(3, 5, 9, FIRST), RingPosition(3, 6, 1, FIRST)),
        (RingPosition(3, 9, 9, FIRST), RingPosition(3, 2, 1, SECOND)),
        (RingPosition(3, 9, 9), RingPosition(3, 2, 1, SECOND)),
        (RingPosition(3, 2**32 - 1, 9), RingPosition(3, 1, 1)),
    ],
)
def test_the_mark_further_back_is_told_by_rings_and_numbers(back: RingPosition, front: RingPosition) -> None:
    assert earlier(back, front) is back
    assert earlier(front, back) is back
