"""A backup brings everything back, and an archive that somebody touched brings nothing."""

import fcntl
import gzip
import io
import json
import os
import resource
import shutil
import sqlite3
import subprocess
import sys
import tarfile
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.access.access import Access, lock, prepare
from app.access.keys import read_key
from app.access.passwords import Cost
from app.access.restoring import JOURNAL, finish_restore
from app.access.roles import SYSTEM
from app.backup import BACKUP_KEY, MANIFEST, Manifest, Opening, back_up, make_identity, table_counts
from app.backup import restore as bring_back
from app.backup import verify_backup as verify
from app.clock import SystemClock
from app.db import Database
from app.errors import ConfigurationError
from app.historian import store
from tests.conftest import ROOT
from tests.historian.conftest import point
from tests.virtual import inline

BEGIN = 1_773_036_000_000_000
KEY = bytes(range(32))
OPENING = Opening(KEY)


def restore(archive: Path, data: Path, plant: Path | None = None, opening: Opening = OPENING) -> tuple[Manifest, Path]:
    return bring_back(archive, data, plant, opening=opening)


def verify_backup(archive: Path, opening: Opening = OPENING) -> Manifest:
    return verify(archive, opening)


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
    history = Database(folder / "history.db", "history", inline)
    history.migrate()
    history.run(lambda c: store.register(c, [point()]))
    history.run(lambda c: store.append(c, [(1, BEGIN + i, float(i), None, 0) for i in range(500)], BEGIN, BEGIN))
    history.close()
    (folder / BACKUP_KEY).write_text(KEY.hex() + "\n")
    (folder / BACKUP_KEY).chmod(0o600)
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
        self.db = Database(folder / "pogon.db", "pogon", inline)
        self.db.migrate()
        self.access = Access(self.db, SystemClock(), folder, Cost(1, 64, 1), threads=inline)

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
    history = Database(data / "history.db", "history", inline)
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
    rest = members[2:]
    change(manifest, rest)
    head = json.dumps(manifest).encode()
    members[0][0].size = len(head)
    with tarfile.open(archive, "w") as tar:
        for member, content in [(members[0][0], head), *rest]:
            tar.addfile(member, io.BytesIO(content))
    with pytest.raises(ConfigurationError):
        restore(archive, tmp_path / "deep" / "new", opening=Opening(unsigned=True))
    assert [path.name for path in (tmp_path / "deep" / "new").iterdir()] == ["server.lock"]
    assert not list(tmp_path.glob("**/evil*"))


def test_the_manifest_says_what_it_is(data: Path, plant: Path, tmp_path: Path) -> None:
    manifest = back_up(tmp_path / "b.tar", data, plant)
    assert isinstance(manifest, Manifest)
    assert (manifest.format, manifest.keys, manifest.signed) == (2, False, True)
    assert {"pogon.db", "history.db", "plant/plant.toml", "audit.head"} <= set(manifest.files)


def rewritten(archive: Path, *, signature: str | None = None, change: Callable[[dict[str, Any]], object]) -> None:
    """The archive with another manifest; its signature as it was, `signature`, or none when that is empty."""
    with tarfile.open(archive) as tar:
        members = [(member, tar.extractfile(member).read()) for member in tar]  # type: ignore[union-attr]
    manifest = json.loads(members[0][1])
    changed = change(manifest)
    contents = [changed if isinstance(changed, bytes) else json.dumps(manifest).encode(), members[1][1]]
    if signature is not None:
        contents[1] = signature.encode()
    with tarfile.open(archive, "w") as tar:
        for (member, _), content in zip(members[:2], contents, strict=True):
            member.size = len(content)
            if content:
                tar.addfile(member, io.BytesIO(content))
        for member, content in members[2:]:
            tar.addfile(member, io.BytesIO(content))


def older(manifest: dict[str, Any]) -> None:
    """As the first version wrote it."""
    manifest["format"] = 1


@pytest.mark.parametrize(
    ("signature", "change", "opening", "said"),
    [
        (None, len, Opening(bytes(32)), "signed with the key .*, and the key here is .*--key-file"),
        (None, len, Opening(), "signed with the key .*, which is not here"),
        (
            None,
            lambda manifest: manifest.update(version="2"),
            OPENING,
            "its signature is not true: somebody changed it",
        ),
        (None, lambda manifest: manifest.update(version="2"), Opening(KEY, True), "its signature is not true"),
        ("", len, OPENING, "it is not signed: anybody may have written it; --unsigned takes it nevertheless"),
        ("", older, OPENING, "it is not signed"),
        ("hmac-sha256 é", len, OPENING, "its signature cannot be read"),
        ("hmac-sha256 00000000 " + "0" * 64, len, OPENING, "signed with the key 00000000"),
        ("x" * 5000, len, OPENING, "its signature cannot be read"),
    ],
)
def test_an_archive_is_believed_only_with_its_signature(
    data: Path, plant: Path, tmp_path: Path, signature: str | None, change: Any, opening: Opening, said: str
) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    rewritten(archive, signature=signature, change=change)
    with pytest.raises(ConfigurationError, match=said):
        restore(archive, tmp_path / "new", opening=opening)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["server.lock"]


@pytest.mark.parametrize("change", [len, older])
def test_an_unsigned_archive_is_restored_when_somebody_says_so(
    data: Path, plant: Path, tmp_path: Path, change: Callable[[dict[str, Any]], object]
) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    assert verify_backup(archive).signed
    rewritten(archive, signature="", change=change)
    manifest, _ = restore(archive, tmp_path / "new", opening=Opening(KEY, unsigned=True))
    assert not manifest.signed
    assert table_counts(tmp_path / "new" / "pogon.db")["person"] == 2


def test_the_key_of_the_signature_is_made_kept_private_and_never_in_an_archive(
    data: Path, plant: Path, tmp_path: Path
) -> None:
    (data / BACKUP_KEY).unlink()
    back_up(tmp_path / "b.tar", data, plant, keys=True)
    key = (data / BACKUP_KEY).read_bytes().strip()
    assert (data / BACKUP_KEY).stat().st_mode & 0o777 == 0o600
    assert key not in (tmp_path / "b.tar").read_bytes()
    elsewhere = tmp_path / "usb.key"
    back_up(tmp_path / "c.tar", data, plant, key_file=elsewhere)
    assert verify_backup(tmp_path / "c.tar", Opening(read_key(elsewhere))).signed
    elsewhere.chmod(0o644)
    with pytest.raises(ConfigurationError, match="may be read or written by others: chmod 0600"):
        back_up(tmp_path / "d.tar", data, plant, key_file=elsewhere)


def test_an_encrypted_archive_is_opened_by_its_private_key_only(data: Path, plant: Path, tmp_path: Path) -> None:
    mine, other = tmp_path / "mine.txt", tmp_path / "other.txt"
    public = make_identity(mine)
    make_identity(other)
    assert mine.stat().st_mode & 0o777 == 0o600
    archive = tmp_path / "b.tar.age"
    back_up(archive, data, plant, encrypt_to=[public])
    content = archive.read_bytes()
    assert content.startswith(b"age-encryption.org/v1") and b"plant.toml" not in content and b"SQLite" not in content
    for identities, said in [((), "it is encrypted: give"), ((other,), "cannot be decrypted"), ((plant,), "a folder")]:
        with pytest.raises(ConfigurationError, match=said):
            restore(archive, tmp_path / "new", opening=Opening(KEY, identities=identities))
    manifest, _ = restore(archive, tmp_path / "new", opening=Opening(KEY, identities=[other, mine]))
    assert manifest.signed
    assert table_counts(tmp_path / "new" / "pogon.db")["person"] == 2
    assert not [path for path in tmp_path.rglob(".*") if path.name != ".secret"], "nothing decrypted stays"
    archive.write_bytes(content[:-100])
    with pytest.raises(ConfigurationError):
        verify_backup(archive, Opening(KEY, identities=[mine]))
    with pytest.raises(ConfigurationError, match="expected public keys of age"):
        back_up(tmp_path / "c.tar", data, plant, encrypt_to=["age1nonsense"])
    with pytest.raises(ConfigurationError, match="exists already"):
        make_identity(mine)


def head_of(size: int, kind: bytes) -> bytes:
    """The head of a member of a tar that says it is `size` long."""
    member = tarfile.TarInfo("plant/x")
    member.size, member.type = size, kind
    return member.tobuf(tarfile.GNU_FORMAT)


@pytest.mark.parametrize(
    "kind", [tarfile.REGTYPE, tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.GNUTYPE_LONGNAME], ids=repr
)
@pytest.mark.parametrize("first", [True, False])
def test_a_small_archive_unpacks_to_no_more_than_its_manifest_says(
    data: Path, plant: Path, tmp_path: Path, kind: bytes, first: bool
) -> None:
    """The head of a tar may be a gigabyte, which `tarfile` reads into memory, as may a file that is not named."""
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    good = b"" if first else archive.read_bytes().rstrip(b"\0") + b"\0" * 4096
    good = good[: len(good) // 512 * 512]
    bomb = tmp_path / "bomb.tar.gz"
    with gzip.open(bomb, "wb", 1) as out:
        out.write(good + head_of(2**30, kind))
        for _ in range(300):
            out.write(b"a" * 2**20)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if first:
        with pytest.raises(ConfigurationError):
            restore(bomb, tmp_path / "new", opening=Opening(unsigned=True))
        assert [path.name for path in (tmp_path / "new").iterdir()] == ["server.lock"]
    else:
        with suppress(ConfigurationError):  # behind the end of a tar nobody looks
            restore(bomb, tmp_path / "new")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


@pytest.mark.parametrize(
    "manifest",
    [
        b"[" * 200_000,
        b'{"a":' * 200_000,
        b"{}",
        b"1" * 100_000,
        b"\xff",
        b'{"format": 2, "files": {"pogon.db": [1e999, "x"]}, "counts": {}, "version": "1", "created": "", "keys": false}',
        b'{"format": 2, "files": {"pogon.db": [-1, "x"]}, "counts": {}, "version": "1", "created": "", "keys": false}',
        b'{"format": 2, "files": {"pogon.db": [99999999999999999999, "x"]}, "counts": {}, "version": "1"}',
        b'{"format": 2, "files": {"pogon.db": [1, "x"]}, "counts": {}, "version": "\\u001b[2J", "created": "", "keys": 0}',
        b'{"format": 2, "files": {"pogon.db": [9223372036854775807, "x"]}, "counts": {}, "version": "", "created": "", "keys": 0}',
    ],
    ids=range(10),
)
def test_a_manifest_that_is_none_is_one_line(data: Path, plant: Path, tmp_path: Path, manifest: bytes) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    rewritten(archive, signature="", change=lambda _: manifest)
    with pytest.raises(ConfigurationError) as refused:
        verify_backup(archive, Opening(unsigned=True))
    assert str(refused.value).isprintable() and len(str(refused.value)) < 400


def test_no_more_is_unpacked_than_there_is_room(
    data: Path, plant: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=10**6))
    for work in (
        lambda: restore(archive, tmp_path / "new"),
        lambda: verify_backup(archive),
        lambda: back_up(tmp_path / "c.tar", data, plant),
    ):
        with pytest.raises(ConfigurationError, match="1 MB are free, expected 6"):
            work()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.tar", "data", "new", "plant"]


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


def test_what_a_killed_backup_left_is_removed_by_the_next(data: Path, plant: Path, tmp_path: Path) -> None:
    stale, used = tmp_path / ".pogon-stale", tmp_path / ".pogon-used"
    for folder in (stale, used):
        folder.mkdir()
        (folder / "pogon.db").write_text("x")
    handle = os.open(used, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    back_up(tmp_path / "b.tar", data, plant)
    assert not stale.exists() and used.exists(), "another backup goes on"
    os.close(handle)
    back_up(tmp_path / "c.tar", data, plant)
    assert not list(tmp_path.glob(".pogon-*"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["kill", "full"])
def test_a_restore_leaves_the_old_or_the_new_at_every_step(data: Path, plant: Path, tmp_path: Path, kind: str) -> None:
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    for name, table in (("pogon.db", "person"), ("history.db", "sample")):
        with closing(sqlite3.connect(data / name)) as connection:
            connection.execute(f"DELETE FROM {table}")
            connection.commit()
    (data / "audit.head").write_text("another head")
    (data / "audit.buffer").write_text("{}")
    call = [sys.executable, "-m", "tests.restore_kills", kind, archive, data, tmp_path]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=True)
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


@pytest.mark.parametrize("text", ["", "{}", "[" * 100_000, '{"state": 1, "moves": [[1]], "remove": []}', "\0", "é" * 9])
def test_a_journal_that_is_none_changes_nothing(data: Path, text: str) -> None:
    (data / JOURNAL).write_text(text)
    before = table_counts(data / "pogon.db")
    with pytest.raises(ConfigurationError, match="expected the journal of a restore"):
        prepare(data)
    assert table_counts(data / "pogon.db") == before
