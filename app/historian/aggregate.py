"""What a point did between two moments: extremes, time-weighted mean, share of good time.

Exact for any range, and no more than some thousand rows are touched: whole minutes and hours come from their roll-ups, the ends from
samples. Values hold as the recorder means it: until the next sample, and no longer than `GAP_AFTER`.
"""

from dataclasses import dataclass
from typing import Literal

from sqlalchemy import Connection

from app.historian import query, sealed
from app.historian.store import GAP_AFTER, HOUR, MINUTE

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
    before = sealed.last(connection, number, begin - 1)
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
    mark = connection.exec_driver_sql("SELECT t FROM mark WHERE name = ?", (table,)).scalar() or 0
    inner, outer = -(-begin // unit) * unit, min(end, mark) // unit * unit
    if inner >= outer:
        return _find(connection, number, begin, end, value, column, finer)
    if found := _find(connection, number, begin, inner, value, column, finer):
        return found
    row = connection.exec_driver_sql(
        f"SELECT t FROM {table} WHERE point = ? AND t >= ? AND t < ? AND {column} = ? ORDER BY t LIMIT 1",
        (number, inner, outer, value),
    ).first()
    if row is None:
        return _find(connection, number, outer, end, value, column, finer)
    return _find(connection, number, row[0], row[0] + unit, value, column, finer) or (row[0], row[0] + unit)


def _find_sample(connection: Connection, number: int, begin: int, end: int, value: float) -> tuple[int, int] | None:
    since = begin
    for first, last in [*sealed.spans(connection, number, begin, end), (end, end - 1)]:
        first, last = max(first, begin), min(last + 1, end)
        row = connection.exec_driver_sql(
            "SELECT min(t) FROM sample WHERE point = ? AND t >= ? AND t < ? AND v = ? AND q & 3 < 2",
            (number, since, first, value),
        ).scalar()
        if row is not None:
            return row, row
        if first < last:
            part = sealed.together(connection, number, first, last)
            for at in range(len(part)):
                if part.number(at) == value and part.qualities[at] & 3 < 2:
                    return part.times[at], part.times[at]
        since = last
    return None


def _add(connection: Connection, number: int, begin: int, end: int, table: str, out: Aggregate) -> None:
    if begin >= end:
        return
    if table == "sample":
        _of_samples(connection, number, begin, end, out)
        return
    unit, finer = (HOUR, "minute") if table == "hour" else (MINUTE, "sample")
    mark = connection.exec_driver_sql("SELECT t FROM mark WHERE name = ?", (table,)).scalar() or 0
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
    low, high, area, good, count = connection.exec_driver_sql(
        """
        WITH part AS (
            SELECT t, v, s, q FROM sample WHERE point = :p AND t >= :b AND t < :e
            UNION ALL
            SELECT * FROM (SELECT t, v, s, q FROM sample WHERE point = :p AND t < :b AND t >= :b - :gap ORDER BY t DESC LIMIT 1)
        ),
        span AS (
            SELECT t, v, v IS NOT NULL OR s IS NOT NULL AS valid, q & 3 AS level,
                   min(lead(t, 1, :e) OVER (ORDER BY t), t + :gap, :e) - max(t, :b) AS d
            FROM part
        )
        SELECT min(v) FILTER (WHERE d > 0 AND level < 2), max(v) FILTER (WHERE d > 0 AND level < 2),
               sum(v * d) FILTER (WHERE d > 0 AND level = 0), coalesce(sum(d) FILTER (WHERE d > 0 AND valid AND level = 0), 0),
               count(*) FILTER (WHERE t >= :b)
        FROM span
        """,
        {"p": number, "b": begin, "e": end, "gap": GAP_AFTER},
    ).one()
    out.note(low, high)
    out.weigh(area, good)
    out.count += count


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
    rows = connection.exec_driver_sql(
        f"""SELECT t, low, high, first_t, last_t, last, last_q & 3, mean, good, count FROM {table}
            WHERE point = ? AND t >= ? AND t < ? ORDER BY t""",
        (number, begin, end),
    )
    for t, low, high, first_t, last_t, last, last_level, mean, good, count in rows:
        _hold(out, value, level, cursor, min(first_t, since + GAP_AFTER), min(t, since + GAP_AFTER))
        out.note(low, high)
        out.weigh(None if mean is None else mean * good, good)
        out.count += count
        cursor, since, value, level = t + unit, last_t, last, last_level
    _hold(out, value, level, cursor, min(end, since + GAP_AFTER), min(end, since + GAP_AFTER))


def _hold(out: Aggregate, value: float | str | None, level: int, begin: int, seen: int, weighed: int) -> None:
    """`value` is seen from `begin` to `seen`; the time up to `weighed` is in no roll-up."""
    if value is None or level > 1 or seen <= begin:
        return
    number = None if isinstance(value, str) else value
    out.note(number, number)
    if level == 0 and weighed > begin:
        out.weigh(None if number is None else number * (weighed - begin), weighed - begin)
