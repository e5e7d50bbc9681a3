"""The history database: append rows, roll them up, cut what is too old or too much.

Everything here runs on the writer thread of `history.db` (or on a reader thread, where it says so) with an open connection. Sums over
samples are left to SQLite: it works on them without holding up the interpreter, and so the event loop.
"""

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, text

from app.historian import events, records, sealed
from app.historian.minutes import MINUTE as MINUTE
from app.historian.minutes import Minutes, of_samples, write
from app.historian.minutes import Row as Row
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
        connection.exec_driver_sql("UPDATE point SET name = ?, unit = ?, kind = ? WHERE lasting_id = ?", changed)
    if new:
        connection.exec_driver_sql("INSERT INTO point (lasting_id, name, unit, kind) VALUES (?, ?, ?, ?)", new)
        known = _known(connection)
    return {id: known[id][0] for id in told}


def _known(connection: Connection) -> dict[str, tuple[int, str, str, str]]:
    """Number, name, unit and kind of every point by lasting id."""
    rows = connection.exec_driver_sql("SELECT lasting_id, id, name, unit, kind FROM point")
    return {lasting_id: (number, name, unit, kind) for lasting_id, number, name, unit, kind in rows}


def begin_run(connection: Connection, start: int) -> int:
    """Note that the recorder runs since `start` [µs UTC], and close what the run before left open.

    A run that was killed could not say that its values hold no longer: every point whose last sample is not bad gets a bad one,
    directly after the last sign of life. Returns the number of these.
    """
    alive = connection.execute(text("SELECT alive FROM run ORDER BY start DESC LIMIT 1")).scalar()
    rows: list[Row] = []
    if alive is not None:
        rows = [
            (number, max(alive, time) + 1, None, None, NO_DATA)
            for number, time in connection.exec_driver_sql(LEFT_OPEN)
        ]
    append(connection, rows, start, start)
    return len(rows)


LEFT_OPEN = """
SELECT p.id, s.t FROM point p CROSS JOIN sample s ON s.point = p.id
 AND s.t = (SELECT max(b.t) FROM sample b WHERE b.point = p.id)
WHERE s.q & 3 <> 2 ORDER BY p.id
"""
"""Points whose last sample is not bad, and its time."""


def append(connection: Connection, rows: Sequence[Row], start: int, alive: int, minutes: Minutes | None = None) -> None:
    """Store `rows` and that the recorder that began at `start` was alive at `alive` [µs UTC].

    A later row of the same point and time wins, so writing rows twice does no harm. Rows older than what is rolled up set the marks
    back, and their minutes and hours are rolled up again; of minutes, only what `minutes` does not know.
    """
    if rows:
        oldest = min(row[1] for row in rows)
        left = oldest if minutes is None else minutes.take(connection, rows, alive)
        connection.exec_driver_sql(
            "INSERT OR REPLACE INTO sample (point, t, v, s, q) VALUES (?, ?, ?, ?, ?)", list(rows)
        )
        for table, width, time in (("minute", MINUTE, left), ("hour", HOUR, oldest)):
            if time is not None:
                connection.exec_driver_sql(
                    "UPDATE mark SET t = ? WHERE name = ? AND t > ?", (time // width * width, table, time)
                )
        connection.exec_driver_sql(
            "INSERT INTO volume (t, rows, grown) VALUES (?, ?, 0) ON CONFLICT (t) DO UPDATE SET rows = rows + excluded.rows",
            (alive // HOUR * HOUR, len(rows)),
        )
    connection.exec_driver_sql(
        "INSERT INTO run (start, alive) VALUES (?, ?) ON CONFLICT (start) DO UPDATE SET alive = max(alive, excluded.alive)",
        (start, alive),
    )


def roll_up(connection: Connection, now: int, minutes: Minutes | None = None) -> bool:
    """Write roll-ups of minutes and hours that are over at `now` [µs UTC], at most 6 hours of them; True when all are written.

    It continues where it stopped, so a killed server loses none. A minute without a sample has no row: the value before holds. Minutes
    that `minutes` knows are taken from there, the others from samples.
    """
    done = True
    reached = now
    for table, width, source in (("minute", MINUTE, "sample"), ("hour", HOUR, "minute")):
        begin = connection.execute(text("SELECT t FROM mark WHERE name = :n"), {"n": table}).scalar()
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
                    connection.execute(text(HOURS), {"w": width, **span})
        reached = max(begin, end)
        if table == "minute" and minutes is not None:
            (minutes.write if known else minutes.skip)(connection, reached)
        connection.execute(
            text("INSERT INTO mark (name, t) VALUES (:n, :t) ON CONFLICT (name) DO UPDATE SET t = excluded.t"),
            {"n": table, "t": reached},
        )
    return done


HOURS = """
INSERT OR REPLACE INTO hour (point, t, low, high, first_t, first, last_t, last, last_q, mean, good, held, count, level)
WITH RECURSIVE
part AS MATERIALIZED (
    SELECT m.* FROM point p CROSS JOIN minute m ON m.point = p.id AND m.t >= :begin AND m.t < :end
    WHERE p.id >= :first AND p.id <= :last
    UNION ALL
    SELECT m.* FROM point p CROSS JOIN minute m ON m.point = p.id
     AND m.t = (SELECT max(b.t) FROM minute b WHERE b.point = p.id AND b.t < :begin AND b.t >= :begin - :gap - 60000000)
    WHERE p.id >= :first AND p.id <= :last
),
span AS (
    SELECT p.point, p.t + 60000000 AS t, last AS v, last_q AS q, k.kind = 'text' AS is_text,
           min(lead(p.t, 1, :end) OVER (PARTITION BY p.point ORDER BY p.t), last_t + :gap) AS e
    FROM part p JOIN point k ON k.id = p.point
),
piece (point, t, e, v, good) AS (
    SELECT point, max(t, :begin), e, v, q & 3 = 0 FROM span
    WHERE (v IS NOT NULL OR is_text) AND q & 3 < 2 AND e > max(t, :begin)
    UNION ALL
    SELECT point, (t / :w + 1) * :w, e, v, good FROM piece WHERE (t / :w + 1) * :w < e
),
weight AS MATERIALIZED (
    SELECT point, m, sum(held) AS held, sum(good) AS good, sum(area) AS area FROM (
        SELECT point, t / :w * :w AS m, d AS held, d * good AS good, v * d * good AS area
        FROM (SELECT point, t, v, good, min(e, (t / :w + 1) * :w) - t AS d FROM piece)
        UNION ALL
        SELECT point, t / :w * :w, held, good, mean * good FROM part WHERE t >= :begin
    ) GROUP BY 1, 2
),
seen AS (
    SELECT point, t / :w * :w AS m, min(low) AS low, max(high) AS high, min(t) AS t0, max(t) AS t1, sum(count) AS n,
           max(level) AS level
    FROM part WHERE t >= :begin GROUP BY 1, 2
)
SELECT seen.point, seen.m, seen.low, seen.high, f.first_t, f.first, l.last_t, l.last, l.last_q,
       iif(weight.good > 0, area / weight.good, NULL), weight.good, weight.held, n, seen.level
FROM seen
JOIN minute f ON f.point = seen.point AND f.t = t0
JOIN minute l ON l.point = seen.point AND l.t = t1
JOIN weight ON weight.point = seen.point AND weight.m = seen.m
"""


def size(connection: Connection, path: Path, now: int) -> Size:
    """How full the history is; on a reader thread."""
    day = connection.exec_driver_sql(
        "SELECT coalesce(sum(rows), 0), coalesce(sum(grown), 0), min(t) FROM volume WHERE t > ?", (now - DAY,)
    ).one()
    return Size(used(connection), shutil.disk_usage(path.parent).free, _first(connection), *day)


def used(connection: Connection) -> int:
    """Bytes in use."""
    pages, free, page = (
        int(connection.exec_driver_sql(f"PRAGMA {name}").scalar_one())
        for name in ("page_count", "freelist_count", "page_size")
    )
    return (pages - free) * page


def note_growth(connection: Connection, now: int, grown: int) -> None:
    """Note that the database has grown by `grown` bytes; forget what is older than two days."""
    connection.exec_driver_sql(
        "INSERT INTO volume (t, rows, grown) VALUES (?, 0, ?) ON CONFLICT (t) DO UPDATE SET grown = grown + excluded.grown",
        (now // HOUR * HOUR, grown),
    )
    connection.exec_driver_sql("DELETE FROM volume WHERE t < ?", (now - 2 * DAY,))


def cut(connection: Connection, before: int, at_once: int = CUT_AT_ONCE) -> tuple[int, bool]:
    """Remove what is older than the hour of `before` [µs UTC], at most `at_once` samples per point, events and records.

    Returns how many of all these were removed, and whether all are.
    """
    before = before // HOUR * HOUR
    removed, done = 0, True
    for (number,) in connection.exec_driver_sql("SELECT id FROM point").all():
        packed, open_from = sealed.cut(connection, number, before, at_once)
        removed += packed
        bound = connection.exec_driver_sql(
            "SELECT t FROM sample WHERE point = ? AND t < ? ORDER BY t LIMIT 1 OFFSET ?", (number, before, at_once)
        ).scalar()
        limit = min(time for time in (before, bound, open_from) if time is not None)
        done = done and bound is None and open_from is None
        for table, width in (("minute", MINUTE), ("hour", HOUR)):
            connection.exec_driver_sql(
                f"DELETE FROM {table} WHERE point = ? AND t < ?", (number, limit // width * width)
            )
        removed += connection.exec_driver_sql("DELETE FROM sample WHERE point = ? AND t < ?", (number, limit)).rowcount
    for part in (events, records):
        part_removed, part_done = part.cut(connection, before, at_once)
        removed, done = removed + part_removed, done and part_done
    if done:
        connection.exec_driver_sql("DELETE FROM run WHERE alive < ?", (before,))
    return removed, done


def _portions(connection: Connection) -> list[tuple[int, int]]:
    """Numbers of all points as ranges of `POINTS_AT_ONCE`."""
    numbers = connection.exec_driver_sql("SELECT id FROM point ORDER BY id").scalars().all()
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
    oldest: int | None = connection.exec_driver_sql(
        f"SELECT min(t) FROM (SELECT (SELECT min(t) FROM {table} WHERE point = p.id) AS t FROM point p)"
    ).scalar()
    return oldest
