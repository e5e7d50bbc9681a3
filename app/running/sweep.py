"""What happens by time alone: overdue values, the lag of the loop, what the system says of itself."""

import asyncio
from collections.abc import Callable, Mapping

from app.clock import Clock
from app.plant.system import SYSTEM
from app.tags.batch import Batch, Value
from app.tags.database import TagDatabase

SWEEP_PERIOD = 0.25
"""How often overdue values are looked for and the loop lag is measured [s]."""


class Sweep:
    """Publishes what `values` gives, key → value, each the tag `sys.<key>`; then calls `published`, and `second` once a second."""

    def __init__(
        self,
        tags: TagDatabase,
        clock: Clock,
        *,
        values: Callable[[], Mapping[str, Value]],
        published: Callable[[], None],
        second: Callable[[], None],
    ) -> None:
        self.loop_lag = 0.0
        """How late the loop was at the last sweep [s]."""
        self.published = published
        self._tags = tags
        self._clock = clock
        self._values = values
        self._second = second

    async def run(self) -> None:
        """Sweep, for ever; what stands still before the first pause is over has been looked at, too."""
        loop = asyncio.get_running_loop()
        self._tags.sweep()
        next_second = loop.time()
        while True:
            before = loop.time()
            await asyncio.sleep(SWEEP_PERIOD)
            self.loop_lag = max(0.0, loop.time() - before - SWEEP_PERIOD)
            self._tags.sweep()
            self.publish()
            if loop.time() >= next_second:
                next_second = loop.time() + 1
                self._second()

    def publish(self) -> None:
        """Publish what changed of the system's own values."""
        tags, values = self._tags, {"loop_lag": round(self.loop_lag * 1000, 1), **self._values()}
        handles = {key: tags.handle(f"{SYSTEM}.{key}") for key in values}
        changed = {handles[key]: value for key, value in values.items() if tags.value(handles[key]) != value}
        now = self._clock.micros()
        tags.publish(Batch(SYSTEM, 0, now, now, list(changed), list(changed.values())))
        self.published()
