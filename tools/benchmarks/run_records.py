"""Runs of sequences: events stored, and a page, a rare filter, times per step and the export of 50 000 runs."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from zoneinfo import ZoneInfo

from app.db import Database
from app.historian import record_query as query
from app.historian.events import Delivery, store
from app.historian.record_export import RecordExport, RecordExportSettings
from app.historian.record_query import ANY, RecordFilter
from app.historian.records import RecordFold
from app.historian.store import DAY
from app.plant import types
from app.plant.definitions import Equipment
from app.plant.events import RingEvent
from app.plant.sequence_definition import SequenceDefinition, SequenceStep
from benchmarks.common import DeviceEvent, Row, milliseconds, thousands, timed

TYPE = types.read_type("sequence", ["en"])[0].type
KIND = TYPE.records["run"]
RUNS = 50_000
MACHINES = 5
STEPS = 8
STORED = 1_000
"""Runs whose events are stored one delivery after the other."""
BEGIN = 1_700_000_000_000_000
PAGE = 50
BIT = (0xFFFF, 0, 0xFFFF, 0xFFFF, 0x7FC0, 0)
DEFINITION = SequenceDefinition(
    "d", {"en": "d"}, [SequenceStep(f"s{n}", {"en": f"s{n}"}, 0.5, 30.0) for n in range(1, STEPS + 1)], ()
)
GENERATE = (
    f"""
WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {MACHINES})
INSERT INTO event_machine (id, lasting_id, name) SELECT i, 'seq' || i, 'seq' || i FROM n
""",
    f"""
WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {RUNS} - 1)
INSERT INTO record (machine, kind, number, boot, sequence, begun, entry, outcome, ended, seconds, paused, missed, alarms, definition, key,
  value, fields, memo)
SELECT i % {MACHINES} + 1, 'run', 0, 1, i * 30, {BEGIN} + i * 1728000, 1, iif(i % 97 = 0, 'aborted', 'done'),
  {BEGIN} + i * 1728000 + 60000000, 60 + (i * 7919 % 1000) / 50.0, 0, 0, '', 'd',
  iif(i % 97 = 0, 's' || (i % 8 + 1) || '.pressure_ok', ''), NULL,
  json_object('step', {STEPS}, 'suspensions', 0, 'stalls', 0, 'losses', i % 97 = 0, 'forces', i % 501 = 0, 'cause',
    iif(i % 97 = 0, 'permissive_lost', NULL), 'first_out', iif(i % 97 = 0, 's' || (i % 8 + 1) || '.pressure_ok', NULL)), '' FROM n
""",
    f"""
WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {STEPS})
INSERT INTO record_part (record, number, key, state, begun, ended, seconds, paused)
SELECT r.id, i, 's' || i, 'done', r.begun + i * 7000000, r.begun + i * 7000000 + 7000000, 6 + (r.id * 31 % 200) / 100.0, 0
FROM record r, n ORDER BY r.id, i
""",
    "INSERT INTO definition (id, text) VALUES ('d', '{}')",
)


def _stored(folder: Path) -> float:
    """Events stored per second as a link delivers them: one run of eight steps after the other."""
    database = Database(folder / "stored.db", "history")
    database.migrate()
    fold = RecordFold([Equipment("seq1", TYPE, "hall", 1, {"en": "seq1"}, "line", {}, [], sequence=DEFINITION)])
    number = 0
    deliveries = []
    for _ in range(STORED):
        told: list[RingEvent] = []
        for code, step in ((1, 0), *((code, n) for n in range(1, STEPS + 1) for code in (3, 4)), (13, 0)):
            number += 1
            told.append(DeviceEvent(number, BEGIN + number * 1_000_000, code, step, 5.0, BIT))
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
        for sentence in GENERATE:
            database.run(lambda connection, sentence=sentence: connection.exec_driver_sql(sentence))  # type: ignore[misc]
        with database.engine.connect() as connection:

            def page(**wanted: object) -> float:
                return timed(lambda: query.find(connection, KIND, RecordFilter(**wanted), PAGE + 1))  # type: ignore[arg-type]

            newest = query.find(connection, KIND, RecordFilter(), 1)[0]
            deep = (BEGIN + DAY // 2, newest.id // 2)
            first, middle, machine = page(), page(before=deep), page(equipment="seq3")
            rare = page(given={"first_out": "s3.pressure_ok"})
            both = page(equipment="seq2", given={"first_out": "s3.pressure_ok"}, outcome="aborted")
            forced, choices = page(given={"forced": ANY}), timed(lambda: query.choices(connection, KIND, "seq2"))
            one = RecordFilter("seq1")
            times = timed(
                lambda: (query.part_times(connection, KIND, one), query.times(connection, KIND, one, "done")), 5
            )
            bare_page = timed(
                lambda: connection.exec_driver_sql(f"SELECT * FROM record ORDER BY id DESC LIMIT {PAGE + 1}").all()
            )
            bare_scan = timed(
                lambda: connection.exec_driver_sql("SELECT count(*) FROM record WHERE +key <> ''").scalar_one(),
                5,
            )
            bare_times = timed(
                lambda: connection.exec_driver_sql(
                    "SELECT number, count(*), min(seconds), avg(seconds), max(seconds) FROM record_part GROUP BY number"
                ).all(),
                5,
            )
            export = RecordExport(
                RecordExportSettings(RecordFilter(), ZoneInfo("Europe/Zagreb"), kind=KIND, names=[""] * STEPS)
            )
            began = time.perf_counter()
            while not export.done:
                export.read(connection)
            exported = export.rows / (time.perf_counter() - began)
            began = time.perf_counter()
            connection.exec_driver_sql("SELECT * FROM record r JOIN record_part s ON s.record = r.id").all()
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
