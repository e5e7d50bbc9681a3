"""What waits for the alarm journal: records, how the alarms stand, how far the events of every machine were taken.

An alarm never waits for a disk: everything is in memory at once, and in the database as soon as that takes it, in the order in which it
happened. Until then the queue says that it waits, and holds the positions of the events back that belong to it.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping

from sqlalchemy import Connection

from app.access.audit.verification import Verdict
from app.alarms import journal
from app.alarms.journal import Record, Stored
from app.alarms.lifecycle import Life
from app.alarms.stored_state import stored
from app.alarms.watch import Watch
from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.plant.events import RingPosition

log = logging.getLogger(__name__)

IDLE = 0.5
"""What waits is looked at this often [s], unless somebody wakes the queue."""
RETRY_PERIOD = 5.0
"""A database that did not take the journal is asked again after this [s]."""
SETTLE_LIMIT = 2.0
"""Nobody waits longer than this for the journal [s]."""
MARK_PERIOD = 10.0
MARK_EVERY = 30
"""How often it is written down how far events without any effect were taken [s], and after how many [events]: a ring holds 59."""


class JournalQueue:
    """Holds what is to be written, writes it in one transaction, and keeps it when the database does not take it."""

    def __init__(self, database: Database, clock: Clock, key: bytes) -> None:
        """`key` is that of the journal's chain."""
        self.healthy = True
        """False while the journal waits for its database."""
        self.on_health: Callable[[bool], None] = lambda healthy: None
        """Called when `healthy` changes."""
        self._db = database
        self._clock = clock
        self._key = key
        self._records: list[Record] = []
        self._dirty: dict[str, Watch | None] = {}
        self._positions: dict[str, RingPosition] = {}
        self._new_positions: dict[str, RingPosition] = {}
        self._safe: Mapping[str, RingPosition] = {}
        self._unmarked = 0
        self._marked_at = 0.0
        self._woken = asyncio.Event()
        self._lock = asyncio.Lock()

    async def load(self) -> tuple[list[Stored], int, list[int]]:
        """Read what was written: how the alarms stood, the newest occurrence, and the annunciations of a day [µs UTC]."""

        def work(connection: Connection) -> tuple[list[Stored], int, list[int], dict[str, RingPosition]]:
            since = self._clock.micros() - journal.DAY
            return (
                journal.stored(connection),
                journal.newest_occurrence(connection),
                journal.annunciations(connection, since),
                journal.ring_positions(connection),
            )

        states, newest, times, self._positions = await self._db.read(work)
        self._safe = dict(self._positions)
        return states, newest, times

    # ---- what comes in --------------------------------------------------------------------------------

    def add(self, record: Record) -> None:
        """A transition is to be written down."""
        self._records.append(record)

    def changed(self, watch: Watch) -> None:
        """How `watch` stands is to be written: as it is then, not as it is now."""
        self._dirty[watch.id] = watch

    def removed(self, id: str) -> None:
        """The alarm `id` is no longer there."""
        self._dirty[id] = None

    def reached(self, equipment: str, position: RingPosition, events: int) -> None:
        """The events of a machine were taken up to `position`, `events` more than before."""
        self._positions[equipment] = self._new_positions[equipment] = position
        self._unmarked += events

    def met(self, equipment: str, position: RingPosition) -> None:
        """The ring of which the last event taken is was found again."""
        self._positions[equipment] = position

    # ---- how far it is --------------------------------------------------------------------------------

    @property
    def waiting(self) -> bool:
        """Whether something that people see is not written yet."""
        return bool(self._records or self._dirty)

    def last_event(self, equipment: str) -> RingPosition | None:
        """The last event of a machine that was taken; None = none ever was."""
        return self._positions.get(equipment)

    def stored_event(self, equipment: str) -> RingPosition | None:
        """The last event of a machine of which everything that follows is in the journal; None = none is."""
        waits = self.waiting or self._lock.locked()
        return (self._safe if waits else self._positions).get(equipment)

    # ---- what goes out --------------------------------------------------------------------------------

    def wake(self) -> None:
        """Write soon."""
        self._woken.set()

    async def run(self) -> None:
        """Write as soon as there is something, for ever."""
        while True:
            self._woken.clear()
            waited = self._clock.monotonic() - self._marked_at
            marks_due = bool(self._new_positions) and (waited >= MARK_PERIOD or self._unmarked >= MARK_EVERY)
            if marks_due:
                self._marked_at = self._clock.monotonic()
            if self.waiting or marks_due:
                try:
                    await self.flush()
                except StorageError:
                    await asyncio.sleep(RETRY_PERIOD)
                    continue
            try:
                async with asyncio.timeout(IDLE):
                    await self._woken.wait()
            except TimeoutError:
                pass

    async def flush(self) -> None:
        """Write what waits.

        Raises:
            StorageError: the database did not take it; it waits on.
        """
        async with self._lock:
            records, dirty, positions = self._records, self._dirty, self._new_positions
            if not records and not dirty and not positions:
                return
            self._records, self._dirty, self._new_positions, self._unmarked = [], {}, {}, 0
            reached = dict(self._positions)
            states = [stored(watch) for watch in dirty.values() if watch and watch.life != Life()]
            gone = [id for id, watch in dirty.items() if watch is None or watch.life == Life()]
            try:
                await self._db.write(
                    lambda connection: journal.write(connection, self._key, records, states, gone, positions)
                )
            except StorageError as error:
                self._records = records + self._records
                self._dirty = dirty | self._dirty
                self._new_positions = positions | self._new_positions
                if self.healthy:
                    log.error("alarm journal waits reason=%s", error)
                    self._turn(healthy=False)
                raise
            self._safe = reached
            if not self.healthy:
                log.warning("alarm journal written again records=%d", len(records))
                self._turn(healthy=True)

    async def settle(self) -> bool:
        """True when everything is in the journal; False when the database has not taken it for 2 s: then it waits in memory."""
        try:
            async with asyncio.timeout(SETTLE_LIMIT):
                await asyncio.shield(self.flush())
        except (StorageError, TimeoutError):
            return False
        return True

    async def close(self) -> None:
        """Write what waits, for the last time."""
        try:
            await self.flush()
        except StorageError as error:
            log.error("alarm journal not written records=%d reason=%s", len(self._records), error)

    async def verify(self) -> Verdict:
        """Walk the chain of the journal."""
        return await self._db.read_long(lambda connection: journal.verify(connection, self._key))

    def _turn(self, *, healthy: bool) -> None:
        self.healthy = healthy
        self.on_health(healthy)
