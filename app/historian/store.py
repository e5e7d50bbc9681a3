"""The history database: append rows, roll them up, cut what is too old or too much.

Everything here runs on the writer thread of `history.db` (or on a reader thread, where it says so) with an open connection. Sums over
samples are left to SQLite: it works on them without holding up the interpreter, and so the event loop.
"""

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Select, Table, bindparam, delete, func, insert, select, update

from app.historian import dialect, events, records, sealed
from app.historian.dialect import Statement, in_order, replacing, updating
from app.historian.hours import HOURS
from app.historian.minutes import MINUTE as MINUTE
from app.historian.minutes import Minutes, of_samples, write
from app.historian.minutes import Row as Row
from app.historian.tables import hour, mark, minute, point, run, sample, volume
from app.plant.definitions import Point
from app.tags.quality import NO_DATA

HOUR = 3_600_000_000
DAY = 86_400_000_000
"""[µs]"""
HEARTBEAT = 600_000_000
"""A sample at least this often while the recorder runs [µs]."""
RAMP = 1_000_000
"""A value that moves on a straight line is stored at least so often [µs]; between, only the line tells where it was."""
GAP_AFTER = HEARTBEAT + 30_000_000
"""A value holds until the next sample, but no longer than this: after it nothing was recorded [µs]."""
ROLL_UP_AT_ONCE = 6 * HOUR
"""Longest time that is rolled up in one transaction [µs], so that catching up does not hold up the writer."""
POINTS_AT_ONCE = 50
"""Points that are rolled up by one statement: what it sorts stays in memory."""
SETTLED = 10_000_000
"""A minute is rolled up so long after it is over [µs]: samples wait in memory, and the last one suppressed comes with the next."""
CUT_AT_ONCE = 100_000
"""Samples of one point that are removed in one transaction."""


@dataclass(frozen=True, slots=True)
class Size:
    """How full the history is."""

    used: int
    """Bytes in use, free pages of the file left out."""
    free: int
    """Bytes left on the disk."""
    oldest: int | None
    """Time of the oldest sample, event, passage of a product or run [µs UTC]."""
    rows_today: int
    """Rows stored in the last 24 h."""
    grown_today: int
    """Bytes by which the database has grown in the last 24 h; what was cut away does not count against it."""
    since: int | None
    """From when on the two are known, at most 24 h ago [µs UTC]."""


def register(connection: Connection, points: Iterable[Point]) -> dict[str, int]:
    """Numbers of `points` by lasting id; new ones are added, changed names and units are taken over."""
    known = _known(connection)
    told = {item.id: (item.name, item.unit, item.kind.value) for item in points}
    new = [(id, *said) for id, said in told.items() if id not in known]
    changed = [(*said, id) for id, said in told.items() if id in known and known[id][1:] != said]
    if changed:
        CHANGE.rows(connection, changed)
    if new:
        ADD.rows(connection, new)
        known = _known(connection)
    return {id: known[id][0] for id in told}


def _known(connection: Connection) -> dict[str, tuple[int, str, str, str]]:
    """Number, name, unit and kind of every point by lasting id."""
    rows = POINTS(connection)
    return {lasting_id: (number, name, unit, kind) for lasting_id, number, name, unit, kind in rows}


def numbers(connection: Connection) -> dict[str, int]:
    """Number of every point by lasting id."""
    return {lasting_id: said[0] for lasting_id, said in _known(connection).items()}


POINTS = Statement(select(point.c.lasting_id, point.c.id, point.c.name, point.c.unit, point.c.kind))
ADD = Statement(insert(point), "lasting_id", "name", "unit", "kind")
CHANGE = Statement(update(point).where(point.c.lasting_id == bindparam("of")), "name", "unit", "kind", "of")


@dataclass(frozen=True, slots=True)
class Closed:
    """What a run found open."""

    samples: int
    """Samples that close something."""
    ahead: tuple[int, ...]
    """Where runs end that ended behind the start of this one, which tells there anew what is so [µs UTC]."""


def begin_run(connection: Connection, start: int) -> Closed:
    """Note that the recorder runs since `start` [µs UTC], and close what the run before left open.

    A run that was killed could not say that its values hold no longer: every point whose last sample is not bad gets a bad one,
    directly after the last sign of life. After a clock that was set back this is done more than once: before `start`, at the end of what
    lies behind it, where the last run ended, and where those did that had got further than it.
    """
    before, alive = ALIVE(connection, until=start).scalar() or 0, ALIVE(connection, until=FOREVER).scalar() or 0
    latest = LATEST(connection).first()
    ended = latest.alive if latest is not None else 0
    rows: list[Row] = [
        (number, max(before, time) + 1, None, None, NO_DATA) for number, time in LEFT_OPEN(connection, until=start)
    ]
    if alive >= start:
        rows += [
            (number, max(alive, time) + 1, None, None, NO_DATA)
            for number, time in LEFT_OPEN(connection, until=FOREVER)
            if time >= start
        ]
    for end in {ended, *ENDS(connection, now=ended).scalars()} - {0, before, alive}:
        rows += [(number, end + 1, None, None, NO_DATA) for number, _ in LEFT_OPEN(connection, until=end + 1)]
    ends = {row[1] for row in rows if row[1] >= start} | {*ahead(connection, start - 1)}
    append(connection, rows, start, start)
    return Closed(len(rows), tuple(sorted(ends)))


def ahead(connection: Connection, now: int) -> list[int]:
    """Where runs end that ended later than `now`, by clocks that were ahead [µs UTC]."""
    return [end + 1 for end in ENDS(connection, now=now).scalars()]


def broken_off(connection: Connection, start: int, ended: Iterable[tuple[int, int]]) -> int:
    """Note where what the recorder that began at `start` said broke off, and went on; when it went on last [µs UTC]."""
    for end, goes_on in ended:
        LIVED(connection, start=start, alive=end)
        start = goes_on
    return start


FOREVER = (1 << 63) - 1
"""Behind every time [µs UTC]."""
_earlier = sample.alias()
_newest = (
    select(func.max(_earlier.c.t))
    .where(_earlier.c.point == point.c.id, _earlier.c.t < bindparam("until"))
    .correlate(point)
    .scalar_subquery()
)
ALIVE = Statement(select(func.max(run.c.alive)).where(run.c.alive < bindparam("until")))
"""The last sign of life before a time."""
ENDS = Statement(select(run.c.alive).where(run.c.alive > bindparam("now")).order_by(run.c.alive))
LAST_RUN = "run"
"""The mark that says since when the run runs that was alive last: after a clock that was set back it is not the latest one."""
LATEST = Statement(
    select(run.c.start, run.c.alive).join_from(run, mark, mark.c.t == run.c.start).where(mark.c.name == LAST_RUN)
)
"""From when to when the run was seen that was alive last: after a clock that was ahead, earlier runs end later."""
LEFT_OPEN = Statement(
    select(point.c.id, sample.c.t)
    .select_from(in_order(point, sample, sample.c.point == point.c.id, sample.c.t == _newest))
    .where(sample.c.q.bitwise_and(3) != 2)
    .order_by(point.c.id)
)
"""Points whose last sample before a time is not bad, and its time."""


def append(connection: Connection, rows: Sequence[Row], start: int, alive: int, minutes: Minutes | None = None) -> None:
    """Store `rows` and that the recorder that began at `start` was alive at `alive` [µs UTC].

    A later row of the same point and time wins, so writing rows twice does no harm. Rows older than what is rolled up set the marks
    back, and their minutes and hours are rolled up again; of minutes, only what `minutes` does not know.
    """
    if rows:
        oldest = min(row[1] for row in rows)
        left = oldest if minutes is None else minutes.take(connection, rows, alive)
        PUT.rows(connection, rows)
        for table, width, time in (("minute", MINUTE, left), ("hour", HOUR, oldest)):
            if time is not None:
                SET_BACK(connection, of=table, t=time // width * width, than=time)
        STORED(connection, t=alive // HOUR * HOUR, rows=len(rows), grown=0)
    LIVED(connection, start=start, alive=alive)
    SET(connection, name=LAST_RUN, t=start)


PUT = Statement(replacing(sample), "point", "t", "v", "s", "q")
SET_BACK = Statement(update(mark).where(mark.c.name == bindparam("of"), mark.c.t > bindparam("than")), "t")
STORED = Statement(updating(volume, ["t"], lambda new: {"rows": volume.c.rows + new.rows}), "t", "rows", "grown")
LIVED = Statement(
    updating(run, ["start"], lambda new: {"alive": dialect.greatest(run.c.alive, new.alive)}), "start", "alive"
)


def roll_up(connection: Connection, now: int, minutes: Minutes | None = None) -> bool:
    """Write roll-ups of minutes and hours that are over at `now` [µs UTC], at most 6 hours of them; True when all are written.

    It continues where it stopped, so a killed server loses none. A minute without a sample has no row: the value before holds. Minutes
    that `minutes` knows are taken from there, the others from samples.
    """
    done = True
    reached = now
    for table, width, source in (("minute", MINUTE, "sample"), ("hour", HOUR, "minute")):
        begin = MARK(connection, name=table).scalar()
        known = table == "minute" and minutes is not None and minutes.covers(begin)
        if begin is None:
            oldest = _oldest(connection, source) if source == "minute" else _first_sample(connection)
            begin = now if oldest is None else oldest
        begin = begin // width * width
        end = reached // width * width if known else min(reached // width * width, begin + ROLL_UP_AT_ONCE)
        done = done and end == reached // width * width
        if begin < end and not known:
            for first, last in _portions(connection):
                span = {"begin": begin, "end": end, "gap": GAP_AFTER, "first": first, "last": last}
                if source == "sample":
                    sealed.unseal(connection, first, last, begin - GAP_AFTER, end)
                    write(connection, of_samples(connection, **span))
                else:
                    HOURS(connection, width=width, **span)
        reached = max(begin, end)
        if table == "minute" and minutes is not None:
            (minutes.write if known else minutes.skip)(connection, reached)
        SET(connection, name=table, t=reached)
    return done


MARK = Statement(select(mark.c.t).where(mark.c.name == bindparam("name")))
SET = Statement(updating(mark, ["name"], lambda new: {"t": new.t}), "name", "t")


def size(connection: Connection, path: Path, now: int) -> Size:
    """How full the history is; on a reader thread."""
    return Size(
        used(connection),
        shutil.disk_usage(path.parent).free,
        _first(connection),
        *DAYS(connection, after=now - DAY).one(),
    )


def used(connection: Connection) -> int:
    """Bytes in use."""
    return dialect.used(connection)


def note_growth(connection: Connection, now: int, grown: int) -> None:
    """Note that the database has grown by `grown` bytes; forget what is older than two days."""
    GROWN(connection, t=now // HOUR * HOUR, rows=0, grown=grown)
    FORGET(connection, before=now - 2 * DAY)


DAYS = Statement(
    select(
        func.coalesce(func.sum(volume.c.rows), 0), func.coalesce(func.sum(volume.c.grown), 0), func.min(volume.c.t)
    ).where(volume.c.t > bindparam("after"))
)
GROWN = Statement(updating(volume, ["t"], lambda new: {"grown": volume.c.grown + new.grown}), "t", "rows", "grown")
FORGET = Statement(delete(volume).where(volume.c.t < bindparam("before")))


def cut(connection: Connection, before: int, at_once: int = CUT_AT_ONCE) -> tuple[int, bool]:
    """Remove what is older than the hour of `before` [µs UTC], at most `at_once` samples per point, events and records.

    Returns how many of all these were removed, and whether all are.
    """
    before = before // HOUR * HOUR
    removed, done = 0, True
    for number in NUMBERS(connection).scalars().all():
        packed, open_from = sealed.cut(connection, number, before, at_once)
        removed += packed
        bound = BOUND(connection, number=number, before=before, at_once=at_once).scalar()
        limit = min(time for time in (before, bound, open_from) if time is not None)
        done = done and bound is None and open_from is None
        for table, width in (("minute", MINUTE), ("hour", HOUR)):
            CUT[table](connection, number=number, before=limit // width * width)
        removed += CUT["sample"](connection, number=number, before=limit).rowcount
    for part in (events, records):
        part_removed, part_done = part.cut(connection, before, at_once)
        removed, done = removed + part_removed, done and part_done
    if done:
        CUT_RUNS(connection, before=before)
    return removed, done


NUMBERS = Statement(select(point.c.id).order_by(point.c.id))
BOUND = Statement(
    select(sample.c.t)
    .where(sample.c.point == bindparam("number"), sample.c.t < bindparam("before"))
    .order_by(sample.c.t)
    .limit(1)
    .offset(bindparam("at_once"))
)
CUT = {
    table.name: Statement(delete(table).where(table.c.point == bindparam("number"), table.c.t < bindparam("before")))
    for table in (sample, minute, hour)
}
CUT_RUNS = Statement(delete(run).where(run.c.alive < bindparam("before")))


def _portions(connection: Connection) -> list[tuple[int, int]]:
    """Numbers of all points as ranges of `POINTS_AT_ONCE`."""
    numbers = NUMBERS(connection).scalars().all()
    portions = (numbers[index : index + POINTS_AT_ONCE] for index in range(0, len(numbers), POINTS_AT_ONCE))
    return [(part[0], part[-1]) for part in portions]


def _first(connection: Connection) -> int | None:
    """Time of the oldest thing that is kept: a sample, an event, a record."""
    sample = _first_sample(connection)
    return min(
        (time for time in (sample, *(part.oldest(connection) for part in (events, records))) if time is not None),
        default=None,
    )


def _first_sample(connection: Connection) -> int | None:
    times = (_oldest(connection, "sample"), sealed.oldest(connection))
    return min((time for time in times if time is not None), default=None)


def _oldest(connection: Connection, table: str) -> int | None:
    """Time of the oldest row of `sample` or `minute`: one look into the index per point."""
    oldest: int | None = OLDEST[table](connection).scalar()
    return oldest


def _least_of_each(table: Table) -> Select[*tuple[Any, ...]]:
    each = select(func.min(table.c.t)).where(table.c.point == point.c.id).correlate(point).scalar_subquery()
    times = select(each.label("t")).select_from(point).subquery()
    return select(func.min(times.c.t))


OLDEST = {table.name: Statement(_least_of_each(table)) for table in (sample, minute)}
