"""Events that were handed over and are not known to be stored: until they are, the device's ring must keep them."""

from collections import deque
from collections.abc import Iterable

from app.links.host_event import HostEvent
from app.plant.events import RingPosition, is_new


class TakenEvents:
    """In the order of the ring."""

    def __init__(self) -> None:
        """Nothing was taken yet."""
        self._waiting: deque[HostEvent] = deque()
        self.stored: int | None = None
        """Sequence of the last one that is stored; None until one is known."""

    def __len__(self) -> int:
        """So many are not known to be stored."""
        return len(self._waiting)

    def add(self, events: Iterable[HostEvent]) -> None:
        """These were taken."""
        self._waiting.extend(events)

    def all_stored(self, sequence: int | None) -> None:
        """Whoever takes events stores them: all up to `sequence` are."""
        self._waiting.clear()
        self.stored = sequence

    def stored_up_to(self, position: RingPosition | None) -> None:
        """All up to `position` are stored; None = nobody knows of any."""
        while position is not None and self._waiting and not is_new(self._waiting[0], position):
            self.stored = self._waiting.popleft().sequence
