"""The loop around a register link: connect, scan, publish, back off, say so once.

Each connection is a lane with a loop of its own; all lanes take their next telegram from one schedule. What needs several telegrams
(to identify a unit, to find the registers that it refuses, to look whether a silent one is back) is a task that puts them into that
schedule one by one, so a write never waits for more than the telegram on the wire.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass
from math import inf
from random import uniform
from typing import Any

from app.clock import Clock
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected, Overtaken
from app.links.contract import Block, StillOwed, Transport
from app.links.events import LastSeen, OnEvents, StoredUpTo
from app.links.examine import NO_REGISTER, Examiner
from app.links.plc import TORN_TRIES, PlcUnit, Seen
from app.links.scan_block import ScanBlock
from app.links.schedule import Job, Priority, Schedule
from app.links.station import Station
from app.links.statistics import LinkStatistics, State, StatisticsPublisher, UnitStatistics
from app.plant.definitions import Link, Scan
from app.registers.rtu import read_time, write_time
from app.tags.database import TagDatabase
from app.tags.quality import COMM_FAILURE, CONFIGURATION, DEVICE

log = logging.getLogger(__name__)

RETRIES = 1
"""Of a read without an answer; a write is never repeated here."""
RETRY_LIMIT = 0.8
"""Longest time-out of a retry [s]: a pulled cable shows within one time-out + 1 s."""
BUSY_PAUSE = 0.05
"""Before a device that is busy is asked again [s]."""
BUSY_TRIES = 2
SLOWEST_REFUSED = 10.0
"""Longest period of a block that the device keeps refusing [s]."""
PERMANENT = 10.0
"""Period of a block that the device cannot serve at all [s]; a repaired device comes back by itself."""
FIRST_PROBE, LAST_PROBE = 1.0, 60.0
"""Pauses between probes of a silent unit [s], doubling."""
SETTLE = 0.05
"""What a device is given to act on registers that somebody wrote, before it is looked at again [s]."""
PROBE_SHARE = 0.05
"""Most of the line's time that goes into probes while others live on it."""
TORN_PAUSE = 1.0
"""Before an image that is read once is tried again when it was never whole [s]."""
FIRST_PAUSE, LAST_PAUSE = 0.1, 5.0
"""Pauses before a lost connection is opened again [s], doubling; the first try is at once."""
ENDED = "link ended"
REPORT = 1.0
"""Period of the statistics [s]."""

TRAINING_WORDS = 4
TRAINING_SPARE = 12
"""Registers behind the head that may be read with it."""
TRAINING_MAGIC = 0x5047
TRAINING_SIMULATED = 0x0001
TRAINING_VERSION = 1
"""Head of the training registers (reference/register-map.md): magic, flags, version, type."""

GATEWAY = (10, 11)
PERMANENT_CODES = (1, 7)


class Torn(BadAnswer):
    """An image that the device was changing while it was read."""


@dataclass(slots=True)
class _Lane:
    """One connection."""

    number: int
    transport: Transport
    answers: int = 0


class LinkRunner:
    """Keeps the units of one link scanned and their tags honest."""

    def __init__(
        self,
        link: Link,
        stations: Mapping[int, Station],
        tags: TagDatabase,
        clock: Clock,
        build: Callable[[], Transport],
        lanes: int,
    ) -> None:
        """`build` makes an unopened connection; `lanes` of them are kept open."""
        self.link = link
        self.stations = stations
        self.statistics = LinkStatistics(units={number: UnitStatistics() for number in stations})
        self.demanded: frozenset[str] = frozenset()
        self._tags = tags
        self.clock = clock
        self._build = build
        self._lanes = lanes
        self._schedule = Schedule()
        self._examiner = Examiner(self)
        self._open: set[int] = set()
        self._sleepers: set[asyncio.Future[None]] = set()
        self._failed: asyncio.Future[None] | None = None
        self._publisher = StatisticsPublisher(link.name, self.statistics, tags, clock)
        self.on_events: OnEvents | None = None
        self.last_seen: LastSeen | None = None
        self.stored_up_to: StoredUpTo | None = None
        self._told_up: bool | None = None
        self._heard = False
        """Whether anybody answered since the connection was opened, or since all were silent."""
        self._line_silent = False
        self._probe_free = 0.0
        self._reopened = 0.0
        self._reopen: set[int] = set()
        for station in stations.values():
            self._prepare(station)

    async def run(self) -> None:
        """Keep every connection open and used until cancelled."""
        loop = asyncio.get_running_loop()
        self._failed = loop.create_future()
        own = [loop.create_task(self._lane(number)) for number in range(self._lanes)]
        own.append(loop.create_task(self._report()))
        try:
            await asyncio.wait([*own, self._failed], return_when=asyncio.FIRST_EXCEPTION)
            for ended in (*own, self._failed):
                if ended.done():
                    ended.result()
        finally:
            for task in own:
                task.cancel()
            await asyncio.gather(*own, return_exceptions=True)
            self._close(ENDED)
            await asyncio.gather(*(station.plc.events.end() for station in self.stations.values() if station.plc))
            if not self._failed.done():
                self._failed.cancel()

    # what others ask

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
            for overtaken in self._schedule.overtake(job.unit):
                _fail(
                    overtaken,
                    Overtaken(f"unit {job.unit}: write to {overtaken.address:#06x} not sent, a Stop came first"),
                )
        self._schedule.add(job, priority)
        self._wake()
        return await job.done

    def job(self, unit: int, read: Block | None = None, *, liveness: bool = True, scan: ScanBlock | None = None) -> Job:
        """A read of `unit`, or the start of a write."""
        station = self.stations.get(unit)
        timeout = station.timeout if station else self.link.timeout or _default_timeout(self.stations)
        done: asyncio.Future[list[int]] = asyncio.get_running_loop().create_future()
        return Job(unit, timeout, done, read, scan, liveness=liveness)

    def schedule(self, block: ScanBlock, due: float) -> None:
        """Scan `block` at `due` [s]; one that is not wanted loses its place."""
        self._schedule.at(block, due)
        self._wake()

    def drop(self, block: ScanBlock) -> None:
        """Scan `block` no more until it is given a place again."""
        self._schedule.drop(block)

    def written(self, station: Station, address: int, count: int) -> None:
        """What holds these registers is read again now."""
        if station.state is State.UP:
            for block in station.around(3, address, address + count - 1):
                self._schedule.at(block, self._now())
            self._wake()

    def nudge(self, unit: int) -> None:
        """Somebody wrote registers of their own to `unit`: what is silent or refused is tried now, not when its pause is over."""
        station = self.stations.get(unit)
        if station is None:
            return
        station.probe_now.set()
        if station.state is State.UP:
            for block in station.blocks:
                if block.failures or (block.quality or 0) & 3:
                    self._schedule.at(block, self._now() + SETTLE)
        self._wake()

    def change(self, stations: Mapping[int, Station]) -> None:
        """Read these units from now on; one whose station is the same object goes on as if nothing were."""
        gone = [station for number, station in self.stations.items() if stations.get(number) is not station]
        fresh = [station for number, station in stations.items() if self.stations.get(number) is not station]
        self.stations = stations
        for station in gone:
            station.end_tasks()
            for block in station.blocks:
                block.alive = False
                self._schedule.drop(block)
        for station in fresh:
            self.statistics.units.setdefault(station.number, UnitStatistics())
            self._prepare(station)
            before = next((old for old in gone if old.number == station.number), None)
            if station.plc is not None and before is not None and before.plc is not None:
                station.plc.adopt(before.plc)
            if self._open:
                self.attend(station, self._bring_up(station))
            else:
                station.state = State.DOWN if self._told_up is not None else State.CONNECTING
        self._settle()
        self._wake()

    def demand(self, names: frozenset[str]) -> None:
        """Points of class PAGE that somebody looks at."""
        fresh = names - self.demanded
        self.demanded = names
        for station in self.stations.values():
            if station.state is State.UP:
                for block in station.covering(fresh):
                    if block.scan is Scan.PAGE and not block.queued:
                        self._schedule.at(block, self._now())
        self._wake()

    # a connection

    async def _lane(self, number: int) -> None:
        pause = 0.0
        transport = self._build()
        transport.counts = self.statistics.wire
        while True:
            lane = _Lane(number, transport)
            try:
                await lane.transport.connect()
                self._opened(number)
                await self._work(lane)
            except NotConnected as error:
                self._lost(number, error)
            finally:
                await lane.transport.close()
            if lane.answers:
                pause = 0.0
            await asyncio.sleep(pause * uniform(0.9, 1.1))
            pause = min(max(2 * pause, FIRST_PAUSE), LAST_PAUSE)

    async def _work(self, lane: _Lane) -> None:
        """Carry telegrams until the connection is lost."""
        number, transport = lane.number, lane.transport
        try:
            while True:
                if not transport.connected:
                    raise NotConnected(f"link {self.link.name}: closed by the other end")
                if number in self._reopen:
                    self._reopen.discard(number)
                    raise NotConnected(f"link {self.link.name}: no unit answers, opening the connection again")
                turn = self._schedule.take(self._now())
                if turn is None:
                    await self._idle()
                elif isinstance(turn, Job):
                    await self._do(lane, turn)
                else:
                    await self._scan(lane, turn)
        except asyncio.CancelledError:
            self._lost(number, NotConnected(ENDED))
            raise

    async def _idle(self) -> None:
        loop = asyncio.get_running_loop()
        sleeper: asyncio.Future[None] = loop.create_future()
        due = self._schedule.next_due()
        timer = None if due is None else loop.call_at(due, _finish, sleeper)
        self._sleepers.add(sleeper)
        try:
            await sleeper
        finally:
            self._sleepers.discard(sleeper)
            if timer is not None:
                timer.cancel()

    def _wake(self) -> None:
        for sleeper in self._sleepers:
            _finish(sleeper)

    def _opened(self, number: int) -> None:
        first = not self._open
        self._open.add(number)
        self.statistics.connections = len(self._open)
        if first:
            self._heard = False
            for station in self.stations.values():
                station.state = State.CONNECTING
                self.attend(station, self._bring_up(station))
            if not self.stations:
                self._note(up=True)
        self._settle()

    def _lost(self, number: int, error: NotConnected) -> None:
        self._open.discard(number)
        self._reopen.discard(number)
        self.statistics.connections = len(self._open)
        self.statistics.last_error, self.statistics.last_error_text = error.kind, str(error)
        if not self._open:
            self._close(str(error))
        self._wake()  # what it left undone is for the others, and whoever was closed with it finds out

    def _close(self, reason: str) -> None:
        """Nothing is connected any more: no job waits, everything is bad at once, and one line says so."""
        for job in self._schedule.clear():
            _fail(job, NotConnected(f"link {self.link.name}: {reason}"))
        for station in self.stations.values():
            station.end_tasks()
            station.state = State.DOWN
            self._publish_lost(station, COMM_FAILURE)
        self._heard = False
        if reason != ENDED:
            self._note(up=False, reason=reason)
        self._settle()

    # one telegram

    async def _do(self, lane: _Lane, job: Job) -> None:
        transport = lane.transport
        started = self._now()
        station = self.stations.get(job.unit)
        try:
            if job.read is not None:
                words = await transport.read(job.unit, job.read, job.timeout)
            elif station is not None:
                async with station.writing:
                    job.sent = True
                    await transport.write(job.unit, job.address, job.words, job.timeout, job.function)
                words = []
            else:
                job.sent = True
                await transport.write(job.unit, job.address, job.words, job.timeout, job.function)
                words = []
        except BaseException as error:
            self.statistics.busy += self._now() - started
            if not isinstance(error, LinkError):
                _fail(job, NotConnected(f"link {self.link.name}: ended while unit {job.unit} was asked"))
                raise
            if isinstance(error, DeviceException):
                lane.answers += 1
                self._answered(station, started, job.liveness and error.code not in GATEWAY)
            if not isinstance(error, StillOwed):
                self.statistics.failed(job.unit, error)
            _fail(job, error)
            if isinstance(error, NotConnected):
                raise
            return
        lane.answers += 1
        self.statistics.busy += self._now() - started
        self._answered(station, started, job.liveness, self._wire(job.read, len(job.words), job.function))
        if job.scan is not None and station is not None and station.state is State.UP and job.scan.alive:
            seen = Seen.WHOLE if job.scan.part is None else self._look(station, job.scan, words, started)
            if seen is Seen.TORN:
                _fail(job, Torn(f"unit {job.unit}: {job.scan.block.address:#06x} changed while it was read"))
            elif seen is not Seen.NOTHING:
                self.publish(station, job.scan, words, started)
        if not job.done.done():
            job.done.set_result(words)

    async def _scan(self, lane: _Lane, block: ScanBlock) -> None:
        station = self.stations[block.unit]
        started = self._now()
        ticket = block.ticket
        timeout = min(station.timeout, RETRY_LIMIT) if block.attempts else station.timeout
        try:
            words = await lane.transport.read(block.unit, block.block, timeout)
        except NotConnected:
            if ticket == block.ticket:
                self._schedule.at(block, block.due)  # another connection may do it
            raise
        except StillOwed as error:
            if ticket == block.ticket:
                self._schedule.at(block, self._now() + error.wait)
            return
        except LinkError as error:
            self.statistics.busy += self._now() - started
            self.statistics.failed(block.unit, error)
            if isinstance(error, DeviceException):
                lane.answers += 1
            if ticket == block.ticket:  # else it has been given another place, or none, while it was away
                self._scan_failed(station, block, error, started)
            return
        lane.answers += 1
        ended = self._now()
        self.statistics.busy += ended - started
        self._answered(station, started, True, self._wire(block.block))
        station.proven = max(station.proven, block.block.count)
        block.attempts = block.failures = 0
        if block.scan is Scan.FAST:
            if block.scanned:
                self.statistics.fast_scan(ended - block.scanned)
            block.scanned = ended
        seen = Seen.WHOLE
        if block.part is not None and station.state is State.UP and block.alive:
            seen = self._look(station, block, words, started)
            if seen in (Seen.TORN, Seen.PARTLY) and block.torn < TORN_TRIES and ticket == block.ticket:
                block.torn += 1
                self._schedule.at(block, block.due, first=True)
                return
            block.torn = 0
        if ticket == block.ticket:
            self._again(block)
            if seen is Seen.TORN and not block.queued:  # what is read once is still wanted
                self._schedule.at(block, self._now() + TORN_PAUSE)
        if seen <= Seen.PARTLY and station.state is State.UP and block.alive:
            self.publish(station, block, words, started)

    def _look(self, station: Station, block: ScanBlock, words: list[int], started: float) -> Seen:
        """What words of a machine with a map of ours are worth."""
        assert station.plc is not None
        seen = station.plc.seen(block, words, started)
        if seen in (Seen.TORN, Seen.PARTLY):
            self.statistics.torn += 1
        return seen

    def _again(self, block: ScanBlock) -> None:
        """The next place of a block: one period after the last, or now and counted when that is over."""
        if block.period == inf or (block.scan is Scan.PAGE and self.demanded.isdisjoint(block.names)):
            return
        due, now = block.due + block.period, self._now()
        if due < now:
            self.statistics.late_scans += 1 + int((now - due) / block.period)
            due = now
        self._schedule.at(block, due)

    def publish(self, station: Station, block: ScanBlock, words: list[int], started: float) -> None:
        """Publish `words` as read by a telegram sent at `started` [s]."""
        if started < block.started:  # a later request was answered before this one, on another connection
            return
        block.started = started
        block.bind(self._tags.handles, self._tags.revision)
        self._tags.publish(block.seen(words, self.clock.micros(), station.origin))

    def _publish_lost(self, station: Station, quality: int) -> None:
        for block in station.blocks:
            self._publish_block_lost(station, block, quality)

    def _publish_block_lost(self, station: Station, block: ScanBlock, quality: int) -> None:
        block.bind(self._tags.handles, self._tags.revision)
        block.attempts, block.scanned = 0, 0.0
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
        if station.state is State.DOWN:
            station.probe_now.set()

    # what goes wrong

    def _scan_failed(self, station: Station, block: ScanBlock, error: LinkError, started: float) -> None:
        if isinstance(error, DeviceException) and error.code not in GATEWAY:
            self._answered(station, started, True)
            self._refused(station, block, error)
        elif block.attempts < RETRIES and not self._line_silent:
            block.attempts += 1
            self.statistics.retries += 1
            self._schedule.at(block, block.due, first=True)
        else:
            block.attempts = 0
            if block.block.count > max(station.proven, station.device.fallback_read) and station.device.fallback_read:
                self.attend(station, self._examiner.try_smaller(station, block, error))
            else:
                self._silent(station, error)

    def refuse(self, station: Station, block: ScanBlock, reason: str) -> None:
        """What `block` holds is not what the plant file says: bad, and looked at again later."""
        log.debug("block refused link=%s unit=%d: %s", self.link.name, station.number, reason)
        self._publish_block_lost(station, block, CONFIGURATION)
        self._schedule.at(block, self._now() + PERMANENT)

    def misconfigured(self, station: Station, reason: str) -> None:
        """The unit is not the device of the plant file: all bad, no writes, until it is."""
        asyncio.get_running_loop().call_soon(self._misconfigured, station)

    def _misconfigured(self, station: Station) -> None:
        if station.state is not State.UP or self.stations.get(station.number) is not station:
            return
        station.end_tasks()
        for block in station.blocks:
            self._schedule.drop(block)
        self._to_configuration(station)
        self.attend(station, self._bring_up(station))

    def _to_configuration(self, station: Station) -> None:
        station.state = State.CONFIGURATION
        self._publish_lost(station, CONFIGURATION)
        self._settle()

    def _refused(self, station: Station, block: ScanBlock, error: DeviceException) -> None:
        now = self._now()
        if error.code in NO_REGISTER and block.part is not None:
            if not block.failures:
                log.warning(
                    "no such registers link=%s unit=%d first=%#06x last=%#06x: %s",
                    self.link.name,
                    station.number,
                    block.block.address,
                    block.block.last,
                    error,
                )
            block.failures += 1
            self.refuse(station, block, str(error))
        elif error.code in NO_REGISTER:
            self.attend(station, self._examiner.examine(station, block))
        elif error.code in PERMANENT_CODES:
            self._publish_block_lost(station, block, CONFIGURATION if error.code == 1 else DEVICE)
            self._schedule.at(block, now + PERMANENT)
        elif block.attempts < BUSY_TRIES:
            block.attempts += 1
            self.statistics.retries += 1
            self._schedule.at(block, now + BUSY_PAUSE * block.attempts)
        else:
            self._publish_block_lost(station, block, DEVICE)
            block.failures += 1
            shortest = min(block.period, 1.0)
            self._schedule.at(block, now + min(SLOWEST_REFUSED, max(shortest, 0.25 * 2 ** min(block.failures, 6))))

    def _silent(self, station: Station, error: LinkError) -> None:
        """A unit in quarantine: bad at once, and from now on only probes."""
        if station.state is State.DOWN or self.stations.get(station.number) is not station:
            return
        station.end_tasks()
        for block in station.blocks:
            self._schedule.drop(block)
        station.state = State.DOWN
        self._line_silent = True
        self._publish_lost(station, COMM_FAILURE)
        if self._several:
            log.warning("unit silent link=%s unit=%d reason=%s", self.link.name, station.number, error)
        self.attend(station, self._probe(station))
        if self._all_silent:
            self._heard = False
            self._note(up=False, reason=str(error))
        self._settle()

    @property
    def _several(self) -> bool:
        return len(self.stations) > 1

    @property
    def _all_silent(self) -> bool:
        return all(station.state is State.DOWN for station in self.stations.values())

    async def _probe(self, station: Station) -> None:
        """Ask a silent unit for one register now and then, until it answers."""
        pause = FIRST_PROBE
        while True:
            wait = pause * uniform(0.9, 1.1)
            wait = min(wait, LAST_PAUSE) if self._all_silent else max(wait, self._probe_free - self._now())
            station.probe_now.clear()
            try:
                async with asyncio.timeout(wait):
                    await station.probe_now.wait()
                await asyncio.sleep(SETTLE)
                pause = FIRST_PROBE / 2
            except TimeoutError:
                pass
            started = self._now()
            try:
                await self.read(station, station.probe())
                break
            except DeviceException as error:
                if error.code not in GATEWAY:
                    break
            except LinkError:
                pass
            self._probe_free = max(self._probe_free, started) + (self._now() - started) / PROBE_SHARE
            pause = min(2 * pause, LAST_PROBE)
            self._reopen_when_all_silent()
        if self._several:
            log.info("unit answers link=%s unit=%d", self.link.name, station.number)
        await self._bring_up(station)

    def _reopen_when_all_silent(self) -> None:
        """A socket can be open and dead; some devices need a new one (pymodbus #2619)."""
        now = self._now()
        if self.link.transport == "tcp" and self._all_silent and now - self._reopened > LAST_PAUSE:
            self._reopened = now
            self._reopen = set(self._open)
            self._wake()

    async def _bring_up(self, station: Station) -> None:
        """Find out what the unit is, then scan it."""
        while True:
            try:
                if await self._identify(station) and (station.plc is None or await station.plc.identify()):
                    break
            except NotConnected:
                if not self._open:
                    raise
                continue  # another connection may do it; those that are closed as well are found by asking
            except NoAnswer as error:
                station.state = State.CONNECTING
                self.later(station, error)
                return
            self._to_configuration(station)
            await asyncio.sleep(LAST_PAUSE)
        station.state = State.UP
        if station.plc is not None:
            station.plc.begin()
        station.tell_unreadable(self._tags, self.clock.micros())
        now = self._now()
        for block in station.blocks:
            self._schedule.at(block, now)
        self._wake()
        self._examiner.start_recheck(station)
        self._settle()

    async def _identify(self, station: Station) -> bool:
        """Whether the device is one to talk to. Only a virtual device has training registers, and they say that it is one."""
        if self.link.simulated:
            station.simulated = True
            return True
        station.simulated = False
        for _ in range(1 + RETRIES):
            try:
                magic, flags, version, _ = await self._read_training_head(station)
            except DeviceException:
                return True
            except (NoAnswer, BadAnswer):
                continue
            if magic != TRAINING_MAGIC:
                return True
            if version != TRAINING_VERSION or not flags & TRAINING_SIMULATED:
                log.error(
                    "training registers not understood link=%s unit=%d flags=%#x version=%d expected=%d",
                    self.link.name,
                    station.number,
                    flags,
                    version,
                    TRAINING_VERSION,
                )
                return False
            station.simulated = True
            return True
        return True

    async def _read_training_head(self, station: Station) -> list[int]:
        """Its words, in the shortest telegram that no earlier answer can be taken for: what lies behind them reads 0."""
        for more in range(TRAINING_SPARE):
            block = Block(station.device.training, TRAINING_WORDS + more)
            try:
                words = await self.ask(self.job(station.number, block, liveness=False), Priority.REFRESH)
            except StillOwed:
                continue
            return words[:TRAINING_WORDS]
        return await self.read(station, Block(station.device.training, TRAINING_WORDS), liveness=False)

    # small things

    def _prepare(self, station: Station) -> None:
        station.plan()
        if station.device.plc is not None:
            station.plc = PlcUnit(self, station, station.device.plc)

    async def read(self, station: Station, block: Block, *, liveness: bool = True) -> list[int]:
        """One read for a task that can wait, also for the line to forget an earlier request."""
        while True:
            try:
                return await self.ask(self.job(station.number, block, liveness=liveness), Priority.REFRESH)
            except StillOwed as error:
                await asyncio.sleep(error.wait)

    def _wire(self, read: Block | None, words: int = 0, function: int = 6) -> float:
        """Time of a telegram on a serial line with both silences [s]; 0 elsewhere."""
        if self.link.transport != "rtu":
            return 0.0
        return read_time(self.link.baud, read.count) if read else write_time(self.link.baud, words, function)

    def replan(self, station: Station) -> None:
        """Read it by a new plan from now on."""
        before = set(map(id, station.blocks))
        for gone in station.plan():
            gone.alive = False
            self._schedule.drop(gone)
        now = self._now()
        station.tell_unreadable(self._tags, self.clock.micros())
        for block in station.blocks:
            if id(block) not in before and station.state is State.UP:
                self._schedule.at(block, now)
        self._wake()

    def attend(self, station: Station, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Do `work` for a station beside its scans."""
        task = asyncio.get_running_loop().create_task(work)
        station.tasks.add(task)
        task.add_done_callback(station.tasks.discard)
        task.add_done_callback(self._ended)
        return task

    def later(self, station: Station, error: LinkError) -> None:
        """`_silent`, outside the task that it ends."""
        asyncio.get_running_loop().call_soon(self._silent, station, error)

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
            statistics.state = State.CONNECTING if self._told_up is None else State.DOWN
        elif State.CONFIGURATION in states:
            statistics.state = State.CONFIGURATION
        elif states and all(state is State.DOWN for state in states):
            statistics.state = State.DOWN
        elif State.DOWN in states:
            statistics.state = State.SOME_SILENT
        else:
            statistics.state = State.CONNECTING if states and State.UP not in states else State.UP
        statistics.simulated = self.link.simulated or (
            bool(states) and all(station.simulated for station in self.stations.values())
        )
        if State.UP in states and self._open and self._heard:
            self._note(up=True)
        self._publisher.publish()

    def _note(self, *, up: bool, reason: str = "") -> None:
        if up == self._told_up:
            return
        self._told_up = up
        if up:
            log.info("link up link=%s", self.link.name)
        else:
            log.warning("link down link=%s reason=%s", self.link.name, reason)

    async def _report(self) -> None:
        while True:
            await asyncio.sleep(REPORT)
            self._publisher.measure()
            self._settle()

    def _now(self) -> float:
        return asyncio.get_running_loop().time()


def _finish(sleeper: asyncio.Future[None]) -> None:
    if not sleeper.done():
        sleeper.set_result(None)


def _fail(job: Job, error: LinkError) -> None:
    if not job.done.done():
        job.done.set_exception(error)


def _default_timeout(stations: Mapping[int, Station]) -> float:
    return max((station.timeout for station in stations.values()), default=1.0)
