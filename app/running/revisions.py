"""Counters that say: a list about a machine is another one now, fetch it again."""

from app.clock import Clock
from app.plant.system import SYSTEM
from app.tags.batch import Batch
from app.tags.database import TagDatabase


class Revisions:
    """`sys.<key>.<equipment>` counts the changes; `block` tells its batches from those of other parts of the system."""

    def __init__(self, tags: TagDatabase, clock: Clock, key: str, block: int) -> None:
        self._tags = tags
        self._clock = clock
        self._key = key
        self._block = block
        self._counts: dict[str, int] = {}

    def changed(self, equipment: str) -> None:
        """The list about `equipment` changed; one without such a tag has none."""
        name = f"{SYSTEM}.{self._key}.{equipment}"
        if name in self._tags:
            count = self._counts[equipment] = self._counts.get(equipment, 0) + 1
            now = self._clock.micros()
            self._tags.publish(Batch(SYSTEM, self._block, now, now, [self._tags.handle(name)], [count]))
