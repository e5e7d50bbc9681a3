"""An archive is believed only as far as it can be proved."""

import gzip
import io
import json
import resource
import shutil
import tarfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.backup import Manifest, Opening, back_up
from app.errors import ConfigurationError
from tests.backup.shelf import restore, rewritten, verify_backup


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


@pytest.mark.sweep(8)
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


def head_of(size: int, kind: bytes) -> bytes:
    """The head of a member of a tar that says it is `size` long."""
    member = tarfile.TarInfo("plant/x")
    member.size, member.type = size, kind
    return member.tobuf(tarfile.GNU_FORMAT)


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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
