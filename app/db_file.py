"""The file of an open database: whether what lies under its name is still what was opened.

SQLite goes on writing into a file that was deleted, and into one that another program wrote over. Nothing of that is an error until it
is too late, so it is looked for: device, inode, size, the first bytes and the id of the file, and that its journal is there.
"""

import os
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from app.db_journal import Journal

MAGIC = b"SQLite format 3\x00"
HEADER = 100
"""Bytes that SQLite's file header has. Source: sqlite.org/fileformat.html, 1.3."""


class Loss(StrEnum):
    """What became of a database file. Texts: `alarm.loss.<value>` of the product."""

    REMOVED = "removed"
    REPLACED = "replaced"
    """Another file lies under its name."""
    EMPTIED = "emptied"
    TRUNCATED = "truncated"
    OVERWRITTEN = "overwritten"
    """The same file, with another content."""
    JOURNAL = "journal"
    """Its journal (`-wal`, `-shm`) was removed; what it held since the last checkpoint is in no file."""
    JOURNAL_DAMAGED = "journal_damaged"
    """Its journal or the index of it was cut or written over."""
    OLDER = "older"
    """An older state of the same database; only found at the start."""


class Mended(StrEnum):
    """What was done about it. Texts: `alarm.mended.<value>` of the product."""

    RESTORED = "restored"
    """Written anew from what the server had open: nothing is lost."""
    SHORTENED = "shortened"
    """Opened anew without what its journal held and is not there any more: rows since the last checkpoint."""
    FRESH = "fresh"
    """A new file was begun; what was there is lost, or in the file set aside."""
    ADOPTED = "adopted"
    """The file found under its name is used from now on."""
    NOTHING = "nothing"
    """Nothing could be done."""


@dataclass(frozen=True, slots=True)
class Incident:
    """A database file was lost, and what was done."""

    database: str
    """Name of the file."""
    loss: Loss
    mended: Mended
    aside: str = ""
    """Name under which the file that was found was put aside; empty: none was."""
    reason: str = ""
    """Why nothing could be done."""


@dataclass(frozen=True, slots=True)
class _Header:
    """What the first bytes of a database file say."""

    magic: bool
    id: int
    """Application id; 0 = none."""
    size: int
    """Bytes that the file has at least."""


class OpenFile:
    """The file that was opened under `path`, held open until `close`.

    Only `close` it when SQLite has closed it: closing any descriptor of a file gives up the locks of the whole process (POSIX).
    """

    def __init__(self, path: Path) -> None:
        """Raises:
        OSError: the file cannot be opened.
        """
        self.path = path
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        about = os.fstat(self._descriptor)
        self._inode = (about.st_dev, about.st_ino)
        self._size = about.st_size
        self._header = self._read()
        self._journal: dict[str, tuple[int, int]] = {}
        self.journal = Journal(path)
        self._look_at_journal()

    @property
    def id(self) -> int:
        """Application id of the database, as far as it is in the file; 0 = none."""
        return self._header.id

    @property
    def whole(self) -> bool:
        """Whether the file is as long as it says; what is in its journal may still make it longer."""
        return self._header.magic and (self._size >= self._header.size or bool(self.journals()))

    def look(self) -> Loss | None:
        """What became of the file since it was opened; None: it is as it should be. Costs some microseconds.

        Raises:
            OSError: the folder cannot be read.
        """
        try:
            found = self.path.stat()
        except FileNotFoundError:
            return Loss.REMOVED
        if (found.st_dev, found.st_ino) != self._inode:
            return Loss.REPLACED
        if found.st_size == 0:
            return Loss.EMPTIED
        header = self._read()
        if not header.magic or (self._header.id and header.id != self._header.id):
            return Loss.OVERWRITTEN
        if found.st_size < self._size and found.st_size < header.size:
            return Loss.TRUNCATED
        self._size, self._header = found.st_size, header
        return self._look_at_journal()

    def journals(self, *, foreign: bool = False) -> list[Path]:
        """Journals under its name; only those that are not the ones that were open, when `foreign`."""
        names = (self.path.with_name(self.path.name + tail) for tail in ("-wal", "-shm"))
        found = {name: inode for name in names if (inode := _inode(name))}
        return [name for name, inode in found.items() if not foreign or self._journal.get(name.name) != inode]

    def close(self) -> None:
        """Let it go."""
        self.journal.close()
        os.close(self._descriptor)

    def _look_at_journal(self) -> Loss | None:
        for tail in ("-wal", "-shm"):
            name = self.path.with_name(self.path.name + tail)
            inode, known = _inode(name), self._journal.get(name.name)
            if known is None and inode is not None:
                self._journal[name.name] = inode
            elif known != inode:
                return Loss.JOURNAL
        return Loss.JOURNAL_DAMAGED if self.journal.damaged() else None

    def _read(self) -> _Header:
        head = os.pread(self._descriptor, HEADER, 0)
        if len(head) < HEADER or not head.startswith(MAGIC):
            return _Header(False, 0, 0)
        page = int.from_bytes(head[16:18], "big")
        return _Header(
            True,
            int.from_bytes(head[68:72], "big"),
            int.from_bytes(head[28:32], "big") * (65_536 if page == 1 else page),
        )


def starts_well(path: Path) -> bool:
    """Whether the first bytes are those of a database."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def _inode(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino
