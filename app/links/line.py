"""What the parts of the loop around a register link share: its units, whose turn it is, what is published and how the link is doing."""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Any

from app.clock import Clock
from app.errors import HungUp, LinkError, NoAnswer, NotConnected, Overtaken, Withdrawn
from app.links.contract import Block, LateAnswerDue, Transport
from app.links.host_event import EventTaker
from app.links.lane import Lane
from app.links.scan_block import ScanBlock
from app.links.schedule import PERMIT, Job, Priority, Schedule
from app.links.station import Station
from app.links.statistics import LinkState, LinkStatistics, StatisticsPublisher, UnitStatistics
from app.plant.definitions import Link
from app.registers.codec import with_own
from app.registers.pdu import READ_HOLDING
from app.registers.rtu import read_time, write_time
from app.tags.database import TagDatabase

log = logging.getLogger(__name__)

REPORT = 1.0
"""Period of the statistics [s]."""
READ_TRIES = 3
"""How often the bits of others are read before a write, where this program stood still each time."""


class Line:
    """The state of one link. Its connections are the runner's, what goes wrong is of `outages`."""

    def __init__(self, link: Link, stations: Mapping[int, Station], tags: TagDatabase, clock: Clock) -> None:
        self.link = link
        self.stations = stations
        self.statistics = LinkStatistics(units={number: UnitStatistics() for number in stations})
        self.demanded: frozenset[str] = frozenset()
        self.clock = clock
        self.events = EventTaker()
        self.paused: Callable[[], bool] = lambda: False
        self._tags = tags
        self._schedule = Schedule()
        self._open: set[int] = set()
        self._sleepers: dict[asyncio.Future[None], None] = {}
        self._failed: asyncio.Future[None] | None = None
        self._publisher = StatisticsPublisher(link.name, self.statistics, tags, clock)
        self._told_up: bool | None = None
        self._heard = False
        """Whether anybody answered since the connection was opened, or since all were silent."""
        self._line_silent = False

    @property
    def connected(self) -> bool:
        """Whether a connection is open."""
        return bool(self._open)

    async def ask(self, job: Job, priority: Priority) -> list[int]:
        """Send the telegram of `job` when it is its turn.

        Raises:
            LinkError: as the transport, or NotConnected at once when there is no connection.
        """
        if not self._open:
            raise NotConnected(f"link {self.link.name}: not connected ({self.statistics.last_error_text or 'not yet'})")
        if job.urgent:
            if (station := self.stations.get(job.unit)) is not None:
                station.stops += 1
                if station.composed is not None and station.composed.yields_to(job.machine):
                    station.composed.overtaken = True
            for overtaken in self._schedule.overtake(job.unit, job.machine):
                fail(overtaken, overtaken_by_stop(overtaken))
        self._schedule.add(job, priority)
        self._wake()
        return await job.done

    def job(self, unit: int, read: Block | None = None, *, liveness: bool = True, scan: ScanBlock | None = None) -> Job:
        """A read of `unit`, or the start of a write."""
        station = self.stations.get(unit)
        timeout = station.timeout if station else self.link.timeout or default_timeout(self.stations)
        done: asyncio.Future[list[int]] = asyncio.get_running_loop().create_future()
        return Job(unit, timeout, done, read, scan, liveness=liveness, permit=PERMIT.get())

    def schedule(self, block: ScanBlock, due: float) -> None:
        """Scan `block` at `due` [s]; one that is not wanted loses its place."""
        self._schedule.at(block, due)
        self._wake()

    def written(self, station: Station, address: int, count: int, function: int = READ_HOLDING) -> None:
        """What holds these registers, or what else `function` reads, is read again now."""
        if station.state is LinkState.UP:
            for block in station.around(function, address, address + count - 1):
                self._schedule.at(block, self._now())
            self._wake()

    def drop(self, block: ScanBlock) -> None:
        """Scan `block` no more until it is given a place again."""
        self._schedule.drop(block)

    async def read(self, station: Station, block: Block, *, liveness: bool = True, quiet: bool = False) -> list[int]:
        """One read for a task that can wait, also for the line to forget an earlier request."""
        while True:
            try:
                job = self.job(station.number, block, liveness=liveness)
                job.quiet = quiet
                return await self.ask(job, Priority.REFRESH)
            except LateAnswerDue as error:
                await asyncio.sleep(error.wait)

    def publish(self, station: Station, block: ScanBlock, words: list[int], started: float) -> None:
        """Publish `words` as read by a telegram sent at `started` [s]."""
        if started < block.started:  # a later request was answered before this one, on another connection
            return
        block.started = started
        block.bind(self._tags.handles, self._tags.revision)
        self._tags.publish(block.seen(words, self.clock.micros(), station.basis))

    def halt(self, station: Station, *, halted: bool) -> None:
        """The program of the unit stands still, or goes on: what is known of it is told to be old, or read again now."""
        station.halted = halted
        time, now = self.clock.micros(), self._now()
        for block in station.blocks:
            if not halted:
                self._schedule.at(block, now)
            elif block.words is not None:
                block.bind(self._tags.handles, self._tags.revision)
                if block.words is not None:
                    self._tags.publish(block.seen(block.words, time, station.basis))
        self._wake()

    def _publish_lost(self, station: Station, quality: int) -> None:
        for block in station.blocks:
            self._publish_block_lost(station, block, quality)

    def _publish_block_lost(self, station: Station, block: ScanBlock, quality: int) -> None:
        block.bind(self._tags.handles, self._tags.revision)
        block.attempts, block.unheard, block.scanned = 0, False, 0.0
        block.started = self._now()
        batch = block.lost(self.clock.micros(), quality | station.origin)
        if batch is not None:
            self._tags.publish(batch)

    def _answered(self, station: Station | None, started: float, alive: bool, wire: float | None = None) -> None:
        """`wire`: what the telegram takes on the line by itself [s]; None when it was not answered in full."""
        self.statistics.telegrams += 1
        if station is None or not alive:
            return
        self.statistics.units[station.number].answered(self._now() - started, wire)
        self._line_silent = False
        if not self._heard:
            self._heard = True
            self._settle()
        if station.state is LinkState.DOWN:
            station.probe_now.set()

    def _wire(self, read: Block | None, words: int = 0, function: int = 6) -> float:
        """Time of a telegram on a serial line with both silences [s]; 0 elsewhere."""
        if self.link.transport != "rtu":
            return 0.0
        if read:
            return read_time(self.link.baud, read.count, read.function)
        return write_time(self.link.baud, words, function)

    def _answer_was_kept(self, standstills: int) -> bool:
        """Whether this program stood still while it waited: the answer may have been there all the time, and tells of the past."""
        self._tags.wake()
        return self._tags.standstills != standstills

    async def _read_on(
        self, lane: Lane, station: Station | None, unit: int, block: Block, patience: float
    ) -> list[int]:
        """What the transport reads. A device that closes the connection at the same registers again and again refuses them.

        Raises:
            LinkError: as the transport; HungUp: the connection was lost as before, and is open again.
        """
        try:
            return await lane.transport.read(unit, block, patience)
        except NotConnected as error:
            if station is None or not lane.answers or not station.hangs_up(block):
                raise
            await lane.transport.close()
            await lane.transport.connect()
            raise HungUp(f"unit {unit}: connection closed at {block.address:#06x}, {block.count} words") from error

    async def _add_others(self, transport: Transport, station: Station, job: Job) -> float:
        """Give the words of `job` the bits of others as they are now; of a Stop as last seen, where the device does not say them.

        Returns when they were there [s].

        Raises:
            LinkError: as the transport, Overtaken by a Stop, or Withdrawn; nothing was written.
        """
        last = station.last_seen(job.address, len(job.words)) if job.urgent else None
        if last is not None and station.state is not LinkState.UP:
            job.words = with_own(last, job.words, job.own)
            return self._now()
        started, station.composed = self._now(), job
        try:
            now = await self._read_others(transport, station, job, last)
        finally:
            station.composed = None
        self.statistics.busy += self._now() - started
        if job.overtaken:
            raise overtaken_by_stop(job)
        check_permit(job)
        job.words = with_own(now, job.words, job.own)
        return self._now()

    async def _read_others(
        self, transport: Transport, station: Station, job: Job, last: Sequence[int] | None
    ) -> Sequence[int]:
        """The words of `job` as the device has them; `last` where it does not say. Never of before this program stood still.

        Raises:
            LinkError: as the transport where there is no `last`; NoAnswer where this program stood still each time.
        """
        block = Block(job.address, len(job.words), READ_HOLDING)
        for _ in range(READ_TRIES):
            asked, standstills = self._now(), self._tags.standstills
            try:
                now: Sequence[int] = await transport.read(job.unit, block, job.timeout)
            except LinkError as error:
                if last is None or isinstance(error, NotConnected):
                    raise
                if not isinstance(error, LateAnswerDue):
                    self.statistics.failed(job.unit, error)
                return last
            self._answered(station, asked, job.liveness, self._wire(block))
            if job.overtaken or not self._answer_was_kept(standstills):
                break
        else:
            if not job.urgent:
                raise NoAnswer(
                    f"unit {job.unit}: {block.address:#06x} was read, and each time this program stood still"
                )
        return now

    def attend(self, station: Station, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Do `work` for a station beside its scans."""
        task = asyncio.get_running_loop().create_task(work)
        station.tasks.add(task)
        task.add_done_callback(station.tasks.discard)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: asyncio.Task[None]) -> None:
        error = None if task.cancelled() else task.exception()
        if error is None or isinstance(error, NotConnected):  # the lanes tell a lost connection
            return
        if self._failed is not None and not self._failed.done():
            self._failed.set_exception(error)

    def _settle(self) -> None:
        """State of the link from the states of its units."""
        states = [station.state for station in self.stations.values()]
        for number, station in self.stations.items():
            self.statistics.units[number].state = station.state
        statistics = self.statistics
        if not self._open:
            statistics.state = LinkState.CONNECTING if self._told_up is None else LinkState.DOWN
        elif LinkState.CONFIGURATION in states:
            statistics.state = LinkState.CONFIGURATION
        elif states and all(state is LinkState.DOWN for state in states):
            statistics.state = LinkState.DOWN
        elif states and LinkState.UP not in states:
            statistics.state = LinkState.CONNECTING
        else:
            statistics.state = LinkState.SOME_SILENT if LinkState.DOWN in states else LinkState.UP
        statistics.simulated = self.link.simulated or (
            bool(states) and all(station.simulated for station in self.stations.values())
        )
        if LinkState.UP in states and self._open and self._heard:
            self._note(up=True)
        self._publisher.publish()

    async def _report(self) -> None:
        while True:
            await asyncio.sleep(REPORT)
            self._publisher.measure()
            self._settle()

    def _note(self, *, up: bool, reason: str = "") -> None:
        if up == self._told_up:
            return
        self._told_up = up
        if up:
            log.info("link up link=%s", self.link.name)
        else:
            log.warning("link down link=%s reason=%s", self.link.name, reason)

    def _wake(self) -> None:
        for sleeper in self._sleepers:
            finish(sleeper)

    def _now(self) -> float:
        return asyncio.get_running_loop().time()


def finish(sleeper: asyncio.Future[None]) -> None:
    """Wake who waits."""
    if not sleeper.done():
        sleeper.set_result(None)


def fail(job: Job, error: LinkError) -> None:
    """Tell whoever waits for `job` that nothing came of it."""
    if not job.done.done():
        job.done.set_exception(error)


def overtaken_by_stop(job: Job) -> Overtaken:
    """What whoever waits for `job` is told."""
    return Overtaken(f"unit {job.unit}: write to {job.address:#06x} not sent, a Stop came first")


def check_permit(job: Job) -> None:
    """Nothing is sent for somebody whose right has ended while it waited; a Stop always is.

    Raises:
        Withdrawn: so it is.
    """
    if job.permit is not None and not job.urgent and not job.permit():
        raise Withdrawn(f"unit {job.unit}: write to {job.address:#06x} not sent, whoever asked for it may no more")


def default_timeout(stations: Mapping[int, Station]) -> float:
    """Of a unit that the plant does not have [s]."""
    return max((station.timeout for station in stations.values()), default=1.0)
