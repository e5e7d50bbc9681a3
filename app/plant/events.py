"""Events of machines as their readers see them, and which of them are new."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

HALF = 2**31
HALF_OF_BOOTS = 2**15


@dataclass(slots=True, eq=False)
class Ring:
    """A ring as the program that reads it knows it. Times say nothing about it: clocks are set, and those of devices start anew."""

    reader: object
    """Whoever reads it; nobody else numbers its rings."""
    number: int = 0
    """Rises when a ring counts from 1 again: its device has lost what it retains, or is another one."""
    boots: int = 0
    """How often the device had been switched on when this ring was met."""
    newest: int = 0
    """Sequence of its newest event then."""

    def replaces(self, position: "RingPosition") -> bool:
        """Whether `position` is of a ring that was before this one. Of a position from a file only its numbers tell: they never go back."""
        if position.ring is not None and position.ring.reader is self.reader:
            return position.ring.number < self.number
        return _behind(self.newest, position.sequence, HALF) or _behind(self.boots, position.boot, HALF_OF_BOOTS)


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
    def ring(self) -> Ring:
        """The ring that it was read from."""
        ...

    @property
    def request(self) -> int:
        """Id of the command that caused it; 0 = none did, or the device does not say."""
        ...


@dataclass(frozen=True, slots=True)
class RingPosition:
    """The last event of a machine that somebody has dealt with."""

    boot: int
    sequence: int
    time: int
    """[µs UTC]"""
    ring: Ring | None = None
    """None: read from a file."""


def position_of(event: RingEvent) -> RingPosition:
    """The position behind `event`."""
    return RingPosition(event.boot, event.sequence, event.time, event.ring)


def is_new(event: RingEvent, position: RingPosition | None) -> bool:
    """Whether `event` comes after `position`; numbers wrap after 2³²−1."""
    return position is None or begins_again(event, position) or _behind(position.sequence, event.sequence, HALF)


def begins_again(event: RingEvent, position: RingPosition) -> bool:
    """Whether `event` is of a ring that replaces the one of `position`."""
    return event.ring.replaces(position)


def earlier(one: RingPosition, other: RingPosition) -> RingPosition:
    """The position that is further back."""
    for first, second in ((one, other), (other, one)):
        if first.ring is not None and first.ring.replaces(second):
            return second
    return one if _behind(one.sequence, other.sequence, HALF) else other


def _behind(number: int, other: int, half: int) -> bool:
    return 0 < (other - number) % (2 * half) < half
