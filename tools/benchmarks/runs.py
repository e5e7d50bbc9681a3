"""Runs of sequences: events stored, and a page, a rare filter, times per step and the export of 50 000 runs."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from zoneinfo import ZoneInfo

from app.db import Database
from app.historian import run_query as query
from app.historian.events import Delivery, store
from app.historian.run_export import RunExport, RunWish
from app.historian.run_query import Wanted
from app.historian.runs import Kept, Runs
from app.historian.store import DAY
from benchmarks.common import Row, median, milliseconds, thousands

RUNS = 50_000
MACHINES = 5
STEPS = 8
STORED = 1_000
"""Runs whose events are stored one delivery after the other."""
BEGIN = 1_700_000_000_000_000
PAGE = 50
BIT = (0xFFFF, 0, 0xFFFF, 0xFFFF, 0x7FC0, 0)
GENERATE = f"""
WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {RUNS} - 1)
INSERT INTO sequence_run (equipment, boot, sequence, definition, started, seen, outcome, ended, seconds, step, suspensions, suspended,
  stalls, losses, forces, cause, first_out, first_step, first_bit, first_time, first_value, first_together, acknowledged_by, person, missed)
SELECT 'seq' || (i % {MACHINES} + 1), 1, i * 30, 'd', {BEGIN} + i * 1728000, 1, iif(i % 97 = 0, 'aborted', 'done'),
  {BEGIN} + i * 1728000 + 60000000, 60 + (i * 7919 % 1000) / 50.0, {STEPS}, 0, 0, 0, i % 97 = 0, i % 501 = 0, iif(i % 97 = 0, 2, 0),
  iif(i % 97 = 0, 's' || (i % 8 + 1) || '.pressure_ok', ''), NULL, NULL, NULL, NULL, 0, '', '', 0 FROM n
"""
GENERATE_STEPS = f"""
WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {STEPS})
INSERT INTO sequence_step (run, step, key, state, entered, ended, seconds, suspended)
SELECT r.id, i, 's' || i, 'done', r.started + i * 7000000, r.started + i * 7000000 + 7000000, 6 + (r.id * 31 % 200) / 100.0, 0
FROM sequence_run r, n ORDER BY r.id, i
"""


@dataclass(frozen=True, slots=True)
class _Event:
    sequence: int
    time: int
    code: int
    source: int
    value: float
    snapshot: Sequence[int] = BIT
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


def _stored(folder: Path) -> float:
    """Events stored per second as a link delivers them: one run of eight steps after the other."""
    database = Database(folder / "stored.db", "history")
    database.migrate()
    fold = Runs()
    fold._definitions, fold.machines = {"seq1": Kept("d", "{}", (), {})}, frozenset({"seq1"})
    number = 0
    deliveries = []
    for _ in range(STORED):
        told: list[_Event] = []
        for code, step in ((1, 0), *((code, n) for n in range(1, STEPS + 1) for code in (3, 4)), (13, 0)):
            number += 1
            told.append(_Event(number, BEGIN + number * 1_000_000, code, step, 5.0))
        deliveries.append(Delivery("seq1", told))
    began = time.perf_counter()
    for one in deliveries:
        database.run(lambda connection, one=one: store(connection, one, (fold,), BEGIN))  # type: ignore[misc]
    taken = time.perf_counter() - began
    database.close()
    return number / taken


async def measure() -> list[Row]:
    with TemporaryDirectory() as name:
        folder = Path(name)
        stored = _stored(folder)
        database = Database(folder / "history.db", "history")
        database.migrate()
        database.run(lambda connection: connection.exec_driver_sql(GENERATE))
        database.run(lambda connection: connection.exec_driver_sql(GENERATE_STEPS))
        with database.engine.connect() as connection:

            def page(**wanted: object) -> float:
                return _timed(lambda: query.find(connection, Wanted(**wanted), PAGE + 1))  # type: ignore[arg-type]

            newest = query.find(connection, Wanted(), 1)[0]
            deep = (BEGIN + DAY // 2, newest.id // 2)
            first, middle, machine = page(), page(before=deep), page(equipment="seq3")
            rare = page(first_out="s3.pressure_ok")
            both = page(equipment="seq2", first_out="s3.pressure_ok", outcome="aborted")
            forced, choices = page(forced=True), _timed(lambda: query.fallen(connection, "seq2"))
            one = Wanted("seq1")
            times = _timed(lambda: (query.step_times(connection, one), query.run_times(connection, one)), 5)
            bare_page = _timed(
                lambda: connection.exec_driver_sql(
                    f"SELECT * FROM sequence_run ORDER BY id DESC LIMIT {PAGE + 1}"
                ).all()
            )
            bare_scan = _timed(
                lambda: connection.exec_driver_sql(
                    "SELECT count(*) FROM sequence_run WHERE +first_out <> ''"
                ).scalar_one(),
                5,
            )
            bare_times = _timed(
                lambda: connection.exec_driver_sql(
                    "SELECT step, count(*), min(seconds), avg(seconds), max(seconds) FROM sequence_step GROUP BY step"
                ).all(),
                5,
            )
            export = RunExport(RunWish(Wanted(), ZoneInfo("Europe/Zagreb"), steps=[""] * STEPS))
            began = time.perf_counter()
            while not export.done:
                export.read(connection)
            exported = export.rows / (time.perf_counter() - began)
            began = time.perf_counter()
            connection.exec_driver_sql("SELECT * FROM sequence_run r JOIN sequence_step s ON s.run = r.id").all()
            bare_rows = RUNS / (time.perf_counter() - began)
        database.close()
    worst, filtered = max(first, middle, machine), max(rare, both, forced, choices)
    return [
        Row(
            "runs: events stored",
            f"{thousands(stored)} /s",
            "500 /s",
            "",
            None,
            stored >= 500,
            f"one commit per run of {STEPS} steps; 50 sequences of 60 s tell 15 /s",
        ),
        Row(
            f"runs: a page of {thousands(RUNS)}",
            milliseconds(worst),
            "5 ms",
            f"{milliseconds(bare_page)}, SELECT of {PAGE + 1} rows",
            worst / bare_page,
            worst <= 0.005,
            "the slowest of the first page, one in the middle, and one of a machine",
        ),
        Row(
            "runs: a rare filter",
            milliseconds(filtered),
            "50 ms",
            f"{milliseconds(bare_scan)}, count of the same table",
            filtered / bare_scan,
            filtered <= 0.05,
            "the slowest of a first-out, with machine and outcome too, of forced runs, and of what there is to filter by",
        ),
        Row(
            "runs: times per step",
            milliseconds(times),
            "200 ms",
            f"{milliseconds(bare_times)}, GROUP BY of all {thousands(RUNS * STEPS)} steps",
            times / bare_times,
            times <= 0.2,
            f"all {thousands(RUNS // MACHINES)} runs of one machine, {STEPS} steps each",
        ),
        Row(
            "runs: CSV",
            f"{thousands(exported)} runs/s",
            "5 000 /s",
            f"{thousands(bare_rows)} /s, SELECT of runs and steps",
            exported / bare_rows,
            exported >= 5000,
            f"{STEPS} steps each",
        ),
    ]
