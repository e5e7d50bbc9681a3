"""What a machine did in a part of a day, from what was recorded: figures that its type declares (plant/today.py).

A figure says what was seen, and whether that was all: time in which nothing was recorded, or a value was bad, is not filled with guesses. A
counter of a device goes on while nobody looks, so only what it did before it was first seen is not known; one that is derived here stands
still meanwhile.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

from sqlalchemy import Connection, bindparam, select

from app.historian import query
from app.historian.aggregate import Aggregate, aggregate
from app.historian.dialect import Statement
from app.historian.record_query import RecordFilter, times
from app.historian.store import GAP_AFTER, MARK, MINUTE
from app.historian.tables import minute, run
from app.plant.definitions import Equipment
from app.plant.today import Figure, How
from app.registers.register import Register, Type

TOLERATED = 60_000_000
"""So much of a day in all may be missing from a figure that is called whole [µs]: it is read in minutes, and a restart takes seconds."""
NEARLY = 0.75
"""Of what its register holds: a counter that falls from above this may have run over, not been set back."""
BITS = {Type.U16: 16, Type.I16: 15, Type.U32: 32, Type.I32: 31, Type.U64: 64, Type.I64: 63}
Span = tuple[int, int]
"""Begin and end [µs UTC]."""


@dataclass(frozen=True, slots=True)
class Amount:
    """One figure."""

    value: float | None
    """[s] of times, [kWh] of energy, else a number; None: nothing was seen."""
    whole: bool
    """Whether nothing of the time is missing: else it is the least that it can be (of a mean: of what is known)."""


@dataclass(slots=True)
class Day:
    """What machines did."""

    begin: int
    """[µs UTC]"""
    end: int
    off: Sequence[Span] = ()
    """When nothing was recorded of any machine."""
    amounts: Mapping[str, Mapping[str, Amount]] = field(default_factory=dict)
    """Machine → name of the figure → what it is."""
    unknown: Mapping[str, Sequence[Span]] = field(default_factory=dict)
    """Machine → when it was not seen besides."""


def read_day(connection: Connection, machines: Iterable[Equipment], begin: int, end: int) -> Day:
    """The figures of `machines` from `begin` to `end` (without it) [µs UTC]."""
    off = _off(connection, begin, end)
    day = Day(begin, end, _long(off))
    amounts, unknown = dict[str, Mapping[str, Amount]](), dict[str, Sequence[Span]]()
    numbers = {name: one.number for name, one in query.recorded(connection).items()}

    @cache
    def seen(number: int) -> Aggregate:
        return aggregate(connection, number, begin, end)

    for item in machines:
        figures = item.type.today.values()
        if not figures:
            continue
        amounts[item.id] = {one.name: _amount(connection, item, one, numbers, begin, end, seen) for one in figures}
        told = next((numbers.get(item.points[one.of].id) for one in figures if one.how is How.TIME), None)
        missing = [(begin, end)] if told is None else _missing(connection, told, begin, end, seen(told).good)
        unknown[item.id] = _long(_without(missing, off))
    day.amounts, day.unknown = amounts, unknown
    return day


def _amount(
    connection: Connection,
    item: Equipment,
    figure: Figure,
    numbers: Mapping[str, int],
    begin: int,
    end: int,
    seen: Callable[[int], Aggregate],
) -> Amount:
    if figure.how is How.MEAN:
        kind = item.type.records[figure.record]
        _, spread = times(connection, kind, RecordFilter(item.id, begin, end), figure.outcome)
        return Amount(spread.mean, True)
    point = item.points[figure.of]
    number = numbers.get(point.id)
    if number is None:
        return Amount(None, False)
    if figure.how is How.COUNT:
        return counted(connection, number, begin, end, goes_on=point.derived is None, room=_room(point.register))
    found = seen(number)
    if found.mean is None:
        return Amount(None, False)
    area = found.mean * found.good / 1e6
    return Amount(area if figure.how is How.TIME else area / 3600, end - begin - found.good <= TOLERATED)


def counted(
    connection: Connection, number: int, begin: int, end: int, *, goes_on: bool, room: float = math.inf
) -> Amount:
    """By how much a counter went up; `goes_on`: it counts on in its device also while it is not seen; its register has `room` for so much.

    Where it began again at nought, what it counted since is the least: whole when it was seen all the time, and its register was not
    nearly full, which is where it may have run over.
    """
    before = _held(connection, number, begin)
    whole, last, total = before is not None, before, 0.0
    fell, ran_over = False, False
    for value in _steps(connection, number, begin, end):
        if last is not None and value < last:
            fell, ran_over, total = True, ran_over or last >= NEARLY * room, total + value
        elif last is not None:
            total += value - last
        last = value
    if last is None:
        return Amount(None, False)
    if not whole:  # it may have been seen from the first minute on
        found = query.page(connection, number, begin - 1, begin + TOLERATED, 1)
        whole = bool(found) and found[0][1] is not None
    if fell or not goes_on:
        whole = whole and end - begin - aggregate(connection, number, begin, end).good <= TOLERATED
    return Amount(total, whole and not ran_over and _held(connection, number, end) is not None)


def _room(register: Register | None) -> float:
    """What a counter in this register counts to before it runs over; without end where that is not known."""
    if register is None or register.type not in BITS:
        return math.inf
    raw = (1 << BITS[register.type]) - 1
    return (raw if register.mask is None else min(raw, register.mask)) * abs(register.scale)


def _held(connection: Connection, number: int, time: int) -> float | None:
    """What a point was just before `time`."""
    found = query.at(connection, number, time - 1)
    if found is None or time - found[0] > GAP_AFTER or found[2] & 3 > 1 or not isinstance(found[1], int | float):
        return None
    return found[1]


def _steps(connection: Connection, number: int, begin: int, end: int) -> Iterator[float]:
    """What a counter was: of a minute that is written and in which it only rose the ends, else sample by sample."""
    mark = MARK(connection, name="minute").scalar() or 0
    inner, outer = -(-begin // MINUTE) * MINUTE, min(end, mark) // MINUTE * MINUTE
    if inner >= outer:
        inner = outer = end
    yield from _of_samples(connection, number, begin, inner)
    for time, first, low, high, last in MINUTES(connection, number=number, begin=inner, end=outer).all():
        if low and (first, last) == (low, high):  # where it was 0, it may have begun again and come further than before
            yield from (first, last)
        elif high is not None:  # it began again, or an end of it was bad: which value came when, the samples say
            yield from _of_samples(connection, number, time, time + MINUTE)
    yield from _of_samples(connection, number, outer, end)


def _of_samples(connection: Connection, number: int, begin: int, end: int) -> Iterator[float]:
    if begin < end:
        for _, value, quality in query.page(connection, number, begin - 1, end, -1):
            if isinstance(value, int | float) and quality & 3 < 2:
                yield value


def _missing(connection: Connection, number: int, begin: int, end: int, good: int) -> list[Span]:
    """When a point that is stored at every change was not known; `good`: for how long it was [µs]."""
    if end - begin - good <= TOLERATED:
        return []
    before, rows = query.at(connection, number, begin - 1), query.page(connection, number, begin - 1, end, -1)
    known: list[Span] = []
    held = [] if before is None else [(begin, before[1], before[2], before[0])]
    samples = [*held, *((time, value, quality, time) for time, value, quality in rows)]
    for index, (time, value, quality, since) in enumerate(samples):
        then = samples[index + 1][0] if index + 1 < len(samples) else end
        if value is not None and quality & 3 == 0:
            known.append((time, min(then, since + GAP_AFTER)))
    return _without([(begin, end)], known)


def _off(connection: Connection, begin: int, end: int) -> list[Span]:
    """When no recorder ran."""
    return _without([(begin, end)], [(start, alive) for start, alive in RUNS(connection, begin=begin, end=end)])


MINUTES = Statement(
    select(minute.c.t, minute.c.first, minute.c.low, minute.c.high, minute.c.last)
    .where(minute.c.point == bindparam("number"), minute.c.t >= bindparam("begin"), minute.c.t < bindparam("end"))
    .order_by(minute.c.t)
)
RUNS = Statement(
    select(run.c.start, run.c.alive)
    .where(run.c.alive > bindparam("begin"), run.c.start < bindparam("end"))
    .order_by(run.c.start)
)


def _without(spans: Iterable[Span], others: Sequence[Span]) -> list[Span]:
    """What of `spans` lies in none of `others`; both in order."""
    left: list[Span] = []
    for at, last in spans:
        for begin, end in others:
            if begin >= last:
                break
            if begin > at:
                left.append((at, begin))
            at = max(at, end)
        if at < last:
            left.append((at, last))
    return left


def _long(spans: Sequence[Span]) -> list[Span]:
    """Those that are worth telling."""
    return [(begin, end) for begin, end in spans if end - begin > TOLERATED]
