"""Events of machines as their readers see them: which of them are new, and what their snapshot says."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from app.registers.plc_map import real_of

RESTARTED = 1_000_000
"""After another boot, an event this much later than the last one is new although its number is not [µs]: the ring began again."""
RESTARTED_SAME_BOOT = 60_000_000
"""The same when the number of boots did not change [µs]."""
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


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What the six snapshot words of a machine that tracks products say."""

    product: int
    """0 = none."""
    second: int
    value: float


def mark_of(event: RingEvent) -> Mark:
    """The mark behind `event`."""
    return Mark(event.boot, event.sequence, event.time)


def is_new(event: RingEvent, mark: Mark | None) -> bool:
    """Whether `event` comes after `mark`.

    Numbers wrap after 2³²−1. A device that lost what it retains counts from 1 again: then its time is what says that it is new.
    """
    if mark is None or 0 < (event.sequence - mark.sequence) % 2**32 < HALF:
        return True
    return event.time > mark.time + (RESTARTED_SAME_BOOT if event.boot == mark.boot else RESTARTED)


def snapshot_of(words: Sequence[int]) -> Snapshot:
    """Words 0–1 product, 2–3 second product, 4–5 second value (float32)."""
    padded = [*words, 0, 0, 0, 0, 0, 0]
    longs = [padded[n] << 16 | padded[n + 1] for n in (0, 2, 4)]
    return Snapshot(longs[0], longs[1], real_of(longs[2]))
