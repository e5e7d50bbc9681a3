"""What derived points remember over a restart: written when it changed, read back, and lost by no error."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import update

from app.db import Database
from app.errors import StorageError
from app.plant.retained import RetainedStates, retained
from tests.virtual import inline


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = Database(tmp_path / "pogon.db", "pogon", inline)
    opened.migrate()
    yield opened
    opened.close()


async def test_what_was_written_is_read_after_a_restart(database: Database) -> None:
    before = RetainedStates(database)
    assert await before.read() == {}
    await before.write({"m1.hours": {"seconds": 3.5}, "m1.starts": {"count": 2}})
    await before.write({"m1.hours": {"seconds": 4.5}})
    assert await RetainedStates(database).read() == {"m1.hours": {"seconds": 4.5}, "m1.starts": {"count": 2}}


async def test_what_has_not_changed_is_not_written_again(database: Database) -> None:
    states = RetainedStates(database)
    await states.write({"m1.hours": {"seconds": 1.0}})
    await database.write(lambda connection: connection.execute(update(retained).values(state={"seconds": 9.0})))
    await states.write({"m1.hours": {"seconds": 1.0}})
    assert await RetainedStates(database).read() == {"m1.hours": {"seconds": 9.0}}
    await states.write({"m1.hours": {"seconds": 2.0}})
    assert await RetainedStates(database).read() == {"m1.hours": {"seconds": 2.0}}


async def test_a_disk_that_does_not_take_it_gets_it_the_next_time(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = RetainedStates(database)

    async def full(work: object) -> None:
        raise StorageError("no space left")

    with monkeypatch.context() as broken:
        broken.setattr(database, "write", full)
        with pytest.raises(StorageError):
            await states.write({"m1.hours": {"seconds": 1.0}})
    await states.write({"m1.hours": {"seconds": 1.0}})
    assert await RetainedStates(database).read() == {"m1.hours": {"seconds": 1.0}}


async def test_a_database_that_cannot_be_read_remembers_nothing_and_says_so(
    database: Database, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def broken(work: object) -> None:
        raise StorageError("disk I/O error")

    monkeypatch.setattr(database, "read", broken)
    assert await RetainedStates(database).read() == {}
    assert "retained states not read reason=disk I/O error" in caplog.text
