"""Bringing an archive back: everything is put beside what is there, then renamed as one step (access/restoring.py)."""

import os
import re
import shutil
import sqlite3
from collections.abc import Iterator, Set
from contextlib import closing
from pathlib import Path
from typing import Any

import tomli

from app.access.keys import lock, read_mark, write_mark
from app.access.restoring import UNTOLD, commit, finish_restore, note_untold, stage, sync_folder, sync_tree
from app.backup.archive import DATABASES, KEYS, MARKS, PLANT, Manifest, Tell, unpack
from app.backup.sealing import Opening
from app.clock import SystemClock, to_datetime
from app.errors import ConfigurationError

AUDIT_KEY = "audit.key"
_WRITES = re.compile(rb"""(\bwrites["']?[ \t]*=[ \t]*)true\b""")


def restore(
    archive: Path,
    data: Path,
    plant: Path | None = None,
    *,
    opening: Opening,
    tell: Tell = lambda _text: None,
) -> tuple[Manifest, Path]:
    """Put what is in `archive` into `data`; returns its manifest and where the plant folder went.

    What was there is moved to `before-restore-…` inside `data`. The plant goes to `plant`, else to `plant` inside `data`, with every
    `writes = true` of a link turned off: a restored system commands nothing until an engineer says so. Nobody stays signed in.
    Killed at any moment it leaves the old state, or a journal with which the next start completes the new one.

    Raises:
        ConfigurationError: a server runs on `data`, the archive does not verify, there is no room, a folder cannot be made, or `plant`
            has files already.
    """
    try:
        data.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise ConfigurationError(f"POGON_DATA={data} cannot be used: {error.strerror}") from error
    data = data.resolve()
    held = lock(data)
    try:
        finish_restore(data, locked=True)
        stamp = _free_stamp(data)
        place = (plant or data / PLANT).absolute()
        if plant is None and place.exists():
            place = data / f"{PLANT}-{stamp}"
        if place.exists() and (not place.is_dir() or any(place.iterdir())):
            raise ConfigurationError(f"{place} has files already: give an empty or a new folder with --plant")
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigurationError(f"{place}: {error.strerror}, expected a new folder with --plant") from error
        staging, old, near = (
            data / f".restore-{stamp}",
            data / f"before-restore-{stamp}",
            place.parent / f".restore-{stamp}",
        )
        stage(data, {staging, old, near})
        try:
            staging.mkdir(mode=0o700)
            tell(f"verifying {archive}")
            manifest = unpack(archive, staging, opening)
            moves = _staged_plant(staging, near, place)
            tell("taking it over")
            names = {*manifest.files, *_without_mark(staging, data)}
            line = note_untold(staging, archive.name, manifest.created, signed=manifest.signed)
            moves = [*_old_files(data, old, names), *_new_files(staging, data, names), (line, data / UNTOLD), *moves]
            sync_tree(staging)
            commit(data, moves, [staging, near])
        except BaseException:
            finish_restore(data, locked=True)
            raise
        finish_restore(data, locked=True)
        sync_folder(place.parent)
        return manifest, place
    except (OSError, sqlite3.Error) as error:
        raise ConfigurationError(f"{archive}: {getattr(error, 'strerror', None) or error}") from error
    finally:
        os.close(held)


def _free_stamp(data: Path) -> str:
    stamp = to_datetime(SystemClock().micros()).strftime("%Y%m%dT%H%M%S")
    number = 1
    while (data / f"before-restore-{stamp}").exists() or (data / f"{PLANT}-{stamp}").exists():
        number += 1
        stamp = f"{stamp.partition('.')[0]}.{number}"
    return stamp


def _without_mark(staging: Path, data: Path) -> list[str]:
    """Stage the key of the audit without its mark: the chain goes on where the backup ends. Returns its name if it was staged."""
    key = next((folder / AUDIT_KEY for folder in (staging, data) if (folder / AUDIT_KEY).exists()), None)
    if key is None or read_mark(key) is None:
        return []
    if key.parent != staging:
        shutil.copyfile(key, staging / AUDIT_KEY)
    write_mark(staging / AUDIT_KEY, None)
    return [AUDIT_KEY]


def _old_files(data: Path, old: Path, names: Set[str]) -> Iterator[tuple[Path, Path]]:
    """Where what is there goes: all that is replaced, and what belongs to it."""
    restored = [name for name in (*DATABASES, *MARKS, *KEYS) if name in names]
    for name in restored:
        if name in DATABASES and (data / name).exists():
            _settle_journal(data / name)
    tails = [f"{name}{tail}" for name in restored if name in DATABASES for tail in ("-wal", "-shm")]
    aside = [
        name for name in dict.fromkeys((*restored, *MARKS, *tails, "audit.buffer", UNTOLD)) if (data / name).exists()
    ]
    if aside:
        old.mkdir(mode=0o700)
    for name in aside:
        yield data / name, old / name


def _new_files(staging: Path, data: Path, names: Set[str]) -> Iterator[tuple[Path, Path]]:
    for name in (*DATABASES, *MARKS, *KEYS):
        if name in names:
            (staging / name).chmod(0o600)
            yield staging / name, data / name


def _staged_plant(staging: Path, near: Path, place: Path) -> list[tuple[Path, Path]]:
    """The plant folder with its links turned off, on the disk on which it shall lie."""
    folder = staging / PLANT
    if not folder.is_dir():
        return []
    _turn_writes_off(folder)
    if near == staging:
        return [(folder, place)]
    try:
        near.mkdir(mode=0o700)
    except OSError as error:
        raise ConfigurationError(f"{place}: {error.strerror}") from error  # else it would be said of the archive
    shutil.copytree(folder, near / PLANT)
    sync_tree(near)
    return [(near / PLANT, place)]


def _settle_journal(database: Path) -> None:
    """Take what is in the write-ahead log into the database, so that the file moved away is whole."""
    try:
        with closing(sqlite3.connect(database)) as connection:
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    except sqlite3.Error:
        pass  # broken: that is why somebody restores


def _turn_writes_off(folder: Path) -> None:
    for path in folder.rglob("*.toml"):
        text = path.read_bytes()
        changed = _WRITES.sub(rb"\1false", text)
        if changed != text:
            path.write_bytes(b"# writes turned off by the restore: they were true\n" + changed)
        if _writes(changed):
            raise ConfigurationError(
                f"{path.name}: its links cannot be turned off: expected writes = true, written plainly"
            )


def _writes(text: bytes) -> bool:
    """Whether a link of this plant file, if it is one, writes."""
    try:
        links: Any = tomli.loads(text.decode("utf-8-sig")).get("links", {})
    except (ValueError, RecursionError):
        return False  # no plant that anybody can start
    return isinstance(links, dict) and any(
        isinstance(link, dict) and link.get("writes") is True for link in links.values()
    )
