"""What a version before the records stored is read as it was: the same CSV files to the letter, then and after what came later."""

import hashlib
import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from sqlalchemy import Connection

from app.db import Database
from app.historian import record_export, record_query
from app.historian.record_export import RecordExport, RecordExportSettings
from app.historian.record_query import RecordFilter
from app.historian.records import RecordFold
from app.plant.definitions import Plant
from app.plant.events import Ring
from app.plant.loader import read_plant
from app.plant.texts import Texts
from tests.historian import books
from tests.historian.former import plant as former
from tests.historian.rings import BEGIN, Event
from tests.virtual import inline

FOLDER = Path(former.__file__).parent
SHA256: dict[str, str] = json.loads((FOLDER / "sha256.json").read_text())
LATER = json.loads((FOLDER / "later.json").read_text())


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Plant:
    found, problems = read_plant(former.write(tmp_path_factory.mktemp("former") / "plant"))
    assert found is not None, problems
    return found


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory, plant: Plant) -> Iterator[dict[str, Database]]:
    """The database as it was then, and with what came later; both brought to the newest schema."""
    made = {}
    for stage in ("then", "later"):
        path = tmp_path_factory.mktemp(stage) / "history.db"
        with closing(sqlite3.connect(path)) as connection:
            connection.executescript((FOLDER / "history.sql").read_text("utf-8"))
        database = made[stage] = Database(path, "history", inline)
        database.migrate()
    made["later"].run(lambda connection: tell(connection, plant))
    yield made
    for database in made.values():
        database.close()


def tell(connection: Connection, plant: Plant) -> None:
    fold = RecordFold(plant.equipment.values())
    for equipment, portions in LATER.items():
        met = next((events for events, _ in portions if events), [[0] * 7])[
            -1
        ]  # as a program that starts finds its ring
        ring = Ring(object(), boots=met[6], newest=met[0])
        for events, lost in portions:
            told = [
                Event(q, t, c, s, float("nan") if v is None else v, tuple(w), b, ring=ring)
                for q, t, c, s, v, w, b in events
            ]
            if told or lost:
                books.store(connection, fold, equipment, told, lost)


def exported(connection: Connection, plant: Plant, kind: str, equipment: str, locale: str) -> bytes:
    texts, of = Texts.read(plant), record_export.kinds(plant)[kind]
    asked = RecordExportSettings(
        RecordFilter(equipment),
        ZoneInfo("Europe/Zagreb"),
        locale,
        kind=of,
        plant="Linija",
        person="ana",
        created=BEGIN,
        **record_export.words(texts, plant, of, locale),
    )
    if kind == "passage":
        asked = replace(asked, bom=locale == "hr", filters=f"equipment={equipment}", simulated=True)
    made = RecordExport(replace(asked, names=record_export.names(plant, of, equipment, asked.label)))
    found = b""
    while not made.done:
        found += made.read(connection)
    return found


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", sorted(SHA256))
def test_an_export_is_the_same_to_the_letter(stages: dict[str, Database], plant: Plant, name: str) -> None:
    stage, kind, *equipment, locale = name.split(".")
    found = stages[stage].run(lambda c: exported(c, plant, kind, "".join(equipment), locale))
    file = FOLDER / f"{name}.csv"
    if file.is_file():  # the same once more, so that a difference can be read
        assert found.decode().splitlines()[1:-1] == file.read_text("utf-8").splitlines()[1:-1]
    lines = found.splitlines(keepends=True)
    assert hashlib.sha256(b"".join(lines[1:-1])).hexdigest() == SHA256[name]


def test_every_event_is_there_once_and_belongs_to_what_it_was_of(stages: dict[str, Database]) -> None:
    def look(connection: Connection) -> None:
        def one(sentence: str) -> int:
            return int(connection.exec_driver_sql(sentence).scalar_one())

        with closing(sqlite3.connect(":memory:")) as old:
            old.executescript((FOLDER / "history.sql").read_text("utf-8"))
            (steps,) = old.execute("SELECT count(*) FROM passage_step").fetchone()
            (of_runs,) = old.execute("SELECT count(*) FROM sequence_event").fetchone()
            (forces,) = old.execute("SELECT count(*) FROM sequence_force").fetchone()
            people = old.execute(
                "SELECT count(*) FROM (SELECT equipment, s.boot, s.sequence FROM passage_step s JOIN passage p ON p.id = s.passage "
                "WHERE person <> '' UNION SELECT equipment, e.boot, e.sequence FROM sequence_event e JOIN sequence_run r ON r.id = e.run "
                "WHERE e.person <> '' UNION SELECT equipment, boot, sequence FROM sequence_force WHERE person <> '')"
            ).fetchone()[0]
        assert one("SELECT count(*) FROM record_event") == steps + of_runs + forces
        assert one("SELECT count(*) FROM event") == one("SELECT count(DISTINCT event) FROM record_event")
        assert one("SELECT count(*) FROM (SELECT DISTINCT machine, boot, sequence, time FROM event)") == one(
            "SELECT count(*) FROM event"
        )
        assert one("SELECT count(*) FROM event WHERE person <> ''") == people

    stages["then"].run(look)


def test_forces_have_their_permissive_and_person(stages: dict[str, Database], plant: Plant) -> None:
    kind = record_export.kinds(plant)["force"]

    def look(connection: Connection) -> None:
        found = record_query.find(connection, kind, RecordFilter("seq1"), 100)
        asked = record_query.people(connection, [one.id for one in found])
        assert {one.outcome for one in found} <= set(kind.outcomes)
        assert all(str(one.fields["permissive"]).endswith(".pressure_ok") for one in found)
        assert any(asked.values())

    stages["then"].run(look)


def test_a_history_without_products_and_runs_is_brought_up_too(tmp_path: Path) -> None:
    path = tmp_path / "history.db"
    script = (FOLDER / "history.sql").read_text("utf-8")
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(
            "\n".join(line for line in script.splitlines() if not line.startswith('INSERT INTO "') or "alembic" in line)
        )
    database = Database(path, "history", inline)
    database.migrate()
    assert database.run(lambda c: c.exec_driver_sql("SELECT count(*) FROM record").scalar_one()) == 0
    database.close()
