"""The history database: storing, a day, a year."""

import sqlite3
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from app.db import Database
from app.historian import query, sealed, store
from app.historian.minutes import Minutes
from app.historian.store import DAY, GAP_AFTER, HOUR
from app.historian.store import Row as Sample
from app.plant.definitions import Point
from benchmarks.common import Row, median, milliseconds, thousands

POINTS = 100
ROWS = 600_000
PORTION = 20_000
PACKED = 6 * 3600
"""Samples of a point that are packed."""
WIDTH = 1600
BEGIN = 1_700_000_000_000_000 // HOUR * HOUR
COARSE = 15_000_000
"""Period of the samples of the year [µs]."""


def _samples(rows: int) -> list[Sample]:
    return [(1 + n % POINTS, BEGIN + n // POINTS * 100_000, n % 977 / 7, None, 0) for n in range(rows)]


def _point(number: int) -> Point:
    return Point(f"d.p{number}", f"d.p{number}", "d", f"p{number}", f"p{number}")


def _store(folder: Path) -> tuple[float, float]:
    rows = _samples(ROWS)
    database = Database(folder / "history.db", "history")
    database.migrate()
    database.run(lambda connection: store.register(connection, [_point(n) for n in range(POINTS)]))
    minutes = Minutes(GAP_AFTER)
    began = time.perf_counter()
    for at in range(0, ROWS, PORTION):
        part = rows[at : at + PORTION]
        database.submit(
            lambda connection, part=part: store.append(connection, part, BEGIN, part[-1][1], minutes)  # type: ignore[misc]
        ).result()
    ours = ROWS / (time.perf_counter() - began)
    schema = database.run(
        lambda connection: connection.exec_driver_sql(
            "SELECT sql FROM sqlite_master WHERE name = 'sample'"
        ).scalar_one()
    )
    database.close()
    bare = sqlite3.connect(folder / "bare.db", isolation_level=None)
    for pragma in ("journal_mode=WAL", "synchronous=NORMAL", "wal_autocheckpoint=8000", "cache_size=-8000"):
        bare.execute(f"PRAGMA {pragma}")
    bare.execute(schema)
    began = time.perf_counter()
    for at in range(0, ROWS, PORTION):
        bare.execute("BEGIN")
        bare.executemany("INSERT INTO sample (point, t, v, s, q) VALUES (?, ?, ?, ?, ?)", rows[at : at + PORTION])
        bare.execute("COMMIT")
    took = time.perf_counter() - began
    bare.close()
    return ours, ROWS / took


def _timed(work: Callable[[], object], times: int = 9) -> float:
    """CPU time of one of them [s]: what the others on the machine do does not count."""
    work()
    taken = []
    for _ in range(times):
        began = time.thread_time()
        work()
        taken.append(time.thread_time() - began)
    return median(taken)


GENERATE = """
WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < ? - 1)
INSERT INTO sample (point, t, v, s, q) SELECT ?, ? + i * ?, abs((i * 7919) % 1000 - 500) / 5.0, NULL, 0 FROM n
"""


def _day(database: Database) -> tuple[float, float, int, str]:
    for number in range(1, 6):  # neighbours in the same table, as in a plant
        database.run(
            lambda connection, number=number: connection.exec_driver_sql(GENERATE, (86_400, number, BEGIN, 1_000_000))  # type: ignore[misc]
        )
    while not database.run(lambda connection: store.roll_up(connection, BEGIN + DAY)):
        pass
    with database.engine.connect() as connection:
        columns = query.columns(connection, 1, BEGIN, BEGIN + DAY, WIDTH)
        ours = _timed(lambda: query.columns(connection, 1, BEGIN, BEGIN + DAY, WIDTH))
        bare = _timed(
            lambda: connection.exec_driver_sql(
                "SELECT t, v FROM sample WHERE point = 1 AND t >= ? AND t < ?", (BEGIN, BEGIN + DAY)
            ).all()
        )
    return ours, bare, len(columns), columns.source


def _year(database: Database) -> tuple[float, float, int, str, float]:
    count = 365 * DAY // COARSE
    database.run(lambda connection: connection.exec_driver_sql(GENERATE, (count, 7, BEGIN, COARSE)))
    began = time.thread_time()
    while not database.run(lambda connection: store.roll_up(connection, BEGIN + 365 * DAY)):
        pass
    rolled = time.thread_time() - began
    with database.engine.connect() as connection:
        columns = query.columns(connection, 7, BEGIN, BEGIN + 365 * DAY, WIDTH)
        ours = _timed(lambda: query.columns(connection, 7, BEGIN, BEGIN + 365 * DAY, WIDTH))
        bare = _timed(
            lambda: connection.exec_driver_sql(
                "SELECT t / ? AS c, min(v), max(v) FROM sample WHERE point = 7 AND t >= ? AND t < ? GROUP BY c",
                (columns.step, BEGIN, BEGIN + 365 * DAY),
            ).all(),
            2,
        )
    return ours, bare, len(columns), columns.source, rolled


def _walk(database: Database) -> int:
    """Ten points that walk in steps of a register, a sample each second for six hours, times as a poll has them."""
    chance, rows = Random(1), list[Sample]()
    for number in range(1, 11):
        value = 5_000
        for second in range(PACKED):
            value += chance.randrange(-5, 6)
            time = BEGIN + second * 1_000_000 + chance.randrange(-300, 301)
            rows.append((number, time, value / 100, None, 0))
    for at in range(0, len(rows), PORTION):
        part = rows[at : at + PORTION]
        database.run(lambda connection, part=part: store.append(connection, part, BEGIN, BEGIN))  # type: ignore[misc]
    return len(rows)


def _packed(folder: Path) -> tuple[float, float, float, float]:
    """Bytes of a sample as a row and packed, CPU time of packing one and of a trend of six packed hours [s]."""
    database = Database(folder / "packed.db", "history")
    database.migrate()
    database.run(lambda connection: store.register(connection, [_point(n) for n in range(10)]))
    empty = database.run(store.used)
    count = _walk(database)
    full = database.run(store.used)
    began = time.process_time()
    point: int | None = 0
    while point is not None:
        point = database.run(partial(sealed.seal, before=BEGIN + DAY, point=point))
    took = time.process_time() - began
    packed = database.run(store.used)
    with database.engine.connect() as connection:
        trend = _timed(lambda: query.columns(connection, 3, BEGIN, BEGIN + 6 * HOUR, WIDTH))
    database.close()
    return (full - empty) / count, (packed - empty) / count, took / count, trend


async def measure() -> list[Row]:
    with TemporaryDirectory() as name:
        folder = Path(name)
        ours, bare = _store(folder)
        row_size, packed_size, packing, packed_trend = _packed(folder)
        database = Database(folder / "trend.db", "history")
        database.migrate()
        database.run(lambda connection: store.register(connection, [_point(n) for n in range(10)]))
        day, raw_day, day_columns, day_source = _day(database)
        year, raw_year, year_columns, source, rolled = _year(database)
        database.close()
    return [
        Row(
            "history: rows stored",
            f"{thousands(ours)} /s",
            "300 000 /s",
            f"{thousands(bare)} /s, sqlite3 executemany",
            ours / bare,
            ours >= 300_000,
            f"{thousands(ROWS)} rows of {POINTS} points in transactions of {thousands(PORTION)}; replacing a row that is there, with the "
            "roll-ups of minutes",
        ),
        Row(
            "history: a sample on the disk, once its hour is packed",
            f"{packed_size:.2f} B",
            "2 B",
            f"{row_size:.1f} B, as a row",
            packed_size / row_size,
            packed_size <= 2.0,
            f"10 points of a register a second, times jittering by 0.3 ms, {thousands(10 * PACKED)} samples; "
            f"packing takes {packing * 1e6:.1f} µs of CPU a sample",
        ),
        Row(
            "six packed hours of 1 s samples as 1 600 px",
            milliseconds(packed_trend),
            "50 ms",
            met=packed_trend <= 0.05,
        ),
        Row(
            "one day of 1 s samples as 1 600 px",
            milliseconds(day),
            "5 ms",
            f"{milliseconds(raw_day)}, SELECT of its 86 400 rows",
            day / raw_day,
            day <= 0.005,
            f"{day_columns} columns from `{day_source}`, as the recorder keeps it",
        ),
        Row(
            "a year as 1 600 px",
            milliseconds(year),
            "50 ms",
            f"{milliseconds(raw_year)}, min and max of {thousands(365 * DAY / COARSE)} rows by SQLite",
            year / raw_year,
            year <= 0.05,
            f"{year_columns} columns from `{source}`; one sample every 15 s; rolling the year up took {rolled:.0f} s",
        ),
    ]
