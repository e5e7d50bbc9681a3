"""Lines that the database does not have yet: in memory, and in the buffer on the disk as long as that takes them."""

import asyncio
import logging
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from pathlib import Path

from sqlalchemy import Connection, select

from app.access.audit.buffer import Buffer, Found
from app.access.audit.line import Entry, of_waiting, parameters_of, waiting_form
from app.access.audit.verification import FOREIGN
from app.access.private import write_private
from app.access.tables import audit_table
from app.trouble import Trouble

log = logging.getLogger(__name__)

MOST_BUFFERED = 10_000
KEEPING_LIMIT = 2.0
"""A line that the disk has not taken by then is kept nowhere [s]."""

Kept = dict[str, object]


class WaitingLines:
    """Keeps lines until the database has them, in order, also over a kill of the server."""

    def __init__(self, buffer: Buffer, data: Path, disk: Executor) -> None:
        """`disk` is the thread on which the buffer is written."""
        self._buffer = buffer
        self._data = data
        self._disk = disk
        self._found = self._read()
        self._lines: dict[str, Kept] = {str(line["id"]): line for line in self._found.lines}
        self._keeping = 0
        """Lines on their way to the buffer."""
        self._lost = 0
        self._trouble = Trouble()

    def __bool__(self) -> bool:
        return bool(self._lines)

    def all(self) -> list[Kept]:
        """The lines that wait, oldest first."""
        return list(self._lines.values())

    # ---- what comes in --------------------------------------------------------------------------------

    def add(self, entry: Entry) -> str | None:
        """Let a line wait in memory; its id, None when too many wait already."""
        if len(self._lines) >= MOST_BUFFERED:
            return None
        line = waiting_form(entry)
        id_ = str(line["id"])
        self._lines[id_] = line
        return id_

    def drop(self, id_: str) -> bool:
        """Let a line wait no more; False when it did not, because it is written."""
        return self._lines.pop(id_, None) is not None

    def lose(self) -> None:
        """One more line is kept nowhere."""
        self._lost += 1

    async def put_by(self, id_: str) -> bool:
        """Put a line that waits into the buffer; False when it does not take it in time."""
        self._keeping += 1
        work = asyncio.get_running_loop().run_in_executor(self._disk, self._append, id_)
        work.add_done_callback(self._put)
        done, _ = await asyncio.wait([work], timeout=KEEPING_LIMIT)
        try:
            if not done:
                raise TimeoutError
            work.result()
        except OSError as problem:  # TimeoutError, too
            if self._trouble.is_news(reason := problem.strerror or "the disk does not answer"):
                log.error("audit buffer not written reason=%s", reason)
            return False
        if self._trouble.is_over():
            log.info("audit buffer written again")
        return True

    def _append(self, id_: str) -> None:
        line = self._lines.get(id_)
        if line is not None:  # else it came too late for somebody, or the database has it
            self._buffer.append(line)

    def _put(self, work: "asyncio.Future[None]") -> None:
        self._keeping -= 1
        if not work.cancelled():
            work.exception()

    # ---- what goes out --------------------------------------------------------------------------------

    def unwritten(self, connection: Connection, waiting: Sequence[Kept]) -> Iterator[Entry]:
        """Of `waiting` what is not in the database yet: the server may have died between commit and emptying the buffer."""
        written = set()
        times = sorted({int(str(kept["time"])) for kept in waiting})
        for first in range(0, len(times), 500):
            query = select(audit_table.c.params).where(audit_table.c.time.in_(times[first : first + 500]))
            for params in connection.execute(query).scalars():
                written.add(parameters_of(params).get("buffered"))
        for kept in waiting:
            if kept["id"] not in written:
                yield of_waiting(kept, marked=True)

    def take_lost(self) -> int:
        """How many lines are kept nowhere since this was asked last."""
        lost, self._lost = self._lost, 0
        return lost

    def written(self, lines: Sequence[Kept]) -> None:
        """The database has `lines`. With the last one the buffer begins anew, unless one is on its way to it."""
        for kept in lines:
            self._lines.pop(str(kept["id"]), None)
        if not self._lines and not self._keeping and self._buffer.used:
            self._disk.submit(self._buffer.rewind)

    # ---- what was left --------------------------------------------------------------------------------

    def take_over(self) -> int:
        """Put aside what others put into the buffer, and allocate the file; how many lines were not of this installation."""
        foreign = self._found.foreign
        try:
            if foreign:
                log.error("audit buffer has foreign lines count=%d: they are in %s", foreign, FOREIGN)
                content = self._buffer.path.read_bytes().rstrip(b"\0")
                write_private(self._data / FOREIGN, content.decode("utf-8", "backslashreplace"))
            self._buffer.open(self._found)
        except OSError as error:
            log.error("audit buffer not written reason=%s", error.strerror)
        return foreign

    def _read(self) -> Found:
        try:
            found = self._buffer.read()
        except OSError as error:
            log.error("audit buffer not read reason=%s", error.strerror)
            return Found()
        good = []
        for line in found.lines:
            try:
                of_waiting(line)
                good.append(line)
            except TypeError:  # of another version
                log.error("audit buffer has a line that cannot be read")
        found.lines = good
        return found
