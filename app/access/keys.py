"""Files that only the server may read: keys, the first code, the databases. 0600, or the server does not start."""

import fcntl
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from app import chance
from app.access.private import check_entered, write_private
from app.access.restoring import finish_restore
from app.errors import ConfigurationError, UnusableFile
from app.files import read_bytes, read_text

KEY_BYTES = 32
LARGEST_KEY_FILE = 65_536
PRIVATE = (
    "secret.key",
    "audit.key",
    "backup.key",
    "factor.identity",
    "first-code",
    "pogon.db",
    "pogon.db-wal",
    "pogon.db-shm",
    "audit.buffer",
)
"""Files of POGON_DATA that nobody else may read or write."""
OPENED = (*PRIVATE, "audit.head", "audit.anchors", "audit.foreign", "server.lock", "history.db")
"""All that are opened at a start; a pipe or a device among them would keep it waiting."""


def check_files(data: Path) -> None:
    """Refuse a data folder that others could change, or files in it that they could read.

    Raises:
        ConfigurationError: names the file, its mode and the command that puts it right; or the folder, into which one may not look.
    """
    check_entered(data)
    if data.is_dir() and stat.S_IMODE(data.stat().st_mode) & 0o002:
        raise ConfigurationError(
            f"{data} may be written by everybody (mode {stat.S_IMODE(data.stat().st_mode):04o}): chmod 0700 {data}"
        )
    for path in (data / name for name in PRIVATE):
        if path.exists() and stat.S_IMODE(path.stat().st_mode) & 0o077:
            if path.is_dir():
                raise ConfigurationError(
                    f"{path} is a folder that others may use, expected an ordinary file: move it away"
                )
            raise ConfigurationError(
                f"{path} may be read or written by others (mode {stat.S_IMODE(path.stat().st_mode):04o}): chmod 0600 {path}"
            )


def check_kinds(data: Path) -> None:
    """Refuse a file of the data folder that would keep its reader waiting.

    Raises:
        ConfigurationError: names it, or the folder, into which one may not look.
    """
    check_entered(data)
    for path in (data / name for name in OPENED):
        if path.exists() and not path.is_dir() and not path.is_file():
            raise ConfigurationError(f"{path}: a pipe, a socket or a device, expected an ordinary file")


def prepare(data: Path) -> None:
    """Make the data folder (0700) and an empty private database file, if missing, and check what is there; end an interrupted restore.

    Raises:
        ConfigurationError: as `check_files`, or the folder cannot be made.
    """
    try:
        data.mkdir(parents=True, exist_ok=True, mode=0o700)
        finish_restore(data)
        check_files(data)
        # SQLite gives its journal files the mode of the database itself
        os.close(os.open(data / "pogon.db", os.O_CREAT | os.O_RDWR, 0o600))
    except OSError as error:
        raise ConfigurationError(f"POGON_DATA={data} cannot be used: {error.strerror}") from error


def lock(data: Path) -> int:
    """Keep a second server off this folder while this process lives; returns the file that holds the lock.

    Raises:
        ConfigurationError: another server runs on it, or its file cannot be used.
    """
    try:
        handle = os.open(data / "server.lock", os.O_CREAT | os.O_RDWR, 0o600)
    except OSError as error:
        raise ConfigurationError(f"{data / 'server.lock'}: {error.strerror}, expected an ordinary file") from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(handle)
        raise ConfigurationError(f"POGON_DATA={data} is in use: another pogon runs on it") from error
    return handle


def read_key(path: Path) -> bytes:
    """The key in `path`, 32 bytes as hex, its first line; a missing one is made, different on every installation.

    Raises:
        ConfigurationError: the file is not a key, or cannot be written.
    """
    if not path.exists():
        try:
            write_private(path, chance.token_hex(KEY_BYTES) + "\n", exclusive=True)
        except OSError as error:
            raise ConfigurationError(f"{path} cannot be written: {error.strerror}") from error
    try:
        key = bytes.fromhex(read_text(path, LARGEST_KEY_FILE).strip().partition("\n")[0])
    except (ValueError, OSError, ConfigurationError) as error:
        raise ConfigurationError(f"{path} is not a key of {KEY_BYTES} bytes in hex") from error
    if len(key) != KEY_BYTES:
        raise ConfigurationError(f"{path} has {len(key)} bytes, a key has {KEY_BYTES}")
    return key


@dataclass(frozen=True, slots=True)
class Mark:
    """What stands behind the key of the audit: which installation this is, and a line that its chain has had."""

    install: str
    seq: int
    mac: str
    sign: str


def read_mark(path: Path) -> Mark | None:
    """The mark behind the key in the file `path`; None when there is none. One that cannot be read is a mark that nothing agrees with."""
    try:
        _, _, text = read_bytes(path, LARGEST_KEY_FILE).decode("ascii").strip().partition("\n")
        if not text.strip():
            return None
        word, install, seq, mac, sign = text.split()
        return Mark(install, int(seq), mac, sign if word == "mark" else "")
    except UnusableFile:
        return None
    except ValueError:
        return Mark("", 1, "", "")


def write_mark(path: Path, mark: Mark | None) -> None:
    """Write `mark` behind the key in `path`, or take it away: a restored chain ends where it ends.

    Raises:
        OSError: the disk does not take it; the file is as it was.
        ConfigurationError: there is no key in it.
    """
    line = f"mark {mark.install} {mark.seq} {mark.mac} {mark.sign}\n" if mark else ""
    write_private(path, f"{read_key(path).hex()}\n{line}")
