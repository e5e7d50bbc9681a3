"""One unit of a line: its machines, the blocks that are read of it, and what it has shown so far."""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import TypeVar

from app.links.contract import Block
from app.links.faults import Faults
from app.links.map_plan import plan_map
from app.links.planner import Learned, Plan, Reading, Rows, overhead, plan, span_of
from app.links.scan_block import ScanBlock, words_of
from app.links.schedule import Job
from app.links.services import Service
from app.links.statistics import LinkState
from app.links.table_block import TableBlock
from app.plant.definitions import Device, Equipment, Link, Point, Scan
from app.registers.pdu import BITS, FUNCTIONS, READ_HOLDING
from app.tags.batch import Batch
from app.tags.database import TagDatabase
from app.tags.quality import GOOD, HALTED, NOT_CONNECTED, Origin

HANGS_UP = 3
"""A connection that was lost so often in a row at the same read, and at no other, was closed for that."""

S = TypeVar("S")


@dataclass(slots=True)
class Station:
    """State of one unit; what happens to it is decided in runner.py."""

    link: Link
    number: int
    equipment: Sequence[Equipment]
    source: str
    next_block: Callable[[], int]
    """Gives the next block number of the link."""
    marked: bool = False
    """Whether it says that it is simulated."""
    untold: bool = False
    """Whether it was asked for that, and said nothing."""
    hung_up: int = 0
    """Connections in a row that were lost while it was asked for that."""
    lost_at: tuple[int, int, int] = (0, 0, 0)
    """Function, address and count of the read at which the connection was lost last."""
    losses: int = 0
    """How often in a row it was lost there, while others were answered."""
    mute: bool = False
    """Whether it said nothing when it was asked for the header of a PLC (plc_instead.py)."""
    faults: Faults = field(default_factory=Faults)
    """Why it is not the device of the plant file, as it was told."""
    state: LinkState = LinkState.CONNECTING
    halted: bool = False
    """Whether its program stands still while it answers."""
    blocks: list[ScanBlock] = field(default_factory=list)
    learned: Learned = field(default_factory=Learned)
    largest: Block | None = None
    """The read with most registers that it ever answered."""
    largest_of_bits: Block | None = None
    """The read with most bits that it ever answered."""
    tasks: set[asyncio.Task[None]] = field(default_factory=set)
    """What is being done to get it going: identify, probe, find out what it refuses."""
    recheck: asyncio.Task[None] | None = None
    """Looks now and then whether refused registers are there after all; one of `tasks`."""
    look_pause: float = 1.0
    """Before the next of these looks [s]."""
    attention: asyncio.Lock = field(default_factory=asyncio.Lock)
    """One examination at a time."""
    probe_now: asyncio.Event = field(default_factory=asyncio.Event)
    writing: asyncio.Lock = field(default_factory=asyncio.Lock)
    """One write at a time, so that a Stop on a second connection never overtakes a start on the first."""
    composed: Job | None = None
    """The write whose other bits are being read: one at a time."""
    stops: int = 0
    """Urgent writes so far: what was prepared before one of them is not sent after it."""
    services: list[Service] = field(default_factory=list)
    """What it offers beside plain registers."""
    unreadable: tuple[Point, ...] = ()
    _unreadable_block: int = -1
    _unreadable_told: tuple[object, ...] = ()

    @property
    def device(self) -> Device:
        """What the device can take; that of the first machine where several share a unit."""
        return self.equipment[0].type.device

    @property
    def timeout(self) -> float:
        """Time for an answer, beside the time on the wire [s]."""
        return self.link.timeout or max(item.type.device.timeout for item in self.equipment)

    @property
    def simulated(self) -> bool:
        """Whether nothing real is behind it: the plant file says so, or allows the device to say so."""
        return self.link.simulated or (self.marked and self.link.believe_simulated)

    @property
    def origin(self) -> int:
        """Origin flag of its values, as the device has it: it only shows."""
        return (
            int(Origin.SIMULATED) if self.marked else 0
        )  # a plain integer: of a flag each question takes five times as long

    @property
    def basis(self) -> int:
        """Quality of what it answers, before each value is looked at."""
        return (HALTED if self.halted else GOOD) | self.origin

    @property
    def may_write(self) -> bool:
        """Whether anything may be written to it."""
        return self.link.may_write

    @property
    def answered(self) -> bool:
        """Whether it ever answered a read."""
        return bool(self.largest or self.largest_of_bits)

    def proven(self, function: int) -> int:
        """Most registers, or bits, that it ever answered in one read with `function` or its like."""
        block = self.largest_of_bits if function in BITS else self.largest
        return 0 if block is None else block.count

    def prove(self, block: Block) -> None:
        """It has answered `block`."""
        if self.lost_at == (block.function, block.address, block.count):
            self.lost_at = (0, 0, 0)
        if block.count <= self.proven(block.function):
            return
        if block.function in BITS:
            self.largest_of_bits = block
        else:
            self.largest = block

    def hangs_up(self, block: Block) -> bool:
        """The connection was lost at `block`; whether the unit closes it for that, and not for whatever it was asked."""
        at = (block.function, block.address, block.count)
        self.losses, self.lost_at = self.losses + 1 if at == self.lost_at else 1, at
        self.learned.hang_up = self.learned.hang_up or self.losses >= HANGS_UP
        return self.learned.hang_up

    @property
    def refuses_by_closing(self) -> bool:
        """Whether there are registers for which it closes the connection."""
        return self.learned.hang_up and bool(self.learned.bad)

    def service(self, kind: type[S]) -> S | None:
        """Its service of one kind; None when it has none."""
        return next((service for service in self.services if isinstance(service, kind)), None)

    def plan(self) -> list[ScanBlock]:
        """Plan the reads anew; blocks that stay as they are keep their number and state. Returns those that are gone."""
        by_type: dict[tuple[str, int], list[Equipment]] = {}
        for item in self.equipment:
            by_type.setdefault((item.type.name, item.base), []).append(item)
        plans = [self._plan_of(items) for items in by_type.values()]
        before = {_identity(block.reading): block for block in self.blocks}
        self.blocks = []
        for reading in (reading for result in plans for reading in result.readings):
            block = before.pop(_identity(reading), None)
            self.blocks.append(block or self._block(reading))
        self.unreadable = tuple(point for result in plans for point in result.unreadable)
        return list(before.values())

    def covering(self, names: Iterable[str]) -> list[ScanBlock]:
        """The blocks that hold these points, without doubles."""
        wanted = frozenset(names)
        return [block for block in self.blocks if not wanted.isdisjoint(block.names)]

    def words(self, name: str) -> Sequence[int] | None:
        """Raw words of the point `name` (`equipment.point`) as last read; None while there are none."""
        for block in self.covering([name]):
            for point in block.points:
                if point.name == name:
                    return words_of(block, point)
        return None

    def around(self, function: int, first: int, last: int) -> list[ScanBlock]:
        """The blocks that hold any register of `first` to `last`."""
        return [
            block
            for block in self.blocks
            if block.block.function == function and block.block.address <= last and first <= block.block.last
        ]

    def last_seen(self, address: int, count: int) -> Sequence[int] | None:
        """What these registers held when they were last read; None = they never were, as far as is known."""
        for block in self.around(READ_HOLDING, address, address + count - 1):
            at = address - block.block.address
            if block.last is not None and at >= 0 and len(found := block.last[at : at + count]) == count:
                return found
        return None

    def probe(self, turn: int = 0) -> Block:
        """One register that the device answered, or should: each `turn` of another block, the fastest first, else the first of its map.

        Of a device that never answered, also those behind the first of a block: that may be the one for which it is silent, or hangs up.
        """
        known = self.largest or self.largest_of_bits
        if known is None and self.blocks:
            block = self.blocks[turn % len(self.blocks)]
            known, spans = block.block, spans_of(block.points)
            if spans and (turn >= len(self.blocks) or self.learned.hang_up):
                first, _ = spread(spans)[turn // len(self.blocks) % len(spans)]
                return Block(first, 1, known.function)
        if known is not None:
            return Block(known.address, 1, known.function)
        for point in self.unreadable:
            if point.register is not None:
                return Block(point.register.address, 1, FUNCTIONS[point.register.table])
        return Block(0, 1)

    def tell_unreadable(self, tags: TagDatabase, time: int) -> None:
        """Publish once that the points without a register in the device are not connected."""
        told = (tags.revision, self.origin, *(point.name for point in self.unreadable))
        if told == self._unreadable_told:
            return
        self._unreadable_told = told
        if self._unreadable_block < 0:
            self._unreadable_block = self.next_block()
        handles = [tags.handle(point.name) for point in self.unreadable if point.name in tags]
        if handles:
            quality = NOT_CONNECTED | self.origin
            nothing = [None] * len(handles)
            tags.publish(Batch(self.source, self._unreadable_block, time, time, handles, nothing, quality))

    def end_tasks(self) -> None:
        """End what is being done to get it going."""
        for task in self.tasks:
            task.cancel()
        self.tasks.clear()
        self.recheck = None

    def _plan_of(self, items: Sequence[Equipment]) -> Plan:
        device = items[0].type.device
        if device.plc is not None:
            return plan_map(items, device, device.plc, overhead(self.link, device), self.learned)
        points = (point for item in items for point in item.points.values())
        device = _moved(device, items[0].base)
        return plan(points, device, overhead(self.link, device), self.learned)

    def _block(self, reading: Reading) -> ScanBlock:
        device = self.device
        fast, slow = self.link.fast or device.fast, self.link.slow or device.slow
        period = {Scan.FAST: fast, Scan.SLOW: slow, Scan.PAGE: slow, Scan.ONCE: inf}[reading.scan]
        if isinstance(reading.part, Rows):
            return TableBlock(self.source, self.next_block(), self.number, reading, period, reading.part)
        return ScanBlock(self.source, self.next_block(), self.number, reading, period)


def _moved(device: Device, base: int) -> Device:
    """`device` as a machine has it whose registers begin at `base`."""
    holes, write_only = (
        [(first + base, last + base) for first, last in of] for of in (device.holes, device.write_only)
    )
    return replace(device, holes=holes, write_only=write_only) if base else device


def _identity(reading: Reading) -> object:
    return reading.block, reading.scan, tuple(point.name for point in reading.points)


@dataclass(slots=True)
class Finding:
    """What cutting a refused block in halves has shown."""

    silence: bool = False
    """Whether it is silence that is examined."""
    hang_up: bool = False
    """Whether it closed the connection meanwhile."""
    code: int = 2
    """Refusal that is examined, beside those that are always about registers."""
    taken: int = 1
    """Most registers that it took in one read meanwhile."""

    @property
    def what(self) -> str:
        """What is wrong with those in `bad`, for the log."""
        if self.hang_up:
            return "connection closed at register"
        if self.silence:
            return "register not answered"
        return "no such register" if self.code == 2 else f"register refused with {self.code:02d}"

    bad: list[tuple[int, int]] = field(default_factory=list)
    """Registers that the device refuses alone."""
    gaps: list[tuple[int, int]] = field(default_factory=list)
    """Unused registers between halves that it takes alone and not together."""
    limit: int | None = None
    """Larger of two neighbouring halves that it takes alone and not together: the block is too large."""


def spans_of(points: Iterable[Point]) -> list[tuple[int, int]]:
    """The different spans of registers of `points`, in order."""
    return sorted({span_of(point.register) for point in points if point.register is not None})


def spread(spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The first of `spans`, that in the middle, those at the quarters, and so on: where many side by side are silent, one is soon found."""
    return [spans[n] for n in sorted(range(len(spans)), key=lambda n: -(n & -n) if n else -len(spans))]
