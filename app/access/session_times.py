"""When a session was last active and when it ends, counted on the monotonic clock.

A step of the wall clock neither ends nor prolongs one; only over a restart the stored times, of the wall clock, say how long it has been.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

from app.clock import Clock

IDLE_AFTER = 15 * 60.0
"""Without a deed for so long a session only watches [s]."""
SHIFT, SHIFT_WITH_POWER, WATCHING = 12 * 3600.0, 8 * 3600.0, 30 * 86_400.0
"""A session ends after a shift for an operator, 8 h for an engineer or administrator, 30 days for a viewer [s]."""
CLOCK_BACK = 60.0
"""A stored time may be later than the wall clock by this [s]; above it the clock was set back while the server was down."""


@dataclass(slots=True)
class _Times:
    """Monotonic [s]."""

    active: float
    ends: float


class SessionTimes:
    """The times of all sessions, by the hash of their id."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._times: dict[str, _Times] = {}

    def begin(self, id_hash: str, roles: Iterable[str]) -> None:
        """A session of somebody with `roles` begins now."""
        begun = self._clock.monotonic()
        self._times[id_hash] = _Times(begun, begun + lifetime(roles))

    def keep(self, hashes: Collection[str]) -> None:
        """Forget all sessions but these."""
        for gone in self._times.keys() - hashes:
            del self._times[gone]

    def load(self, row: Any) -> None:
        """Take the stored times of a session over, unless they are known."""
        self._of(row)

    def acted(self, id_hash: str) -> float | None:
        """Its person has done something: the idle time starts anew. How long it still lasts [s].

        None: it is not known, or was idle already and stays so.
        """
        now, times = self._clock.monotonic(), self._times.get(id_hash)
        if times is None or now - times.active >= IDLE_AFTER:
            return None
        times.active = now
        return times.ends - now

    def end(self, id_hash: str) -> None:
        """It is over now, whatever is stored of it."""
        self._times[id_hash] = _Times(self._clock.monotonic(), float("-inf"))

    def is_over(self, id_hash: str) -> bool:
        """Whether it is known and has ended."""
        times = self._times.get(id_hash)
        return times is not None and times.ends <= self._clock.monotonic()

    def left(self, row: Any) -> float:
        """How long the session may still last [s]; 0 and below, it is over."""
        return self._of(row).ends - self._clock.monotonic()

    def quiet(self, row: Any) -> float:
        """How long its person has done nothing [s]."""
        return self._clock.monotonic() - self._of(row).active

    def _of(self, row: Any) -> _Times:
        """At first from what is stored.

        A session never has more left than it had when it was last active; one that was active in what is now the future watches only.
        """
        times = self._times.get(row.id_hash)
        if times is not None:
            return times
        now, wall = self._clock.monotonic(), self._clock.micros()
        quiet = (wall - row.active) / 1e6
        left = (row.until - max(wall, row.active, row.created)) / 1e6
        if quiet < -CLOCK_BACK:
            quiet = IDLE_AFTER
        times = self._times[row.id_hash] = _Times(now - max(0.0, quiet), now + left)
        return times


def lifetime(roles: Iterable[str]) -> float:
    """How long a session of somebody with `roles` lasts at most [s]."""
    held = set(roles)
    if held & {"engineer", "admin"}:
        return SHIFT_WITH_POWER
    return SHIFT if "operator" in held else WATCHING
