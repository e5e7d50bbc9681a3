"""What tells that the tail of the audit was cut off, or everything wiped: written outside the database.

audit.head     the newest line, after every commit; once more in front of audit.buffer
audit.anchors  a line every 1000 lines and every hour, each signed together with the one before, and sent elsewhere
audit.key      behind the key: the id of the installation and the newest anchor, signed
"""

import fcntl
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from app import chance
from app.access.audit.buffer import Buffer
from app.access.audit.chain import signed
from app.access.audit.verification import LARGEST, read_marks
from app.access.keys import Mark, read_mark, write_mark
from app.clock import Clock
from app.errors import ConfigurationError, MissingFile
from app.files import append_line, read_text
from app.logs import security
from app.trouble import Trouble

log = logging.getLogger(__name__)

ANCHOR_LINES = 1000
ANCHOR_PERIOD = 3600.0
"""An anchor is written after so many lines and after so much time [s], if there was a line."""


class Anchoring:
    """Keeps the head, the anchors and the mark behind the key."""

    def __init__(
        self, data: Path, key: bytes, clock: Clock, buffer: Buffer, elsewhere: Sequence[Callable[[str], None]]
    ) -> None:
        """`elsewhere` are told every anchor; an OSError of theirs is logged."""
        self._data = data
        self._key = key
        self._clock = clock
        self._buffer = buffer
        self._elsewhere = elsewhere
        self._mark = read_mark(data / "audit.key")
        self._anchored, self._last_sign = self._last_anchor()
        self._anchored_at = clock.monotonic()
        self._newest: tuple[int, str] = (0, "")
        self._noted = self._newest
        self._trouble = Trouble()

    def begin(self) -> None:
        """Of the one server on this folder: take away the piece of an anchor that a power cut left.

        It stays, and the chain counts as broken, where the mark, written after each anchor, knows of one after the last whole.
        """
        path = self._data / "audit.anchors"
        try:
            whole, end, torn = read_text(path, LARGEST).rpartition("\n")
            begun, last = torn.split(" ")[0] if " " in torn else "", whole.rpartition("\n")[2].split(" ")[0]
            known = self._mark.seq if self._mark else 0
            if not torn:
                return
            if _number(last) >= known or _number(begun) > known:
                os.truncate(path, len((whole + end).encode()))
                self._anchored, self._last_sign = self._last_anchor()
                log.warning("torn audit anchor taken back file=%s", path)
            else:
                append_line(path, "")  # it is whole, or stays broken: the next one stands on a line of its own
        except MissingFile:
            pass
        except (OSError, ConfigurationError) as error:
            log.error("audit anchors not read reason=%s", error)

    @property
    def install(self) -> str:
        """Id of the installation; empty before its first line."""
        return self._mark.install if self._mark else ""

    @property
    def due(self) -> bool:
        """Whether an anchor, or the mark of the first line, is to be written."""
        seq = self._newest[0]
        if seq and self._mark is None:
            return True
        due = seq - self._anchored >= ANCHOR_LINES or self._clock.monotonic() - self._anchored_at >= ANCHOR_PERIOD
        return seq > self._anchored and due

    @property
    def newest(self) -> int:
        """Number of the line that was committed last; 0 = none that is known."""
        return self._newest[0]

    def committed(self, seq: int, mac: str) -> None:
        """The database has the line `seq` with this mac: it is the head from now on, unless a newer one is; `write_head` notes it."""
        if seq > self._newest[0]:
            self._newest = seq, mac

    def write_head(self) -> None:
        """Note the head where it is not yet noted; a disk that hangs holds up whoever calls this."""
        newest = self._newest
        if newest == self._noted:
            return
        seq, mac = newest
        # in place and within one sector: after a power cut it is the old line or the new one
        line = f"{seq:020d} {mac} {signed(self._key, 'head', seq, mac)}\n".encode()
        try:
            handle = os.open(self._data / "audit.head", os.O_CREAT | os.O_WRONLY, 0o600)
            try:
                os.pwrite(handle, line, 0)
            finally:
                os.close(handle)
            self._buffer.write_head(line)
            self._noted = newest
            if self._trouble.is_over():
                log.info("audit head written again")
        except OSError as error:
            if self._trouble.is_news(reason := error.strerror or str(error)):
                log.error("audit head not written reason=%s", reason)

    def write_if_due(self, *, now: bool = False) -> None:
        """Write an anchor, here and elsewhere, and mark the key file, also with the first line of an installation.

        `now`: also when none is due, if there are new lines.
        """
        seq, mac = self._newest
        try:
            if seq and self._mark is None:
                self._note_mark(seq, mac)
            if seq <= self._anchored or not (now or self.due):
                return
            with _alone(self._data):
                self._follow()
                if seq <= self._anchored:
                    return
                line = self._write(seq, mac)
                self._note_mark(seq, mac)
        except (OSError, ConfigurationError) as error:
            log.error("audit anchor not written reason=%s", error)
            return
        security("audit.anchor", grave=False, line=line)  # with POGON_SYSLOG it leaves this machine
        for tell in self._elsewhere:
            try:
                tell(line)
            except OSError as error:
                log.error("audit anchor not sent reason=%s", error.strerror or error)

    def _follow(self) -> None:
        """Another process on this folder, such as `pogon user`, may have written an anchor since: the next one hangs on that.

        One that is older than ours is no such anchor: ours was taken away, and the next one tells.
        """
        seq, sign = self._last_anchor()
        if seq > self._anchored:
            self._anchored, self._last_sign = seq, sign

    def _write(self, seq: int, mac: str) -> str:
        time = self._clock.micros()
        before = self._last_sign[:16] or "-"
        line = f"{seq} {time} {mac} {before} {signed(self._key, 'anchor', seq, mac, time, before)}"
        append_line(self._data / "audit.anchors", line)
        self._anchored, self._anchored_at, self._last_sign = seq, self._clock.monotonic(), line.split()[-1]
        return line

    def _note_mark(self, seq: int, mac: str) -> None:
        known = read_mark(self._data / "audit.key")
        install = known.install if known else chance.token_hex(8)
        if known is None or known.seq < seq:
            known = Mark(install, seq, mac, signed(self._key, "mark", install, seq, mac))
            write_mark(self._data / "audit.key", known)
        self._mark = known

    def _last_anchor(self) -> tuple[int, str]:
        """Number and signature of the newest anchor; 0 without one that can be read."""
        anchors = read_marks(self._data).anchors
        return (anchors[-1].seq, anchors[-1].sign) if anchors else (0, "")


@contextmanager
def _alone(data: Path) -> Iterator[None]:
    """No other process writes an anchor meanwhile.

    Raises:
        OSError: one does.
    """
    handle = os.open(data, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def _number(text: str) -> int:
    return int(text) if text.isdecimal() else 0
