"""Questions to the history: what a screen can show of any range, and raw rows for those who want all.

A trend asks for `width` columns. Each column carries first, lowest, highest, last (after "M4", hmi-design.md section 15), so that no
spike is lost, however far it is zoomed out. It is read from whichever table is the coarsest that still fills the columns.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import BigInteger, Connection, Integer, Select, Table, bindparam, func, or_, select

from app.historian import sealed
from app.historian.dialect import Statement, in_order
from app.historian.packing import NUMBER, Packed
from app.historian.store import GAP_AFTER, HOUR, LATEST, MARK, MINUTE, RAMP
from app.historian.tables import hour, minute, point, run, sample
from app.plant.definitions import Kind

MAX_WIDTH = 4000


@dataclass(frozen=True, slots=True)
class Recorded:
    """A point as the history knows it, also when the plant has it no longer."""

    number: int
    id: str
    name: str
    unit: str
    kind: str


@dataclass(slots=True)
class Columns:
    """A decimated series: n columns in order of time; where nothing was recorded there is none.

    Draw each as first, low, high, last, and lift the pen at every None. A column without samples (`count` 0) is a break (all None), or
    what holds at an edge: where the range begins or ends, or just before a break.
    """

    time: list[int] = field(default_factory=list)
    """Of the first sample in the column [µs UTC]."""
    first: list[float | None] = field(default_factory=list)
    """None when the first sample is bad."""
    low: list[float | None] = field(default_factory=list)
    high: list[float | None] = field(default_factory=list)
    last: list[float | None] = field(default_factory=list)
    """None when the last sample is bad: the line is broken there."""
    quality: list[int] = field(default_factory=list)
    """Worst level in the column: 0 good, 1 uncertain, 2 bad."""
    count: list[int] = field(default_factory=list)
    """Samples in the column."""
    source: str = "sample"
    """Coarsest table that was read: `sample`, `minute` or `hour`."""
    step: int = 0
    """Width of a column [µs]; columns begin at whole multiples of it."""

    def __len__(self) -> int:
        return len(self.time)

    def add(
        self,
        time: int,
        first: float | None,
        low: float | None,
        high: float | None,
        last: float | None,
        quality: int,
        count: int,
    ) -> None:
        """Append one column."""
        self.time.append(time)
        self.first.append(first)
        self.low.append(low)
        self.high.append(high)
        self.last.append(last)
        self.quality.append(quality)
        self.count.append(count)

    def drop(self) -> None:
        """Take the last column away."""
        for column in (self.time, self.first, self.low, self.high, self.last, self.quality, self.count):
            column.pop()

    def hold(self, time: int, value: float | None, quality: int) -> None:
        """Append what holds at `time`, when that is later than what is there; a None breaks the line."""
        if not self.time or time > self.time[-1]:
            self.add(time, value, value, value, value, quality, 0)


def recorded(connection: Connection) -> dict[str, Recorded]:
    """Every point of the history by name and by lasting id; a name in use wins over an id."""
    rows = [Recorded(*row) for row in RECORDED(connection).all()]
    return {row.id: row for row in rows} | {row.name: row for row in rows}


def find(connection: Connection, name: str) -> Recorded | None:
    """The point with this name or lasting id, None when it was never recorded."""
    row = NAMED(connection, name=name).first()
    return None if row is None else Recorded(*row)


_recorded = select(point.c.id, point.c.lasting_id, point.c.name, point.c.unit, point.c.kind)
RECORDED = Statement(_recorded)
_named = point.c.name == bindparam("name")
NAMED = Statement(
    _recorded.where(or_(_named, point.c.lasting_id == bindparam("name"))).order_by(_named.desc(), point.c.id.desc())
)


def alive(connection: Connection) -> int:
    """The recorder's last sign of life [µs UTC]; 0 when it never ran."""
    return int(ALIVE(connection).scalar_one())


ALIVE = Statement(select(func.coalesce(func.max(run.c.alive), 0)))


def columns(connection: Connection, number: int, begin: int, end: int, width: int) -> Columns:
    """The point `number` from `begin` to `end` (without it) [µs UTC] as about `width` columns, at most one more, and edges and breaks.

    The last value is drawn up to `end`, or as far as the recorder has come.

    Raises:
        ValueError: the range is empty or `width` is outside 1 to 4000.
    """
    if end <= begin:
        raise ValueError(f"a range must end after it begins: {begin} to {end}")
    if not 1 <= width <= MAX_WIDTH:
        raise ValueError(f"width must be 1 to {MAX_WIDTH}, not {width}")
    step, table = _grid(end - begin, width)
    cells = _cells(connection, number, begin, end, step, table)
    before, known_to = _before(connection, number, begin), min(end, alive(connection))
    ramp = _ramp(connection, number)
    after = _after(connection, number, end, ramp)
    latest = LATEST(connection).first()
    lived = (0, 0) if latest is None else (latest.start, latest.alive)
    return _drawn(before, cells, after, begin, known_to, lived, ramp, Columns(source=table, step=step))


def raw(
    connection: Connection, number: int, begin: int, end: int, chunk: int = 5000
) -> Iterator[tuple[int, float | str | None, int]]:
    """Every sample of `number` with begin <= time < end, in order: time [µs UTC], value, quality word. Constant memory."""
    after = begin - 1
    while True:
        rows = page(connection, number, after, end, chunk)
        yield from rows
        if len(rows) < chunk:
            return
        after = rows[-1][0]


def page(
    connection: Connection, number: int, after: int, end: int, limit: int
) -> list[tuple[int, float | str | None, int]]:
    """The first `limit` samples with after < time < end."""
    return [(t, s if v is None else v, q) for t, v, s, q in sealed.samples(connection, number, after + 1, end, limit)]


def count(connection: Connection, number: int, begin: int, end: int) -> int:
    """How many samples `raw` would give."""
    return sealed.count(connection, number, begin, end)


def at(connection: Connection, number: int, time: int) -> tuple[int, float | str | None, int] | None:
    """The sample that held at `time` [µs UTC]: its own time, value, quality word; None when there is none."""
    row = sealed.last(connection, number, time)
    return None if row is None else (row[0], row[2] if row[1] is None else row[1], row[3])


def line_at(connection: Connection, number: int, time: int) -> tuple[int, float | str | None, int] | None:
    """As `at`, with the value where the curve is at `time`: between the two samples of a ramp on the line that joins them."""
    held = at(connection, number, time)
    if held is None or not isinstance(held[1], float) or not (ramp := _ramp(connection, number)):
        return held
    return held[0], _on_line(time, held[0], held[1], _after(connection, number, time + 1, ramp), ramp), held[2]


def texts(
    connection: Connection, number: int, begin: int, end: int, limit: int = MAX_WIDTH
) -> list[tuple[int, str | None]]:
    """The first `limit` values of a text point in the range, after the one that held at its beginning; None: bad or not recorded."""
    held = at(connection, number, begin)
    out: list[tuple[int, str | None]] = []
    if held is not None and begin - held[0] <= GAP_AFTER:
        out.append((begin, str(held[1]) if held[1] is not None else None))
    for time, value, _ in page(connection, number, begin, end, limit):
        text = None if value is None else str(value)
        if not out or out[-1][1] != text:
            out.append((time, text))
    return out


@dataclass(slots=True)
class _Cell:
    """What lies in one column."""

    index: int
    low: float | None
    high: float | None
    first_time: int
    first: float | None
    last_time: int
    last: float | None
    last_level: int
    worst: int
    count: int

    def join(self, other: "_Cell") -> None:
        """Take over the rest of the same column."""
        self.last_time, self.last, self.last_level = other.last_time, other.last, other.last_level
        self.low = other.low if self.low is None else self.low if other.low is None else min(self.low, other.low)
        self.high = other.high if self.high is None else self.high if other.high is None else max(self.high, other.high)
        self.worst = max(self.worst, other.worst)
        self.count += other.count


def _grid(length: int, width: int) -> tuple[int, str]:
    """Width of a column [µs], and the coarsest table whose rows fill at least every second column asked for.

    A column of roll-ups is a whole number of them, so that each belongs to one column. Hours are taken from every third column on: a
    month of minutes is ten times as long to read as a year of hours, and shows no more.
    """
    step = max(1, -(-length // width))
    for table, unit, least in (("hour", HOUR, HOUR // 3), ("minute", MINUTE, MINUTE // 2)):
        if step >= least:
            return -(-step // unit) * unit, table
    return step, "sample"


def _cells(connection: Connection, number: int, begin: int, end: int, step: int, table: str) -> list[_Cell]:
    """Columns that have samples; what the roll-ups do not cover (the ends, and what is too young) comes from the finer table."""
    if begin >= end:
        return []
    if table == "sample":
        return _of_samples(connection, number, begin, end, step)
    unit, finer = (HOUR, "minute") if table == "hour" else (MINUTE, "sample")
    mark = MARK(connection, name=table).scalar() or 0
    inner, outer = -(-begin // unit) * unit, min(end, mark) // unit * unit
    if inner >= outer:
        return _cells(connection, number, begin, end, step, finer)
    return _joined(
        _cells(connection, number, begin, inner, step, finer),
        _of_roll_ups(connection, number, inner, outer, step, table),
        _cells(connection, number, outer, end, step, finer),
    )


def _joined(*parts: list[_Cell]) -> list[_Cell]:
    """Parts that follow one another; the last column of one may be the first of the next."""
    out: list[_Cell] = []
    for part in parts:
        if out and part and out[-1].index == part[0].index:
            out[-1].join(part.pop(0))
        out += part
    return out


def _of_samples(connection: Connection, number: int, begin: int, end: int, step: int) -> list[_Cell]:
    parts, since = [], begin
    for first, last in sealed.spans(connection, number, begin, end):
        first, last = max(first, begin), min(last + 1, end)
        parts.append(_of_rows(connection, number, since, first, step))
        parts.append(_of_packed(sealed.together(connection, number, first, last), step))
        since = last
    return _joined(*parts, _of_rows(connection, number, since, end, step))


def _of_packed(part: Packed, step: int) -> list[_Cell]:
    out: list[_Cell] = []
    at, count, times = 0, len(part), part.times
    same = not count or min(part.qualities) == max(part.qualities)
    while at < count:
        index = times[at] // step
        to = part.place((index + 1) * step)
        numbers, qualities = part.numbers[at:to], part.qualities[at:to]
        first, last = part.number(at), part.number(to - 1)
        known = (
            [n for n, kind in zip(numbers, part.kinds[at:to], strict=True) if kind == NUMBER] if part.kinds else numbers
        )
        low, high = (min(known), max(known)) if known else (None, None)
        worst = qualities[0] & 3 if same else max(quality & 3 for quality in qualities)
        out.append(_Cell(index, low, high, times[at], first, times[to - 1], last, qualities[-1] & 3, worst, to - at))
        at = to
    return out


def _of_rows(connection: Connection, number: int, begin: int, end: int, step: int) -> list[_Cell]:
    if begin >= end:
        return []
    return [_Cell(*row) for row in OF_ROWS(connection, step=step, number=number, begin=begin, end=end)]


def _of_roll_ups(connection: Connection, number: int, begin: int, end: int, step: int, table: str) -> list[_Cell]:
    found = OF_EACH if step == (HOUR if table == "hour" else MINUTE) else OF_ROLL_UPS
    return [_Cell(*row) for row in found[table](connection, step=step, number=number, begin=begin, end=end)]


def _columns(table: Table, low: str, high: str, level: Any, count: Any) -> Any:
    """The rows of one point in columns of `step`: extremes, first and last time, worst level, how many."""
    return (
        select(
            (table.c.t // bindparam("step", type_=BigInteger)).label("c"),
            func.min(table.c[low]).label("low"),
            func.max(table.c[high]).label("high"),
            func.min(table.c.t).label("t0"),
            func.max(table.c.t).label("t1"),
            func.max(level).label("worst"),
            count.label("n"),
        )
        .where(table.c.point == bindparam("number"), table.c.t >= bindparam("begin"), table.c.t < bindparam("end"))
        .group_by("c")
        .subquery("g")
    )


def _with_ends(table: Table, group: Any, first_of: Sequence[str], last_of: Sequence[str]) -> Select[*tuple[Any, ...]]:
    """Columns as a `_Cell` takes them: these of the first row and of the last one, whose last is a quality word."""
    number = bindparam("number", type_=Integer)
    first, last = table.alias("f"), table.alias("l")
    begun = in_order(group, first, first.c.point == number, first.c.t == group.c.t0)
    ended = in_order(begun, last, last.c.point == number, last.c.t == group.c.t1)
    *ends, quality = (last.c[name] for name in last_of)
    told = group.c.c, group.c.low, group.c.high, *(first.c[name] for name in first_of), *ends, quality.bitwise_and(3)
    return select(*told, group.c.worst, group.c.n).select_from(ended).order_by(group.c.c)


_rows = _columns(sample, "v", "v", sample.c.q.bitwise_and(3), func.count())
OF_ROWS = Statement(_with_ends(sample, _rows, ("t", "v"), ("t", "v", "q")))
OF_ROLL_UPS = {
    table.name: Statement(
        _with_ends(
            table,
            _columns(table, "low", "high", table.c.level, func.sum(table.c["count"])),
            ("first_t", "first"),
            ("last_t", "last", "last_q"),
        )
    )
    for table in (minute, hour)
}

OF_EACH = {
    table.name: Statement(
        select(
            table.c.t // bindparam("step", type_=BigInteger),
            *(table.c[name] for name in ("low", "high", "first_t", "first", "last_t", "last")),
            table.c.last_q.bitwise_and(3),
            table.c.level,
            table.c["count"],
        )
        .where(table.c.point == bindparam("number"), table.c.t >= bindparam("begin"), table.c.t < bindparam("end"))
        .order_by(table.c.t)
    )
    for table in (minute, hour)
}
"""A day as wide as a screen: each roll-up is a column of its own, and nothing has to be looked for twice."""


def _before(connection: Connection, number: int, begin: int) -> tuple[int, float | None, int] | None:
    row = sealed.last(connection, number, begin - 1)
    return None if row is None or row[0] < begin - GAP_AFTER else (row[0], row[1], row[3] & 3)


def _ramp(connection: Connection, number: int) -> int:
    """How far apart two samples of the point may be that a line joins [µs]; 0: it holds its values."""
    kind = KIND(connection, number=number).scalar()
    return RAMP if kind == Kind.ANALOG else 0


KIND = Statement(select(point.c.kind).where(point.c.id == bindparam("number")))


def _after(connection: Connection, number: int, end: int, ramp: int) -> tuple[int, float | None] | None:
    """The sample at or behind `end` to which a line may lead."""
    rows = sealed.samples(connection, number, end, end + ramp, 1)
    return (rows[0][0], rows[0][1]) if rows else None


def _drawn(
    before: tuple[int, float | None, int] | None,
    cells: Sequence[_Cell],
    after: tuple[int, float | None] | None,
    begin: int,
    known_to: int,
    lived: tuple[int, int],
    ramp: int,
    out: Columns,
) -> Columns:
    """Columns in order, with what holds at the edges and a break wherever nothing was recorded or a sample was bad.

    `lived`: what is from this time holds no longer than its end: the recorder runs now, whatever a clock that was ahead had it write.
    """

    def until(since: int) -> int:
        held_to = since + GAP_AFTER
        return min(held_to, lived[1]) if lived[0] <= since <= lived[1] else held_to

    held_time, held, level = before if before is not None else (begin - GAP_AFTER - 1, None, 2)
    if held is not None:
        following = (cells[0].first_time, cells[0].first) if cells else after
        out.hold(begin, _on_line(begin, held_time, held, following, ramp), level)
    for cell in cells:
        if held is not None:
            _end_of_hold(out, until(held_time), held, level, cell.first_time, cell.first)
        if out.time and cell.first_time <= out.time[-1]:
            out.drop()
        out.add(cell.first_time, cell.first, cell.low, cell.high, cell.last, cell.worst, cell.count)
        held_time, held, level = cell.last_time, cell.last, cell.last_level
    if held is not None and known_to > held_time:
        _end_of_hold(out, until(held_time), held, level, known_to, held)
        if known_to <= until(held_time):
            out.hold(known_to, _on_line(known_to, held_time, held, after, ramp), level)
    return out


def _on_line(moment: int, since: int, value: float, then: tuple[int, float | None] | None, ramp: int) -> float:
    """Between two samples: on a ramp the line tells, else the first one holds."""
    if then is None or then[1] is None or not 0 < then[0] - since <= ramp:
        return value
    return value + (then[1] - value) * (moment - since) / (then[0] - since)


def _end_of_hold(out: Columns, until: int, held: float, level: int, time: int, value: float | None) -> None:
    """Draw `held` (a sample that holds `until` then at most) up to where it ends before `time`, where the point is `value`."""
    if time > until:
        out.hold(until, held, level)
        out.hold(until + 1, None, 2)
    elif value is None:
        out.hold(time - 1, held, level)
