"""Whether the disk is slow: a write that commands wait for takes longer than they may."""

from app.clock import Clock
from app.threads import Turns

SLOW = 2.0
"""A write that takes longer is slow [s]: a command whose line is not on the disk after `waiting.KEEPING_LIMIT` is refused."""
CALM = 30.0
"""A disk is slow until no write was for so long [s]."""
LONGEST_LOOK = 1.0
"""Between two looks no more than this counts [s]: a process that stood still did not wait for its disk."""


class DiskPace:
    """Watches how long writes take; who asks often enough misses none that is slow."""

    def __init__(self, clock: Clock, *threads: Turns) -> None:
        """`threads` write to the disk."""
        self._clock = clock
        self._threads = threads
        self._seen = [0 for _ in threads]
        self._waited = [0.0 for _ in threads]
        self._looked = clock.monotonic()
        self._calm_from = self._looked

    def is_slow(self) -> bool:
        """Look: whether a write is slow, or was a short time ago."""
        now = self._clock.monotonic()
        passed, self._looked = min(now - self._looked, LONGEST_LOOK), now
        for place, thread in enumerate(self._threads):
            number = thread.at_work
            self._waited[place] = self._waited[place] + passed if number and number == self._seen[place] else 0.0
            self._seen[place] = number
            if self._waited[place] > SLOW:
                self._calm_from = now + CALM
        return now < self._calm_from
