"""Passages of products: events stored, and a page, a rare filter, the count and the export of 100 000 passages."""

import sqlite3
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
from benchmarks.common import DeviceEvent, Row, milliseconds, thousands, timed

TYPE = types.read_type("conveyor", ["en"])[0].type
KIND = TYPE.records["passage"]
PASSAGES = 100_000
MACHINES = 50
STEPS = 8
STORED = 4_000
"""Products whose events are stored one delivery after the other."""
BEGIN = 1_700_000_000_000_000
PAGE = 50
GENERATE = (
    f"""
WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {MACHINES})
INSERT INTO event_machine (id, lasting_id, name) SELECT i, 'c' || i, 'c' || i FROM n
""",
    f"""
WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {PASSAGES} - 1)
INSERT INTO record (machine, kind, number, boot, sequence, begun, entry, outcome, ended, seconds, paused, missed, alarms, definition, key,
  value, fields, memo)
SELECT i % {MACHINES} + 1, 'passage', i / {MACHINES} + 1, 1, i * {STEPS}, {BEGIN} + i * 864000, 1,
  iif(i % 9973 = 0, 'lost', 'unloaded'), {BEGIN} + i * 864000 + 40000000, NULL, 0, 0, iif(i % 97 = 0, ' 10 ', ''), '', '',
  (i * 7919 % 1000) / 250.0, json_object('length', 20 + i % 40, 'corrections', 6, 'greatest', (i * 7919 % 1000) / 250.0), '' FROM n
""",
    f"""
WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {STEPS} - 1)
INSERT INTO event (id, machine, boot, sequence, time, code, source, value, words, request, person, reason)
SELECT r.id * {STEPS} + i, r.machine, 1, r.id * {STEPS} + i, r.begun + i * 1000000, iif(i = 0, 1, 3), i / 2 + 1, 0.25, x'', 0, '', ''
FROM record r, n
""",
    f"INSERT INTO record_event (record, event) SELECT id / {STEPS}, id FROM event",
)


def _stored(folder: Path) -> tuple[float, float]:
    """Events stored per second as links deliver them, and rows of the same steps by bare sqlite3."""
    database = Database(folder / "stored.db", "history")
    database.migrate()
    deliveries = []
    for product in range(1, STORED + 1):
        base = product * 10
        events: list[RingEvent] = [
            DeviceEvent(base + n, BEGIN + base * 100_000 + n, code, n, 0.5, (0, product, 0, 0, 0, 0))
            for n, code in enumerate((1, 2, 3, 4, 3, 4, 3, 4, 5))
        ]
        deliveries.append(Delivery("c1", events))
    fold = RecordFold([Equipment("c1", TYPE, "hall", 1, {"en": "c1"}, "line", {}, [])])
    began = time.perf_counter()
    for at in range(0, STORED, 4):
        database.run(
            lambda connection, part=deliveries[at : at + 4]: [store(connection, one, (fold,), BEGIN) for one in part]  # type: ignore[misc]
        )
    ours = 9 * STORED / (time.perf_counter() - began)
    schema = database.run(
        lambda connection: connection.exec_driver_sql(
            "SELECT sql FROM sqlite_master WHERE name = 'event' AND type = 'table'"
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
                "INSERT INTO event (machine, boot, sequence, time, code, source, value, words, request, person, reason) "
                "VALUES (1, 1, ?, ?, 3, 1, 0.5, x'000000000001', 0, '', '')",
                (product * 9 + n, BEGIN),
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
        for sentence in GENERATE:
            database.run(lambda connection, sentence=sentence: connection.exec_driver_sql(sentence))  # type: ignore[misc]
        with database.engine.connect() as connection:

            def page(**wanted: object) -> float:
                return timed(lambda: query.find(connection, KIND, RecordFilter(**wanted), PAGE + 1))  # type: ignore[arg-type]

            newest = query.find(connection, KIND, RecordFilter(), 1)[0]
            deep = (BEGIN + DAY // 2, newest.id // 2)
            first, middle, machine = page(), page(before=deep), page(equipment="c7")
            rare, alarms = page(outcome="lost"), page(given={"alarm": ANY, "correction": 3.0})
            count = timed(lambda: query.count(connection, KIND, RecordFilter(given={"alarm": ANY}), PASSAGES + 1), 5)
            bare_page = timed(
                lambda: connection.exec_driver_sql(f"SELECT * FROM record ORDER BY id DESC LIMIT {PAGE + 1}").all()
            )
            bare_scan = timed(
                lambda: connection.exec_driver_sql("SELECT count(*) FROM record WHERE alarms <> ''").scalar_one(), 5
            )
            export = RecordExport(RecordExportSettings(RecordFilter(), ZoneInfo("Europe/Zagreb"), kind=KIND))
            began = time.perf_counter()
            while not export.done:
                export.read(connection)
            exported = export.rows / (time.perf_counter() - began)
            began = time.perf_counter()
            connection.exec_driver_sql(
                "SELECT * FROM record r JOIN record_event b ON b.record = r.id JOIN event e ON e.id = b.event"
            ).all()
            bare_rows = PASSAGES / (time.perf_counter() - began)
        database.close()
    worst = max(first, middle, machine)
    return [
        Row(
            "passages: events stored",
            f"{thousands(ours)} /s",
            "2 000 /s",
            f"{thousands(bare)} /s, sqlite3 INSERT of the same",
            ours / bare,
            ours >= 2000,
            "commits of 4 products of 9 events; 50 conveyors at full speed tell about 100 /s",
        ),
        Row(
            f"passages: a page of {thousands(PASSAGES)}",
            milliseconds(worst),
            "5 ms",
            f"{milliseconds(bare_page)}, SELECT of {PAGE + 1} rows",
            worst / bare_page,
            worst <= 0.005,
            "the slowest of the first page, one in the middle, and one of a machine",
        ),
        Row(
            "passages: a rare filter",
            milliseconds(max(rare, alarms, count)),
            "50 ms",
            f"{milliseconds(bare_scan)}, count of the same table",
            max(rare, alarms, count) / bare_scan,
            max(rare, alarms, count) <= 0.05,
            "the slowest of 11 lost products, of alarms with a correction above 3 mm, and of counting all with an alarm",
        ),
        Row(
            "passages: CSV",
            f"{thousands(exported)} passages/s",
            "5 000 /s",
            f"{thousands(bare_rows)} /s, SELECT of passages and events",
            exported / bare_rows,
            exported >= 5000,
            f"{STEPS} steps each",
        ),
    ]
