"""Making an archive, beside a running server: copies, the manifest, its signature, and a restore into a folder that is thrown away."""

import json
import os
import shutil
import sqlite3
import tarfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

from app import __version__
from app.access.former import check_former
from app.access.restoring import finish_restore, sync_folder
from app.backup.archive import (
    DATABASES,
    FORMAT,
    KEYS,
    MANIFEST,
    MARKS,
    MOST_FILES,
    PLANT,
    SIGNATURE,
    Manifest,
    Tell,
    digest,
    need_room,
    table_counts,
    unpack,
    work_folder,
)
from app.backup.sealing import BACKUP_KEY, Opening, encrypt, sign, signing_key
from app.clock import SystemClock, to_datetime
from app.db import open_to_read
from app.errors import ConfigurationError
from app.plant.loader import PLANT_FILE

LARGEST_PLANT = 256 * 2**20
"""Of all files of a plant folder [bytes]: it holds text, not archives."""


def back_up(
    archive: Path,
    data: Path,
    plant: Path,
    *,
    keys: bool = False,
    history: bool = True,
    key_file: Path | None = None,
    encrypt_to: Sequence[str] = (),
    tell: Tell = lambda _text: None,
) -> Manifest:
    """Write `archive` (a .tar, or .tar.gz), signed and verified by restoring it into a folder that is thrown away.

    Works beside a running server. Signed with the key in `key_file`, else with `backup.key` of the data folder, which is made when missing;
    encrypted to the public keys `encrypt_to` of age.

    Raises:
        ConfigurationError: there is nothing to back up, no plant, the file exists, no room for it, a database is lost or
            damaged, or what was written does not verify.
    """
    finish_restore(data)
    if not (data / "pogon.db").is_file():
        raise ConfigurationError(
            f"{data / 'pogon.db'} is not there: nothing to back up, or POGON_DATA is another folder"
        )
    if (
        not archive.parent.is_dir()
    ):  # mistyped, or a disk that is not mounted: a folder made there would be a backup nobody finds
        raise ConfigurationError(f"{archive.parent} is no folder: a backup makes none, expected one that is there")
    if os.path.lexists(archive):
        raise ConfigurationError(f"{archive} exists already: a backup replaces no file")
    described = plant / PLANT_FILE
    if not described.is_file() or described.is_symlink():  # nobody would miss it before he restores
        raise ConfigurationError(f"{described} is not there, or no ordinary file: expected the plant folder (--plant)")
    check_former(data)
    key = signing_key(key_file or data / BACKUP_KEY, make=True)
    try:
        with work_folder(archive.parent) as work:
            wanted = DATABASES if history else DATABASES[:1]
            need_room(work, 2 * sum((data / name).stat().st_size for name in wanted if (data / name).is_file()))
            copies = work / "copies"
            copies.mkdir()
            names = [
                name for name in MARKS if _copied(data / name, copies / name)
            ]  # before the database: lines may be added
            for name in wanted:
                if (data / name).is_file():
                    tell(f"copying {name}")
                    _copy_database(data / name, copies / name)
                    names.append(name)
            if keys:
                names += [name for name in KEYS if _copied(data / name, copies / name)]
            names += _copy_plant(plant, copies / PLANT)
            manifest = Manifest(
                FORMAT,
                __version__,
                to_datetime(SystemClock().micros()).isoformat(timespec="seconds"),
                keys,
                {name: ((copies / name).stat().st_size, digest(copies / name)) for name in names},
                {name: _counted(copies / name, data / name) for name in names if name in DATABASES},
            )
            said = asdict(manifest)
            del said["signed"]
            text = json.dumps(said, indent=1, sort_keys=True).encode()
            (copies / MANIFEST).write_bytes(text)
            (copies / SIGNATURE).write_text(sign(text, key), "ascii")
            tell(f"writing {archive}")
            unfinished = work / "archive"
            _pack(copies, (MANIFEST, SIGNATURE, *names), unfinished, compress=archive.suffix in (".gz", ".tgz"))
            shutil.rmtree(copies)
            tell("verifying")
            (work / "restored").mkdir()
            unpack(unfinished, work / "restored", Opening(key))
            shutil.rmtree(work / "restored")
            if encrypt_to:
                encrypt(unfinished, work / "encrypted", encrypt_to)
                unfinished = work / "encrypted"
            unfinished.chmod(0o600)
            with unfinished.open("rb") as file:
                os.fsync(file.fileno())
            unfinished.replace(archive)
            sync_folder(archive.parent)
            return manifest
    except OSError as error:
        raise ConfigurationError(f"{archive}: {error.strerror or error}") from error


def _pack(folder: Path, names: Sequence[str], archive: Path, *, compress: bool) -> None:
    with tarfile.open(archive, "w:gz" if compress else "w") as tar:
        for name in names:
            tar.add(folder / name, name, recursive=False, filter=_plain)


def _copy_database(source: Path, target: Path) -> None:
    try:
        with closing(open_to_read(source)) as old, closing(sqlite3.connect(target)) as new:
            old.backup(new)
            new.execute("PRAGMA journal_mode = DELETE")
            new.execute("PRAGMA secure_delete = ON")
            if new.execute("SELECT 1 FROM sqlite_master WHERE name = 'session'").fetchone():
                new.execute("DELETE FROM session")
                new.commit()
    except sqlite3.Error as error:
        raise ConfigurationError(f"{source} cannot be copied: {error}") from error


def _counted(copy: Path, source: Path) -> dict[str, int]:
    try:
        return table_counts(copy)
    except sqlite3.Error as error:
        raise ConfigurationError(f"{source} is damaged: {error}") from error


def _copied(source: Path, target: Path) -> bool:
    if not source.is_file():
        return False
    shutil.copyfile(source, target)
    return True


def _copy_plant(source: Path, target: Path) -> list[str]:
    """The ordinary files of the plant folder, no links, nothing hidden; their names in the archive."""
    names: list[str] = []
    rest = LARGEST_PLANT
    for path in sorted(source.rglob("*")):
        inside = path.relative_to(source)
        if (
            path.is_file()
            and not path.is_symlink()
            and not any(part.startswith((".", "__pycache__")) for part in inside.parts)
        ):
            rest -= path.stat().st_size
            if rest < 0 or len(names) >= MOST_FILES - 10:
                raise ConfigurationError(
                    f"{source}: expected a plant of at most {MOST_FILES - 10} files and {LARGEST_PLANT >> 20} MB"
                )
            (target / inside).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target / inside)
            names.append(f"{PLANT}/{inside.as_posix()}")
    return names


def _plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid = member.gid = 0
    member.uname = member.gname = ""
    member.mode = 0o600
    return member
