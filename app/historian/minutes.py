"""Roll-ups of minutes, kept while the samples are stored: what was just written need not be read back.

One for each point, for the minute under way. What it cannot know (samples from before it began, or in the wrong order) is rolled up from
stored samples, in the same way (`of_samples`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import BigInteger, Connection, bindparam, func, select

from app.historian import sealed
from app.historian.dialect import Statement, in_order, replacing
from app.historian.tables import minute, point, sample

MINUTE = 60_000_000
"""[µs]"""
Row = tuple[int, int, float | None, str | None, int]
"""point number, time [µs UTC], number, text, quality word"""
MOST_DONE = 20
"""Minutes over per point that wait to be written; with more of them they are forgotten, and rolled up from samples."""
RollUp = tuple[
    int, int, float | None, float | None, int, float | None, int, float | None, int, float | None, int, int, int, int
]

LATEST = 2**62
Held = tuple[int, float | None, int, bool]
"""time, number, quality word of a sample; whether it has a value"""


@dataclass(slots=True)
class Minute:
    """A minute of one point as it grows; `count` 0: only what held when it began is known."""

    number: int
    gap: int
    """How long a value holds at most [µs]."""
    last_t: int
    last: float | None
    last_q: int
    holds: bool
    """The last sample has a value."""
    begin: int = 0
    end: int = 0
    low: float | None = None
    high: float | None = None
    first_t: int = 0
    first: float | None = None
    good: int = 0
    held: int = 0
    area: float | None = None
    count: int = 0
    level: int = 0
    written: bool = True

    def open(self, time: int) -> None:
        """Begin the minute of `time`."""
        self.begin = time // MINUTE * MINUTE
        self.end = self.begin + MINUTE
        self.low = self.high = self.first = self.area = None
        self.first_t = self.good = self.held = self.count = self.level = 0

    def take(self, time: int, value: float | None, is_text: bool, quality: int) -> None:
        """The next sample; it lies in this minute."""
        if self.holds:
            self.weigh(time)
        if value is not None:
            if self.low is None or value < self.low:
                self.low = value
            if self.high is None or value > self.high:
                self.high = value
        if not self.count:
            self.first_t, self.first = time, value
        level = quality & 3
        if level > self.level:
            self.level = level
        self.count += 1
        self.last_t, self.last, self.last_q = time, value, quality
        self.holds = level < 2 and (value is not None or is_text)
        self.written = False

    def weigh(self, time: int) -> None:
        """The last sample held until `time`, which is in this minute, or its end."""
        self.held, self.good, self.area = self._weighed(time)

    def row(self) -> RollUp:
        """What is known of it when it is over."""
        held, good, area = self._weighed(self.end)
        mean = area / good if good and area is not None else None
        return (
            self.number, self.begin, self.low, self.high, self.first_t, self.first, self.last_t, self.last, self.last_q, mean, good, held,
            self.count, self.level,
        )  # fmt: skip

    def _weighed(self, time: int) -> tuple[int, int, float | None]:
        since, until = max(self.last_t, self.begin), min(time, self.last_t + self.gap)
        if not self.holds or until <= since:
            return self.held, self.good, self.area
        elapsed, good = until - since, self.last_q & 3 == 0
        area = self.area
        if self.last is not None:
            area = (area or 0.0) + (self.last * elapsed if good else 0.0)
        return self.held + elapsed, self.good + elapsed * good, area


class Minutes:
    """The minutes under way of all points. It is used on the writer thread only."""

    def __init__(self, gap: int) -> None:
        """`gap`: how long a value holds at most [µs]."""
        self.since: int | None = None
        """From this minute on all samples were seen; None: from none."""
        self.reached: int | None = None
        """Up to when roll-ups were written when this was last asked for."""
        self._gap = gap
        self._latest = 0
        self._cells: dict[int, Minute] = {}
        self._done: list[RollUp] = []

    def forget(self) -> None:
        """What was seen does not count: another database, say."""
        self.since = self.reached = None
        self._cells.clear()
        self._done.clear()

    def take(self, connection: Connection, rows: Sequence[Row], now: int) -> int | None:
        """Samples that are about to be stored; the oldest time of those that are left to the roll-up from samples, None: of none.

        As long as it is not known up to when roll-ups are written, all are left to it.

        Of a minute that was written already the new roll-up is written at once, so that a server killed now leaves none that is wrong.
        """
        self._latest = max(now, self._latest, max(row[1] for row in rows))
        if self.since is None:
            self._begin_after(self._latest)
        if len(self._done) > MOST_DONE * max(1, len(self._cells)):
            self._begin_after(self._latest)
        cells, since, reached = self._cells, self.since or 0, self.reached or 0
        left: int | None = None
        late: dict[int, Minute] = {}
        before: dict[int, Held] = {}
        for number, time, value, text, quality in rows:
            cell = cells.get(number)
            if cell is None:
                if time < since:
                    left = time if left is None else min(left, time)
                    if number not in before or before[number][0] < time:
                        before[number] = (time, value, quality, value is not None or text is not None)
                    continue
                cell = self._cell(connection, number, before.get(number))
                if cell.last_t >= since:  # of a clock that was ahead
                    return self._again_after(cell.last_t, rows)
            if time <= cell.last_t:
                return self._again_after(cell.last_t, rows)
            if time >= cell.end:
                if not cell.written:
                    self._done.append(cell.row())
                cell.open(time)
            cell.take(time, value, text is not None, quality)
            if time < reached:
                late[number] = cell
        if late:
            write(connection, [*self._done, *(cell.row() for cell in late.values())])
            self._done.clear()
        return min(row[1] for row in rows) if self.reached is None else left

    def covers(self, mark: int | None) -> bool:
        """Whether all is known from `mark` on, up to which roll-ups are written: nobody has set it back, and nothing is missing."""
        return self.since is not None and mark is not None and mark == self.reached and mark >= self.since

    def write(self, connection: Connection, end: int) -> None:
        """Write the minutes that are over at `end`."""
        over = [cell for cell in self._cells.values() if not cell.written and cell.end <= end]
        write(connection, [*self._done, *(cell.row() for cell in over)])
        for cell in over:
            cell.written = True
        self._done.clear()
        self.reached = end

    def skip(self, connection: Connection, end: int) -> None:
        """Minutes before `end` were rolled up from samples."""
        self._done = [row for row in self._done if row[1] >= end]
        for cell in self._cells.values():
            cell.written = cell.written or cell.end <= end
        self.reached = end

    def _again_after(self, time: int, rows: Sequence[Row]) -> int:
        """What comes in the wrong order is left to the roll-up from samples, and so is all until a minute after `time`."""
        self._begin_after(max(self._latest, time))
        return min(row[1] for row in rows)

    def _begin_after(self, time: int) -> None:
        self.forget()
        self.since = (time // MINUTE + 1) * MINUTE

    def _cell(self, connection: Connection, number: int, before: Held | None) -> Minute:
        """A point whose first sample is seen now: what held until then, stored or about to be (`before`)."""
        row = sealed.last(connection, number, LATEST)
        stored: Held = (0, None, 2, False) if row is None else (row[0], row[1], row[3], row[1:3] != (None, None))
        time, value, quality, valid = stored if before is None or before[0] < stored[0] else before
        cell = self._cells[number] = Minute(number, self._gap, time, value, quality, valid and quality & 3 < 2)
        return cell


def of_samples(connection: Connection, *, first: int, last: int, begin: int, end: int, gap: int) -> list[RollUp]:
    """Minutes from `begin` to `end` [µs UTC], both on the minute, of the points `first` to `last`, from their stored samples."""
    span = {"begin": begin, "end": end, "gap": gap, "first": first, "last": last}
    found: list[RollUp] = []
    cell: Minute | None = None
    for number, time, value, is_text, quality in SAMPLES(connection, **span):
        if cell is None or cell.number != number:
            if cell is not None and cell.count:
                found.append(cell.row())
            cell = Minute(number, gap, 0, None, 2, False)
        if time < begin:  # what held when they began
            cell.last_t, cell.last, cell.last_q = time, value, quality
            cell.holds = quality & 3 < 2 and (value is not None or bool(is_text))
            continue
        if time >= cell.end:
            if cell.count:
                found.append(cell.row())
            cell.open(time)
        cell.take(time, value, bool(is_text), quality)
    if cell is not None and cell.count:
        found.append(cell.row())
    return found


_begin = bindparam("begin", type_=BigInteger)
_former = sample.alias()
_held = (
    select(func.max(_former.c.t))
    .where(
        _former.c.point == point.c.id, _former.c.t < _begin, _former.c.t >= _begin - bindparam("gap", type_=BigInteger)
    )
    .correlate(point)
    .scalar_subquery()
)
_spanned = in_order(
    point,
    sample,
    sample.c.point == point.c.id,
    sample.c.t >= func.coalesce(_held, _begin),
    sample.c.t < bindparam("end"),
)
SAMPLES = Statement(
    select(point.c.id, sample.c.t, sample.c.v, sample.c.s.is_not(None), sample.c.q)
    .select_from(_spanned)
    .where(point.c.id.between(bindparam("first"), bindparam("last")))
    .order_by(point.c.id, sample.c.t)
)
"""Samples of a span, and of each point the one that held when it began."""


def write(connection: Connection, rows: Sequence[RollUp]) -> None:
    """Write roll-ups of minutes; one that is there is replaced."""
    if rows:
        WRITE.rows(connection, rows)


WRITE = Statement(replacing(minute), *minute.c.keys())
