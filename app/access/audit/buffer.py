"""The second place of audit lines: a file of its own, allocated in advance, into which a line goes before the database has it.

    head    `audit.head` once more, in the first 512 bytes
    record  HMAC(K, rest) " " turn " " place " " line "\\n", and a zero byte after the last one

A record is on the disk when `append` returns. Once the database has all of them the next one begins anew in front, with the next turn
(`rewind`), so nothing has to be erased and none of an earlier turn is taken for one of this. Who has no key cannot put a line in: it is
counted as foreign and never chained.
"""

import hmac
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from errno import EINVAL
from hashlib import sha256
from pathlib import Path

from app.errors import MissingFile, UnusableFile
from app.files import open_ordinary

NAME = "audit.buffer"
HEAD = 512
"""Bytes in front for the head."""
SIZE = 4 * 1024 * 1024
"""Bytes of the file, some 6000 lines: it is allocated when the server starts, so that it has room on a disk that is full."""


@dataclass(slots=True)
class Found:
    """What is in a buffer."""

    lines: list[dict[str, object]] = field(default_factory=list)
    foreign: int = 0
    """Lines that this installation did not put there."""
    head: str = ""
    turn: int = 0
    end: int = HEAD
    """Where the next record goes."""


class Buffer:
    """The file."""

    def __init__(self, data: Path, key: bytes) -> None:
        self.path = data / NAME
        self._key = hmac.new(key, b"buffer", sha256).digest()
        self._handle = -1
        self._at, self._turn, self._place = HEAD, 0, 0

    def read(self) -> Found:
        """What is in it; nothing when there is no file. A last record that a power cut tore off is none.

        Raises:
            OSError: it is there and cannot be read.
        """
        found = Found()
        try:
            file = open_ordinary(self.path)
        except MissingFile:
            return found
        except UnusableFile as error:
            raise OSError(EINVAL, str(error)) from error
        with file:
            head = re.fullmatch(rb"(?:([0-9]{20} [0-9a-f]{64} [0-9a-f]{64})\n)?\0*", file.read(HEAD))
            if head is None:
                found.foreign = 1
            elif head[1]:
                found.head = head[1].decode()
            at = HEAD
            # record by record: nearly all of the file is room, and a thread that read it whole would keep as much memory
            while (first := file.read(1)) not in (b"", b"\0"):
                record = first + file.readline() if first != b"\n" else first
                if not record.endswith(b"\n"):
                    break
                at += len(record)
                self._take(record[:-1], found, at)
        return found

    def _take(self, record: bytes, found: Found, end: int) -> None:
        mac, _, rest = record.partition(b" ")
        parts = rest.split(b" ", 2)
        line: object = None
        if hmac.compare_digest(mac, self._mac(rest)) and len(parts) == 3:
            turn, place = int(parts[0]), int(parts[1])
            if place == len(found.lines) and (not place or turn == found.turn):
                line, found.turn = json.loads(parts[2].decode("utf-8", "surrogatepass")), turn
        if isinstance(line, dict):
            found.lines.append(line)
            found.end = end
        else:
            found.foreign += 1

    def open(self, found: Found) -> None:
        """Make the file as long as it gets and go on behind what was `found` in it; a disk without room gives what it has.

        Raises:
            OSError: the file cannot be made.
        """
        if self._handle < 0:
            self._handle = os.open(self.path, os.O_CREAT | os.O_RDWR, 0o600)
        try:
            os.posix_fallocate(self._handle, 0, SIZE)
        except OSError:
            os.ftruncate(self._handle, max(HEAD, os.fstat(self._handle).st_size))
        if found.foreign:
            os.pwrite(self._handle, b"\0" * HEAD, 0)
        self._at, self._turn, self._place = found.end, found.turn, len(found.lines)
        os.pwrite(self._handle, b"\0", self._at)
        if not found.lines:
            self._turn += 1

    def append(self, line: Mapping[str, object]) -> None:
        """Put `line` on the disk.

        Raises:
            OSError: there is no room for it, or the disk does not take it.
        """
        if self._handle < 0:
            self.open(self.read())
        text = json.dumps(line, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "surrogatepass")
        rest = b"%d %d %s" % (self._turn, self._place, text)
        record = b"%s %s\n" % (self._mac(rest), rest)
        if self._at + len(record) >= SIZE:
            raise OSError(27, f"{NAME} is full")
        os.pwrite(self._handle, record + b"\0", self._at)
        os.fdatasync(self._handle)
        self._at += len(record)
        self._place += 1

    def rewind(self) -> None:
        """The database has every line: the next one begins anew in front."""
        self._at, self._place, self._turn = HEAD, 0, self._turn + 1
        os.pwrite(self._handle, b"\0", HEAD)

    @property
    def used(self) -> bool:
        """Whether there is something in it that was put there or found by this process."""
        return self._handle >= 0 and self._place > 0

    def write_head(self, line: bytes) -> None:
        """Keep the newest line of the chain here, too, when there is a file.

        Raises:
            OSError: the disk does not take it.
        """
        try:
            handle = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK)
        except FileNotFoundError:
            return
        try:
            os.pwrite(handle, line, 0)
        finally:
            os.close(handle)

    def close(self) -> None:
        """Close the file."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1

    def _mac(self, rest: bytes) -> bytes:
        return hmac.new(self._key, rest, sha256).hexdigest().encode()
