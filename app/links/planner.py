"""Points → the fewest reads: neighbouring registers in one telegram, over a gap when the gap is cheaper than another telegram.

Cost of a plan [registers] = telegrams x overhead + registers read; the plan of least cost is found exactly (dynamic programming over the
points in order of address). Overhead is what a telegram costs beside its registers: reference/modbus.md section 1 and section 3 item 3.
Coils and discrete inputs are planned alike, counted in bits; no telegram reads of two tables.
"""

from bisect import bisect_left
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from operator import itemgetter

from app.links.contract import Block
from app.plant.definitions import Device, Link, Point, Register, Scan, TableMap
from app.registers.pdu import (
    BITS,
    FUNCTIONS,
    MAX_READ,
    MAX_READ_BITS,
    READ_HOLDING,
    most_read,
)
from app.registers.plc_map import TABLE_HEAD
from app.registers.rtu import character_time, read_time

BITS_OF_REGISTER = 16
NETWORK_OVERHEAD = 10_000.0
"""Over TCP and in memory a register costs next to nothing: first the fewest telegrams, then the fewest registers."""

Span = tuple[int, int]
"""First and last address."""


class Part(Enum):
    """What a block of a Pogon PLC is, beyond values (links/plc.py)."""

    HEADER = "header"
    IMAGE = "image"
    RING = "ring"


@dataclass(frozen=True, slots=True)
class Rows:
    """Whole rows of a table that are read in one telegram."""

    equipment: str
    table: TableMap
    slots: int
    """Rows of the whole table on this machine."""
    first: int
    """First row in the block, from 0."""
    rows: int

    @property
    def head(self) -> int:
        """Words before the first row: the head of the table stands before row 0."""
        return TABLE_HEAD if self.first == 0 else 0


@dataclass(frozen=True, slots=True)
class Reading:
    """One block of a plan and the points that lie in it."""

    block: Block
    scan: Scan
    points: tuple[Point, ...]
    part: Part | Rows | None = None
    """None for plain registers."""


@dataclass(frozen=True, slots=True)
class Plan:
    """All reads of one unit."""

    readings: tuple[Reading, ...] = ()
    unreadable: tuple[Point, ...] = ()
    """Points whose registers the device does not answer."""


@dataclass(slots=True)
class Learned:
    """What a device has shown beyond its data sheet, kept as long as the link lives."""

    limit: int = MAX_READ
    """Most registers per read."""
    bit_limit: int = MAX_READ_BITS
    """Most bits per read."""
    bad: set[tuple[int, int, int]] = field(default_factory=set)
    """(function, first, last) of registers that the device refuses."""
    known: set[tuple[int, int, int]] = field(default_factory=set)
    """Of them, those that it had answered before."""
    hang_up: bool = False
    """Whether it closes the connection for some of them instead of refusing."""
    gaps: set[tuple[int, int, int]] = field(default_factory=set)
    """(function, first, last) of unused registers that no block may span."""

    def most(self, function: int) -> int:
        """Most registers, or bits, of one read with `function`."""
        return self.bit_limit if function in BITS else self.limit

    def take_at_most(self, function: int, limit: int) -> None:
        """From now on no read with `function` asks for more."""
        if function in BITS:
            self.bit_limit = limit
        else:
            self.limit = limit


def overhead(link: Link, device: Device) -> float:
    """What one telegram costs, counted in registers: the break-even gap.

    9600 baud 8E1: 10 without turnaround, 12 with 5 ms, 18 with 20 ms (reference/modbus.md section 3).
    """
    if link.transport != "rtu":
        return NETWORK_OVERHEAD
    return (read_time(link.baud, 0) + device.turnaround) / (2 * character_time(link.baud))


def plan(points: Iterable[Point], device: Device, cost: float, learned: Learned | None = None) -> Plan:
    """The reads of one unit. `cost`: overhead of a telegram [registers].

    Fast points come first; a slower point that lies inside a faster block is read with it, for nothing. Points without a register
    and command registers are left out.
    """
    learned = learned or Learned()
    readings: list[Reading] = []
    unreadable: list[Point] = []
    classes: dict[tuple[Scan, int], list[Point]] = {}
    for point in points:
        register = point.register
        if register is None or not register.readable:
            continue
        function = FUNCTIONS[register.table]
        limit = limit_of(device, point.scan, learned, function)
        if _is_unreadable(register, function, device, learned) or register.words > limit:
            unreadable.append(point)
        else:
            classes.setdefault((point.scan, function), []).append(point)
    for scan in Scan:
        for function in sorted(set(FUNCTIONS.values())):
            wanted = classes.get((scan, function), [])
            limit = limit_of(device, scan, learned, function)
            wanted = _ride(wanted, readings, function, limit)
            walls = _walls(device, function, learned)
            for group in _cut(wanted, limit, walls, cost * BITS_OF_REGISTER if function in BITS else cost):
                readings.append(Reading(_around(group, function), scan, tuple(group)))
    return Plan(tuple(readings), tuple(unreadable))


def span_of(register: Register) -> Span:
    """First and last address of a register."""
    return register.address, register.address + register.words - 1


def limit_of(device: Device, scan: Scan, learned: Learned, function: int = READ_HOLDING) -> int:
    """Most registers, or bits, of one read."""
    if function in BITS:
        return max(1, min(device.max_read_bits, learned.bit_limit, most_read(function)))
    return max(1, min(device.max_read, device.group_read.get(scan.value, MAX_READ), learned.limit, MAX_READ))


def _is_unreadable(register: Register, function: int, device: Device, learned: Learned) -> bool:
    first, last = span_of(register)
    if function not in device.read_functions or last > 0xFFFF:
        return True
    silent = (*_never(device, function), *((a, b) for f, a, b in learned.bad if f == function))
    return any(first <= b and a <= last for a, b in silent)


def _never(device: Device, function: int) -> Sequence[Span]:
    """Addresses that no read with `function` may touch: the device says so of registers."""
    if function in BITS:
        return ()
    return (*device.holes, *(device.write_only if function == READ_HOLDING else ()))


def _walls(device: Device, function: int, learned: Learned) -> list[Span]:
    known = ((a, b) for f, a, b in learned.bad | learned.gaps if f == function)
    apart: list[Span] = []
    for first, last in sorted([*_never(device, function), *known]):
        if apart and first <= apart[-1][1]:
            apart[-1] = apart[-1][0], max(last, apart[-1][1])
        else:
            apart.append((first, last))
    return apart


def _ride(points: Sequence[Point], readings: list[Reading], function: int, limit: int) -> list[Point]:
    """The points that no faster block holds already; the others join it."""
    rest = []
    for point in points:
        assert point.register is not None
        first, last = span_of(point.register)
        for index, reading in enumerate(readings):
            block = reading.block
            if block.function == function and block.count <= limit and block.address <= first and last <= block.last:
                cuts = tuple(at for at in block.cuts if not first < block.address + at <= last)
                whole = Block(block.address, block.count, block.function, cuts)
                readings[index] = Reading(whole, reading.scan, (*reading.points, point))
                break
        else:
            rest.append(point)
    return rest


def _cut(points: Sequence[Point], limit: int, walls: Sequence[Span], cost: float) -> list[list[Point]]:
    """Cut the points, in order of address, into groups of least cost.

    One pass, also over thousands of bits: of all groups that end with a point the cheapest begins where least was paid before it, counted
    back from its address, and what is too far off for one point, or behind a wall, is so for all after it.
    """
    spans = sorted(((span_of(point.register), point) for point in points if point.register), key=lambda item: item[0])
    best: list[tuple[float, int]] = [(0.0, 0)]
    begins: deque[tuple[float, int]] = deque()
    left, last = 0, -1
    for end, ((first, own), _) in enumerate(spans, 1):
        last = max(last, own)
        paid = best[-1][0] - first
        while begins and paid < begins[-1][0]:
            begins.pop()
        begins.append((paid, end - 1))
        while left < end - 1 and (last - spans[left][0][0] + 1 > limit or _between(spans[left][0][0], last, walls)):
            left += 1
        while begins[0][1] < left:
            begins.popleft()
        paid, begin = begins[0]
        best.append((paid + cost + last + 1, begin))
    groups = []
    end = len(spans)
    while end:
        begin = best[end][1]
        groups.append([point for _, point in spans[begin:end]])
        end = begin
    return groups[::-1]


def _between(first: int, last: int, walls: Sequence[Span]) -> bool:
    """Whether one of the `walls`, in order and apart, has an address of `first` to `last`."""
    place = bisect_left(walls, first, key=itemgetter(1))
    return place < len(walls) and walls[place][0] <= last


def _around(points: Sequence[Point], function: int) -> Block:
    spans = [span_of(point.register) for point in points if point.register]
    first, last = min(span[0] for span in spans), max(span[1] for span in spans)
    torn = {at for begin, end in spans for at in range(begin + 1, end + 1)}
    step = BITS_OF_REGISTER if function in BITS else 1  # cut closer, answers of bits are no better told apart
    cuts = tuple(at - first for at in range(first + step, last + 1, step) if at not in torn)
    return Block(first, last - first + 1, function, cuts)
