"""An event of a device as the host has it, and who takes events: the link hands them over, the house says how far they are stored."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass

from app.plant.definitions import Equipment
from app.plant.events import Ring, RingPosition


@dataclass(frozen=True, slots=True)
class HostEvent:
    """One event of a device, in our time."""

    sequence: int
    time: int
    """When it happened [µs UTC]; two of one start differ by exactly what they differ in the device's time."""
    seen: int
    """When it was read [µs UTC]."""
    code: int
    source: int
    value: float
    """NaN = no value."""
    snapshot: tuple[int, ...]
    """Raw words; what they mean is the type's."""
    boot: int
    """Start of the device that it belongs to."""
    ring: Ring
    """The ring that it was read from."""
    request: int = 0
    """Id of the command that caused it; 0 = none did, or the device does not say."""


OnEvents = Callable[[Equipment, Sequence[HostEvent], int], Awaitable[None]]
"""Takes events in order, and how many were lost before the first; what it raises means: not taken."""
LastSeen = Callable[[Equipment], Awaitable[Sequence[RingPosition | None]] | Sequence[RingPosition | None]]
"""The last event of a machine, for each of those who take them; None = that one knows none."""
StoredUpTo = Callable[[Equipment], RingPosition | None]
"""The last event of a machine that is stored wherever it belongs; None = none is."""


@dataclass(slots=True)
class EventTaker:
    """Who takes the events of the Pogon PLCs on a link, in order, with the number that was lost before them.

    What `take` raises means that they are handed over again. They are acknowledged to the device when `stored_up_to` says so, without
    that as soon as it has returned. Without `take` the rings are not read; without `last_seen` the device's own acknowledgement counts.
    """

    take: OnEvents | None = None
    last_seen: LastSeen | None = None
    stored_up_to: StoredUpTo | None = None
