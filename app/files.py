"""Files that other people wrote: ordinary ones only, of an agreed size, inside the folder they belong to; opening one never waits.

A plant folder, a list of people or an archive may hold anything: a pipe that nobody writes to, a device, a link to a file that is none of
our business. Each is one line, and nothing of its content is shown.
"""

import os
import re
import stat
from collections.abc import Iterator
from contextlib import suppress
from errno import ENOSPC
from pathlib import Path
from typing import BinaryIO

from app.errors import MissingFile, UnusableFile

KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
ORDINARY = "an ordinary file"
UNFINISHED = re.compile(r"\.(.+)\.(?:new|[0-9a-f]{8})")
"""What a file that is written beside another, and then takes its place, is called."""
AT_WORK = 60.0
"""A file that is written beside another one is in its place by then [s]."""
PIECE = 1_000_000
"""A file is read in such pieces [bytes]."""


def open_ordinary(path: Path, *, inside: Path | None = None) -> BinaryIO:
    """Open `path` for reading if it is an ordinary file and, links followed, lies in the folder `inside`.

    Raises:
        MissingFile: it is not there.
        UnusableFile: it is no ordinary file, lies elsewhere or may not be read.
    """
    try:
        real = Path(os.path.realpath(path, strict=True))
        if inside is not None and not real.is_relative_to(os.path.realpath(inside)):
            raise UnusableFile(path, "a link that leads out of its folder", f"{ORDINARY} in {inside}")
        _check(path, real.stat().st_mode)
        handle = os.open(real, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY | os.O_NOFOLLOW)
        try:
            _check(path, os.fstat(handle).st_mode)  # another one may have been put there meanwhile
            return os.fdopen(handle, "rb")
        except BaseException:
            os.close(handle)
            raise
    except (FileNotFoundError, NotADirectoryError) as error:
        raise MissingFile(path, "no such file", ORDINARY) from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise UnusableFile(path, getattr(error, "strerror", None) or str(error), ORDINARY) from error


def read_bytes(path: Path, most: int, *, inside: Path | None = None) -> bytes:
    """All of `path`, at most `most` bytes.

    Raises:
        MissingFile, UnusableFile: as `open_ordinary`, or the file is larger.
    """
    with open_ordinary(path, inside=inside) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            content = b"".join(_pieces(file, most + 1)) if size <= most else b""
        except OSError as error:
            raise UnusableFile(path, error.strerror or str(error), ORDINARY) from error
    if size > most or len(content) > most:
        raise UnusableFile(path, f"{max(size, len(content))} bytes", f"at most {most} bytes")
    return content


def read_text(path: Path, most: int, *, inside: Path | None = None) -> str:
    """The text in `path`, UTF-8 with or without its mark.

    Raises:
        MissingFile, UnusableFile: as `read_bytes`, or it is no such text.
    """
    content = read_bytes(path, most, inside=inside)
    expected = "text in UTF-8"
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"byte 0x{error.object[error.start]:02x}"
        raise UnusableFile(path, found, expected, error.object[: error.start].count(b"\n") + 1) from error


def may_exchange(path: Path) -> bool:
    """Whether `exchange_file` may do its work: the folder of `path` takes a new file. False on a file system that is mounted read only."""
    folder = Path(os.path.realpath(path)).parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def exchange_file(path: Path, content: bytes) -> None:
    """Put `content` in the place of the file `path`: whole or not at all, whatever happens meanwhile; who may read it stays as it was.

    Raises:
        OSError: it was not done (disk full, no right); the file is as before.
    """
    real = Path(os.path.realpath(path))
    beside = real.with_name(f".{real.name}.new")
    handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    try:
        with os.fdopen(handle, "wb") as file:
            os.fchmod(file.fileno(), stat.S_IMODE(real.stat().st_mode))
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(real)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise
    with suppress(OSError):  # the name is on the disk as well
        folder = os.open(real.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def remove_unfinished(folder: Path, now: int) -> list[Path]:
    """Remove what `exchange_file` or `write_private` left in `folder` when they were killed; returns it.

    What was written in the last minute before `now` [µs UTC] may be another process at its work. One that cannot be removed stays.
    """
    removed = []
    for path in sorted(folder.glob(".*")):
        of = UNFINISHED.fullmatch(path.name)
        if of is None or not (folder / of[1]).is_file():
            continue
        with suppress(OSError):
            found = path.lstat()
            if stat.S_ISREG(found.st_mode) and not 0 <= now - found.st_mtime * 1e6 < AT_WORK * 1e6:
                path.unlink()
                removed.append(path)
    return removed


def append_line(path: Path, line: str) -> None:
    """Add `line` behind the others in the file `path`, which nobody else may read; on the disk when it returns, whole or not at all.

    Raises:
        OSError: it was not done (disk full, no right); the file is as before.
    """
    content = (line + "\n").encode()
    handle = os.open(path, os.O_CREAT | os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC, 0o600)
    try:
        size = os.fstat(handle).st_size
        try:
            if os.write(handle, content) < len(content):
                raise OSError(ENOSPC, os.strerror(ENOSPC))
            os.fsync(handle)
        except BaseException:
            with suppress(OSError):  # else what is there of it would be the beginning of the next line
                os.ftruncate(handle, size)
            raise
    finally:
        os.close(handle)


def _pieces(file: BinaryIO, most: int) -> Iterator[bytes]:
    """The first `most` bytes of `file`; room is made for what is there, not for all that may be."""
    while piece := file.read(min(most, PIECE)):
        most -= len(piece)
        yield piece


def _check(path: Path, mode: int) -> None:
    for is_kind, name in KINDS:
        if is_kind(mode):
            raise UnusableFile(path, name, ORDINARY)
    if not stat.S_ISREG(mode):
        raise UnusableFile(path, "no file", ORDINARY)
