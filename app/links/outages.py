"""Units that come, refuse, fall silent and come back: what a unit is, what its refusals mean, and when it is asked again.

What needs several telegrams (to identify a unit, to look whether a silent one is back) is a task that puts them into the schedule one by
one, so a write never waits for more than the telegram on the wire.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace

from app import chance
from app.clock import Clock
from app.errors import GATEWAY, BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected
from app.links.examine import NO_REGISTER, Examiner
from app.links.line import Line
from app.links.mailbox import MailboxUnit
from app.links.plc import PlcUnit
from app.links.plc_instead import answers_instead
from app.links.register_parameters import RegisterParameters
from app.links.scan_block import ScanBlock
from app.links.schedule import Priority
from app.links.services import Service
from app.links.station import Station
from app.links.statistics import LinkState
from app.links.training_head import UNTOLD, look_at_head
from app.plant.definitions import Link, MailboxMap, ParameterMap, PlcMap, UnitService
from app.registers.pdu import BITS, READ_HOLDING
from app.tags.database import TagDatabase
from app.tags.quality import COMM_FAILURE, CONFIGURATION, DEVICE

log = logging.getLogger(__name__)

RETRIES = 1
"""Of a read without an answer; a write is never repeated here."""
RETRY_LIMIT = 0.8
"""Longest time-out of a retry after silence [s]: a pulled cable shows within one time-out + 1 s; not of a slow device."""
SLOW_ANSWERS = 1.5
"""A retry is given so many times the slowest answer of late."""
BUSY_PAUSE = 0.05
"""Before a device that is busy is asked again [s]."""
BUSY_TRIES = 2
STUBBORN = 2
"""Scans in a row that were refused with a code that says nothing of registers: the next one is looked at register by register."""
SLOWEST_REFUSED = 1.5
"""Longest period of a block that the device keeps refusing [s]."""
PERMANENT = 1.5
"""Period of a block that the device cannot serve at all [s]; a repaired device comes back by itself."""
FIRST_PROBE, LAST_PROBE = 0.7, 60.0
"""Pauses between probes of a unit that never answered [s], doubling; while all of a line are silent nobody suffers from the first one."""
KNOWN_PROBE = 1.4
"""Longest pause between probes of a unit that did answer [s]: who comes back is seen within two seconds."""
SHORTEST_PATIENCE, PATIENCES, FULL_PATIENCE = 0.05, 4.0, 8
"""Such a unit is given at least this [s], and so many times what it used to take; the whole of its time with every so manieth probe."""
SETTLE = 0.05
"""What a device is given to act on registers that somebody wrote, before it is looked at again [s]."""
PROBE_SHARE = 0.05
"""Most of the line's time that goes into probes while others live on it, but for the rare one with full patience."""
REOPEN = 5.0
"""A connection that is open and on which nobody answers is opened again this often [s]."""
RECHECK = 1.5
"""Before a unit that is not the device of the plant file is asked again what it is [s]."""
FIRST_LOOK, LOOKS = 1.0, 6
"""Before the first [s], doubling, and how often a device that is read is asked once more for what it did not say: if it is simulated."""
HANG_UPS = 2
"""A device with which the connection was lost so often in a row at that question is read without: some hang up instead of refusing."""
PERMANENT_CODES = (1, 7)
KINDS: Mapping[type[UnitService], Callable[..., Service]] = {
    PlcMap: PlcUnit,
    MailboxMap: MailboxUnit,
    ParameterMap: RegisterParameters,
}
"""What a type says of a service → what serves it."""


class Outages(Line):
    """A link whose units are not always there."""

    def __init__(self, link: Link, stations: Mapping[int, Station], tags: TagDatabase, clock: Clock) -> None:
        super().__init__(link, stations, tags, clock)
        self._examiner = Examiner(self)
        self._probe_free = {True: 0.0, False: 0.0}
        """Of units that did answer, and of those that never did: before it none is asked while others live [s]."""
        self._reopened = 0.0
        self._reopen: set[int] = set()

    def _scan_failed(self, station: Station, block: ScanBlock, error: LinkError, started: float) -> None:
        if isinstance(error, DeviceException) and error.code not in GATEWAY:
            block.unheard = False
            self._answered(station, started, True)
            self._refused(station, block, error)
        elif block.attempts < RETRIES and not self._line_silent:
            block.attempts += 1
            block.unheard = True
            self.statistics.retries += 1
            self._schedule.at(block, block.due, first=True)
        else:
            block.attempts, block.unheard = 0, False
            if _above_fallback(station, block):
                self.attend(station, self._examiner.try_smaller(station, block, error))
            elif block.words is None and block.part is None and isinstance(error, NoAnswer | BadAnswer):
                self.attend(station, self._examiner.examine_silence(station, block, error))
            else:
                self._silent(station, error)

    def _timeout(self, station: Station, block: ScanBlock) -> float:
        """Time for an answer to a scan; less where none came the last time, or a pulled cable would show late [s]."""
        if not block.unheard:
            return station.timeout
        slowest = self.statistics.units[station.number].slowest
        return min(station.timeout, max(RETRY_LIMIT, SLOW_ANSWERS * slowest))

    def refuse(self, station: Station, block: ScanBlock, reason: str) -> None:
        """What `block` holds is not what the plant file says: bad, and looked at again later."""
        log.debug("block refused link=%s unit=%d: %s", self.link.name, station.number, reason)
        self._publish_block_lost(station, block, CONFIGURATION)
        self._schedule.at(block, self._now() + PERMANENT)

    def misconfigured(self, station: Station, reason: str) -> None:
        """The unit is not the device of the plant file: all bad, no writes, until it is."""
        asyncio.get_running_loop().call_soon(self._misconfigured, station)

    def _misconfigured(self, station: Station) -> None:
        if station.state is not LinkState.UP or self.stations.get(station.number) is not station:
            return
        station.end_tasks()
        for block in station.blocks:
            self._schedule.drop(block)
        self._to_configuration(station)
        self.attend(station, self._bring_up(station))

    def _to_configuration(self, station: Station) -> None:
        station.state = LinkState.CONFIGURATION
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
        elif block.failures == STUBBORN and error.code not in UNTOLD and block.part is None and len(block.points) > 1:
            block.failures += 1
            self.attend(station, self._examiner.examine_refusal(station, block, error.code))
        elif error.code in PERMANENT_CODES:
            self._publish_block_lost(station, block, CONFIGURATION if error.code == 1 else DEVICE)
            block.failures += 1
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
        if station.state is LinkState.DOWN or self.stations.get(station.number) is not station:
            return
        station.end_tasks()
        for block in station.blocks:
            self._schedule.drop(block)
        station.state = LinkState.DOWN
        self._line_silent = True
        self._publish_lost(station, COMM_FAILURE)
        if self._several:
            log.warning("unit silent link=%s unit=%d reason=%s", self.link.name, station.number, error)
        self.attend(station, self._probe(station))
        if self._all_silent:
            self._heard = False
            self._note(up=False, reason=str(error))
        self._settle()

    def later(self, station: Station, error: LinkError) -> None:
        """`_silent`, outside the task that it ends."""
        asyncio.get_running_loop().call_soon(self._silent, station, error)

    @property
    def _several(self) -> bool:
        return len(self.stations) > 1

    @property
    def _all_silent(self) -> bool:
        return all(station.state is LinkState.DOWN for station in self.stations.values())

    async def _probe(self, station: Station) -> None:
        """Ask a silent unit for one register now and then, until it answers."""
        pause, tries = FIRST_PROBE, 0
        known = station.answered
        patience = max(SHORTEST_PATIENCE, PATIENCES * self.statistics.units[station.number].turnaround)
        while True:
            wait = min(pause, KNOWN_PROBE if known else LAST_PROBE) * chance.uniform(0.9, 1.1)
            wait = min(wait, FIRST_PROBE) if self._all_silent else max(wait, self._probe_free[known] - self._now())
            station.probe_now.clear()
            try:
                async with asyncio.timeout(wait):
                    await station.probe_now.wait()
                await asyncio.sleep(SETTLE)
                pause = FIRST_PROBE / 2
            except TimeoutError:
                pass
            started = self._now()
            tries += 1
            # its words are not looked at: an older answer shows as well that it is there
            job = self.job(station.number, replace(station.probe(tries - 1), again=True))
            if known and tries % FULL_PATIENCE and not self._all_silent:
                job.timeout = min(job.timeout, patience)
            try:
                await self.ask(job, Priority.REFRESH)
                if job.read is not None:
                    station.prove(job.read)  # a witness that it is there, where it is silent for what is scanned
                break
            except DeviceException as error:
                if error.code not in GATEWAY:
                    break
            except LinkError:
                pass
            if not self._all_silent:  # nobody had to wait for it, so nobody has to be spared afterwards
                self._spare(started, known=known)
            pause = min(2 * pause, LAST_PROBE)
            self._reopen_when_all_silent()
        for other in self.stations.values():  # what kept them silent may be over for all
            if other is not station and (self._all_silent or other.answered):
                other.probe_now.set()
        if self._several:
            log.info("unit answers link=%s unit=%d", self.link.name, station.number)
        await self._bring_up(station, heard=True)

    def _spare(self, started: float, *, known: bool) -> None:
        """After a probe of `started` [s] the line is for others; a unit that did answer waits for none that never did."""
        rest = (self._now() - started) / PROBE_SHARE
        for of in {known, False}:
            self._probe_free[of] = max(self._probe_free[of], started) + (min(rest, KNOWN_PROBE) if known else rest)

    def _reopen_when_all_silent(self) -> None:
        """A socket can be open and dead; some devices need a new one (pymodbus #2619)."""
        now = self._now()
        if self.link.transport == "tcp" and self._all_silent and now - self._reopened > REOPEN:
            self._reopened = now
            self._reopen = set(self._open)
            self._wake()

    async def _bring_up(self, station: Station, *, heard: bool = False) -> None:
        """Find out what the unit is, then scan it; `heard`: it has just answered."""
        while True:
            try:
                if await self._identify(station, heard) and await self._identified(station):
                    break
            except NotConnected:
                if not self._open:
                    raise
                continue  # another connection may do it; those that are closed as well are found by asking
            except NoAnswer as error:
                station.state = LinkState.CONNECTING
                self.later(station, error)
                return
            self._to_configuration(station)
            await asyncio.sleep(RECHECK)
            heard = False
        station.state = LinkState.UP
        for service in station.services:
            service.begin()
        station.tell_unreadable(self._tags, self.clock.micros())
        now = self._now()
        for block in station.blocks:
            self._schedule.at(block, now)
        self._wake()
        self._examiner.start_recheck(station)
        if station.untold:
            self.attend(station, self._look_again(station))
        self._settle()

    async def _identified(self, station: Station) -> bool:
        """Whether all its services take the unit for the device of the plant file, and no PLC stands in its place."""
        if await answers_instead(self, station):
            return False
        for service in station.services:
            if not await service.identify():
                return False
        return True

    async def _identify(self, station: Station, heard: bool) -> bool:
        """Whether the device is one to talk to. Only a virtual device has training registers, and they say that it is one.

        Raises:
            NoAnswer: nobody is there.
        """
        if self.link.simulated:
            station.marked = True
            return True
        station.marked = station.untold = False
        device = station.device
        if READ_HOLDING not in device.read_functions or any(a <= device.training <= b for a, b in device.holes):
            return heard or await self._is_there(station)
        if station.hung_up >= HANG_UPS:
            station.hung_up = 0  # lost later on, it is asked again
            return heard or await self._is_there(station)
        for _ in range(1 + RETRIES):
            station.hung_up += 1  # before: a lost connection ends this task
            told = await look_at_head(self, station)
            station.hung_up = 0
            if told is not None:
                return told
        station.untold = True
        return heard or await self._is_there(station)

    async def _look_again(self, station: Station) -> None:
        """What a device that is read did not say at the first look: its values may be those of a simulation."""
        for turn in range(LOOKS):
            await asyncio.sleep(FIRST_LOOK * 2**turn)
            try:
                told = await look_at_head(self, station)
            except NotConnected:  # there may be other connections
                continue
            if told is None:
                continue
            if not told:
                self.misconfigured(station, "training registers not understood")
            if station.marked:
                now = self._now()
                for block in station.blocks:
                    self._schedule.at(block, now)
                station.tell_unreadable(self._tags, self.clock.micros())
                self._wake()
                self._settle()
            break

    async def _is_there(self, station: Station) -> bool:
        """True: it answers for a register that it has. Where it has none it may be silent, and a gateway then refuses in its place.

        Raises:
            NoAnswer: nobody is there.
        """
        try:
            await self.read(station, replace(station.probe(), again=True))
        except DeviceException as error:
            if error.code in GATEWAY:
                raise NoAnswer(str(error)) from error
        except BadAnswer:
            pass
        return True

    def replan(self, station: Station) -> None:
        """Read it by a new plan from now on."""
        before = set(map(id, station.blocks))
        for gone in station.plan():
            gone.alive = False
            self._schedule.drop(gone)
        now = self._now()
        station.tell_unreadable(self._tags, self.clock.micros())
        for block in station.blocks:
            if id(block) not in before and station.state is LinkState.UP:
                self._schedule.at(block, now)
        self._wake()

    def _prepare(self, station: Station) -> None:
        if not station.blocks:
            station.plan()
        station.services = [
            KINDS[type(definition)](self, station, definition) for definition in station.device.services
        ]


def _above_fallback(station: Station, block: ScanBlock) -> bool:
    """Whether a read asks for more registers than the unit ever answered, and its device is known to take fewer."""
    function, fallback = block.block.function, station.device.fallback_read
    return function not in BITS and fallback > 0 and block.block.count > max(station.proven(function), fallback)
