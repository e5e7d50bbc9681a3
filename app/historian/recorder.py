"""The recorder: decides which values become history and hands them to the writer.

A sample is stored when it leaves the dead-band, together with the last one suppressed (so that the line has its true corner), on every
change of quality, and at least every 10 minutes; of a ramp one a second is enough. What is stored, drawn as a line, is nowhere further
from what was seen than the dead-band; held from sample to sample it is neither, but for the last second of a ramp.
"""

import asyncio
import logging
import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeGuard

from sqlalchemy import Connection

from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.historian import sealed, store
from app.historian.minutes import Minutes
from app.historian.store import DAY, GAP_AFTER, HEARTBEAT, HOUR, RAMP, SETTLED, Row
from app.plant.definitions import Kind, Point
from app.tags.batch import Batch, Value
from app.tags.database import Standstill, TagDatabase
from app.tags.quality import BAD, NO_DATA, Reason

log = logging.getLogger(__name__)

FLUSH_PERIOD = 0.5
"""Longest time a sample waits in memory [s]; a killed server loses no more than this, the end of a ramp and the commit under way."""
PORTION = 20_000
"""Rows per transaction."""
PROBE = 1_000
"""Rows of the first transaction after one that failed."""
RETRY_PAUSE = 5.0
"""Pause between attempts while the disk does not take anything [s]."""
BUFFER_LIMIT = 250_000
"""Rows kept in memory while the disk does not take them (about 40 MB); then the oldest are dropped, and it is told."""
CARE_PERIOD = 60.0
"""How often is rolled up, measured and cut [s]."""
SLACK = 1 + 1e-9
"""A difference of just the dead-band is not above it: 0.4 − 0.3 is more than 0.1 in binary."""
WARN_AT = 0.8
"""Part of the quota at which a warning is due."""
LOW_DISK = 500_000_000
"""Free bytes below which a warning is due."""
CUT_TO = 0.95
"""Part of the quota that is left when it was reached."""


@dataclass(slots=True)
class Track:
    """What the recorder remembers of one point.

    The suppressed samples since the stored one lie in a corridor: every line from the stored sample with a slope of `least` to `most`
    passes them within the dead-band.
    """

    number: int
    dead_band: float
    linear: bool
    """Drawn as a line between samples, so that corners count; else a value holds until the next one."""
    value: Value = None
    quality: int = -1
    time: int = 0
    held: Value = None
    held_time: int = 0
    """The last sample suppressed; 0 = none."""
    least: float = -math.inf
    most: float = math.inf

    def take(self, time: int, value: Value, quality: int, seen: int, rows: list[Row]) -> None:
        """Add to `rows` what has to be stored now that the point is `value`.

        `seen` is when its source last made sure of the value before: until then it had not changed [µs UTC].
        """
        if self.linear and self.quality >= 0 and (self.held_time or self.time) < seen < time:
            self._put(seen, self.held if self.held_time else self.value, self.quality, rows)
        self._put(time, value, quality, rows)

    def beat(self, now: int, rows: list[Row]) -> None:
        """Add the value as it stands when the last sample is 10 minutes old, and the end of a ramp when no more came after it."""
        if self.held_time and now - self.time >= RAMP and _is_number(self.held) and not self._within(self.held):
            self.end(rows)
        if self.quality >= 0 and now - self.time >= HEARTBEAT:
            self._put(now, self.held if self.held_time else self.value, self.quality, rows)

    def end(self, rows: list[Row]) -> None:
        """Add the last sample suppressed, when there is one."""
        if self.held_time:
            rows.append(self._row(self.held_time, self.held, self.quality))
            self._anchor(self.held_time, self.held, self.quality)

    def _put(self, time: int, value: Value, quality: int, rows: list[Row]) -> None:
        if quality == self.quality and 0 < time - self.time < HEARTBEAT and self._suppressed(time, value, rows):
            return
        if self.held_time and self.held_time < time:
            rows.append(self._row(self.held_time, self.held, self.quality))
        rows.append(self._row(time, value, quality))
        self._anchor(time, value, quality)

    def _suppressed(self, time: int, value: Value, rows: list[Row]) -> bool:
        if not self.linear or not self.dead_band or not _is_number(value) or not _is_number(self.value):
            if value != self.value:
                return False
            if self.linear:
                self.held, self.held_time = value, time
            return True
        if not self._fits(time, value):
            # the sample before becomes a corner, from which it may go on
            if not self.held_time or self.held_time >= time:
                return False
            self.end(rows)
            if not self._fits(time, value):
                return False
        slope, reach = (value - self.value) / (time - self.time), self.dead_band * SLACK / (time - self.time)
        self.least, self.most = max(self.least, slope - reach), min(self.most, slope + reach)
        self.held, self.held_time = value, time
        return True

    def _fits(self, time: int, value: float) -> bool:
        """Whether (time, value) may be told by the line from the stored sample on."""
        if time - self.time > RAMP and not self._within(value):
            return False
        change: float = value - self.value  # type: ignore[operator]
        return math.isfinite(change) and (not self.held_time or self.least <= change / (time - self.time) <= self.most)

    def _within(self, value: Value) -> bool:
        return bool(abs(value - self.value) <= self.dead_band * SLACK)  # type: ignore[operator]

    def _anchor(self, time: int, value: Value, quality: int) -> None:
        self.time, self.value, self.quality = time, value, quality
        self.held, self.held_time = None, 0
        self.least, self.most = -math.inf, math.inf

    def _row(self, time: int, value: Value, quality: int) -> Row:
        if quality & 3 == BAD:
            return (self.number, time, None, None, quality)
        if isinstance(value, str):
            return (self.number, time, None, value, quality)
        if value is None:
            return (self.number, time, None, None, quality & 0xF00 | NO_DATA)
        if not math.isfinite(value):
            return (self.number, time, None, None, quality & 0xF00 | Reason.OUT_OF_RANGE << 2 | BAD)
        return (self.number, time, float(value), None, quality)


def _is_number(value: Value) -> TypeGuard[float]:
    return isinstance(value, int | float)


class Recorder:
    """Follows the tag database and writes history, for ever. A database that cannot be opened or written is told, and tried again."""

    def __init__(self, tags: TagDatabase, database: Database, clock: Clock, *, keep_days: float, quota: int) -> None:
        """`quota` [bytes] is where the oldest is cut; `keep_days` the age."""
        self.full = False
        """True while the database does not take what is recorded."""
        self.error = ""
        """Why it does not."""
        self.dropped = 0
        """Rows lost because it did not take them for too long."""
        self.rows_stored = 0
        self.rows_per_second = 0.0
        """Rows stored per second, over about 10 s."""
        self.size: store.Size | None = None
        """As last measured; None before."""
        self.measured = 0
        """When [µs UTC]."""
        self.quota = quota
        self.keep_days = keep_days
        self._tags = tags
        self._database = database
        self._clock = clock
        self._tracks: dict[int, Track] = {}
        self._by_id: dict[str, Track] = {}
        self._revision = -1
        self._unregistered: list[Point] = []
        self._seen: dict[tuple[str, int], int] = {}
        self._rows: list[Row] = []
        self._minutes = Minutes(GAP_AFTER)
        self._start = clock.micros()
        self._wanted: list[Point] = []
        self._opened = False
        self._begun = False
        self._id = 0
        """Of the database to which the numbers of the tracks belong."""
        self._used: int | None = None
        self._warned = False
        self._sealed = 0
        """What is older is packed [µs UTC]."""
        self._retry_at = 0.0
        self._rates: deque[tuple[float, int]] = deque(maxlen=21)
        self._unsubscribe = tags.subscribe(self.take)
        tags.on_standstill(self.break_off)

    async def configure(self, points: Iterable[Point]) -> None:
        """Record `points` from now on (those with `history`); what the point is called does not matter, its lasting id does.

        Never raises for a database that does not take it: then points that it does not know yet wait until it does.
        """
        wanted = list(points)
        self.follow(wanted, await self.register(wanted))

    async def register(self, points: Iterable[Point]) -> Mapping[str, int]:
        """Make `points` known to the database before the tag database knows them; their numbers by lasting id, for `follow`."""
        wanted = [point for point in points if point.history]
        try:
            await self._open()
            return await self._database.write(lambda connection: store.register(connection, wanted))
        except StorageError as error:
            self._say(error)
            return await self._known()

    def follow(self, points: Iterable[Point], numbers: Mapping[str, int]) -> None:
        """As `configure`, at once: no batch falls between the handles of two revisions. `numbers` come from `register`."""
        wanted = self._wanted = [point for point in points if point.history]
        self._unregistered = [point for point in wanted if point.id not in numbers]
        before, self._by_id = self._by_id, {}
        for point in wanted:
            if point.id in numbers:
                linear = point.kind is Kind.ANALOG
                track = before.pop(point.id, None)
                if track is None or track.linear != linear:
                    track = Track(numbers[point.id], 0.0, linear)
                track.dead_band = point.dead_band if linear else 0.0
                self._by_id[point.id] = track
        now = self._clock.micros()
        for track in before.values():
            track.end(self._rows)
            self._rows.append((track.number, max(now, track.time + 1), None, None, NO_DATA))
        self._map()
        self._take_as_it_stands()

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

    def statistics(self) -> Mapping[str, Value]:
        """What the recorder tells of itself, as `sys.history.<key>`; None is not known yet.

        `full` 0 or 1, `fill` [% of the quota], `rows_per_second`, `dropped` rows, `quota_days` [d].
        """
        days = self.quota_days
        return {
            "full": int(self.full),
            "fill": round(100 * self.fill, 2),
            "rows_per_second": round(self.rows_per_second, 1),
            "dropped": self.dropped,
            "quota_days": None if days is None else round(days, 1),
        }

    def take(self, batch: Batch) -> None:
        """Take a batch from the tag database."""
        if self._tags.revision != self._revision:
            self._map()
        tracks, rows, time = self._tracks, self._rows, batch.time
        block = (batch.source, batch.block)
        seen = self._seen.get(block, 0)
        if batch.seen > seen:
            self._seen[block] = batch.seen
        if batch.qualities is None:
            quality = batch.quality
            for handle, value in zip(batch.handles, batch.values, strict=True):
                track = tracks.get(handle)
                if track is not None:
                    track.take(time, value, quality, seen, rows)
        else:
            for handle, value, quality in zip(batch.handles, batch.values, batch.qualities, strict=True):
                track = tracks.get(handle)
                if track is not None:
                    track.take(time, value, quality, seen, rows)

    def break_off(self, still: Standstill) -> None:
        """Nobody saw anything from `still.begin` to `still.end`: no value holds in between."""
        if still.begin >= still.end:
            return
        for handle, track in self._tracks.items():
            if track.quality < 0 or track.quality & 3 == BAD or track.time >= still.begin:
                continue
            sample = self._tags.read(handle)
            seen = min(sample.seen, still.begin)
            track.take(still.begin, None, track.quality & 0xF00 | NO_DATA, seen, self._rows)
            track.take(still.end, sample.value, sample.quality, 0, self._rows)

    async def run(self) -> None:
        """Write twice a second what was taken; roll up, measure and cut once a minute."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._write())
            group.create_task(self._care())

    async def flush(self) -> None:
        """Write what waits. What the database does not take is kept and tried again."""
        self._tags.wake()
        now = self._clock.micros()
        for track in self._tracks.values():
            track.beat(now, self._rows)
        self._trim()
        if self.full and self._clock.monotonic() < self._retry_at:
            return
        try:
            await self._begin()
            if self._database.id != self._id:
                await self._begin_again()
            portion = self._rows[: PROBE if self.full else PORTION]
            while True:
                await self._append(portion, now)
                # only now: were the task cancelled above, the same rows would be written once more, which does no harm
                del self._rows[: len(portion)]
                self.rows_stored += len(portion)
                portion = self._rows[:PORTION]
                if not portion:
                    break
        except StorageError as error:
            self._retry_at = self._clock.monotonic() + RETRY_PAUSE
            self._say(error)
            return
        self._count()
        if self.full:
            self.full, self.error = False, ""
            log.info("history is written again dropped=%d", self.dropped)
        if self._unregistered:
            waiting = self._unregistered
            self._unregistered = []
            await self._register(waiting)

    async def look_after(self) -> None:
        """Measure, cut what is older than `keep_days` or above the quota, roll up.

        Raises:
            StorageError: the database did not take it.
        """
        await self.measure()
        await self._cut()
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

    async def measure(self) -> None:
        """Bring `size` up to date.

        Raises:
            StorageError: the database cannot be read.
        """
        now = self._clock.micros()
        used = await self._database.read(store.used)
        grown = 0 if self._used is None else used - self._used
        self._used = used
        if not self.full:
            await self._database.write(lambda connection: store.note_growth(connection, now, grown))
        self.size, self.measured = await self._measured(), now
        if self.fill >= WARN_AT and not self._warned:
            log.warning("history fills up used=%d quota=%d days=%s", self.size.used, self.quota, self.quota_days)
        self._warned = self.fill >= WARN_AT

    async def close(self) -> None:
        """Write what waits and stop following."""
        self._unsubscribe()
        for track in self._tracks.values():
            track.end(self._rows)
        self._retry_at = 0.0
        await self.flush()
        if self._rows:
            log.error("history lost rows=%d reason=%s", len(self._rows), self.error)

    async def _write(self) -> None:
        while True:
            await asyncio.sleep(FLUSH_PERIOD)
            await self.flush()

    async def _care(self) -> None:
        await asyncio.sleep(FLUSH_PERIOD)
        while True:
            try:
                await self.look_after()
            except StorageError as error:
                self._say(error)
            await asyncio.sleep(CARE_PERIOD)

    async def _append(self, rows: list[Row], now: int) -> None:
        start, id = self._start, self._id

        def work(connection: Connection) -> None:
            if self._database.id == id:  # else the numbers are of points of the database that was lost
                store.append(connection, rows, start, now, self._minutes)

        await self._database.write(work)
        if self._database.id != id:
            raise StorageError(f"{self._database.path.name}: exchanged meanwhile")

    async def _begin_again(self) -> None:
        """The database is another one than before: go on in it with the points as they stand, and what waits."""
        points, id = self._wanted, self._database.id
        start = self._clock.micros()

        def work(connection: Connection) -> dict[str, int]:
            self._minutes.forget()
            store.begin_run(connection, start)
            return store.register(connection, points)

        numbers = await self._database.write(work)
        self._start, self._id = start, id
        for track in self._by_id.values():
            track.end(self._rows)
        moved = {track.number: numbers[id] for id, track in self._by_id.items() if id in numbers}
        self._rows = [(moved[row[0]], *row[1:]) for row in self._rows if row[0] in moved]
        for track in self._by_id.values():
            track.number, track.quality = moved.get(track.number, track.number), -1
        self._take_as_it_stands()
        log.info("history goes on in another file points=%d", len(moved))

    async def _open(self) -> None:
        if not self._opened:
            await asyncio.to_thread(self._database.migrate)
            self._opened, self._id = True, self._database.id

    async def _begin(self) -> None:
        await self._open()
        if not self._begun:
            start = self._start
            await self._database.write(lambda connection: store.begin_run(connection, start))
            self._begun = True

    async def _register(self, points: list[Point]) -> None:
        try:
            numbers = await self._database.write(lambda connection: store.register(connection, points))
        except StorageError:
            self._unregistered = points
            return
        for point in points:
            linear = point.kind is Kind.ANALOG
            self._by_id[point.id] = Track(numbers[point.id], point.dead_band if linear else 0.0, linear)
        self._map()
        self._take_as_it_stands()

    def _map(self) -> None:
        """Find the handles of this revision of the plant: a handle may be another point's now."""
        self._revision = self._tags.revision
        self._tracks = {
            handle: self._by_id[tag.id] for handle, tag in enumerate(self._tags.tags) if tag.id in self._by_id
        }

    async def _known(self) -> dict[str, int]:
        def look(connection: Connection) -> dict[str, int]:
            return {row[0]: row[1] for row in connection.exec_driver_sql("SELECT lasting_id, id FROM point")}

        try:
            return await self._database.read(look)
        except StorageError:
            return {}

    def _take_as_it_stands(self) -> None:
        """A point that is new here may have a value already, and its source publishes changes only."""
        for handle, track in self._tracks.items():
            sample = self._tags.read(handle)
            if track.quality < 0 and sample.time:
                track.take(max(sample.time, self._start), sample.value, sample.quality, 0, self._rows)

    async def _cut(self) -> None:
        size = self.size
        while size is not None and size.oldest is not None:
            before = self._cut_before(size.used, size.oldest)
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

    def _cut_before(self, used: int, oldest: int) -> int:
        """Everything older than this has to go [µs UTC]."""
        now = self._clock.micros()
        before = now - int(self.keep_days * DAY)
        if used > self.quota:
            part = 1 - CUT_TO * self.quota / used
            before = max(before, oldest + max(HOUR, int((now - oldest) * part)))
        return min(before, now - HOUR)

    async def _measured(self) -> store.Size:
        now, path = self._clock.micros(), self._database.path
        return await self._database.read(lambda connection: store.size(connection, path, now))

    def _trim(self) -> None:
        excess = len(self._rows) - BUFFER_LIMIT
        if excess > 0:
            lost = self._rows[:excess]
            gaps: dict[int, Row] = {}
            for number, time, _, _, _ in lost:
                gaps.setdefault(number, (number, time, None, None, NO_DATA))
            self.dropped += sum(row != gaps[row[0]] for row in lost)
            self._rows[:excess] = gaps.values()

    def _count(self) -> None:
        now = self._clock.monotonic()
        self._rates.append((now, self.rows_stored))
        since, rows = self._rates[0]
        if now > since:
            self.rows_per_second = (self.rows_stored - rows) / (now - since)

    def _say(self, error: StorageError) -> None:
        if not self.full:
            log.error("history is not written reason=%s", error)
        self.full, self.error = True, str(error)
