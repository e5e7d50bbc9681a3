"""A plant that has lost its database, or everybody in it, is not taken for a new one."""

import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from app.access.access import prepare
from app.access.former import begin_anew
from app.access.keys import read_mark
from app.errors import ConfigurationError
from tests.access.conftest import OpenAccess, add


def remove(data: Path) -> None:
    for path in data.glob("pogon.db*"):
        path.unlink()


def truncate(data: Path) -> None:
    remove(data)
    (data / "pogon.db").touch(0o600)


def sql(*statements: str) -> Callable[[Path], None]:
    def change(data: Path) -> None:
        with closing(sqlite3.connect(data / "pogon.db")) as database:
            for statement in statements:
                database.execute(statement)
            database.commit()

    return change


def another(data: Path) -> None:
    remove(data)
    sql("CREATE TABLE x (y)", "DROP TABLE x")(data)
    (data / "pogon.db").chmod(0o600)


def names(data: Path) -> list[str]:
    """Files, without those that reading a database makes."""
    return sorted(path.name for path in data.iterdir() if not path.name.endswith(("-wal", "-shm")))


LOST = {
    "removed": remove,
    "emptied file": truncate,
    "another file": another,
    "no people": sql("DELETE FROM person"),
    "no rows at all": sql("DELETE FROM person", "DELETE FROM audit"),
    "no tables": sql("DROP TABLE person_role", "DROP TABLE person"),
}
LEFT = {
    "all marks": (),
    "only the key": ("audit.head", "audit.anchors", "audit.buffer"),
    "only the head": ("audit.anchors", "audit.buffer", "audit.key"),
    "only the anchors": ("audit.head", "audit.buffer", "audit.key"),
}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("left", LEFT)
@pytest.mark.parametrize("way", LOST)
async def test_the_start_is_refused_with_what_to_do(open_access: OpenAccess, data: Path, way: str, left: str) -> None:
    access = open_access()
    await access.start()
    await add(access, "ana", "admin")
    await access.stop()
    access.sessions._db.close()
    prepare(data)  # as it is it starts
    LOST[way](data)
    for name in LEFT[left]:
        (data / name).unlink(missing_ok=True)
    before = names(data)
    with pytest.raises(ConfigurationError, match=r"restore.*--begin-anew") as refused:
        prepare(data)
    assert "\n" not in str(refused.value)
    assert names(data) == before  # nothing was made
    place = begin_anew(data)
    assert place is not None
    prepare(data)
    assert begin_anew(data) is None


async def test_a_new_plant_starts_and_starts_again_before_anybody_signed_in(
    open_access: OpenAccess, data: Path, tmp_path: Path
) -> None:
    prepare(tmp_path / "new")
    prepare(tmp_path / "new")
    for _ in range(2):
        access = open_access()
        assert await access.start()
        await access.stop()
        prepare(data)


@pytest.mark.timeout(30)
def test_a_pipe_in_the_place_of_the_key_keeps_nobody_waiting_and_moves_nothing(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "audit.key", 0o600)
    (tmp_path / "audit.head").write_text("of a plant")
    assert read_mark(tmp_path / "audit.key") is None
    with pytest.raises(ConfigurationError, match=r"audit\.key: a pipe"):
        begin_anew(tmp_path)
    assert names(tmp_path) == ["audit.head", "audit.key"]


async def test_a_plant_with_accounts_is_never_put_aside(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    await access.start()
    await add(access, "ana", "admin")
    assert begin_anew(data) is None


def test_a_history_without_its_plant_is_told_when_a_new_one_begins_beside_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for name, told in (("fresh", False), ("emptied", False), ("copied", True)):
        data = tmp_path / name
        data.mkdir(mode=0o700)
        if name != "fresh":
            (data / "history.db").write_bytes(b"SQLite format 3" if told else b"")
            (data / "history.db").chmod(0o600)
        caplog.clear()
        prepare(data)
        assert ["missing=pogon.db" in text for text in caplog.messages] == [True] * told, name
