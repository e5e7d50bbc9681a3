"""An archive read within limits: the manifest and its signature first, then only what it names, as much as it says."""

import fcntl
import gzip
import hashlib
import json
import os
import shutil
import sqlite3
import tarfile
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Any

from app.backup.sealing import AGE, Opening, check_signature, decrypt
from app.db import open_to_read
from app.errors import ConfigurationError
from app.files import open_ordinary

FORMAT = 2
READABLE = (1, FORMAT)
"""1 had no signature."""
MANIFEST = "manifest.json"
SIGNATURE = "manifest.hmac"
DATABASES = ("pogon.db", "history.db")
MARKS = ("audit.head", "audit.anchors")
"""What the audit keeps outside the database; no secret, but without `audit.key` nobody can tell whether they are true."""
KEYS = ("audit.key", "secret.key", "factor.identity")
PLANT = "plant"
MOST_FILES = 10_000
MOST_BYTES = 256 * 2**30
"""Of all files of an archive, beside the space that is free."""
RESERVE = 64 * 2**20
"""Space that stays free [bytes]."""
LONGEST_MANIFEST = 4_000_000
CHUNK = 1 << 20
WORK = ".pogon-"
"""Work folders begin so."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Manifest:
    """What is in an archive."""

    format: int
    version: str
    created: str
    """ISO 8601 UTC."""
    keys: bool
    """Whether the keys are in it."""
    files: Mapping[str, tuple[int, str]]
    """Name → size, SHA-256."""
    counts: Mapping[str, Mapping[str, int]]
    """Database → table → rows."""
    signed: bool = True
    """Whether its signature was checked."""


def verify_backup(archive: Path, opening: Opening) -> Manifest:
    """Restore `archive` into a folder that is thrown away: every SHA-256, every database whole, every table with its number of rows.

    Raises:
        ConfigurationError: says what is not as it was, or that there is no room to try.
    """
    with work_folder(archive.parent) as work:
        return unpack(archive, work, opening)


def unpack(archive: Path, folder: Path, opening: Opening) -> Manifest:
    """Put the files of `archive` into `folder` and check each.

    Raises:
        ConfigurationError: as `verify_backup`.
    """
    try:
        with open_ordinary(archive) as file:
            encrypted = file.read(len(AGE)) == AGE
            size = os.fstat(file.fileno()).st_size
        if not encrypted:
            return _unpack(archive, archive, folder, opening)
        need_room(folder, size)
        plain = folder / ".decrypted"
        decrypt(archive, plain, opening.identities)
        try:
            return _unpack(archive, plain, folder, opening)
        finally:
            plain.unlink()
    except (tarfile.TarError, EOFError, OSError, zlib.error) as error:
        said = (str(getattr(error, "strerror", None) or error).splitlines() or [type(error).__name__])[0].rstrip(":")
        raise ConfigurationError(f"{archive}: {said[:200]}, expected a backup of pogon") from error


def need_room(folder: Path, size: int) -> None:
    """Refuse what does not fit.

    Raises:
        ConfigurationError: less than `size` [bytes] and a reserve is free where `folder` is.
    """
    free = shutil.disk_usage(folder).free
    if size + RESERVE > free:
        raise ConfigurationError(
            f"{folder}: {free / 1e6:.0f} MB are free, expected {(size + RESERVE) / 1e6:.0f} MB for what is to be written"
        )


def table_counts(database: Path) -> dict[str, int]:
    """Rows of every table of a database file."""
    with closing(open_to_read(database)) as connection:
        names = [
            row[0]
            for row in connection.execute(
                "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
            )
        ]
        quoted = {name: name.replace('"', '""') for name in sorted(names)}
        return {
            name: connection.execute(f'SELECT count(*) FROM "{safe}"').fetchone()[0] for name, safe in quoted.items()
        }


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def work_folder(beside: Path) -> Iterator[Path]:
    """A folder that is gone afterwards; those that killed ones left are removed."""
    beside.mkdir(parents=True, exist_ok=True)
    for left in beside.glob(f"{WORK}*"):
        with suppress(OSError), _held(left):
            shutil.rmtree(left)
    with tempfile.TemporaryDirectory(prefix=WORK, dir=beside) as name, _held(Path(name)):
        yield Path(name)


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Show others that a folder is in use. Raises OSError where another one uses it, or it is no folder of ours."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


class _Metered:
    """A reader that gives no more than was agreed: neither at once, as the head of a tar may ask for, nor in all."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.rest = LONGEST_MANIFEST + CHUNK

    def read(self, size: int = -1) -> bytes:
        """At most `size` bytes."""
        if not 0 <= size <= LONGEST_MANIFEST or self.rest <= 0:
            raise tarfile.ReadError("more in it than its manifest says")
        content = self._file.read(size)
        self.rest -= len(content)
        return content


def _unpack(archive: Path, file: Path, folder: Path, opening: Opening) -> Manifest:
    with open_ordinary(file) as raw, _plain(raw) as stream:
        metered = _Metered(stream)
        with tarfile.open(fileobj=metered, mode="r|", bufsize=64 * 1024) as tar:  # type: ignore[call-overload]
            members = iter(tar)
            said, signature, following = _heads(archive, tar, members)
            signed = check_signature(archive, said, signature, opening)
            manifest = _manifest(archive, said, signed=signed)
            total = sum(size for size, _ in manifest.files.values())
            if total > MOST_BYTES:
                raise ConfigurationError(f"{archive}: {total} bytes in it, expected at most {MOST_BYTES}")
            need_room(folder, total)
            metered.rest += total + (len(manifest.files) + 20) * 4096  # a tar's heads and padding
            seen: set[str] = set()
            if following:
                _unpack_one(archive, tar, following, manifest, folder, seen)
            for member in members:
                _unpack_one(archive, tar, member, manifest, folder, seen)
            missing = sorted(set(manifest.files) - seen)
            if missing:
                raise ConfigurationError(f"{archive}: {missing[0]} is missing: the archive is not whole")
    for name, counts in manifest.counts.items():
        _check_database(archive, folder / name, counts)
    return manifest


def _plain(raw: IO[bytes]) -> IO[bytes]:
    compressed = raw.read(2) == b"\x1f\x8b"
    raw.seek(0)
    return gzip.open(raw) if compressed else raw  # type: ignore[return-value]


def _heads(
    archive: Path, tar: tarfile.TarFile, members: Iterator[tarfile.TarInfo]
) -> tuple[bytes, str, tarfile.TarInfo | None]:
    """The manifest, its signature (empty = none), and the member that was read in vain for one."""
    first = next(members, None)
    if first is None or first.name != MANIFEST or not first.isreg() or first.size > LONGEST_MANIFEST:
        raise ConfigurationError(f"{archive}: its manifest cannot be read, expected a backup of pogon")
    said = _open(tar, first).read()
    second = next(members, None)
    if second is None or second.name != SIGNATURE:
        return said, "", second
    if not second.isreg() or second.size > 1000:
        raise ConfigurationError(f"{archive}: its signature cannot be read")
    return said, _open(tar, second).read().decode("ascii", "replace"), None


def _manifest(archive: Path, said: bytes, *, signed: bool) -> Manifest:
    wrong = f"{archive}: its manifest cannot be read, expected a backup of pogon"
    try:
        content: dict[str, Any] = json.loads(said)
        files = {str(name): (_whole(size), str(digest)) for name, (size, digest) in content["files"].items()}
        counts = {
            str(name): {str(table): _whole(rows) for table, rows in tables.items()}
            for name, tables in content["counts"].items()
        }
        manifest = Manifest(
            _whole(content["format"]),
            _shown(content["version"]),
            _shown(content["created"]),
            bool(content["keys"]),
            files,
            counts,
            signed,
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ConfigurationError(wrong) from error
    if manifest.format not in READABLE:
        raise ConfigurationError(
            f"{archive}: format {manifest.format}, expected {FORMAT}: it is of another version of pogon"
        )
    if len(files) > MOST_FILES or "pogon.db" not in files or set(counts) - set(DATABASES) or set(counts) - set(files):
        raise ConfigurationError(wrong)
    for name in files:
        parts = PurePosixPath(name).parts
        known = name in (*DATABASES, *MARKS, *KEYS) or (len(parts) > 1 and parts[0] == PLANT)
        odd = ".." in parts or "\\" in name or not name.isprintable() or len(name) > 1000
        if not known or odd or PurePosixPath(*parts).as_posix() != name:
            raise ConfigurationError(f"{archive}: {name[:100]!r} is no name of a file that belongs into a backup")
    return manifest


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        raise ValueError("no whole number")
    return value


def _shown(value: object) -> str:
    if not isinstance(value, str) or len(value) > 100 or not value.isprintable():
        raise ValueError("no short text")
    return value


def _unpack_one(
    archive: Path, tar: tarfile.TarFile, member: tarfile.TarInfo, manifest: Manifest, folder: Path, seen: set[str]
) -> None:
    if not member.isreg() or member.name not in manifest.files or member.name in seen:
        raise ConfigurationError(
            f"{archive}: {member.name[:100]!r} is not named in its manifest, or no file, or there twice"
        )
    size, expected = manifest.files[member.name]
    if member.size != size:
        raise ConfigurationError(f"{archive}: {member.name} has {member.size} bytes, its manifest says {size}")
    seen.add(member.name)
    target = folder / member.name
    target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    with _open(tar, member) as source, target.open("xb") as sink:
        shutil.copyfileobj(source, sink, CHUNK)
    if digest(target) != expected:
        raise ConfigurationError(f"{archive}: {member.name} was changed: its SHA-256 is not that of the manifest")


def _check_database(archive: Path, database: Path, counts: Mapping[str, int]) -> None:
    try:
        with closing(open_to_read(database)) as connection:
            sound = connection.execute("PRAGMA integrity_check").fetchone()[0]
        found = table_counts(database)
    except sqlite3.Error as error:
        raise ConfigurationError(f"{archive}: {database.name}: {error}") from error
    if sound != "ok":
        raise ConfigurationError(f"{archive}: {database.name}: {sound[:200]}")
    for table in sorted(set(found) | set(counts)):
        if found.get(table) != counts.get(table):
            raise ConfigurationError(
                f"{archive}: {database.name}: table {table[:100]!r} has {found.get(table)} rows, "
                f"its manifest says {counts.get(table)}"
            )


def _open(tar: tarfile.TarFile, member: tarfile.TarInfo) -> IO[bytes]:
    file = tar.extractfile(member)
    assert file is not None
    return file
