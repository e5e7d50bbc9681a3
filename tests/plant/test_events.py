"""Which events of a ring are new: by number and boot, and by time where a ring counts from 1 again."""

from dataclasses import dataclass

import pytest

from app.plant.events import Mark, begins_again, is_new

MARK = Mark(3, 5, 1_000_000_000)


@dataclass(frozen=True)
class Event:
    boot: int
    sequence: int
    time: int
    code: int = 1
    source: int = 0
    value: float = 0.0
    snapshot: tuple[int, ...] = ()
    request: int = 0


@pytest.mark.parametrize(
    ("boot", "sequence", "later", "new", "again"),
    [
        (3, 6, 1, True, False),
        (4, 6, -60_000_000, True, False),
        (3, 5, 0, False, False),
        (3, 5, 5_300_000, False, False),  # the device's clock stood still before it was told once more
        (3, 5, 3_600_000_000, False, False),
        (3, 4, 0, False, False),
        (1, 1, 5_300_000, True, True),
        (1, 5, 5_300_000, True, True),
        (1, 1, 0, False, False),
    ],
)
def test_an_event_is_new_or_known(boot: int, sequence: int, later: int, new: bool, again: bool) -> None:
    event = Event(boot, sequence, MARK.time + later)
    assert (is_new(event, MARK), begins_again(event, MARK)) == (new, again)
