"""Backup and restore: both databases, the plant folder and the marks of the audit in one tar, with a manifest that proves it.

The databases are copied with SQLite's own backup beside a running server, each as it is at one moment. Keys (`audit.key`, `secret.key`)
are left out unless asked for; sessions are never in it. Nothing of an archive is executed, and only what its manifest names is read.
"""

import hashlib
import json
import os
import re
import shutil
import sqlite3
import tarfile
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import IO, Any

from app import __version__
from app.access.keys import lock
from app.errors import ConfigurationError

FORMAT = 1
MANIFEST = "manifest.json"
DATABASES = ("pogon.db", "history.db")
MARKS = ("audit.head", "audit.anchors")
"""What the audit keeps outside the database; no secret, but without `audit.key` nobody can tell whether they are true."""
KEYS = ("audit.key", "secret.key")
PLANT = "plant"
MOST_FILES = 10_000
LONGEST_MANIFEST = 16_000_000
CHUNK = 1 << 20

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


def back_up(
    archive: Path, data: Path, plant: Path, *, keys: bool = False, history: bool = True, tell: Tell = lambda _text: None
) -> Manifest:
    """Write `archive` (a .tar, or .tar.gz) and verify it by restoring it into a folder that is thrown away. Works beside a running server.

    Raises:
        ConfigurationError: there is nothing to back up, the file exists, or what was written does not verify.
    """
    if not (data / "pogon.db").is_file():
        raise ConfigurationError(
            f"{data / 'pogon.db'} is not there: nothing to back up, or POGON_DATA is another folder"
        )
    if archive.exists():
        raise ConfigurationError(f"{archive} exists already: a backup replaces no file")
    try:
        with _work_folder(archive.parent) as work:
            names = [
                name for name in MARKS if _copied(data / name, work / name)
            ]  # before the database: lines may be added
            for name in DATABASES if history else DATABASES[:1]:
                if (data / name).is_file():
                    tell(f"copying {name}")
                    _copy_database(data / name, work / name)
                    names.append(name)
            if keys:
                names += [name for name in KEYS if _copied(data / name, work / name)]
            names += _copy_plant(plant, work / PLANT)
            manifest = Manifest(
                FORMAT,
                __version__,
                datetime.now(UTC).isoformat(timespec="seconds"),
                keys,
                {name: ((work / name).stat().st_size, _digest(work / name)) for name in names},
                {name: table_counts(work / name) for name in names if name in DATABASES},
            )
            (work / MANIFEST).write_text(json.dumps(asdict(manifest), indent=1, sort_keys=True), "utf-8")
            tell(f"writing {archive}")
            unfinished = work / "archive"
            with tarfile.open(unfinished, "w:gz" if archive.suffix in (".gz", ".tgz") else "w") as tar:
                for name in (MANIFEST, *names):
                    tar.add(work / name, name, recursive=False, filter=_plain)
            tell("verifying")
            verify_backup(unfinished)
            unfinished.chmod(0o600)
            unfinished.replace(archive)
            return manifest
    except OSError as error:
        raise ConfigurationError(f"{archive}: {error.strerror or error}") from error


def verify_backup(archive: Path) -> Manifest:
    """Restore `archive` into a folder that is thrown away: every SHA-256, every database whole, every table with its number of rows.

    Raises:
        ConfigurationError: says what is not as it was.
    """
    with _work_folder(archive.parent) as work:
        return _unpack(archive, work)


def restore(
    archive: Path, data: Path, plant: Path | None = None, *, tell: Tell = lambda _text: None
) -> tuple[Manifest, Path]:
    """Put what is in `archive` into `data`; returns its manifest and where the plant folder went.

    What was there is moved to `before-restore-…` inside `data`. The plant goes to `plant`, else to `plant` inside `data`, with every
    `writes = true` of a link turned off: a restored system commands nothing until an engineer says so. Nobody stays signed in.

    Raises:
        ConfigurationError: a server runs on `data`, the archive does not verify, or `plant` has files already.
    """
    data.mkdir(parents=True, exist_ok=True, mode=0o700)
    held = lock(data)
    try:
        with _work_folder(data) as work:
            tell(f"verifying {archive}")
            manifest = _unpack(archive, work)
            stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S")
            place = plant or data / PLANT
            if plant is None and place.exists():
                place = data / f"{PLANT}-{stamp}"
            if place.exists() and (not place.is_dir() or any(place.iterdir())):
                raise ConfigurationError(f"{place} has files already: give an empty or a new folder with --plant")
            old = data / f"before-restore-{stamp}"
            restored = [name for name in (*DATABASES, *MARKS, *KEYS) if name in manifest.files]
            moved = [name for name in restored if (data / name).exists()]
            moved += [name for name in MARKS if name not in restored and (data / name).exists()]
            moved += [
                f"{name}{tail}" for name in DATABASES for tail in ("-wal", "-shm") if (data / f"{name}{tail}").exists()
            ]
            moved += [name for name in ("audit.buffer",) if (data / name).exists()]
            if moved:
                tell(f"moving what was there to {old}")
                _settle_journal(data, [name for name in DATABASES if name in moved])
                old.mkdir(mode=0o700)
                for name in moved:
                    if (data / name).exists():
                        (data / name).replace(old / name)
            for name in restored:
                (work / name).chmod(0o600)
                (work / name).replace(data / name)
            if (work / PLANT).is_dir():
                _turn_writes_off(work / PLANT)
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copytree(work / PLANT, place, dirs_exist_ok=True)
            return manifest, place
    except OSError as error:
        raise ConfigurationError(f"{archive}: {error.strerror or error}") from error
    finally:
        os.close(held)


def table_counts(database: Path) -> dict[str, int]:
    """Rows of every table of a database file."""
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as connection:
        names = [
            row[0]
            for row in connection.execute(
                "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
            )
        ]
        return {name: connection.execute(f'SELECT count(*) FROM "{name}"').fetchone()[0] for name in sorted(names)}


def _copy_database(source: Path, target: Path) -> None:
    with closing(sqlite3.connect(f"file:{source}?mode=ro", uri=True)) as old, closing(sqlite3.connect(target)) as new:
        old.backup(new)
        new.execute("PRAGMA journal_mode = DELETE")
        new.execute("PRAGMA secure_delete = ON")
        if new.execute("SELECT 1 FROM sqlite_master WHERE name = 'session'").fetchone():
            new.execute("DELETE FROM session")
            new.commit()


def _settle_journal(data: Path, names: list[str]) -> None:
    """Take what is in the write-ahead log into the database, so that the file moved away is whole."""
    for name in names:
        try:
            with closing(sqlite3.connect(data / name)) as connection:
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        except sqlite3.Error:
            continue  # broken: that is why somebody restores


def _copied(source: Path, target: Path) -> bool:
    if not source.is_file():
        return False
    shutil.copyfile(source, target)
    return True


def _copy_plant(source: Path, target: Path) -> list[str]:
    """The ordinary files of the plant folder, no links, nothing hidden; their names in the archive."""
    names = []
    for path in sorted(source.rglob("*")):
        inside = path.relative_to(source)
        if (
            path.is_file()
            and not path.is_symlink()
            and not any(part.startswith((".", "__pycache__")) for part in inside.parts)
        ):
            (target / inside).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target / inside)
            names.append(f"{PLANT}/{inside.as_posix()}")
    return names


def _turn_writes_off(folder: Path) -> None:
    for path in folder.rglob("*.toml"):
        text = path.read_text("utf-8")
        changed = re.sub(r"(?m)^(\s*writes\s*=\s*)true\b", r"\1false  # turned off by the restore; it was true", text)
        if changed != text:
            path.write_text(changed, "utf-8")


def _unpack(archive: Path, folder: Path) -> Manifest:
    try:
        with tarfile.open(archive) as tar:
            members = iter(tar)
            first = next(members, None)
            manifest = _manifest(archive, tar, first)
            seen: set[str] = set()
            for member in members:
                _unpack_one(archive, tar, member, manifest, folder, seen)
            missing = sorted(set(manifest.files) - seen)
            if missing:
                raise ConfigurationError(f"{archive}: {missing[0]} is missing: the archive is not whole")
    except (tarfile.TarError, EOFError, OSError) as error:
        said = (str(error).splitlines() or [type(error).__name__])[0].rstrip(":")
        raise ConfigurationError(f"{archive}: {said}, expected a backup of pogon") from error
    for name, counts in manifest.counts.items():
        _check_database(archive, folder / name, counts)
    return manifest


def _manifest(archive: Path, tar: tarfile.TarFile, first: tarfile.TarInfo | None) -> Manifest:
    wrong = f"{archive}: its manifest cannot be read, expected a backup of pogon"
    if first is None or first.name != MANIFEST or not first.isreg() or first.size > LONGEST_MANIFEST:
        raise ConfigurationError(wrong)
    try:
        content: dict[str, Any] = json.loads(_open(tar, first).read())
        files = {str(name): (int(size), str(digest)) for name, (size, digest) in content["files"].items()}
        counts = {
            str(name): {str(table): int(rows) for table, rows in tables.items()}
            for name, tables in content["counts"].items()
        }
        manifest = Manifest(
            int(content["format"]),
            str(content["version"]),
            str(content["created"]),
            bool(content["keys"]),
            files,
            counts,
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(wrong) from error
    if manifest.format != FORMAT:
        raise ConfigurationError(
            f"{archive}: format {manifest.format}, expected {FORMAT}: it is of another version of pogon"
        )
    if len(files) > MOST_FILES or "pogon.db" not in files or set(counts) - set(DATABASES) or set(counts) - set(files):
        raise ConfigurationError(wrong)
    for name in files:
        parts = PurePosixPath(name).parts
        plain = name in (*DATABASES, *MARKS, *KEYS) or (len(parts) > 1 and parts[0] == PLANT)
        if not plain or ".." in parts or "\\" in name or "\0" in name or PurePosixPath(*parts).as_posix() != name:
            raise ConfigurationError(f"{archive}: {name} is no name of a file that belongs into a backup")
    return manifest


def _unpack_one(
    archive: Path, tar: tarfile.TarFile, member: tarfile.TarInfo, manifest: Manifest, folder: Path, seen: set[str]
) -> None:
    if not member.isreg() or member.name not in manifest.files or member.name in seen:
        raise ConfigurationError(f"{archive}: {member.name} is not named in its manifest, or no file, or there twice")
    size, digest = manifest.files[member.name]
    if member.size != size:
        raise ConfigurationError(f"{archive}: {member.name} has {member.size} bytes, its manifest says {size}")
    seen.add(member.name)
    target = folder / member.name
    target.parent.mkdir(parents=True, exist_ok=True)
    with _open(tar, member) as source, target.open("xb") as sink:
        shutil.copyfileobj(source, sink, CHUNK)
    if _digest(target) != digest:
        raise ConfigurationError(f"{archive}: {member.name} was changed: its SHA-256 is not that of the manifest")


def _check_database(archive: Path, database: Path, counts: Mapping[str, int]) -> None:
    try:
        with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as connection:
            sound = connection.execute("PRAGMA integrity_check").fetchone()[0]
        found = table_counts(database)
    except sqlite3.Error as error:
        raise ConfigurationError(f"{archive}: {database.name}: {error}") from error
    if sound != "ok":
        raise ConfigurationError(f"{archive}: {database.name}: {sound}")
    for table in sorted(set(found) | set(counts)):
        if found.get(table) != counts.get(table):
            raise ConfigurationError(
                f"{archive}: {database.name}: table {table} has {found.get(table)} rows, its manifest says {counts.get(table)}"
            )


def _open(tar: tarfile.TarFile, member: tarfile.TarInfo) -> IO[bytes]:
    file = tar.extractfile(member)
    assert file is not None
    return file


def _plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid = member.gid = 0
    member.uname = member.gname = ""
    member.mode = 0o600
    return member


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def _work_folder(beside: Path) -> Iterator[Path]:
    beside.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".pogon-", dir=beside) as name:
        yield Path(name)
