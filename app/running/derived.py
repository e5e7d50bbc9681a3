"""Points that are computed from others, while the plant runs: with every batch, every second, and over a restart."""

import asyncio
import logging
from collections.abc import Mapping
from contextlib import suppress

from app.clock import Clock
from app.errors import StorageError
from app.plant.derive import Derivation
from app.plant.retained import RetainedStates
from app.tags.batch import Batch, Value
from app.tags.database import Standstill, TagDatabase

log = logging.getLogger(__name__)

DERIVED = "derived"
"""Source of these points."""
RETAIN_PERIOD = 60.0
"""How often running hours and the like are kept [s]."""
RETAIN_SOON = 10.0
"""So long after a start or a stop they are kept as well [s]; what happens in it is one write, as belts start all day."""


class DerivedPoints:
    """Publishes what `derivation` makes of the tags, and keeps what it remembers."""

    def __init__(self, tags: TagDatabase, clock: Clock, states: RetainedStates | None) -> None:
        """`states`: None = nothing is kept over a restart."""
        self.derivation: Derivation | None = None
        """None while there is no plant."""
        self._tags = tags
        self._clock = clock
        self._states = states
        self._inputs: frozenset[int] = frozenset()
        self._soon = asyncio.Event()

    async def restore(self, derivation: Derivation) -> None:
        """`derivation` goes on from what was kept."""
        derivation.restore(await self._states.read() if self._states else {})

    def take(self, derivation: Derivation | None) -> None:
        """Go on with `derivation`, which takes over what the former one has accumulated."""
        if derivation is not None:
            other = self.derivation is not None and self.derivation is not derivation
            derivation.restore(self.derivation.retained() if other and self.derivation else {})
        self.derivation = derivation

    def renew(self) -> None:
        """The tags have other handles now."""
        inputs = self.derivation.inputs if self.derivation else ()
        self._inputs = frozenset(self._tags.handle(name) for name in inputs)

    def follow(self, batch: Batch) -> None:
        """Compute what depends on `batch`."""
        inputs, tags = self._inputs, self._tags
        handles = [handle for handle in batch.handles if handle in inputs] if batch.source != DERIVED else []
        if handles:
            changed = {tags.tags[handle].name: (tags.value(handle), tags.quality(handle)) for handle in handles}
            self._publish(changed, batch.time, batch.seen)

    def pass_time(self) -> None:
        """Compute what depends on time alone."""
        now = self._clock.micros()
        self._publish({}, now, now)

    def compute_all(self) -> None:
        """Compute everything anew."""
        names = self.derivation.inputs if self.derivation else ()
        inputs = {name: self._tags.handle(name) for name in names if name in self._tags}
        now = self._clock.micros()
        self._publish(
            {name: (self._tags.value(handle), self._tags.quality(handle)) for name, handle in inputs.items()}, now, now
        )

    def interrupted(self, still: Standstill) -> None:
        """Nothing was seen for a while: it counts for nothing."""
        if self.derivation is not None:
            self.derivation.interrupted(still.begin, still.end)

    async def run(self) -> None:
        """Keep what they remember, for ever; a killed server forgets no start but those of the last 10 s, and a minute of what runs on."""
        while True:
            with suppress(TimeoutError):
                async with asyncio.timeout(RETAIN_PERIOD):
                    await self._soon.wait()
                    await asyncio.sleep(RETAIN_SOON)
            self._soon.clear()
            try:
                await self.keep()
            except StorageError as error:
                log.error("running hours and the like not kept reason=%s", error)
                await asyncio.sleep(RETAIN_PERIOD)

    async def keep(self) -> None:
        """Keep what they remember now.

        Raises:
            StorageError: the disk does not take it.
        """
        if self.derivation and self._states:
            await self._states.write(self.derivation.retained())

    def _publish(self, changed: Mapping[str, tuple[Value, int]], time: int, seen: int) -> None:
        if self.derivation is None:
            return
        results = self.derivation.update(changed, time)
        if self.derivation.worth_keeping:
            self.derivation.worth_keeping = False
            self._soon.set()
        self._tags.publish(
            Batch(
                source=DERIVED,
                block=0,
                time=time,
                seen=seen,
                handles=[self._tags.handle(name) for name, _, _ in results],
                values=[value for _, value, _ in results],
                qualities=[quality for _, _, quality in results],
            )
        )
