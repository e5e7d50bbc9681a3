"""Annunciations: how often alarms asked for attention, when, and whether they come as a flood."""

from collections import deque
from collections.abc import Iterable, Sequence

from app.alarms import journal
from app.clock import Clock

FLOOD_WINDOW = 600.0
FLOOD_BEGINS, FLOOD_ENDS = 10, 5
"""Annunciations within the window [s] that begin a flood, and below which it is over."""


class Annunciations:
    """Counts every annunciation and keeps the times of a day, by the clock that nobody sets: a rate is one of time that went by."""

    def __init__(self, clock: Clock) -> None:
        self.count = 0
        """How many there were since the server started."""
        self.flood = False
        """Whether more come than one person can attend to."""
        self._clock = clock
        self._times: deque[float] = deque()
        """Those of a day, monotonic [s]."""
        self._recent: deque[float] = deque()
        """Those that count in a flood, monotonic [s]."""

    def restore(self, times: Iterable[int]) -> None:
        """Take the times [µs UTC] that the journal knows: they count in the rates, not in `count` and not in a flood.

        Those that are still to come are of a clock that was ahead: when they really were, nobody knows.
        """
        now, mine = self._clock.micros(), self._clock.monotonic()
        self._times.extend(sorted(mine - (now - at) / 1e6 for at in times if at <= now))

    def add(self) -> None:
        """An alarm asks for attention."""
        self.count += 1
        now = self._clock.monotonic()
        self._times.append(now)
        self._recent.append(now)
        self.judge()

    def sound_again(self) -> None:
        """An alarm that sounds became more important: it is heard anew, and is no new alarm in the rates."""
        self.count += 1

    def judge(self) -> bool:
        """Look whether there is a flood; whether that changed."""
        now = self._clock.monotonic()
        while self._recent and now - self._recent[0] > FLOOD_WINDOW:
            self._recent.popleft()
        flood = len(self._recent) >= (FLOOD_ENDS if self.flood else FLOOD_BEGINS)
        changed, self.flood = flood is not self.flood, flood
        return changed

    @property
    def times(self) -> Sequence[int]:
        """When they were in the last 24 hours [µs UTC], oldest first, told by the clock as it is set now."""
        now, mine = self._clock.micros(), self._clock.monotonic()
        while self._times and (mine - self._times[0]) * 1e6 > journal.DAY:
            self._times.popleft()
        return tuple(now - round((mine - at) * 1e6) for at in self._times)
