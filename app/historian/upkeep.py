"""Looking after what is stored: it is measured, cut by age and quota, rolled up and packed."""

import asyncio
import logging
from collections.abc import Callable

from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.historian import age, sealed, store
from app.historian.age import Age
from app.historian.minutes import Minutes
from app.historian.store import DAY, HOUR, SETTLED
from app.historian.written import Written

log = logging.getLogger(__name__)

FIRST = 0.5
"""After the start it begins after this [s]."""
CARE_PERIOD = 60.0
"""How often is rolled up, measured and cut [s]."""
WARN_AT = 0.8
"""Part of the quota at which a warning is due."""
LOW_DISK = 500_000_000
"""Free bytes below which a warning is due."""
CUT_TO = 0.95
"""Part of the quota that is left when it was reached."""


class Upkeep:
    """Keeps the history within its age and its quota, and knows how much there is."""

    def __init__(self, database: Database, clock: Clock, minutes: Minutes, *, keep_days: float, quota: int) -> None:
        """`quota` [bytes] is where the oldest is cut; `keep_days` the age; `minutes` are those that the recorder fills."""
        self.size: store.Size | None = None
        """As last measured; None before."""
        self.measured = 0
        """When [µs UTC]."""
        self.written = Written()
        """What the whole program gives to the disk."""
        self.quota = quota
        self.keep_days = keep_days
        self._database = database
        self._clock = clock
        self._minutes = minutes
        self._used: int | None = None
        self._warned = False
        self._sealed = 0
        """What is older is packed [µs UTC]."""
        self._aged = clock.monotonic()
        """When it was last looked how old the history is [s]."""
        self.clock_leapt = False
        """Whether the clock leapt ahead and is not believed yet (historian/age.py)."""

    @property
    def fill(self) -> float:
        """Part of the quota that is used, 0 to 1 and above."""
        return self.size.used / self.quota if self.size else 0.0

    @property
    def disk_low(self) -> bool:
        """Whether the disk itself is nearly full."""
        return self.size is not None and self.size.free < LOW_DISK

    @property
    def growth(self) -> float | None:
        """By how much the history grows at the rate of the last 24 h [bytes per day]; None while that is not known."""
        size = self.size
        if size is None or size.since is None or size.oldest is None or size.grown_today <= 0:
            return None
        elapsed = self.measured - max(size.since, size.oldest, self.measured - DAY)
        return size.grown_today / elapsed * DAY if elapsed >= HOUR // 60 else None

    @property
    def quota_days(self) -> float | None:
        """In how many days the quota is reached at that rate; None while that is not known."""
        growth = self.growth
        if growth is None or self.size is None:
            return None
        return max(0.0, (self.quota - self.size.used) / growth)

    async def run(self, takes: Callable[[], bool], say: Callable[[StorageError], None]) -> None:
        """Look after it once a minute, for ever; `takes` says whether the database takes rows, `say` is told when it does not."""
        await asyncio.sleep(FIRST)
        while True:
            try:
                await self.look_after(takes=takes())
            except StorageError as error:
                say(error)
            await asyncio.sleep(CARE_PERIOD)

    async def look_after(self, *, takes: bool = True) -> None:
        """Measure, cut what is older than `keep_days` or above the quota, roll up, pack.

        Raises:
            StorageError: the database did not take it.
        """
        await self.measure(takes=takes)
        await self._cut(await self._grow_older(takes=takes))
        settled = self._clock.micros() - SETTLED
        done = False
        while not done:
            done = await self._database.write(lambda connection: store.roll_up(connection, settled, self._minutes))
        await self._seal()

    async def _seal(self) -> None:
        """Pack what is old enough, once an hour."""
        before = (self._clock.micros() - sealed.YOUNG) // HOUR * HOUR
        if before == self._sealed:
            return
        point: int | None = 0
        while point is not None:
            first = point
            point = await self._database.write(lambda connection: sealed.seal(connection, before, first))  # noqa: B023
        self._sealed = before

    async def measure(self, *, takes: bool = True) -> None:
        """Bring `size` up to date; while the database does not take anything its growth is not noted.

        Raises:
            StorageError: the database cannot be read.
        """
        now = self._clock.micros()
        self.written.note(self._clock.monotonic())
        used = await self._database.read(store.used)
        grown = 0 if self._used is None else used - self._used
        self._used = used
        if takes:
            await self._database.write(lambda connection: store.note_growth(connection, now, grown))
        self.size, self.measured = await self._measured(), now
        if self.fill >= WARN_AT and not self._warned:
            log.warning("history fills up used=%d quota=%d days=%s", self.size.used, self.quota, self.quota_days)
        self._warned = self.fill >= WARN_AT

    async def _grow_older(self, *, takes: bool) -> Age:
        """By which time the history is cut; it is kept, so that no restart makes a clock that leapt any truer."""
        now, at = self._clock.micros(), self._clock.monotonic()
        known = await self._database.read(age.read)
        found = (known or Age(now)).after(round((at - self._aged) * 1e6), now, self.keep_days)
        if takes:
            await self._database.write(lambda connection: age.note(connection, found))
            self._aged = at
        if found.leapt and not self.clock_leapt:
            days = (now - found.time) / DAY
            log.error(
                "history not cut by this clock: it leapt days=%.0f; it is believed when it runs so for a day", days
            )
        self.clock_leapt = found.leapt > 0
        return found

    async def _cut(self, aged: Age) -> None:
        size = self.size
        while size is not None and size.oldest is not None:
            before = self._cut_before(aged.time, size.used, size.oldest)
            if before // HOUR * HOUR <= size.oldest:
                return
            removed = await self._remove(before)
            log.warning("history cut samples=%d used=%d quota=%d", removed, size.used, self.quota)
            size = self.size = await self._measured()
            self._used = size.used

    async def _remove(self, before: int) -> int:
        removed, done = 0, False
        while not done:
            count, done = await self._database.write(lambda connection: store.cut(connection, before))
            removed += count
        return removed

    def _cut_before(self, now: int, used: int, oldest: int) -> int:
        """Everything older than this has to go [µs UTC]."""
        before = now - int(self.keep_days * DAY)
        if used > self.quota:
            part = 1 - CUT_TO * self.quota / used
            before = max(before, oldest + max(HOUR, int((now - oldest) * part)))
        return min(before, now - HOUR)

    async def _measured(self) -> store.Size:
        now, path = self._clock.micros(), self._database.path
        return await self._database.read(lambda connection: store.size(connection, path, now))
