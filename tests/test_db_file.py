"""A database file that is removed, exchanged or written over under a running server is found, and mended as far as that goes."""

import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from app.db import Database
from app.db_file import Incident, Loss, Mended, OpenFile
from tests.databases import TABLE, Name
from tests.virtual import inline


@pytest.fixture
def opened(tmp_path: Path, empty_databases: Path) -> Iterator[Callable[[Name], Database]]:
    made: list[Database] = []

    def make(name: Name) -> Database:
        (tmp_path / "data").mkdir(exist_ok=True)
        database = Database(Path(shutil.copy(empty_databases / f"{name}.db", tmp_path / "data")), name, inline)
        database.migrate()
        made.append(database)
        return database

    yield make
    for one in made:
        one.close()


def put(database: Database, key: str) -> None:
    database.run(
        lambda connection: connection.exec_driver_sql(f"INSERT INTO {TABLE[database.name]} VALUES (?, 1)", (key,))
    )


def keys(path: Path, name: Name) -> set[str]:
    """What another program finds in the file."""
    column = TABLE[name].split("(")[1].split(",")[0]
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as connection:
        return {row[0] for row in connection.execute(f"SELECT {column} FROM {TABLE[name].split()[0]}")}


def another(path: Path, name: Name) -> Path:
    """A whole database of the same kind that holds the key `other`."""
    other = Path(shutil.copy(path, path.with_name("another.db")))
    with closing(sqlite3.connect(other)) as connection:
        connection.execute("PRAGMA application_id = 4711")
        connection.execute(f"DELETE FROM {TABLE[name].split()[0]}")
        connection.execute(f"INSERT INTO {TABLE[name]} VALUES ('other', 1)")
        connection.commit()
    return other


def removed(database: Database) -> None:
    database.path.unlink()


def removed_with_journals(database: Database) -> None:
    for path in database.path.parent.glob(f"{database.path.name}*"):
        path.unlink()


def without_log(database: Database) -> None:
    database.path.with_name(f"{database.path.name}-wal").unlink()


def without_index(database: Database) -> None:
    database.path.with_name(f"{database.path.name}-shm").unlink()


def moved_away(database: Database) -> None:
    database.path.replace(database.path.with_name("elsewhere.db"))


def replaced(database: Database) -> None:
    another(database.path, database.name).replace(database.path)


def replaced_by_rubbish(database: Database) -> None:
    rubbish = database.path.with_name("rubbish")
    rubbish.write_bytes(b"rubbish" * 10_000)
    rubbish.replace(database.path)


def replaced_by_nothing(database: Database) -> None:
    database.path.unlink()
    database.path.touch()


def emptied(database: Database) -> None:
    os.truncate(database.path, 0)


def truncated(database: Database) -> None:
    os.truncate(database.path, database.path.stat().st_size // 2)


def overwritten_by_rubbish(database: Database) -> None:
    database.path.write_bytes(b"\0" * database.path.stat().st_size)


def overwritten_in_its_head(database: Database) -> None:
    with database.path.open("r+b") as file:
        file.write(b"rubbish rubbish!")


def overwritten(database: Database) -> None:
    shutil.copyfile(another(database.path, database.name), database.path)


FAULTS: list[tuple[Callable[[Database], None], Loss, tuple[Mended, set[str]], tuple[Mended, str]]] = [
    # fault, what it is, history: what is done and what is in it, pogon: what is done and where the foreign file is
    (removed, Loss.REMOVED, (Mended.RESTORED, {"kept", "later"}), (Mended.RESTORED, "")),
    (removed_with_journals, Loss.REMOVED, (Mended.RESTORED, {"kept", "later"}), (Mended.RESTORED, "")),
    (moved_away, Loss.REMOVED, (Mended.RESTORED, {"kept", "later"}), (Mended.RESTORED, "")),
    (without_log, Loss.JOURNAL, (Mended.RESTORED, {"kept", "later"}), (Mended.RESTORED, "")),
    (without_index, Loss.JOURNAL, (Mended.RESTORED, {"kept", "later"}), (Mended.RESTORED, "")),
    (replaced, Loss.REPLACED, (Mended.ADOPTED, {"other", "later"}), (Mended.RESTORED, "pogon.db.other-1")),
    (replaced_by_rubbish, Loss.REPLACED, (Mended.FRESH, {"later"}), (Mended.RESTORED, "pogon.db.other-1")),
    (replaced_by_nothing, Loss.REPLACED, (Mended.FRESH, {"later"}), (Mended.RESTORED, "pogon.db.other-1")),
    (emptied, Loss.EMPTIED, (Mended.FRESH, {"later"}), (Mended.NOTHING, "")),
    (truncated, Loss.TRUNCATED, (Mended.FRESH, {"later"}), (Mended.NOTHING, "")),
    (overwritten_by_rubbish, Loss.OVERWRITTEN, (Mended.FRESH, {"later"}), (Mended.NOTHING, "")),
    (overwritten_in_its_head, Loss.OVERWRITTEN, (Mended.FRESH, {"later"}), (Mended.NOTHING, "")),
    (overwritten, Loss.OVERWRITTEN, (Mended.ADOPTED, {"other", "later"}), (Mended.NOTHING, "")),
]


@pytest.mark.parametrize(("fault", "loss", "outcome"), [(row[0], row[1], row[2]) for row in FAULTS])
async def test_a_lost_history_is_found_and_what_comes_later_is_in_the_file_under_its_name(
    opened: Callable[[Name], Database],
    fault: Callable[[Database], None],
    loss: Loss,
    outcome: tuple[Mended, set[str]],
) -> None:
    database = opened("history")
    put(database, "kept")
    assert await database.check() is None
    fault(database)
    incident = await database.check()
    assert incident is not None
    assert (incident.loss, incident.mended) == (loss, outcome[0])
    assert await database.check() is None
    await database.write(lambda connection: connection.exec_driver_sql("INSERT INTO mark VALUES ('later', 1)"))
    assert keys(database.path, "history") == outcome[1]
    database.close()
    assert keys(database.path, "history") == outcome[1]
    if incident.aside:
        assert (database.path.parent / incident.aside).stat().st_size


@pytest.mark.parametrize(("fault", "loss", "outcome"), [(row[0], row[1], row[3]) for row in FAULTS])
async def test_people_and_audit_stay_those_of_the_running_server(
    opened: Callable[[Name], Database],
    fault: Callable[[Database], None],
    loss: Loss,
    outcome: tuple[Mended, str],
) -> None:
    database = opened("pogon")
    put(database, "kept")
    assert await database.check() is None
    fault(database)
    for _ in range(2):  # what cannot be mended stays told
        incident = await database.check()
        assert incident is not None
        assert (incident.loss, incident.mended, incident.aside) == (loss, *outcome)
        assert bool(incident.reason) is (incident.mended is Mended.NOTHING)
        if incident.mended is not Mended.NOTHING:
            break
    if outcome[0] is Mended.RESTORED:
        put(database, "later")
        database.close()
        assert keys(database.path, "pogon") == {"kept", "later"}
        assert loss is Loss.JOURNAL or database.path.stat().st_mode & 0o777 == 0o600
    if outcome[1] and fault is replaced:
        assert keys(database.path.parent / outcome[1], "pogon") == {"other"}


@pytest.mark.parametrize("name", ["pogon", "history"])
async def test_use_as_it_is_meant_is_no_loss(opened: Callable[[Name], Database], name: Name) -> None:
    database = opened(name)
    for number in range(300):
        put(database, f"{number}-{'x' * 500}")
    assert await database.check() is None
    with closing(sqlite3.connect(database.path)) as beside:  # another program reads, writes, checkpoints and packs
        beside.execute(f"DELETE FROM {TABLE[name].split()[0]}")
        beside.commit()
        beside.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        assert await database.check() is None
        beside.execute("VACUUM")
        beside.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        assert await database.check() is None
    assert await database.check() is None
    copied = database.path.with_name("copy.db")
    with closing(sqlite3.connect(database.path)) as old, closing(sqlite3.connect(copied)) as new:
        old.backup(new)
    assert await database.check() is None


async def test_each_database_has_an_id_that_it_keeps(opened: Callable[[Name], Database], tmp_path: Path) -> None:
    database = opened("history")
    id = database.id
    assert id
    await database.write(lambda connection: connection.exec_driver_sql("INSERT INTO mark VALUES ('a', 1)"))
    database.close()
    again = Database(database.path, "history", inline)
    again.migrate()
    assert again.id == id
    again.close()
    other = Database(tmp_path / "other.db", "history", inline)
    other.migrate()
    assert other.id not in (0, id)
    other.close()


async def test_a_file_that_cannot_be_mended_now_is_mended_when_it_can(
    opened: Callable[[Name], Database], monkeypatch: pytest.MonkeyPatch
) -> None:
    database = opened("history")
    put(database, "kept")
    replaced(database)

    def refuse() -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(database, "migrate", refuse)
        incident = await database.check()
        assert incident == Incident(
            "history.db", Loss.REPLACED, Mended.NOTHING, "", incident.reason if incident else ""
        )
        assert "No space left" in incident.reason
        assert await database.check() == incident
    incident = await database.check()
    assert incident is not None
    assert incident.mended is not Mended.NOTHING
    assert await database.check() is None
    put(database, "later")
    assert keys(database.path, "history") >= {"later"}


async def test_a_folder_that_may_not_be_looked_into_is_told_once_in_the_log(
    opened: Callable[[Name], Database], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    database = opened("history")

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    for times in (1, 2):
        with monkeypatch.context() as patch:
            patch.setattr(OpenFile, "look", refuse)
            patch.setattr(database, "_restored", refuse)
            for _ in range(3):
                incident = await database.check()
                assert incident is not None and incident.mended is Mended.NOTHING
        assert caplog.text.count("database not found") == times
        assert await database.check() is None


async def test_a_missing_file_is_not_made_by_who_reads_it(tmp_path: Path) -> None:
    database = Database(tmp_path / "history.db", "history", inline)
    with pytest.raises(Exception, match="unable to open"):
        await database.read(lambda connection: connection.exec_driver_sql("SELECT 1").scalar())
    assert not database.path.exists()
    database.close()
