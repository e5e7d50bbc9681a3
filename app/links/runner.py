"""The loop around a register link: connect, scan, publish, back off, say so once.

Each connection is a lane with a loop of its own; all lanes take their next telegram from one schedule. What needs several telegrams
(to identify a unit, to find the registers that it refuses, to look whether a silent one is back) is a task that puts them into that
schedule one by one, so a write never waits for more than the telegram on the wire.
"""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from math import inf

from app.clock import Clock
from app.errors import GATEWAY, BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected, Overtaken, Withdrawn
from app.links.contract import LateAnswerDue, Transport
from app.links.lane import Deaf, Hearing, Lane, Reopening
from app.links.line import check_permit, fail, finish
from app.links.outages import SETTLE, Outages
from app.links.plc import TORN_TRIES
from app.links.scan_block import ScanBlock
from app.links.schedule import Job
from app.links.services import Seen
from app.links.station import Station
from app.links.statistics import LinkState, UnitStatistics
from app.plant.definitions import Link, Scan
from app.tags.database import TagDatabase
from app.tags.quality import COMM_FAILURE

TORN_PAUSE = 1.0
"""Before an image that is read once is tried again when it was never whole [s]."""
ENDED = "link ended"


class Torn(BadAnswer):
    """An image that the device was changing while it was read."""


class LinkRunner(Outages):
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
        super().__init__(link, stations, tags, clock)
        self._build = build
        self._lanes = lanes
        self._hearing = Hearing(link.name)
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
            await asyncio.gather(*(each.end() for station in self.stations.values() for each in station.services))
            if not self._failed.done():
                self._failed.cancel()

    def nudge(self, unit: int) -> None:
        """Somebody wrote registers of their own to `unit`: what is silent or refused is tried now, not when its pause is over."""
        station = self.stations.get(unit)
        if station is None:
            return
        station.probe_now.set()
        if station.state is LinkState.UP:
            for block in station.blocks:
                if block.failures or (block.quality or 0) & 3:
                    self._schedule.at(block, self._now() + SETTLE)
        self._wake()

    def change(self, stations: Mapping[int, Station]) -> None:
        """Read these units from now on; one whose station is the same object goes on as if nothing were."""
        gone = [station for number, station in self.stations.items() if stations.get(number) is not station]
        fresh = [station for number, station in stations.items() if self.stations.get(number) is not station]
        former, self.stations = self.stations, stations
        for station in gone:
            station.end_tasks()
            for block in station.blocks:
                block.alive = False
                self._schedule.drop(block)
        for station in fresh:
            self.statistics.units.setdefault(station.number, UnitStatistics())
            self._prepare(station)
            before = former.get(station.number)
            for service in station.services:
                predecessor = before.service(type(service)) if before is not None else None
                if predecessor is not None:
                    service.adopt(predecessor)
            if self._open:
                self.attend(station, self._bring_up(station))
            else:
                station.state = LinkState.DOWN if self._told_up is not None else LinkState.CONNECTING
        self._settle()
        self._wake()

    def demand(self, names: frozenset[str]) -> None:
        """Points of class PAGE that somebody looks at."""
        fresh = names - self.demanded
        self.demanded = names
        for station in self.stations.values():
            if station.state is LinkState.UP:
                for block in station.covering(fresh):
                    if block.scan is Scan.PAGE and not block.queued:
                        self._schedule.at(block, self._now())
        self._wake()

    async def _lane(self, number: int) -> None:
        again = Reopening()
        transport = self._build()
        transport.counts = self.statistics.wire
        while True:
            lane, began = Lane(number, transport), self._now()
            try:
                await lane.transport.connect()
                if again.deaf:
                    await self._hearing.prove(lane, self.stations.values())
                again.deaf = False
                self._opened(number)
                await self._work(lane)
            except NotConnected as error:
                again.deaf = again.deaf or isinstance(error, Deaf)
                self._lost(number, error)
            finally:
                await lane.transport.close()
            await asyncio.sleep(again.after(lane, self._now() - began))

    async def _work(self, lane: Lane) -> None:
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
        timer = None if due is None else loop.call_at(due, finish, sleeper)
        self._sleepers[sleeper] = None
        try:
            await sleeper
        finally:
            self._sleepers.pop(sleeper, None)
            if timer is not None:
                timer.cancel()

    def _opened(self, number: int) -> None:
        first = not self._open
        self._open.add(number)
        self.statistics.connections = len(self._open)
        if first:
            self._heard = False
            for station in self.stations.values():
                station.state = LinkState.CONNECTING
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
            fail(job, NotConnected(f"link {self.link.name}: {reason}"))
        for station in self.stations.values():
            station.end_tasks()
            station.state = LinkState.DOWN
            self._publish_lost(station, COMM_FAILURE)
        self._heard = False
        if reason != ENDED:
            self._note(up=False, reason=reason)
        self._settle()

    async def _do(self, lane: Lane, job: Job) -> None:
        transport = lane.transport
        started, standstills = self._now(), self._tags.standstills
        station = self.stations.get(job.unit)
        try:
            if job.read is not None:
                words = await self._read_on(lane, station, job.unit, job.read, job.timeout)
            else:
                async with station.writing if station is not None else nullcontext():
                    check_permit(job)
                    if job.own and station is not None:
                        started = await self._add_others(transport, station, job)
                    job.sent = True
                    await transport.write(job.unit, job.address, job.words, job.timeout, job.function)
                words = []
        except BaseException as error:
            self.statistics.busy += self._now() - started
            if isinstance(error, Withdrawn | Overtaken):
                fail(job, error)
                return
            if not isinstance(error, LinkError):
                fail(job, NotConnected(f"link {self.link.name}: ended while unit {job.unit} was asked"))
                raise
            if isinstance(error, DeviceException):
                self._hearing.refused(lane, job.unit, error, self._now())
                self._answered(station, started, job.liveness and error.code not in GATEWAY)
            if not isinstance(error, LateAnswerDue) and not (job.quiet and isinstance(error, DeviceException)):
                self.statistics.failed(job.unit, error)
            fail(job, error)
            if isinstance(error, NotConnected):
                raise
            if isinstance(error, NoAnswer) and not isinstance(error, LateAnswerDue):  # that one was not sent
                self._hearing.missed(lane, job.unit, started)
            return
        self._hearing.heard(lane, job.unit, self._now())
        self.statistics.busy += self._now() - started
        self._answered(station, started, job.liveness, self._wire(job.read, len(job.words), job.function))
        if job.scan is not None and self._answer_was_kept(standstills):
            fail(job, NoAnswer(f"unit {job.unit}: its answer waited while this program stood still"))
        elif job.scan is not None and station is not None and station.state is LinkState.UP and job.scan.alive:
            seen = Seen.WHOLE if job.scan.part is None else self._look(station, job.scan, words, started)
            if seen is Seen.TORN:
                fail(job, Torn(f"unit {job.unit}: {job.scan.block.address:#06x} changed while it was read"))
            elif seen is not Seen.NOTHING:
                self.publish(station, job.scan, words, started)
        if not job.done.done():
            job.done.set_result(words)

    async def _scan(self, lane: Lane, block: ScanBlock) -> None:
        station = self.stations[block.unit]
        started = self._now()
        ticket = block.ticket
        standstills = self._tags.standstills
        try:
            words = await self._read_on(lane, station, block.unit, block.block, self._timeout(station, block))
        except NotConnected:
            if ticket == block.ticket:
                self._schedule.at(block, block.due)  # another connection may do it
            raise
        except LateAnswerDue as error:
            if ticket == block.ticket:
                self._schedule.at(block, self._now() + error.wait)
            return
        except LinkError as error:
            self.statistics.busy += self._now() - started
            self.statistics.failed(block.unit, error)
            if isinstance(error, DeviceException):
                self._hearing.refused(lane, block.unit, error, self._now())
            if ticket == block.ticket:  # else it has been given another place, or none, while it was away
                self._scan_failed(station, block, error, started)
            if isinstance(error, NoAnswer):
                self._hearing.missed(lane, block.unit, started)
            return
        self._hearing.heard(lane, block.unit, self._now())
        ended = self._now()
        self.statistics.busy += ended - started
        self._answered(station, started, True, self._wire(block.block))
        station.prove(block.block)
        block.attempts = block.failures = 0
        block.unheard = False
        if block.scan is Scan.FAST:
            if block.scanned:
                self.statistics.fast_scan(ended - block.scanned)
            block.scanned = ended
        if self._answer_was_kept(standstills):
            if ticket == block.ticket:
                self._schedule.at(block, self._now(), first=True)
            return
        seen = Seen.WHOLE
        if block.part is not None and station.state is LinkState.UP and block.alive:
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
        if seen <= Seen.PARTLY and station.state is LinkState.UP and block.alive:
            self.publish(station, block, words, started)

    def _look(self, station: Station, block: ScanBlock, words: list[int], started: float) -> Seen:
        """What words that a service cares for are worth."""
        service = next(each for each in station.services if each.reads(block))
        seen = service.seen(block, words, started)
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
