"""What is wrong with a device, as it is told: each thing once in a spell, and not without end where it is another one each time."""

from math import inf

from app.links.restarts import MANY, QUIET


class Faults:
    """Those of one unit. Times are monotonic [s]."""

    def __init__(self) -> None:
        self._told: set[str] = set()
        self._last = -inf

    def new(self, fault: str, now: float) -> bool:
        """`fault` was seen; whether it is to be told: not yet in this spell, and none of too many.

        A spell is over when none was seen for `QUIET` seconds.
        """
        if now - self._last > QUIET:
            self._told.clear()
        self._last = now
        if fault in self._told or len(self._told) >= MANY:
            return False
        self._told.add(fault)
        return True
