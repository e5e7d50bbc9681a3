"""A backup brings everything back, and an archive that somebody touched brings nothing."""

import io
import json
import os
import sqlite3
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.access.access import Access, lock, prepare
from app.access.passwords import Cost
from app.access.roles import SYSTEM
from app.backup import MANIFEST, Manifest, back_up, restore, table_counts, verify_backup
from app.clock import SystemClock
from app.db import Database
from app.errors import ConfigurationError
from app.historian import store
from tests.historian.conftest import point

BEGIN = 1_773_036_000_000_000


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The data folder of a plant with two people, a session, an audit and some history."""
    folder = tmp_path / "data"
    prepare(folder)
    with _access(folder) as access:
        access.people.add_now(SYSTEM, [("ana", "Ana", ("operator",)), ("ivo", "Ivo", ("engineer",))])
    with sqlite3.connect(folder / "pogon.db") as connection:
        connection.execute("INSERT INTO session VALUES ('5ec2e7', 1, 1, 1, 1, 'here', 'me')")
    connection.close()
    history = Database(folder / "history.db", "history")
    history.migrate()
    history.run(lambda c: store.register(c, [point()]))
    history.run(lambda c: store.append(c, [(1, BEGIN + i, float(i), None, 0) for i in range(500)], BEGIN, BEGIN))
    history.close()
    return folder


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    folder = tmp_path / "plant"
    (folder / "extra").mkdir(parents=True)
    (folder / "plant.toml").write_text('[links.hall]\ntransport = "tcp"\nwrites = true  # since March\n')
    (folder / "extra" / "note.txt").write_text("x")
    (folder / ".secret").write_text("x")
    (folder / "link").symlink_to("/etc/passwd")
    return folder


class _access:
    """People and audit of a folder, closed at the end."""

    def __init__(self, folder: Path) -> None:
        self.db = Database(folder / "pogon.db", "pogon")
        self.db.migrate()
        self.access = Access(self.db, SystemClock(), folder, Cost(1, 64, 1))

    def __enter__(self) -> Access:
        return self.access

    def __exit__(self, *_: object) -> None:
        self.access.close()
        self.db.close()


def names(archive: Path) -> list[str]:
    with tarfile.open(archive) as tar:
        return tar.getnames()


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
    with sqlite3.connect(fresh / "pogon.db") as connection:
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


def test_keys_are_only_in_it_when_asked_for(data: Path, plant: Path, tmp_path: Path) -> None:
    secrets = [(data / name).read_bytes().strip() for name in ("audit.key", "secret.key")]
    back_up(tmp_path / "b.tar", data, plant)
    assert not any(secret in (tmp_path / "b.tar").read_bytes() for secret in secrets)
    back_up(tmp_path / "k.tar", data, plant, keys=True)
    assert all(secret in (tmp_path / "k.tar").read_bytes() for secret in secrets)


def test_what_was_there_is_moved_aside(data: Path, plant: Path, tmp_path: Path) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    with sqlite3.connect(data / "pogon.db") as connection:
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


def test_a_backup_is_taken_while_the_databases_are_written(data: Path, plant: Path, tmp_path: Path) -> None:
    history = Database(data / "history.db", "history")
    for i in range(5):
        for k in range(20):
            t = BEGIN + 10**6 + i * 1000 + k
            history.submit(lambda c, t=t: store.append(c, [(1, t, 1.0, None, 0)], BEGIN, t))  # type: ignore[misc]
        manifest = back_up(tmp_path / f"b{i}.tar", data, plant)
        assert manifest.counts["history.db"]["sample"] >= 500
    history.close()


def test_without_history_the_history_of_the_machine_stays(data: Path, plant: Path, tmp_path: Path) -> None:
    back_up(tmp_path / "b.tar", data, plant, history=False)
    restore(tmp_path / "b.tar", data)
    assert table_counts(data / "history.db")["sample"] == 500


def test_nothing_is_replaced(data: Path, plant: Path, tmp_path: Path) -> None:
    (tmp_path / "b.tar").write_text("mine")
    with pytest.raises(ConfigurationError, match="exists already"):
        back_up(tmp_path / "b.tar", data, plant)
    back_up(tmp_path / "c.tar", data, plant)
    with pytest.raises(ConfigurationError, match="has files already"):
        restore(tmp_path / "c.tar", tmp_path / "new", plant)
    with pytest.raises(ConfigurationError, match="nothing to back up"):
        back_up(tmp_path / "d.tar", tmp_path / "empty", plant)


def test_one_changed_byte_is_found(data: Path, plant: Path, tmp_path: Path) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    content = archive.read_bytes()
    with tarfile.open(archive) as tar:
        places = [member.offset_data + member.size // 2 for member in tar]
    for place in [*places, 200]:
        changed = bytearray(content)
        changed[place] ^= 4
        archive.write_bytes(changed)
        with pytest.raises(ConfigurationError):
            restore(archive, tmp_path / "new")
        assert not (tmp_path / "new" / "pogon.db").exists()
    archive.write_bytes(content[: len(content) // 2])
    with pytest.raises(ConfigurationError):
        verify_backup(archive)
    archive.write_bytes(b"no archive")
    with pytest.raises(ConfigurationError, match="expected a backup"):
        verify_backup(archive)


Change = Callable[[dict[str, Any], list[tuple[tarfile.TarInfo, bytes]]], None]


def rename(name: str) -> Change:
    """Give the note another name, in the manifest and in the archive."""

    def change(manifest: dict[str, Any], members: list[tuple[tarfile.TarInfo, bytes]]) -> None:
        manifest["files"][name] = manifest["files"].pop("plant/extra/note.txt")
        for member, _ in members:
            if member.name == "plant/extra/note.txt":
                member.name = name

    return change


def as_link(manifest: dict[str, Any], members: list[tuple[tarfile.TarInfo, bytes]]) -> None:
    for member, _ in members:
        if member.name == "plant/extra/note.txt":
            member.type, member.linkname, member.size = tarfile.SYMTYPE, "/etc/passwd", 0


def twice(manifest: dict[str, Any], members: list[tuple[tarfile.TarInfo, bytes]]) -> None:
    members.append(members[-1])


def unnamed(manifest: dict[str, Any], members: list[tuple[tarfile.TarInfo, bytes]]) -> None:
    member = tarfile.TarInfo("plant/more.toml")
    member.size = 1
    members.append((member, b"x"))


def other_counts(manifest: dict[str, Any], members: list[tuple[tarfile.TarInfo, bytes]]) -> None:
    manifest["counts"]["pogon.db"]["person"] += 1


def other_format(manifest: dict[str, Any], members: list[tuple[tarfile.TarInfo, bytes]]) -> None:
    manifest["format"] = 9


def huge(manifest: dict[str, Any], members: list[tuple[tarfile.TarInfo, bytes]]) -> None:
    manifest["files"]["plant/extra/note.txt"][0] = 10**15


@pytest.mark.parametrize(
    "change",
    [
        rename("../evil"),
        rename("/etc/evil"),
        rename("plant/../../evil"),
        rename("plant/./x"),
        rename("evil.py"),
        rename("plant\\..\\evil"),
        as_link,
        twice,
        unnamed,
        other_counts,
        other_format,
        huge,
    ],
)
def test_an_archive_made_to_do_harm_is_refused_whole(data: Path, plant: Path, tmp_path: Path, change: Change) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    with tarfile.open(archive) as tar:
        members = [(member, tar.extractfile(member).read()) for member in tar]  # type: ignore[union-attr]
    manifest = json.loads(members[0][1])
    rest = members[1:]
    change(manifest, rest)
    head = json.dumps(manifest).encode()
    members[0][0].size = len(head)
    with tarfile.open(archive, "w") as tar:
        for member, content in [(members[0][0], head), *rest]:
            tar.addfile(member, io.BytesIO(content))
    with pytest.raises(ConfigurationError):
        restore(archive, tmp_path / "deep" / "new")
    assert [path.name for path in (tmp_path / "deep" / "new").iterdir()] == ["server.lock"]
    assert not list(tmp_path.glob("**/evil*"))


def test_the_manifest_says_what_it_is(data: Path, plant: Path, tmp_path: Path) -> None:
    manifest = back_up(tmp_path / "b.tar", data, plant)
    assert isinstance(manifest, Manifest)
    assert (manifest.format, manifest.keys) == (1, False)
    assert {"pogon.db", "history.db", "plant/plant.toml", "audit.head"} <= set(manifest.files)
