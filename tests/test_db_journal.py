"""A journal, or the index of it, that is cut or written over under a running server is found, and what is whole of it is kept."""

import asyncio
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from random import Random

import pytest
from sqlalchemy import Connection

from app.db import Database
from app.db_file import Loss, Mended
from app.errors import StorageError
from tests.databases import TABLE, Name
from tests.virtual import inline

NOISE = Random(1)
LONG = "x" * 3000
"""Makes a row fill a page of its own."""


@pytest.fixture(params=["pogon", "history"])
def database(request: pytest.FixtureRequest, tmp_path: Path, empty_databases: Path) -> Iterator[Database]:
    name: Name = request.param
    database = Database(Path(shutil.copy(empty_databases / f"{name}.db", tmp_path)), name, inline)
    database.migrate()
    yield database
    database.close()


async def put(database: Database, *keys: str) -> None:
    def work(connection: Connection) -> None:
        for key in keys:
            connection.exec_driver_sql(f"INSERT INTO {TABLE[database.name]} VALUES (?, 1)", (key,))

    await database.write(work)


async def stored(database: Database) -> set[str]:
    """What the server reads: the keys without what makes them long."""
    table, column = TABLE[database.name].split(" (")
    asked = f"SELECT {column.split(',')[0]} FROM {table}"
    rows = await database.read(lambda connection: connection.exec_driver_sql(asked).scalars().all())
    return {row.rstrip("x") for row in rows}


def sound(database: Database) -> bool:
    """Whether another program finds the file in order."""
    with closing(sqlite3.connect(f"file:{database.path}?mode=ro", uri=True)) as connection:
        found: list[tuple[str]] = connection.execute("PRAGMA integrity_check").fetchall()
        return found == [("ok",)]


def journal(database: Database, tail: str = "-wal") -> Path:
    return database.path.with_name(database.path.name + tail)


def cut(path: Path) -> None:
    os.truncate(path, 0)


def halved(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def noise(path: Path) -> None:
    with path.open("r+b") as file:
        file.write(NOISE.randbytes(path.stat().st_size))


def noise_at_its_end(path: Path) -> None:
    with path.open("r+b") as file:
        file.seek(-6000, os.SEEK_END)
        file.write(NOISE.randbytes(6000))


def written_over(path: Path) -> None:
    path.write_bytes(NOISE.randbytes(5000))


FAULTS = [cut, halved, noise, written_over]
Fault = Callable[[Path], None]


@pytest.mark.parametrize("fault", FAULTS)
async def test_what_is_in_the_file_stays_when_its_journal_is_damaged_and_the_rest_is_told(
    database: Database, fault: Fault
) -> None:
    await put(database, "in the file")
    database.checkpoint()
    await put(database, "in the journal")
    for number in range(20):
        await put(database, f"{number}{LONG}")
    assert await database.check() is None
    edition = database.edition
    fault(journal(database))
    incident = await database.check()
    assert incident is not None
    assert (incident.loss, incident.mended) == (Loss.JOURNAL_DAMAGED, Mended.SHORTENED)
    assert database.edition == edition + 1
    assert await database.check() is None
    await put(database, "later")
    found = await stored(database)
    assert found >= {"in the file", "later"}
    assert ("in the journal" in found) is (fault is halved)  # what is whole of it is kept
    assert "19" not in found
    database.close()
    assert sound(database)


@pytest.mark.parametrize("fault", [*FAULTS, noise_at_its_end])
async def test_a_journal_that_was_carried_into_the_file_takes_nothing_with_it(database: Database, fault: Fault) -> None:
    for number in range(20):
        await put(database, f"{number}{LONG}")
    database.checkpoint()
    assert await database.check() is None
    fault(journal(database))
    incident = await database.check()
    assert incident is not None
    assert (incident.loss, incident.mended) == (Loss.JOURNAL_DAMAGED, Mended.RESTORED)
    assert database.edition == 0
    await put(database, "later")
    assert await stored(database) == {"later", *map(str, range(20))}
    database.close()
    assert sound(database)


async def test_an_older_journal_in_its_place_does_not_get_into_the_file(database: Database) -> None:
    for number in range(20):
        await put(database, f"{number}{LONG}")
    older = journal(database).read_bytes()
    database.checkpoint()
    await put(database, "newer")  # begins the journal anew
    with journal(database).open("r+b") as file:
        file.write(older)
    incident = await database.check()
    assert incident is not None
    assert (incident.loss, incident.mended) == (Loss.JOURNAL_DAMAGED, Mended.SHORTENED)
    await put(database, "later")
    assert await stored(database) == {"later", *map(str, range(20))}
    database.close()
    assert sound(database)


@pytest.mark.parametrize("fault", FAULTS)
async def test_nothing_is_written_behind_a_gap_in_the_journal(database: Database, fault: Fault) -> None:
    """Nor carried into the file: who writes looks first, and `check` tells what was done."""
    await put(database, "in the file")
    database.checkpoint()
    for number in range(20):
        await put(database, f"{number}{LONG}")
    fault(journal(database))
    database.checkpoint()
    await put(database, "later")
    assert await stored(database) >= {"in the file", "later"}
    incident = await database.check()
    assert incident is not None
    assert incident.mended is Mended.SHORTENED
    assert await database.check() is None
    database.close()
    assert sound(database)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("looked", [True, False])
async def test_an_index_that_is_damaged_is_built_anew_from_the_journal(
    database: Database, fault: Fault, *, looked: bool
) -> None:
    """One that is cut kills who reads it, says the system, unless it is made long again at once."""
    await put(database, "in the file")
    assert await database.check() is None
    database.checkpoint()
    for number in range(20):
        await put(database, f"{number}{LONG}")
    if looked:
        assert await database.check() is None
    fault(journal(database, "-shm"))
    incident = await database.check()
    assert incident is not None
    assert (incident.loss, incident.mended) == (Loss.JOURNAL_DAMAGED, Mended.RESTORED)
    assert await database.check() is None
    await put(database, "later")
    assert await stored(database) == {"in the file", "later", *map(str, range(20))}
    database.close()
    assert sound(database)


@pytest.mark.parametrize("fault", FAULTS)
async def test_who_reads_first_finds_all_and_the_damage_to_the_index_is_told(database: Database, fault: Fault) -> None:
    for number in range(20):
        await put(database, f"{number}{LONG}")
    assert await database.check() is None
    fault(journal(database, "-shm"))
    assert await stored(database) == {*map(str, range(20))}
    incident = await database.check()
    assert incident is not None
    assert (incident.loss, incident.mended) == (Loss.JOURNAL_DAMAGED, Mended.RESTORED)
    await put(database, "later")
    assert await stored(database) == {"later", *map(str, range(20))}
    database.close()
    assert sound(database)


@pytest.mark.parametrize("fault", FAULTS)
async def test_who_reads_when_the_journal_is_damaged_reads_what_is_left(database: Database, fault: Fault) -> None:
    for number in range(20):
        await put(database, f"{number}{LONG}")
    database.checkpoint()
    await put(database, "in the journal")
    fault(journal(database))
    database.engine.dispose()  # nobody knows a page by heart
    assert await stored(database) >= {*map(str, range(20))}
    await database.check()
    assert await database.check() is None
    database.close()
    assert sound(database)


@pytest.mark.parametrize("tail", ["-wal", "-shm"])
@pytest.mark.parametrize("reads", [True, False])
async def test_what_is_being_written_when_the_journal_is_cut_is_refused_or_whole(
    database: Database, tail: str, *, reads: bool
) -> None:
    """`reads`: what it writes depends on pages that it has to read after the cut."""
    for number in range(20):
        await put(database, f"{number}{LONG}")
    database.checkpoint()
    await put(database, *(f"more {number}{LONG}" for number in range(20)))

    def work(connection: Connection) -> None:
        connection.exec_driver_sql(f"INSERT INTO {TABLE[database.name]} VALUES ('torn', 1)")
        cut(journal(database, tail))
        if reads:
            connection.exec_driver_sql("PRAGMA shrink_memory")
            connection.exec_driver_sql(f"SELECT * FROM {TABLE[database.name].split()[0]}").all()
        connection.exec_driver_sql(f"INSERT INTO {TABLE[database.name]} VALUES (?, 1)", (f"too{LONG}",))

    try:
        await database.write(work)
        refused = False
    except StorageError:
        refused = True
    incident = await database.check()
    assert incident is not None
    await put(database, "later")
    found = await stored(database)
    assert found >= {"later", *map(str, range(20))}
    assert refused or not reads
    if tail == "-shm":
        assert found >= {f"more {number}" for number in range(20)}
        assert found & {"torn", "too"} == (set() if refused else {"torn", "too"})
    database.close()
    assert sound(database)


@pytest.mark.real_time  # threads beside one another
async def test_a_journal_in_use_is_never_taken_for_damaged(tmp_path: Path, empty_databases: Path) -> None:
    """While another thread writes, checkpoints and reads, and another program does."""
    database = Database(Path(shutil.copy(empty_databases / "history.db", tmp_path)), "history")
    database.migrate()
    try:
        for number in range(200):
            writing = asyncio.ensure_future(put(database, f"{number}{LONG}"))
            if number % 7 == 0:
                database.checkpoint()
            if number % 31 == 0:
                with closing(sqlite3.connect(database.path)) as beside:
                    beside.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            assert await database.check() is None
            await writing
        assert database.edition == 0
        assert len(await stored(database)) == 200
    finally:
        database.close()
    assert sound(database)
