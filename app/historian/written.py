"""What the program gives to the disk, as the kernel counts it: a card or a chip wears by that, whatever the files grow."""

from collections import deque
from collections.abc import Callable
from pathlib import Path

DAY = 86_400.0
"""[s]"""
LEAST = 60.0
"""From so long on a rate is told [s]."""
IO = Path("/proc/self/io")


def of_this_process() -> int | None:
    """Bytes that this process has made the kernel write to disks since it began; None where nobody counts them."""
    try:
        lines = dict(line.split(": ") for line in IO.read_text("ascii").splitlines())
        return int(lines["write_bytes"])
    except (OSError, ValueError, KeyError):
        return None


class Written:
    """How much was written in the last 24 hours, or since this was begun."""

    def __init__(self, read: Callable[[], int | None] = of_this_process) -> None:
        self._read = read
        self._seen: deque[tuple[float, int]] = deque()

    def note(self, now: float) -> None:
        """Look again, about once a minute; `now` is a monotonic time [s]."""
        count = self._read()
        if count is None:
            self._seen.clear()
            return
        self._seen.append((now, count))
        while len(self._seen) > 1 and self._seen[1][0] <= now - DAY:
            self._seen.popleft()

    @property
    def per_day(self) -> float | None:
        """Bytes per day at that rate; None: not known, or not yet."""
        if not self._seen:
            return None
        (since, before), (now, count) = self._seen[0], self._seen[-1]
        return (count - before) / (now - since) * DAY if now - since >= LEAST else None
