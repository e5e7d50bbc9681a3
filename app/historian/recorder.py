"""The recorder: decides which values become history and hands them to the writer.

A sample is stored when it leaves the dead-band, together with the last one suppressed (so that the line has its true corner), on every
change of quality, and at least every 10 minutes; of a ramp one a second is enough. What is stored, drawn as a line, is nowhere further
from what was seen than the dead-band; held from sample to sample it is neither, but for the last second of a ramp.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Iterable, Mapping, Sequence

from sqlalchemy import Connection

from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.historian import store
from app.historian.minutes import Minutes
from app.historian.store import GAP_AFTER, Row
from app.historian.track import Track
from app.historian.upkeep import Upkeep
from app.plant.definitions import Kind, Point
from app.tags.batch import Batch, Value
from app.tags.database import Standstill, TagDatabase
from app.tags.quality import BAD, NO_DATA

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
        self.upkeep = Upkeep(database, clock, self._minutes, keep_days=keep_days, quota=quota)
        self._start = self._alive = clock.micros()
        self._furthest = 0
        """Of what was stored since the clock was last set back [µs UTC]."""
        self._ended: list[tuple[int, int]] = []
        """Where what this recorder says breaks off since it was stored last, by a clock that was set, and where it goes on [µs UTC]."""
        self._wanted: list[Point] = []
        self._opened = False
        self._begun = False
        self._edition = 0
        """Of the database to which the numbers of the tracks belong."""
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
            track.lose(now, self._rows)
        self._map()
        self._take_as_it_stands()

    def statistics(self) -> Mapping[str, Value]:
        """What the recorder tells of itself, as `sys.history.<key>`; None is not known yet.

        `full` 0 or 1, `fill` [% of the quota], `rows_per_second`, `dropped` rows, `quota_days` [d].
        """
        days = self.upkeep.quota_days
        return {
            "full": int(self.full),
            "fill": round(100 * self.upkeep.fill, 2),
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
        if still.end - still.begin > still.seconds * 1e6:  # the clock left time out
            self._ended.append((still.begin, still.end))
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
            group.create_task(self.upkeep.run(lambda: not self.full, self._say))

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
            if self._database.edition != self._edition:
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
            if self._opened and self._database.edition != self._edition:
                return  # what waits is written into it the next time
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

    async def _append(self, rows: list[Row], now: int) -> None:
        reached = max(self._alive, self._ended[-1][1] if self._ended else self._start)
        furthest = max(reached, self._furthest, *(row[1] for row in self._rows))
        if now < reached:  # the clock was set back
            self._ended.append((furthest, now))
        self._furthest = now if now < reached else furthest
        start, edition, self._alive, ended = self._start, self._edition, now, list(self._ended)

        def work(connection: Connection) -> Sequence[int]:
            if self._database.edition != edition:  # the numbers are of points of the database that was lost
                return ()
            store.append(connection, rows, store.broken_off(connection, start, ended), now, self._minutes)
            return store.ahead(connection, now) if any(goes_on < end for end, goes_on in ended) else ()

        ahead = await self._database.write(work)
        if self._database.edition != edition:
            raise StorageError(f"{self._database.path.name}: exchanged meanwhile")
        if ended:
            self._start = ended[-1][1]
            del self._ended[: len(ended)]
        self._go_beyond(ahead)

    async def _begin_again(self) -> None:
        """The database is another one than before, or an older state of it: go on in it with the points as they stand, and what waits."""
        points, edition = self._wanted, self._database.edition
        start = self._clock.micros()

        def work(connection: Connection) -> tuple[store.Closed, dict[str, int]]:
            self._minutes.forget()
            return store.begin_run(connection, start), store.register(connection, points)

        closed, numbers = await self._database.write(work)
        self._start, self._alive, self._edition = start, start, edition
        self._ended.clear()
        for track in self._by_id.values():
            track.end(self._rows)
        moved = {track.number: numbers[id] for id, track in self._by_id.items() if id in numbers}
        self._rows = [(moved[row[0]], *row[1:]) for row in self._rows if row[0] in moved]
        for track in self._by_id.values():
            track.number, track.quality = moved.get(track.number, track.number), -1
        self._go_beyond(closed.ahead)
        self._take_as_it_stands()
        log.info("history goes on in another file points=%d", len(moved))

    async def _open(self) -> None:
        if not self._opened:
            await asyncio.to_thread(self._database.migrate)
            self._opened, self._edition = True, self._database.edition

    async def _begin(self) -> None:
        await self._open()
        if not self._begun:
            start = self._start
            closed = await self._database.write(lambda connection: store.begin_run(connection, start))
            self._begun = True
            self._go_beyond(closed.ahead)

    def _go_beyond(self, ends: Sequence[int]) -> None:
        """Runs ended later than it is now, by clocks that were ahead: what is so is told again behind their `ends`."""
        for track in self._by_id.values() if ends else ():
            track.lived_until(*ends)

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
        try:
            return await self._database.read(store.numbers)
        except StorageError:
            return {}

    def _take_as_it_stands(self) -> None:
        """A point that is new here may have a value already, and its source publishes changes only."""
        for handle, track in self._tracks.items():
            sample = self._tags.read(handle)
            if track.quality < 0 and sample.time:
                track.take(max(sample.time, self._start), sample.value, sample.quality, 0, self._rows)

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
