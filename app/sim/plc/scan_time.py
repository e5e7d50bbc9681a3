"""How long the scans of a virtual PLC take, as it tells in its header; the program never sees it."""

from collections.abc import Callable


class ScanTime:
    """Last and longest scan [µs], and how many took longer than their period."""

    def __init__(self) -> None:
        self.stopwatch: Callable[[], float] | None = None
        """Seconds that rise; without it every time is 0."""
        self.start_up()

    def start_up(self) -> None:
        """Nothing was measured."""
        self.last = self.longest = self.overruns = 0
        self._began = 0.0

    def begin(self) -> None:
        """A scan begins."""
        if self.stopwatch:
            self._began = self.stopwatch()

    def end(self, period: float) -> None:
        """It is over; `period` [s] is what it may take."""
        if self.stopwatch:
            self.last = min(round((self.stopwatch() - self._began) * 1_000_000), 0xFFFF)
            self.longest = max(self.longest, self.last)
            self.overruns += self.last > period * 1_000_000
