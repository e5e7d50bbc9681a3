"""First-out of the conveyor's PLC: which cause stopped the line first, and which comes next when that one ends by itself."""

from dataclasses import dataclass

FORGOTTEN = 10_000_000
"""A cause that ended by itself is shown for so long [µs]."""


@dataclass(slots=True)
class StopCause:
    """What stopped the line."""

    code: int = 0
    """Of its event; 0 = nothing did."""
    source: int = 0
    rear: int = 0
    front: int = 0
    """Ids of the products of a gap stop."""
    time: int = 0
    """[µs]"""
    value: float = 0.0
    ended: int = 0
    """When it ended by itself [µs]; 0 = it has not."""


class FirstOut:
    """The first cause, until a reset."""

    def __init__(self) -> None:
        self.first = StopCause()
        self._next = StopCause()
        """What stops the line, too."""

    def add(self, cause: StopCause) -> None:
        """Something stops the line now; the first one stands, of the others the earliest is kept."""
        if not self.first.code or self.first.ended:
            self.first = cause
        elif not self._next.code:
            self._next = cause

    def end(self, code: int, time: int) -> None:
        """What has this code has ended by itself at `time` [µs]; the next cause is the first now."""
        if self.first.code == code:
            self.first.ended = time
            if self._next.code:
                self.first, self._next = self._next, StopCause()

    def age(self, time: int) -> None:
        """Do not show for ever what ended by itself; `time` is now [µs]."""
        if self.first.ended and time - self.first.ended > FORGOTTEN:
            self.first = StopCause()

    def reset(self) -> None:
        """Nothing stopped the line."""
        self.first, self._next = StopCause(), StopCause()
