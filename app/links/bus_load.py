"""What a line can carry, what the plan asks of it, and what more registers would cost. Pure arithmetic.

Time of a telegram = time on the wire with both silences (reference/modbus.md section 1, nothing over TCP and in memory) + what device,
adapter and this computer take, measured as soon as the unit has answered.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, inf

from app.links.contract import Block
from app.links.station import Station
from app.links.statistics import UnitStatistics
from app.plant.definitions import Link, Scan
from app.registers.pdu import BITS, MAX_READ, size_of
from app.registers.rtu import read_time

FULL = 0.95
"""A line that is asked for more of its time than this has none left for writes."""


@dataclass(frozen=True, slots=True)
class Reads:
    """What is read of one unit, again and again."""

    unit: int
    limit: int
    """Most registers in one telegram."""
    turnaround: float
    """What a telegram takes beside the wire [s]."""
    fast: Sequence[tuple[int, float]]
    """(registers, period [s]) of the blocks that are read fast."""
    slow: Sequence[tuple[int, float]] = ()
    of_bits: int = 0
    """How many of the first in `fast` are of bits, 16 of which weigh as much as a register: no register is read with them."""


@dataclass(frozen=True, slots=True)
class Load:
    """What the plan asks of a line."""

    asked: float
    """Shortest period of a fast block [s]; infinite when there is none."""
    round: float
    """All fast blocks, one after another [s]."""
    share: float
    """Of the line's time that all periodic reads ask for; above 1 it is too short for them."""

    @property
    def slow_share(self) -> float:
        """Of the line's time that slow blocks ask for."""
        return self.share - self._fast_share

    @property
    def _fast_share(self) -> float:
        return self.round / self.asked if self.asked < inf else 0.0

    @property
    def cycle(self) -> float:
        """Time between two scans of a fast block that can be expected [s]; infinite when nothing is left for them."""
        if self.share <= 1 or self.asked == inf:
            return self.asked
        rest = 1 - self.slow_share
        return max(self.asked, self.round / rest) if rest > 0 else inf

    @property
    def too_short(self) -> bool:
        """Whether the line cannot carry what is asked, writes not counted."""
        return self.share > 1

    @property
    def full(self) -> bool:
        """Whether writes have to take their time from the scans."""
        return self.share > FULL


def arithmetic_limit(link: Link, count: int) -> float:
    """Most polls of `count` registers per second that the wire itself allows; infinite where there is no serial wire."""
    return 1 / read_time(link.baud, count) if link.transport == "rtu" else inf


def telegram_time(link: Link, count: int, turnaround: float) -> float:
    """One read of `count` registers [s]."""
    return turnaround + (read_time(link.baud, count) if link.transport == "rtu" else 0.0)


def reads_of(station: Station, statistics: UnitStatistics) -> Reads:
    """What is read of `station` now, with what its telegrams were seen to take."""
    device = station.device
    limit = min(device.max_read, device.group_read.get(Scan.FAST.value, MAX_READ), station.learned.limit, MAX_READ)
    blocks = sorted((b for b in station.blocks if b.wanted), key=lambda b: b.block.function not in BITS)
    periodic = {scan: [(_registers(b.block), b.period) for b in blocks if b.scan is scan] for scan in Scan}
    return Reads(
        station.number,
        max(1, limit),
        statistics.turnaround or device.turnaround,
        periodic[Scan.FAST],
        periodic[Scan.SLOW],
        sum(b.scan is Scan.FAST and b.block.function in BITS for b in blocks),
    )


def _registers(block: Block) -> int:
    """Registers that take as long as what `block` reads."""
    return ceil(size_of(block.function, block.count) / 2)


def load(link: Link, units: Iterable[Reads]) -> Load:
    """What `units` ask of the line together."""
    units = list(units)
    asked = min((period for unit in units for _, period in unit.fast), default=inf)
    fast = [(telegram_time(link, n, unit.turnaround), period) for unit in units for n, period in unit.fast]
    slow = [(telegram_time(link, n, unit.turnaround), period) for unit in units for n, period in unit.slow]
    return Load(asked, sum(time for time, _ in fast), sum(time / period for time, period in (*fast, *slow)))


def cost(link: Link, unit: Reads, registers: int) -> float:
    """What `registers` more, following the last fast ones, add to one round of the fast blocks [s]."""
    if registers <= 0:
        return 0.0
    return sum(telegram_time(link, n, unit.turnaround) for n in _grown(unit, registers)) - sum(
        telegram_time(link, n, unit.turnaround) for n, _ in unit.fast
    )


def with_more(link: Link, units: Sequence[Reads], number: int, registers: int) -> Load:
    """The load when unit `number` had `registers` more fast ones."""
    asked = min((period for unit in units for _, period in unit.fast), default=link.fast or 0.1)
    grown = [
        unit
        if unit.unit != number or registers <= 0
        else Reads(
            unit.unit,
            unit.limit,
            unit.turnaround,
            [(n, unit.fast[0][1] if unit.fast else asked) for n in _grown(unit, registers)],
            unit.slow,
            unit.of_bits,
        )
        for unit in units
    ]
    return load(link, grown)


def _grown(unit: Reads, registers: int) -> list[int]:
    """Registers of each fast telegram afterwards: the last one is filled up, then new ones are begun."""
    counts = [n for n, _ in unit.fast]
    total = (counts.pop() if len(counts) > unit.of_bits else 0) + registers
    pieces = ceil(total / unit.limit)
    return [*counts, *(unit.limit for _ in range(pieces - 1)), total - unit.limit * (pieces - 1)]
