"""The journal (`-wal`) of an open database and the index of it (`-shm`): whether they are as SQLite left them.

SQLite believes its index and reads whatever lies in the journal at that place: one that was cut is a read error until somebody opens the
file anew, and the next checkpoint would carry what is not there any more into the database. Source of all places:
sqlite.org/fileformat2.html section 4, sqlite.org/walformat.html section 2.
"""

import ctypes
import os
import select
import signal
import struct
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Order = Literal["little", "big"]

WAL_HEADER, FRAME_HEADER = 32, 24
"""[bytes]"""
INDEX_HEADER = 48
"""Bytes of the index's header, which is there twice."""
BACKFILLED = 96
"""Where the index says how many frames are in the database file."""
WAL_MAGIC = (0x377F0682, 0x377F0683)
"""Checksums over little-endian and over big-endian words."""
INITIALISED = 12
"""Where the index says that it is one."""
INDEX_LENGTH = 1 << 21
"""An index that was cut is made at least so long again [bytes]: enough for 260 000 frames; what nobody writes takes no room."""
CHANGING, CHANGING_PAUSE = 100, 0.001
"""So many times an index is read that somebody is writing, and the pause between [s]."""


@dataclass(frozen=True, slots=True)
class Index:
    """What the index says of the journal."""

    changes: int
    """Counts commits; begins anew with an index that was built anew."""
    page: int
    """Size of a page [bytes]."""
    frames: int
    """Pages in the journal that are part of a commit."""
    salts: bytes
    """What all frames of this turn of the journal have in common."""
    backfilled: int
    """Frames that are in the database file as well."""

    @property
    def frame(self) -> int:
        """Bytes of a frame."""
        return FRAME_HEADER + self.page


@dataclass(frozen=True, slots=True)
class Salvage:
    """What a damaged journal is good for."""

    usable: bool
    """Its frames as far as they are whole go into the database when it is opened; else it has to go."""
    lost: bool
    """Rows are missing that were committed."""
    doubtful: bool
    """The database file may be a mixture of two states."""


class Journal:
    """Journal and index of the database at `path`, which SQLite has open.

    Only `close` it when SQLite has closed them: closing any descriptor of a file gives up the locks of the whole process (POSIX).
    """

    def __init__(self, path: Path) -> None:
        self._wal_path = path.with_name(f"{path.name}-wal")
        self._index_path = path.with_name(f"{path.name}-shm")
        self._wal = self._index = -1
        self._length = 0
        """Of the index [bytes]."""
        self._known: Index | None = None
        self._consistent = (b"", 0)
        """Of which turn so many frames, and nothing beyond, were in the database file."""
        self.bus_errors = 0
        """How often somebody who read the index found it cut."""

    def damaged(self) -> bool:
        """Whether they are not as SQLite left them. Costs some microseconds."""
        if self._index < 0 and not self._open():
            return False
        if self.bus_errors or os.fstat(self._index).st_size < self._length:
            return True
        index = None
        for _ in range(CHANGING):
            index = self._read()
            if index is None:  # or somebody is writing it just now, perhaps a process that waits for its turn
                select.select([], [], [], CHANGING_PAUSE)
            elif self._is_whole(index):
                self._note(index)
                return False
            elif index == self._read():
                return True
        return index is None

    def salvage(self) -> Salvage:
        """What can be had of a journal that is damaged; nobody writes meanwhile."""
        index = None if self.bus_errors else self._read()
        salts, whole = self._whole_frames()
        known = index or (self._known if self._known and self._known.salts == salts else None)
        if known is None:  # in a turn that was begun since it was looked at, when all before had been in the file
            return Salvage(usable=bool(salts), lost=not salts, doubtful=not salts)
        if salts == known.salts and whole >= known.backfilled:
            return Salvage(usable=True, lost=whole < known.frames, doubtful=False)
        consistent = known.backfilled in (0, known.frames) or self._consistent == (known.salts, known.backfilled)
        return Salvage(usable=False, lost=known.backfilled < known.frames, doubtful=not consistent)

    def lengthen(self) -> bool:
        """Make an index that was cut as long again as it was; False: it was not cut."""
        if os.fstat(self._index).st_size >= self._length:
            return False
        self.bus_errors += 1
        self._length = max(self._length, INDEX_LENGTH)
        os.ftruncate(self._index, self._length)
        return True

    def close(self) -> None:
        """Let them go."""
        if self._index >= 0:
            _opened.remove(self)
            os.close(self._index)
            os.close(self._wal)
            self._index = self._wal = -1

    def _open(self) -> bool:
        try:
            self._wal = os.open(self._wal_path, os.O_RDONLY | os.O_CLOEXEC)
        except FileNotFoundError:
            return False
        try:
            self._index = os.open(self._index_path, os.O_RDWR | os.O_CLOEXEC)
        except FileNotFoundError:
            os.close(self._wal)
            return False
        self._length = os.fstat(self._index).st_size
        _opened.append(self)
        _catch_bus_errors()
        return True

    def _read(self) -> Index | None:
        """The index; None: it is being written, or is none."""
        head = os.pread(self._index, BACKFILLED + 4, 0)
        first, second = head[:INDEX_HEADER], head[INDEX_HEADER:BACKFILLED]
        if len(head) < BACKFILLED + 4 or first != second or not first[INITIALISED]:
            return None
        if struct.pack("=II", *_checksum(first[:40], sys.byteorder)) != first[40:]:
            return None
        changes, _, _, page, frames = struct.unpack_from("=IBBHI", first, 8)
        (backfilled,) = struct.unpack_from("=I", head, BACKFILLED)
        return Index(changes, 65_536 if page == 1 else page, frames, first[32:40], backfilled)

    def _is_whole(self, index: Index) -> bool:
        """Whether the journal has what the index says: looked at in front, where it ended the last time, and at its end."""
        known = self._known if self._known and self._known.salts == index.salts else None
        if known and index.changes < known.changes:
            return False  # built anew from the journal, by SQLite, which found it damaged
        if not index.frames:
            return True
        if os.fstat(self._wal).st_size < WAL_HEADER + index.frames * index.frame:
            return False
        head = os.pread(self._wal, WAL_HEADER, 0)
        if int.from_bytes(head[:4], "big") not in WAL_MAGIC or head[16:24] != index.salts:
            return False
        looked_at = {1, known.frames if known and 0 < known.frames < index.frames else 1, index.frames}
        return all(
            os.pread(self._wal, 8, WAL_HEADER + (number - 1) * index.frame + 8) == index.salts for number in looked_at
        )

    def _note(self, index: Index) -> None:
        self._known = index
        self._length = max(self._length, os.fstat(self._index).st_size)
        if index.backfilled in (0, index.frames):
            self._consistent = (index.salts, index.backfilled)

    def _whole_frames(self) -> tuple[bytes, int]:
        """The turn of the journal, and its frames up to the last commit before the first one that is not as it was written.

        No turn, and none: its head is not as it was written.
        """
        head = os.pread(self._wal, WAL_HEADER, 0)
        magic, _, page = struct.unpack_from(">III", head) if len(head) == WAL_HEADER else (0, 0, 0)
        order: Order = "big" if magic & 1 else "little"
        sums = _checksum(head[:24], order) if magic in WAL_MAGIC else (0, 0)
        if magic not in WAL_MAGIC or struct.pack(">II", *sums) != head[24:]:
            return b"", 0
        salts, whole, number = head[16:24], 0, 0
        size, at = FRAME_HEADER + page, WAL_HEADER
        while len(frame := os.pread(self._wal, size, at)) == size:
            number, at = number + 1, at + size
            sums = _checksum(frame[FRAME_HEADER:], order, _checksum(frame[:8], order, sums))
            if frame[8:16] != salts or struct.pack(">II", *sums) != frame[16:24]:
                break
            if frame[4:8] != bytes(4):  # the last one of a commit
                whole = number
        return salts, whole


def _checksum(data: bytes, order: Order, before: tuple[int, int] = (0, 0)) -> tuple[int, int]:
    """SQLite's checksum over words of four bytes, continued from `before`."""
    first, second = before
    words = struct.unpack(f"{'>' if order == 'big' else '<'}{len(data) // 4}I", data)
    for one, other in zip(words[::2], words[1::2], strict=True):
        first = (first + one + second) & 0xFFFFFFFF
        second = (second + other + first) & 0xFFFFFFFF
    return first, second


# ---- an index that was cut --------------------------------------------------------------------------------

_opened: list[Journal] = []
_handlers: list[object] = []
"""What is called on a bus error, and who was before; kept for as long as the process lives."""


def _catch_bus_errors() -> None:
    """Have an index that was cut made long again, where the system would kill the process: every reader has it in its memory.

    What stands there then is no index, so SQLite builds it anew from the journal; and until the file was opened anew nothing is committed.
    Not by `signal`: that is called after the instruction, which never gets done.
    """
    if _handlers or not hasattr(signal, "SIGBUS"):
        return
    set_handler = ctypes.CDLL(None).signal
    set_handler.restype = ctypes.c_void_p
    set_handler.argtypes = (ctypes.c_int, ctypes.c_void_p)

    def on_bus_error(number: int) -> None:
        try:
            ours = [one for one in _opened if one.lengthen()]
        except OSError:
            ours = []
        if not ours:
            set_handler(number, _handlers[1])  # none of ours: as it would have been

    handler = ctypes.CFUNCTYPE(None, ctypes.c_int)(on_bus_error)
    _handlers.append(handler)
    _handlers.append(set_handler(signal.SIGBUS, ctypes.cast(handler, ctypes.c_void_p)))
