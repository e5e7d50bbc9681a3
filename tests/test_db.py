"""The databases: a new file is made and the newest schema is recognised without Alembic; any other is left to it."""

import asyncio
import shutil
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, Literal

import pytest
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine, event

from app.db import LONG_READERS, PAGE_SIZE, Database, _heads, alembic_config
from app.errors import StorageError
from tests.conftest import ROOT
from tests.migrated import by_migrations
from tests.virtual import inline

NAMES: tuple[Literal["pogon", "history"], ...] = ("pogon", "history")


@pytest.mark.parametrize("name", NAMES)
def test_the_newest_revision_is_the_one_that_alembic_names(name: str) -> None:
    script = ScriptDirectory.from_config(alembic_config(name, "sqlite://"))
    assert _heads(name) == set(script.get_heads())


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", NAMES)
def test_a_new_file_and_one_of_the_newest_schema_are_opened_without_alembic(
    tmp_path: Path, name: Literal["pogon", "history"]
) -> None:
    """It would stay in the memory of a plant's first run."""
    file = tmp_path / f"{name}.db"
    start = (
        "import sys; from pathlib import Path; from app.db import Database; "
        f"Database(Path({str(file)!r}), {name!r}).migrate(); sys.exit('alembic' in sys.modules)"
    )
    for _ in ("new", "again"):
        assert subprocess.run([sys.executable, "-c", start], cwd=ROOT, check=False).returncode == 0
    assert file.stat().st_size > 20_000


def parts(database: Database) -> dict[str, object]:
    """Table → its kind, its columns, and the rest that its statement says; index, trigger or view → its statement. In no order."""

    def read(connection: Connection) -> dict[str, object]:
        found: dict[str, object] = {}
        for kind, of, text in connection.exec_driver_sql("SELECT type, name, coalesce(sql, '') FROM sqlite_master"):
            words = " ".join(text.replace('"', "").split())
            said = words.partition("(")[2].removesuffix(")").split(",")
            found[of] = (kind, sorted(part.strip() for part in said) if kind == "table" else words)
        for _, of, *rest in connection.exec_driver_sql("PRAGMA table_list"):
            found[f"{of}: kind"] = [rest[0], *rest[2:]]
            found[f"{of}: columns"] = sorted(
                map(tuple, (row[1:] for row in connection.exec_driver_sql(f"PRAGMA table_xinfo({of})")))
            )
        return found

    return database.run(read)


@pytest.mark.parametrize("name", NAMES)
def test_a_new_file_is_what_its_migrations_make(tmp_path: Path, name: Literal["pogon", "history"]) -> None:
    migrated, made = by_migrations(tmp_path / "migrated.db", name), Database(tmp_path / "made.db", name, inline)
    try:
        made._create()
        made.migrate()
        assert parts(made) == parts(migrated)
        assert len(parts(made)) > 20
        made.migrate()
    finally:
        migrated.close()
        made.close()


@pytest.mark.parametrize("version", [None, "9999"])
def test_an_empty_file_is_filled_and_one_of_a_newer_program_is_refused(tmp_path: Path, version: str | None) -> None:
    file = tmp_path / "history.db"
    database = Database(file, "history", inline)
    if version is None:
        file.touch()
        database.migrate()
        assert database.run(lambda connection: connection.exec_driver_sql("SELECT count(*) FROM sample").scalar()) == 0
    else:
        database.migrate()
        database.run(lambda connection: connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'"))
        with pytest.raises(StorageError, match="9999"):
            database.migrate()
    database.close()


@pytest.mark.parametrize("name", NAMES)
def test_a_new_file_has_pages_of_its_size_and_an_older_one_goes_on_as_it_is(
    tmp_path: Path, name: Literal["pogon", "history"]
) -> None:
    for file, size in ((tmp_path / "new.db", PAGE_SIZE[name]), (tmp_path / "old.db", 8192)):
        if size == 8192:
            with closing(sqlite3.connect(file)) as connection:
                connection.execute("PRAGMA page_size=8192")
                connection.execute("PRAGMA user_version=1")
        database = Database(file, name)
        database.migrate()
        assert database.run(lambda connection: connection.exec_driver_sql("PRAGMA page_size").scalar()) == size
        assert database.id
        database.close()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("former", ["none", "base", "0001"])
def test_killed_at_any_statement_of_a_migration_it_is_migrated_by_the_next_start(
    tmp_path: Path, name: Literal["pogon", "history"], former: str
) -> None:
    """What the disk has before each statement is put by: that is what a kill leaves there."""
    (tmp_path / "left").mkdir()
    file = tmp_path / "left" / f"{name}.db"
    if former == "none":
        Database(file, name, inline)._create()
    else:
        by_migrations(file, name, former).close()
    left: list[Path] = []

    def put_by(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        if statement.split()[0] in ("CREATE", "ALTER", "DROP", "INSERT", "UPDATE", "DELETE"):
            left.append(tmp_path / str(len(left)))
            shutil.copytree(file.parent, left[-1])

    event.listen(Engine, "before_cursor_execute", put_by)
    try:
        newest = schema(file, name)
    finally:
        event.remove(Engine, "before_cursor_execute", put_by)
    assert len(left) > 20
    for folder in left:
        assert schema(folder / file.name, name) == newest, folder.name


def schema(file: Path, name: Literal["pogon", "history"]) -> list[str]:
    """What is in the file after a start."""
    database = Database(file, name, inline)
    try:
        database.migrate()
        return database.run(
            lambda c: list(c.exec_driver_sql("SELECT coalesce(sql, name) FROM sqlite_master ORDER BY 1").scalars())
        )
    finally:
        database.close()


@pytest.fixture
def medium(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a history, to which nobody can write: whoever runs the tests may be root, who can."""
    folder = tmp_path / "medium"
    folder.mkdir()
    made = Database(folder / "history.db", "history", inline)
    made.migrate()
    made.close()
    assert [path.name for path in folder.iterdir()] == ["history.db"]
    monkeypatch.setattr("app.db.os.access", lambda path, _mode: Path(path) != folder)
    return folder


def test_a_copy_on_a_medium_that_is_read_only_is_read_as_it_lies_there(medium: Path) -> None:
    copy = Database(medium / "history.db", "history", inline, only_read=True)
    assert copy.run(lambda connection: connection.exec_driver_sql("SELECT count(*) FROM sample").scalar()) == 0
    assert [path.name for path in medium.iterdir()] == ["history.db"], "SQLite would put a journal beside it"
    with pytest.raises(StorageError, match="readonly"):
        copy.run(lambda connection: connection.exec_driver_sql("DELETE FROM sample") and None)
    copy.close()


def test_a_copy_whose_newest_rows_are_in_its_journal_says_where_they_are(medium: Path) -> None:
    (medium / "history.db-wal").write_bytes(b"rows")
    copy = Database(medium / "history.db", "history", inline, only_read=True)
    with pytest.raises(
        StorageError, match=r"history\.db: its newest rows are in history\.db-wal, and .*medium cannot be"
    ):
        copy.run(lambda connection: connection.exec_driver_sql("SELECT count(*) FROM sample").scalar())
    copy.close()


def _no_database(file: Path) -> None:
    file.write_bytes(b"\0garbage" * 4096)


def _damaged_inside(file: Path) -> None:
    """The header is good; the first table is not."""
    with file.open("r+b") as opened:
        opened.seek(100)
        opened.write(b"\xff" * 800)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("fault", [_no_database, _damaged_inside])
def test_no_connection_to_a_file_that_was_refused_stays_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: Literal["pogon", "history"], fault: Callable[[Path], None]
) -> None:
    """Closed later it would remove the journal of the file that took this one's place."""
    opened: list[sqlite3.Connection] = []
    connect = sqlite3.connect

    def noted(*args: Any, **options: Any) -> sqlite3.Connection:
        opened.append(connect(*args, **options))
        return opened[-1]

    file = tmp_path / f"{name}.db"
    database = Database(file, name, inline)
    database.migrate()
    database.close()
    fault(file)
    monkeypatch.setattr(sqlite3, "connect", noted)
    refused = Database(file, name, inline)
    with pytest.raises(
        StorageError, match=f"{name} database: (file is not a database|database disk image is malformed)"
    ):
        refused.migrate()
    assert not refused.is_newest()
    with pytest.raises(StorageError):
        refused.run(lambda connection: connection.exec_driver_sql("SELECT 1 FROM sqlite_master"))
    assert all(_closed(connection) for connection in opened)
    refused.close()


def _closed(connection: sqlite3.Connection) -> bool:
    try:
        connection.total_changes  # noqa: B018  # raises when it is closed
    except sqlite3.ProgrammingError:
        return True
    return False


@pytest.mark.real_time  # threads that wait for one another
async def test_who_reads_little_does_not_wait_for_those_who_read_much(tmp_path: Path) -> None:
    """Many who ask for much at once: a session is found all the same, and so a Stop goes on."""
    database = Database(tmp_path / "pogon.db", "pogon")
    database.migrate()
    goes_on = threading.Event()
    many = [asyncio.ensure_future(database.read_long(lambda _: goes_on.wait(30))) for _ in range(3 * LONG_READERS)]
    await asyncio.sleep(0)
    try:
        async with asyncio.timeout(10):
            assert await database.read(lambda connection: connection.exec_driver_sql("SELECT 1").scalar()) == 1
        assert not any(one.done() for one in many)
    finally:
        goes_on.set()
        await asyncio.gather(*many)
        database.close()
