"""A restored machine is as it was, at every step and after every kill; it writes nothing and nobody is signed in."""

import json
import os
import shutil
import sqlite3
import subprocess
import sys
import tarfile
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.access.access import lock, prepare
from app.access.audit.search import Filter
from app.access.former import begin_anew
from app.access.restoring import JOURNAL, UNTOLD, finish_restore
from app.backup import MANIFEST, back_up, table_counts
from app.cli import cli
from app.errors import ConfigurationError
from tests.backup.shelf import _access, restore, verify_backup
from tests.conftest import ROOT
from tests.test_selftest import findings


def names(archive: Path) -> list[str]:
    with tarfile.open(archive) as tar:
        return tar.getnames()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("ending", [".tar", ".tar.gz"])
def test_a_restored_machine_is_as_it_was(data: Path, plant: Path, tmp_path: Path, ending: str) -> None:
    archive = tmp_path / f"b{ending}"
    manifest = back_up(archive, data, plant, keys=True)
    assert archive.stat().st_mode & 0o777 == 0o600
    assert names(archive)[0] == MANIFEST
    assert verify_backup(archive) == manifest
    fresh = tmp_path / "other" / "data"
    again, place = restore(archive, fresh)
    assert again == manifest
    assert place == fresh / "plant"
    for name in ("pogon.db", "history.db"):
        assert table_counts(fresh / name) == manifest.counts[name]
    assert manifest.counts["pogon.db"] == table_counts(data / "pogon.db") | {"session": 0}
    assert manifest.counts["history.db"]["sample"] == 500
    with _access(fresh) as access:
        assert access.audit.check_now().ok
    with closing(sqlite3.connect(fresh / "pogon.db")) as connection, connection:
        assert [row[0] for row in connection.execute("SELECT name FROM person ORDER BY name")] == ["ana", "ivo"]
    connection.close()
    assert list(tmp_path.glob("**/.pogon-*")) == []


def test_a_restored_link_does_not_write_and_nobody_is_signed_in(data: Path, plant: Path, tmp_path: Path) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    assert names(archive)[-2:] == ["plant/extra/note.txt", "plant/plant.toml"], "no links, nothing hidden"
    _, place = restore(archive, tmp_path / "new", tmp_path / "new-plant")
    text = (place / "plant.toml").read_text()
    assert "writes = false" in text
    assert "writes = true" not in text.replace("it was true", "")
    assert b"5ec2e7" not in (tmp_path / "new" / "pogon.db").read_bytes()


def test_what_was_there_is_moved_aside(data: Path, plant: Path, tmp_path: Path) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    with closing(sqlite3.connect(data / "pogon.db")) as connection, connection:
        connection.execute("DELETE FROM person")
    connection.close()
    restore(archive, data)
    (aside,) = data.glob("before-restore-*")
    assert table_counts(aside / "pogon.db")["person"] == 0
    assert table_counts(data / "pogon.db")["person"] == 2
    with _access(data) as access:
        assert access.audit.check_now().ok, "the key of this machine stayed"


def test_restore_refuses_beside_a_server(data: Path, plant: Path, tmp_path: Path) -> None:
    back_up(tmp_path / "b.tar", data, plant)
    held = lock(data)
    before = table_counts(data / "pogon.db")
    with pytest.raises(ConfigurationError, match="in use"):
        restore(tmp_path / "b.tar", data)
    assert table_counts(data / "pogon.db") == before
    os.close(held)
    restore(tmp_path / "b.tar", data)


def test_a_folder_that_cannot_be_made_is_one_line_that_names_it(data: Path, plant: Path, tmp_path: Path) -> None:
    back_up(tmp_path / "b.tar", data, plant)
    file = tmp_path / "file"
    file.touch()
    for folder in (file, file / "data"):
        with pytest.raises(ConfigurationError, match=f"POGON_DATA={folder} cannot be used"):
            restore(tmp_path / "b.tar", folder)
    with pytest.raises(ConfigurationError, match=f"{file}/plant: .*expected a new folder with --plant"):
        restore(tmp_path / "b.tar", tmp_path / "new", file / "plant")
    with pytest.raises(ConfigurationError, match=r"^/proc/plant: "):  # a folder that is there, and takes no other
        restore(tmp_path / "b.tar", tmp_path / "new", Path("/proc/plant"))
    assert not (tmp_path / "new" / "pogon.db").exists()


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "text",
    [
        b"[links.a]\ntransport = 'tcp'\nwrites = true\n",
        b"links.a = { transport = 'tcp', writes=true }\n",
        b"[links]\na.transport = 'tcp'\na.writes = true # always\n",
        b"[links.a]\n\"writes\" = true\n'transport' = 'tcp'\n",
        b"# \xff in a comment\n[links.a]\nwrites\t=\ttrue\n",
    ],
    ids=range(5),
)
def test_writes_are_turned_off_however_they_are_written(data: Path, tmp_path: Path, text: bytes) -> None:
    plant = tmp_path / "plant"
    plant.mkdir()
    (plant / "plant.toml").write_bytes(text)
    back_up(tmp_path / "b.tar", data, plant)
    _, place = restore(tmp_path / "b.tar", tmp_path / "new")
    assert b"true" not in (place / "plant.toml").read_bytes().replace(
        b"# writes turned off by the restore: they were true", b""
    )


def test_writes_that_cannot_be_found_refuse_the_restore(data: Path, tmp_path: Path) -> None:
    plant = tmp_path / "plant"
    plant.mkdir()
    (plant / "plant.toml").write_text('[links.a]\n"wr\\u0069tes" = true\n')
    back_up(tmp_path / "b.tar", data, plant)
    with pytest.raises(ConfigurationError, match="cannot be turned off"):
        restore(tmp_path / "b.tar", tmp_path / "new")
    assert not (tmp_path / "new" / "pogon.db").exists()


@pytest.mark.sweep(8)
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["kill", "full"])
def test_a_restore_leaves_the_old_or_the_new_at_every_step(data: Path, plant: Path, tmp_path: Path, kind: str) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    for name, rows in (("pogon.db", "person WHERE name = 'ivo'"), ("history.db", "sample")):
        with closing(sqlite3.connect(data / name)) as connection:
            connection.execute(f"DELETE FROM {rows}")
            connection.commit()
    (data / "audit.head").write_text("another head")
    (data / "audit.buffer").write_text("{}")
    (data / "audit.buffer").chmod(0o600)
    call = [sys.executable, "-m", "tests.restore_kills", kind, archive, data, tmp_path]
    done = subprocess.run(call, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    found = json.loads(done.stdout)
    assert found["steps"] > 20
    with tarfile.open(archive) as tar:
        head = tar.extractfile("audit.head").read().decode()  # type: ignore[union-attr]
    new = [2, 500, head, None, ["extra", "extra/note.txt", "plant.toml"]]
    for step, (code, ended, state, left) in enumerate(found["states"]):
        assert state in ("old", new), (step, state)
        assert left == [], step
        assert code != 0 or state == new, step
        assert ended != "committed" or state == new, step
    assert {str(state) for _, _, state, _ in found["states"]} == {"old", str(new)}
    assert kind == "full" or "committed" in [ended for _, ended, _, _ in found["states"]]


def test_a_start_completes_an_interrupted_restore(data: Path, plant: Path, tmp_path: Path) -> None:
    (data / ".restore-1").mkdir()
    (data / ".restore-1" / "secret.key").write_text("ab" * 32)
    (data / ".restore-1" / "secret.key").chmod(0o600)
    moves = [[str(data / "secret.key"), str(data / "before-restore-1" / "secret.key")]]
    moves += [[str(data / ".restore-1" / "secret.key"), str(data / "secret.key")]]
    (data / "before-restore-1").mkdir()
    journal = {"state": "committed", "moves": moves, "remove": [str(data / ".restore-1")]}
    (data / JOURNAL).write_text(json.dumps(journal))
    held = lock(data)
    with pytest.raises(ConfigurationError, match="a restore runs on it"):
        prepare(data)
    os.close(held)
    prepare(data)
    assert (data / "secret.key").read_text() == "ab" * 32
    assert not (data / JOURNAL).exists() and not (data / ".restore-1").exists()
    assert finish_restore(data) == ""


@pytest.fixture
def between(data: Path) -> Path:
    """A restore over a plant with accounts was killed when the old database was aside and the new one not in its place yet."""
    staged, aside = data / ".restore-1", data / "before-restore-1"
    staged.mkdir()
    aside.mkdir()
    moves = [(data / "pogon.db", aside / "pogon.db"), (staged / "pogon.db", data / "pogon.db")]
    shutil.copyfile(data / "pogon.db", staged / "pogon.db")
    (staged / "pogon.db").chmod(0o600)
    journal = {"state": "committed", "moves": [[str(old), str(new)] for old, new in moves], "remove": [str(staged)]}
    (data / JOURNAL).write_text(json.dumps(journal))
    moves[0][0].rename(moves[0][1])
    return data


def test_a_start_completes_a_restore_that_was_killed_while_no_database_was_there(between: Path) -> None:
    prepare(between)
    assert table_counts(between / "pogon.db")["person"] == 2
    assert not (between / JOURNAL).exists()


def test_a_new_plant_is_not_begun_over_a_restore_that_was_killed(between: Path) -> None:
    assert begin_anew(between) is None
    assert table_counts(between / "pogon.db")["person"] == 2


def test_a_selftest_says_that_a_start_ends_a_restore_that_was_killed(between: Path) -> None:
    found = findings(between)["database.pogon.db"]
    assert (found.state, found.key) == ("warning", "selftest.database.restore")
    prepare(between)
    assert findings(between)["database.pogon.db"].key == "selftest.database.good"


def test_a_selftest_fails_where_a_start_cannot_end_the_restore(between: Path) -> None:
    (between / JOURNAL).write_text("{}")
    found = findings(between)["database.pogon.db"]
    assert (found.state, found.key) == ("failed", "selftest.database.broken")
    assert "expected the journal of a restore" in str(found.params["reason"])


def test_a_restore_whose_folder_cannot_be_locked_is_one_line(between: Path) -> None:
    (between / "server.lock").unlink(missing_ok=True)
    (between / "server.lock").mkdir()
    with pytest.raises(ConfigurationError, match=r"server\.lock: Is a directory; without it"):
        prepare(between)
    assert (between / JOURNAL).exists()


def test_a_command_completes_a_restore_that_was_killed(between: Path) -> None:
    done = CliRunner().invoke(cli, ["user", "list", "--data", str(between)])
    assert done.exit_code == 0 and "ana" in done.output and "ivo" in done.output


@pytest.mark.parametrize("text", ["", "{}", "[" * 100_000, '{"state": 1, "moves": [[1]], "remove": []}', "\0", "é" * 9])
def test_a_journal_that_is_none_changes_nothing(data: Path, text: str) -> None:
    (data / JOURNAL).write_text(text)
    before = table_counts(data / "pogon.db")
    with pytest.raises(ConfigurationError, match="expected the journal of a restore"):
        prepare(data)
    assert table_counts(data / "pogon.db") == before


async def test_of_a_restore_that_was_killed_when_all_was_there_the_next_start_tells_once(
    data: Path, plant: Path, tmp_path: Path
) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant, keys=True)
    fresh = tmp_path / "new"
    manifest, _ = restore(archive, fresh)  # and nobody came to write its line
    for _ in range(2):
        with _access(fresh) as access:
            await access.start()
            (line,) = await access.audit.find(Filter(kind="backup.restored"))
            assert (line.object, line.result) == ("b.tar", "ok")
            assert line.parameters == {"made": manifest.created, "signed": "1"}
            assert access.audit.check_now().ok
    assert not (fresh / UNTOLD).exists()


def test_a_restore_that_came_to_its_end_is_told_once_too(data: Path, plant: Path, tmp_path: Path) -> None:
    archive, fresh = tmp_path / "b.tar", tmp_path / "new"
    back_up(archive, data, plant, keys=True)
    done = CliRunner().invoke(
        cli, ["restore", str(archive), "--yes", "--data", str(fresh), "--key-file", str(data / "backup.key")]
    )
    assert done.exit_code == 0, done.output
    assert not (fresh / UNTOLD).exists()
    with closing(sqlite3.connect(fresh / "pogon.db")) as connection:
        told = connection.execute("SELECT person FROM audit WHERE kind = 'backup.restored'").fetchall()
    assert len(told) == 1 and told[0][0].startswith("terminal:")
