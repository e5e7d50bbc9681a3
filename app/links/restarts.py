"""Restarts that a device shows in its header: told once, and as one spell while they do not end."""

from math import inf

MANY = 3
"""So many in a row are no restart: the device is started again and again, or its header jumps."""
QUIET = 30.0
"""A spell is over when none was seen for so long [s]."""


class Restarts:
    """Those of one device. Times are monotonic [s]."""

    def __init__(self) -> None:
        self._count = 0
        self._last = -inf

    def seen(self, now: float) -> bool:
        """One was seen; whether it is the first of its spell."""
        self._count = 1 if now - self._last > QUIET else self._count + 1
        self._last = now
        return self._count == 1

    def endless(self, now: float) -> bool:
        """Whether they do not end."""
        return self._count >= MANY and now - self._last <= QUIET
