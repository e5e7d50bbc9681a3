"""Passages of products: events stored, and a page, a rare filter, the count and the export of 100 000 passages."""

import sqlite3
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from zoneinfo import ZoneInfo

from app.db import Database
from app.historian import passage_query as query
from app.historian.events import Delivery, store
from app.historian.passage_export import PassageExport, PassageWish
from app.historian.passage_query import Wanted
from app.historian.passages import Passages
from app.historian.store import DAY
from benchmarks.common import Row, median, milliseconds, thousands

PASSAGES = 100_000
MACHINES = 50
STEPS = 8
STORED = 4_000
"""Products whose events are stored one delivery after the other."""
BEGIN = 1_700_000_000_000_000
PAGE = 50
GENERATE = f"""
WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {PASSAGES} - 1)
INSERT INTO passage (equipment, boot, product, entered, entry, length, corrections, greatest, alarms, outcome, ended, missed)
SELECT 'c' || (i % {MACHINES} + 1), 1, i / {MACHINES} + 1, {BEGIN} + i * 864000, 1, 20 + i % 40, 6, (i * 7919 % 1000) / 250.0,
       iif(i % 97 = 0, ' 10 ', ''), iif(i % 9973 = 0, 'lost', 'unloaded'), {BEGIN} + i * 864000 + 40000000, 0 FROM n
"""
GENERATE_STEPS = f"""
WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {STEPS} - 1)
INSERT INTO passage_step (passage, boot, sequence, time, code, source, value, second, second_value, person, reason)
SELECT p.id, 1, p.id * {STEPS} + i, p.entered + i * 1000000, iif(i = 0, 1, 3), i / 2 + 1, 0.25, 0, NULL, '', '' FROM passage p, n
"""


@dataclass(frozen=True, slots=True)
class _Event:
    sequence: int
    time: int
    code: int
    source: int
    value: float
    snapshot: Sequence[int]
    boot: int = 1
    request: int = 0


def _timed(work: Callable[[], object], times: int = 15) -> float:
    work()
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return median(taken)


def _stored(folder: Path) -> tuple[float, float]:
    """Events stored per second as links deliver them, and rows of the same steps by bare sqlite3."""
    database = Database(folder / "stored.db", "history")
    database.migrate()
    deliveries = []
    for product in range(1, STORED + 1):
        base = product * 10
        events = [
            _Event(base + n, BEGIN + base * 100_000 + n, code, n, 0.5, (0, product, 0, 0, 0, 0))
            for n, code in enumerate((1, 2, 3, 4, 3, 4, 3, 4, 5))
        ]
        deliveries.append(Delivery("c1", events))
    fold = Passages()
    fold.machines = frozenset({"c1"})
    began = time.perf_counter()
    for at in range(0, STORED, 4):
        database.run(
            lambda connection, part=deliveries[at : at + 4]: [store(connection, one, (fold,), BEGIN) for one in part]  # type: ignore[misc]
        )
    ours = 9 * STORED / (time.perf_counter() - began)
    schema = database.run(
        lambda connection: connection.exec_driver_sql(
            "SELECT sql FROM sqlite_master WHERE name = 'passage_step'"
        ).scalar_one()
    )
    database.close()
    bare = sqlite3.connect(folder / "bare.db", isolation_level=None)
    for pragma in ("journal_mode=WAL", "synchronous=NORMAL"):
        bare.execute(f"PRAGMA {pragma}")
    bare.execute(schema)
    began = time.perf_counter()
    for product in range(0, STORED, 4):
        bare.execute("BEGIN")
        for n in range(36):
            bare.execute(
                "INSERT INTO passage_step VALUES (?, 1, ?, ?, 3, 1, 0.5, 0, NULL, '', '')", (product, n, BEGIN)
            )
        bare.execute("COMMIT")
    took = time.perf_counter() - began
    bare.close()
    return ours, 9 * STORED / took


async def measure() -> list[Row]:
    with TemporaryDirectory() as name:
        folder = Path(name)
        ours, bare = _stored(folder)
        database = Database(folder / "history.db", "history")
        database.migrate()
        database.run(lambda connection: connection.exec_driver_sql(GENERATE))
        database.run(lambda connection: connection.exec_driver_sql(GENERATE_STEPS))
        with database.engine.connect() as connection:

            def page(**wanted: object) -> float:
                return _timed(lambda: query.find(connection, Wanted(**wanted), PAGE + 1))  # type: ignore[arg-type]

            newest = query.find(connection, Wanted(), 1)[0]
            deep = (BEGIN + DAY // 2, newest.id // 2)
            first, middle, machine = page(), page(before=deep), page(equipment="c7")
            rare, alarms = page(outcome="lost"), page(alarm="any", correction=3.0)
            count = _timed(lambda: query.count(connection, Wanted(alarm="any"), PASSAGES + 1), 5)
            bare_page = _timed(
                lambda: connection.exec_driver_sql(f"SELECT * FROM passage ORDER BY id DESC LIMIT {PAGE + 1}").all()
            )
            bare_scan = _timed(
                lambda: connection.exec_driver_sql("SELECT count(*) FROM passage WHERE alarms <> ''").scalar_one(), 5
            )
            export = PassageExport(PassageWish(Wanted(), ZoneInfo("Europe/Zagreb")))
            began = time.perf_counter()
            while not export.done:
                export.read(connection)
            exported = export.rows / (time.perf_counter() - began)
            began = time.perf_counter()
            connection.exec_driver_sql("SELECT * FROM passage p JOIN passage_step s ON s.passage = p.id").all()
            bare_rows = PASSAGES / (time.perf_counter() - began)
        database.close()
    worst = max(first, middle, machine)
    return [
        Row(
            "products: events stored",
            f"{thousands(ours)} /s",
            "2 000 /s",
            f"{thousands(bare)} /s, sqlite3 INSERT of their steps",
            ours / bare,
            ours >= 2000,
            "commits of 4 products of 9 events; 50 conveyors at full speed tell about 100 /s",
        ),
        Row(
            f"products: a page of {thousands(PASSAGES)}",
            milliseconds(worst),
            "5 ms",
            f"{milliseconds(bare_page)}, SELECT of {PAGE + 1} rows",
            worst / bare_page,
            worst <= 0.005,
            "the slowest of the first page, one in the middle, and one of a machine",
        ),
        Row(
            "products: a rare filter",
            milliseconds(max(rare, alarms, count)),
            "50 ms",
            f"{milliseconds(bare_scan)}, count of the same table",
            max(rare, alarms, count) / bare_scan,
            max(rare, alarms, count) <= 0.05,
            "the slowest of 11 lost products, of alarms with a correction above 3 mm, and of counting all with an alarm",
        ),
        Row(
            "products: CSV",
            f"{thousands(exported)} passages/s",
            "5 000 /s",
            f"{thousands(bare_rows)} /s, SELECT of passages and steps",
            exported / bare_rows,
            exported >= 5000,
            f"{STEPS} steps each",
        ),
    ]
