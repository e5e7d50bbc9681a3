"""What a point did between two moments: extremes, time-weighted mean, share of good time.

Exact for any range, and no more than some thousand rows are touched: whole minutes and hours come from their roll-ups, the ends from
samples. Values hold as the recorder means it: until the next sample, and no longer than `GAP_AFTER`.
"""

from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import BigInteger, Connection, Select, bindparam, case, func, or_, select, union_all

from app.historian import query, sealed
from app.historian.dialect import Statement, greatest, least
from app.historian.store import GAP_AFTER, HOUR, MARK, MINUTE
from app.historian.tables import hour, minute, sample

Column = Literal["low", "high"]

BY_MINUTES = 2 * HOUR
BY_HOURS = 72 * HOUR
"""From these lengths on, minutes and hours are read instead of samples [µs]."""


@dataclass(slots=True)
class Aggregate:
    """A point over a range."""

    low: float | None = None
    """Of good and uncertain values, that which held at the beginning included."""
    high: float | None = None
    good: int = 0
    """Time with a good value [µs]."""
    count: int = 0
    """Samples."""
    _area: float = 0.0
    _weight: int = 0

    @property
    def mean(self) -> float | None:
        """Time-weighted mean of the good values."""
        return self._area / self._weight if self._weight else None

    def note(self, low: float | None, high: float | None) -> None:
        """These occurred."""
        if low is not None:
            self.low = low if self.low is None else min(self.low, low)
        if high is not None:
            self.high = high if self.high is None else max(self.high, high)

    def weigh(self, area: float | None, good: int) -> None:
        """Good for `good` µs; `area` is the sum of value times time, None when the value is a text."""
        self.good += good
        if area is not None:
            self._area += area
            self._weight += good


def aggregate(connection: Connection, number: int, begin: int, end: int) -> Aggregate:
    """The point `number` with begin <= time < end [µs UTC].

    Raises:
        ValueError: the range is empty.
    """
    if end <= begin:
        raise ValueError(f"a range must end after it begins: {begin} to {end}")
    out = Aggregate()
    table = "hour" if end - begin > BY_HOURS else "minute" if end - begin > BY_MINUTES else "sample"
    _add(connection, number, begin, end, table, out)
    return out


def first_time(
    connection: Connection, number: int, begin: int, end: int, value: float, column: Column
) -> tuple[int, int] | None:
    """When the point first had `value`, the `column` of its aggregate from `begin` to `end`: [µs UTC], twice the same where a sample tells.

    Where only roll-ups are left it is the minute or the hour, from and to. None: no such value is stored.
    """
    before = sealed.last(connection, number, begin)  # what held; a sample of this very moment ends it
    if before is not None and before[1] == value and before[3] & 3 < 2 and before[0] >= begin - GAP_AFTER:
        return begin, begin
    table = "hour" if end - begin > BY_HOURS else "minute" if end - begin > BY_MINUTES else "sample"
    return _find(connection, number, begin, end, value, column, table)


def _find(
    connection: Connection, number: int, begin: int, end: int, value: float, column: str, table: str
) -> tuple[int, int] | None:
    if begin >= end:
        return None
    if table == "sample":
        return _find_sample(connection, number, begin, end, value)
    unit, finer = (HOUR, "minute") if table == "hour" else (MINUTE, "sample")
    mark = MARK(connection, name=table).scalar() or 0
    inner, outer = -(-begin // unit) * unit, min(end, mark) // unit * unit
    if inner >= outer:
        return _find(connection, number, begin, end, value, column, finer)
    if found := _find(connection, number, begin, inner, value, column, finer):
        return found
    row = WITH_EXTREME[table, column](connection, number=number, begin=inner, end=outer, value=value).first()
    if row is None:
        return _find(connection, number, outer, end, value, column, finer)
    return _find(connection, number, row[0], row[0] + unit, value, column, finer) or (row[0], row[0] + unit)


def _find_sample(connection: Connection, number: int, begin: int, end: int, value: float) -> tuple[int, int] | None:
    since = begin
    for first, last in [*sealed.spans(connection, number, begin, end), (end, end - 1)]:
        first, last = max(first, begin), min(last + 1, end)
        row = WITH_VALUE(connection, number=number, begin=since, end=first, value=value).scalar()
        if row is not None:
            return row, row
        if first < last:
            part = sealed.together(connection, number, first, last)
            for at in range(len(part)):
                if part.number(at) == value and part.qualities[at] & 3 < 2:
                    return part.times[at], part.times[at]
        since = last
    return None


WITH_EXTREME = {
    (table.name, column): Statement(
        select(table.c.t)
        .where(
            table.c.point == bindparam("number"),
            table.c.t >= bindparam("begin"),
            table.c.t < bindparam("end"),
            table.c[column] == bindparam("value"),
        )
        .order_by(table.c.t)
        .limit(1)
    )
    for table in (minute, hour)
    for column in ("low", "high")
}
WITH_VALUE = Statement(
    select(func.min(sample.c.t)).where(
        sample.c.point == bindparam("number"),
        sample.c.t >= bindparam("begin"),
        sample.c.t < bindparam("end"),
        sample.c.v == bindparam("value"),
        sample.c.q.bitwise_and(3) < 2,
    )
)


def _add(connection: Connection, number: int, begin: int, end: int, table: str, out: Aggregate) -> None:
    if begin >= end:
        return
    if table == "sample":
        _of_samples(connection, number, begin, end, out)
        return
    unit, finer = (HOUR, "minute") if table == "hour" else (MINUTE, "sample")
    mark = MARK(connection, name=table).scalar() or 0
    inner, outer = -(-begin // unit) * unit, min(end, mark) // unit * unit
    if inner >= outer:
        _add(connection, number, begin, end, finer, out)
        return
    _add(connection, number, begin, inner, finer, out)
    _of_roll_ups(connection, number, inner, outer, unit, table, out)
    _add(connection, number, outer, end, finer, out)


def _of_samples(connection: Connection, number: int, begin: int, end: int, out: Aggregate) -> None:
    if sealed.spans(connection, number, begin - GAP_AFTER, end):
        _of_packed(connection, number, begin, end, out)
        return
    low, high, area, good, count = OF_SAMPLES(connection, number=number, begin=begin, end=end, gap=GAP_AFTER).one()
    out.note(low, high)
    out.weigh(area, good)
    out.count += count


def _weighed() -> Select[*tuple[Any, ...]]:
    """Extremes, area, good time and number of the samples of a span, and of the one that held when it began."""
    begin, end, gap = (bindparam(name, type_=BigInteger) for name in ("begin", "end", "gap"))
    told = select(sample.c.t, sample.c.v, sample.c.s, sample.c.q).where(sample.c.point == bindparam("number"))
    held = told.where(sample.c.t < begin, sample.c.t >= begin - gap).order_by(sample.c.t.desc()).limit(1).subquery()
    part = union_all(told.where(sample.c.t >= begin, sample.c.t < end), select(held)).cte("part")
    until = least(func.lead(part.c.t, 1, end).over(order_by=part.c.t), part.c.t + gap, end)
    span = select(
        part.c.t,
        part.c.v,
        case((or_(part.c.v.is_not(None), part.c.s.is_not(None)), 1), else_=0).label("valid"),
        part.c.q.bitwise_and(3).label("level"),
        (until - greatest(part.c.t, begin)).label("d"),
    ).cte("span")
    lasts = span.c.d > 0
    return select(
        func.min(span.c.v).filter(lasts, span.c.level < 2),
        func.max(span.c.v).filter(lasts, span.c.level < 2),
        func.sum(span.c.v * span.c.d).filter(lasts, span.c.level == 0),
        func.coalesce(func.sum(span.c.d).filter(lasts, span.c.valid == 1, span.c.level == 0), 0),
        func.count().filter(span.c.t >= begin),
    )


OF_SAMPLES = Statement(_weighed())


def _of_packed(connection: Connection, number: int, begin: int, end: int, out: Aggregate) -> None:
    before, rows = query.at(connection, number, begin - 1), query.page(connection, number, begin - 1, end, -1)
    out.count += len(rows)
    if before is not None and before[0] >= begin - GAP_AFTER:
        rows.insert(0, before)
    for index, (time, value, quality) in enumerate(rows):
        then = rows[index + 1][0] if index + 1 < len(rows) else end
        elapsed = min(then, time + GAP_AFTER, end) - max(time, begin)
        if value is None or quality & 3 > 1 or elapsed <= 0:
            continue
        figure = None if isinstance(value, str) else value
        out.note(figure, figure)
        if quality & 3 == 0:
            out.weigh(None if figure is None else figure * elapsed, elapsed)


def _of_roll_ups(
    connection: Connection, number: int, begin: int, end: int, unit: int, table: str, out: Aggregate
) -> None:
    before = query.at(connection, number, begin - 1)
    since, value, level = (before[0], before[1], before[2] & 3) if before else (0, None, 2)
    cursor = begin
    rows = ROLL_UPS[table](connection, number=number, begin=begin, end=end)
    for t, low, high, first_t, last_t, last, last_level, mean, good, count in rows:
        _hold(out, value, level, cursor, min(first_t, since + GAP_AFTER), min(t, since + GAP_AFTER))
        out.note(low, high)
        out.weigh(None if mean is None else mean * good, good)
        out.count += count
        cursor, since, value, level = t + unit, last_t, last, last_level
    _hold(out, value, level, cursor, min(end, since + GAP_AFTER), min(end, since + GAP_AFTER))


ROLL_UPS = {
    table.name: Statement(
        select(
            table.c.t, table.c.low, table.c.high, table.c.first_t, table.c.last_t, table.c.last, table.c.last_q.bitwise_and(3),
            table.c.mean, table.c.good, table.c["count"],
        )
        .where(table.c.point == bindparam("number"), table.c.t >= bindparam("begin"), table.c.t < bindparam("end"))
        .order_by(table.c.t)
    )
    for table in (minute, hour)
}  # fmt: skip


def _hold(out: Aggregate, value: float | str | None, level: int, begin: int, seen: int, weighed: int) -> None:
    """`value` is seen from `begin` to `seen`; the time up to `weighed` is in no roll-up."""
    if value is None or level > 1 or seen <= begin:
        return
    number = None if isinstance(value, str) else value
    out.note(number, number)
    if level == 0 and weighed > begin:
        out.weigh(None if number is None else number * (weighed - begin), weighed - begin)
