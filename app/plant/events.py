"""Events of machines as their readers see them, and which of them are new."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

RESTARTED = 1_000_000
"""An event this much later than the last one is new although its number is not [µs]: the ring began again. Delivered again, an event has
the time that it had, within the few ms of how well the device's clock is known."""
HALF = 2**31


class RingEvent(Protocol):
    """One event of a device's ring, its time put into ours (links/events.py, `HostEvent`)."""

    @property
    def sequence(self) -> int:
        """1 … 2³²−1, rises by one; it goes on over power cycles."""
        ...

    @property
    def time(self) -> int:
        """When it happened [µs UTC]."""
        ...

    @property
    def code(self) -> int: ...
    @property
    def source(self) -> int: ...
    @property
    def value(self) -> float: ...
    @property
    def snapshot(self) -> Sequence[int]: ...
    @property
    def boot(self) -> int:
        """How often the device had been switched on."""
        ...

    @property
    def request(self) -> int:
        """Id of the command that caused it; 0 = none did, or the device does not say."""
        ...


@dataclass(frozen=True, slots=True)
class Mark:
    """The last event of a machine that somebody has dealt with."""

    boot: int
    sequence: int
    time: int
    """[µs UTC]"""

    @property
    def seen(self) -> tuple[int, int]:
        """Boot and sequence, as a link asks for it."""
        return self.boot, self.sequence


def mark_of(event: RingEvent) -> Mark:
    """The mark behind `event`."""
    return Mark(event.boot, event.sequence, event.time)


def is_new(event: RingEvent | Mark, mark: Mark | None) -> bool:
    """Whether `event` comes after `mark`; numbers wrap after 2³²−1."""
    return mark is None or _ahead(event, mark) or begins_again(event, mark)


def begins_again(event: RingEvent | Mark, mark: Mark) -> bool:
    """Whether `event` is of a ring that counts from 1 again: its device has lost what it retains, or is another one.

    The very event of the mark is none: delivered again, it has another time when the device's clock stood still meanwhile.
    """
    same = (event.boot, event.sequence) == (mark.boot, mark.sequence)
    return not same and not _ahead(event, mark) and event.time > mark.time + RESTARTED


def _ahead(event: RingEvent | Mark, mark: Mark) -> bool:
    return 0 < (event.sequence - mark.sequence) % 2**32 < HALF
