"""What is looked at in the registers of a Pogon PLC before anything of them is published, and what follows from it.

- Header: read at connecting and with every slow scan. Magic, major version and type must be those of the plant file, else the whole unit
  is bad (configuration) and takes no writes. Another boot count or check sum: everything that is read once is read again.
- Images: unequal or odd generations are read again at once, at most `TORN_TRIES` times; after that the old values stay and grow old
  (uncertain, stale) until a scan is whole. A torn image is never published.
- Tables: a torn row likewise, while the other rows of its telegram are published. Telegrams beyond the `count` of the head are not read,
  their rows are empty.
- Signs of life: links/pulse.py. While the program stands still all values are uncertain (halted) and nothing but a Stop is sent.
- Event ring: links/events.py. Host heartbeat: written every second while writes are allowed.
"""

import asyncio
import logging
from collections.abc import Sequence
from contextlib import suppress
from math import inf

from app import chance
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer
from app.links.bus_access import BusAccess
from app.links.contract import Block
from app.links.device_clock import DeviceClock
from app.links.events import EventReader
from app.links.orders import Orders
from app.links.planner import Part
from app.links.pulse import FIRST, LAST, Pulse
from app.links.ring_head import head_of
from app.links.scan_block import ScanBlock
from app.links.schedule import Priority
from app.links.services import Seen, Service, SetWrite
from app.links.station import Station
from app.links.statistics import LinkState
from app.links.table_block import TableBlock
from app.links.wholeness import Wholeness
from app.plant.definitions import PlcMap, Register
from app.registers import plc_map
from app.registers.pdu import WRITE_SINGLE

log = logging.getLogger(__name__)

WHOLE_PARTS = (plc_map.AT_BOOTS, plc_map.AT_SCAN, plc_map.AT_STEP, plc_map.AT_CAPACITIES)
"""Where the header may be cut: a serial line that still owes an answer to a first look is asked for parts, which it cannot be taken for."""
TORN_TRIES = 3
"""How often an answer that the device was changing is asked for again at once."""
HEARTBEAT = 1.0
"""Period of the host's heartbeat [s]."""
NO_HEARTBEAT = 60.0
"""Before a device that refused the heartbeat gets another [s]."""
TOUCH = 1.0
"""Rows that are not read because there are none are said to be empty this often [s], so that they do not count as old."""
FIRST_LOOK = 0.03
"""Before the second look at a program, to see whether it goes round [s]."""
TRIES = 3
BUSY_PAUSE = 0.1
NO_HEADER = (1, 2, 3)
"""Refusals that mean: this device has no header."""


def header_fault(words: Sequence[int], map: PlcMap) -> str:
    """Why this header is not one of the device of the plant file; empty when it is. A newer minor version is."""
    magic, major, kind = words[plc_map.AT_MAGIC], words[plc_map.AT_MAJOR], words[plc_map.AT_TYPE]
    if magic != plc_map.MAGIC:
        return f"word 0 of the header is {magic:#06x}, expected {plc_map.MAGIC:#06x}"
    if major != plc_map.MAJOR:
        return f"its map has version {major}.{words[plc_map.AT_MINOR]}, expected {plc_map.MAJOR}.x"
    if kind != map.type_code:
        return f"its type is {kind}, expected {map.type_code}"
    return ""


def younger_image(map: PlcMap, address: int, minor: int) -> str:
    """Why the image at `address` is none of a device with this minor version of the map; empty when it may be."""
    since = next((image.since for image in map.images if image.address == address), 0)
    return f"the image at 0x{address:04X} came with map {plc_map.MAJOR}.{since}" if minor < since else ""


class PlcUnit:
    """One unit that is a Pogon PLC."""

    def __init__(self, bus: BusAccess, station: Station, map: PlcMap) -> None:
        self.map = map
        self.clock = DeviceClock()
        self.events = EventReader(bus, station, self.clock)
        self.orders = Orders(bus, station, self.clock)
        self.crc: int | None = None  # check sum of its configuration
        self.minor = plc_map.MINOR  # of its map
        self._bus = bus
        self._station = station
        self._heartbeat = chance.randrange(0, 0x10000)
        self._pulse = Pulse()
        self._wholeness = Wholeness(station.link.name, station.number)
        self._pulse_words = Block(plc_map.HEADER + FIRST, LAST - FIRST + 1)

    def adopt(self, before: Service) -> None:
        """The plant file has changed around the same device: go on where `before` was."""
        if isinstance(before, PlcUnit) and before.map.type_code == self.map.type_code:
            self.events.adopt(before.events)
            self.orders.adopt(before.orders)

    async def end(self) -> None:
        """The link ends: whoever takes events finishes with those that he has."""
        await self.events.end()

    # connecting

    async def identify(self) -> bool:
        """Whether it is the device of the plant file.

        Raises:
            NoAnswer: it did not say.
        """
        station = self._station
        last: LinkError = NoAnswer(f"unit {station.number}: no header")
        for _ in range(TRIES):
            began = asyncio.get_running_loop().time()
            try:
                words = await self._bus.read(station, Block(plc_map.HEADER, self._header_words, cuts=WHOLE_PARTS))
            except DeviceException as error:
                last = error
                if error.code not in NO_HEADER:
                    await asyncio.sleep(BUSY_PAUSE)
                    continue
                fault = f"it has no header ({error})"
            except (NoAnswer, BadAnswer) as error:
                last = error
                continue
            else:
                fault = header_fault(words, self.map)
            if fault:
                self._tell(fault)
                return False
            self._header(words, began, asyncio.get_running_loop().time())
            await self._first_sign()
            return True
        raise NoAnswer(str(last))

    def begin(self) -> None:
        """It is there, and is the right one."""
        for block in self._station.blocks:
            if isinstance(block, TableBlock) and block.rows.first:
                block.wanted, block.touched = False, 0.0
        self.events.begin()
        self._bus.attend(self._station, self.orders.begin())
        if self._station.may_write:
            self._bus.attend(self._station, self._beat())
        self._bus.attend(self._station, self._watch())

    # sets of setpoints

    def takes(self, register: Register) -> bool:
        """Whether `register` is a setpoint in effect: it is changed through the staging area only."""
        map, at = self.map.settings, register.address
        return map is not None and register.table == "holding" and map.address <= at < map.address + map.words

    async def write(self, writes: Sequence[SetWrite]) -> int:
        """Put `writes` into the set of setpoints and have the device take it as a whole (orders.py); the id that it knows this by."""
        request = await self.orders.set(self.map, writes)
        settings = self.map.settings
        assert settings is not None
        self._bus.written(self._station, settings.address, settings.words)
        return request

    # scans

    def reads(self, block: ScanBlock) -> bool:
        """Whether `block` is a part of the map."""
        return block.part is not None

    def seen(self, block: ScanBlock, words: list[int], started: float) -> Seen:
        """What `words`, read by a telegram sent at `started` [s], are worth; they may be put right."""
        match block.part:
            case Part.IMAGE:
                self._pulse.image(block.block.address, words, started)
                self._judge()
                if younger := younger_image(self.map, block.block.address, self.minor):
                    self._bus.refuse(self._station, block, younger)
                    return Seen.NOTHING
                return self._wholeness.judge(block.block.address, words, started)
            case Part.RING:
                torn = self._wholeness.judge(block.block.address, words, started) is Seen.TORN
                if torn or (head := head_of(words)) is None:
                    return Seen.TORN
                self.events.seen(head)
                return Seen.WHOLE if block.points else Seen.NOTHING
            case Part.HEADER:
                fault = header_fault(words, self.map)
                if fault:
                    self._tell(fault)
                    self._bus.misconfigured(self._station, fault)
                    return Seen.NOTHING
                now = asyncio.get_running_loop().time()
                self._header(words, started, now)
                if len(words) > LAST:
                    self._pulse.header(words[FIRST : LAST + 1], started, now, paused=self._bus.paused())
                    self._judge()
                return Seen.WHOLE
        return self._rows_seen(block, words, started) if isinstance(block, TableBlock) else Seen.WHOLE

    def worth_reading(self, blocks: Sequence[ScanBlock]) -> list[ScanBlock]:
        """`blocks`, and for rows that the head of their table does not count the head instead."""
        found: dict[int, ScanBlock] = {}
        for block in blocks:
            if isinstance(block, TableBlock) and not block.wanted:
                found.update((each.number, each) for each in self._of_table(block) if not each.rows.first)
            else:
                found[block.number] = block
        return list(found.values())

    def _header(self, words: Sequence[int], began: float, ended: float) -> None:
        stood, clock = self._station.halted or not self._pulse.moved, self._bus.clock
        restarted = self.clock.header(words, 0, began, ended, clock.micros(), halted=stood)
        crc = words[plc_map.AT_CRC] << 16 | words[plc_map.AT_CRC + 1]
        changed, self.crc, self.minor = self.crc is not None and crc != self.crc, crc, words[plc_map.AT_MINOR]
        first = (restarted or changed) and self.clock.restarts.seen(clock.monotonic())
        level = logging.WARNING if first else logging.DEBUG
        if changed:
            log.log(level, "configuration of the device changed link=%s unit=%d crc=%#010x", *self._where, crc)
        if restarted:
            log.log(level, "device was restarted link=%s unit=%d boots=%d", *self._where, self.clock.boots)
            self.events.restarted()
            self._bus.attend(self._station, self.orders.begin())
        if (restarted or changed) and self._station.state is LinkState.UP:
            for block in self._station.blocks:
                if block.period == inf:
                    self._bus.schedule(block, asyncio.get_running_loop().time())

    def _rows_seen(self, block: TableBlock, words: list[int], started: float) -> Seen:
        if not block.wanted:
            return Seen.NOTHING
        if block.rows.first == 0:
            table = block.rows.table
            if self.minor < table.since:
                return self._refuse_table(block, f"table {table.key} came with map {plc_map.MAJOR}.{table.since}")
            generation, _, count, size = words[: plc_map.TABLE_HEAD]
            if generation % 2:
                return Seen.TORN
            if size != table.row:
                reason = f"a row of table {table.key} has {size} words, expected {table.row}"
                self._tell(reason)
                return self._refuse_table(block, reason)
            if count > block.rows.slots:
                self._tell(f"table {table.key} has {count} rows in use, the plant file only {block.rows.slots}")
            self._count(block, count, started)
        torn, unknown = block.settle(words)
        self._wholeness.note(block.block.address, block.torn_row, started)
        if unknown:
            return Seen.TORN
        return Seen.PARTLY if torn else Seen.WHOLE

    def _refuse_table(self, head: TableBlock, reason: str) -> Seen:
        for each in self._of_table(head):
            self._bus.refuse(self._station, each, reason)
        return Seen.NOTHING

    def _count(self, head: TableBlock, count: int, started: float) -> None:
        """The head counts so many rows: what lies behind is not read, what is new at once."""
        for block in self._of_table(head):
            rows = block.rows
            block.used = max(0, min(rows.rows, count - rows.first))
            if block is head:
                continue
            wanted = block.used > 0
            if wanted and not block.wanted:
                block.wanted = True
                self._bus.schedule(block, started)
            elif not wanted and (
                block.wanted or block.words is None or started - block.touched >= max(TOUCH, head.period)
            ):
                block.wanted, block.touched = False, started
                self._bus.schedule(block, started)  # takes its place away
                self._bus.publish(self._station, block, [0] * block.block.count, started)

    def _of_table(self, head: TableBlock) -> list[TableBlock]:
        return [block for block in self._station.blocks if isinstance(block, TableBlock) and block.is_beside(head)]

    # signs of life

    async def _first_sign(self) -> None:
        """Wait until its program is seen to go round; one that stands from the beginning is said to.

        Raises:
            NoAnswer: it did not say.
        """
        loop, pulse = asyncio.get_running_loop(), self._pulse
        pulse.begin(loop.time())
        pause, wrong = FIRST_LOOK, 0
        while not (pulse.moved or pulse.halted or self._bus.paused()):
            try:
                await self._look_at_pulse()
            except (BadAnswer, DeviceException) as error:
                wrong += 1
                if wrong >= TRIES:
                    raise NoAnswer(str(error)) from error
            if not pulse.moved:
                await asyncio.sleep(pause)
                pause = min(2 * pause, pulse.limit / 4)
        self._station.halted = pulse.halted
        if pulse.halted:
            self._say_halted()

    async def _watch(self) -> None:
        """Look at the heartbeat whenever no image has shown that the program goes round."""
        loop, pulse = asyncio.get_running_loop(), self._pulse
        while True:
            wait = pulse.due - loop.time()
            if wait > 0:
                await asyncio.sleep(wait)
                continue
            before = pulse.due
            with suppress(LinkError):  # silence is for the scans to judge
                await self._look_at_pulse()
            self._judge()
            if pulse.due <= max(before, loop.time()):
                await asyncio.sleep(pulse.limit / 4)

    async def _look_at_pulse(self) -> None:
        started = asyncio.get_running_loop().time()
        try:
            words = await self._bus.read(self._station, self._pulse_words)
        except DeviceException:
            if self._pulse_words.address == plc_map.HEADER:
                raise
            self._pulse_words = Block(plc_map.HEADER, max(self._header_words, LAST + 1))  # it takes no part of it
            return
        skip = plc_map.HEADER + FIRST - self._pulse_words.address
        now, paused = asyncio.get_running_loop().time(), self._bus.paused()
        self._pulse.header(words[skip : skip + LAST - FIRST + 1], started, now, paused=paused)

    def _judge(self) -> None:
        station = self._station
        if station.state is not LinkState.UP or self._pulse.halted == station.halted:
            return
        self._bus.halt(station, halted=self._pulse.halted)
        self._say_halted()

    def _say_halted(self) -> None:
        if self._pulse.halted:
            log.warning("program stands still link=%s unit=%d", *self._where)
        else:
            log.info("program goes on link=%s unit=%d", *self._where)

    # heartbeat

    async def _beat(self) -> None:
        """Show the device that its host is there."""
        while True:
            self._heartbeat = self._heartbeat + 1 & 0xFFFF
            job = self._bus.job(self._station.number)
            job.address, job.words, job.function = (
                plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT,
                (self._heartbeat,),
                WRITE_SINGLE,
            )
            pause = HEARTBEAT
            try:
                await self._bus.ask(job, Priority.WRITE)
            except DeviceException as error:
                if error.code in NO_HEADER:
                    log.warning("host heartbeat refused link=%s unit=%d: %s", *self._where, error)
                    pause = NO_HEARTBEAT
            except LinkError:
                pass  # silence is for the scans to judge
            await asyncio.sleep(pause)

    @property
    def _header_words(self) -> int:
        return next(block.block.count for block in self._station.blocks if block.part is Part.HEADER)

    @property
    def _where(self) -> tuple[str, int]:
        return self._station.link.name, self._station.number

    def _tell(self, fault: str) -> None:
        if self._station.faults.new(fault, self._bus.clock.monotonic()):
            log.error("device is not that of the plant file link=%s unit=%d: %s", *self._where, fault)
