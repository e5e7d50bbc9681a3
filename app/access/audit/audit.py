"""The audit: one line for everything that somebody did, chained by HMAC so that a changed, removed or reordered line is found.

The chain is in `chain`, what a line says in `line`. K is `POGON_DATA/audit.key`, outside the database: who can write the database cannot
compute the chain anew. What tells that the tail was cut off, or everything wiped, stands in files of their own (`anchoring`), and is
compared by `verification`. Who can write all of these files, and so reads the key, can go back to an older state of all of them; only
anchors elsewhere tell that. Source: reference/security.md section 6, with HMAC instead of Ed25519 for the anchors.

A command is written down twice: as sent, on the disk before its telegram leaves (`foretell`, first in `audit.buffer`), and with its
outcome. When the database does not take a line it waits there (`waiting`) and is written later, in order and marked; meanwhile `healthy`
is False.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from sqlalchemy import Connection, insert, select

from app.access.audit import search
from app.access.audit.anchoring import Anchoring
from app.access.audit.buffer import Buffer
from app.access.audit.chain import begin_now, chained, genesis, tolerant
from app.access.audit.line import Entry, Record, announce, entry_at
from app.access.audit.search import Filter
from app.access.audit.together import Together
from app.access.audit.verification import Verdict, read_marks, verify
from app.access.audit.waiting import KEEPING_LIMIT, Kept, WaitingLines
from app.access.keys import read_key
from app.access.roles import Person
from app.access.tables import audit_table
from app.clock import Clock
from app.db import Database
from app.errors import Refused, StorageError
from app.threads import Threads, Turns, threads

log = logging.getLogger(__name__)

T = TypeVar("T")
P = ParamSpec("P")


class Audit:
    """Writes, reads and verifies the chain."""

    def __init__(
        self,
        db: Database,
        clock: Clock,
        data: Path,
        elsewhere: Sequence[Callable[[str], None]] = (),
        threads: Threads = threads,
    ) -> None:
        """`elsewhere` are told every anchor, on a thread of their own; an OSError of theirs is logged."""
        self._db = db
        self._clock = clock
        self._data = data
        self._key = read_key(data / "audit.key")
        self.disk = Turns(threads(1, "audit-buffer"))
        self._buffer = Buffer(data, self._key)
        self._waiting = WaitingLines(self._buffer, data, self.disk)
        self._anchoring = Anchoring(data, self._key, clock, self._buffer, elsewhere)
        self._overdue = bool(self._waiting)
        self._flushing: asyncio.Task[None] | None = None
        self._next = Together()
        self._writing: asyncio.Task[tuple[None, tuple[int, str] | None]] | None = None
        self.verdict: Verdict | None = None
        """What the last verifying found; None before the first."""
        self.entry = _now(clock, entry_at)
        """The line that `record` would write, now, for `with_entries`: as `entry_at`, without its time."""
        self.record = _then(self.entry, self.write)
        """Write one line as of now: as `entry_at`, without its time; returns what `write` does."""

    @property
    def healthy(self) -> bool:
        """False while the database takes no lines: then engineering is refused (503), Stop and acknowledge go on."""
        return not self._overdue

    @property
    def newest(self) -> int:
        """Number of the line that was committed last; 0 = none that is known."""
        return self._anchoring.newest

    @property
    def intact(self) -> bool:
        """False once verifying found a line that is not in order."""
        return self.verdict is None or self.verdict.ok

    @property
    def install(self) -> str:
        """Id of the installation; empty before its first line."""
        return self._anchoring.install

    # ---- writing --------------------------------------------------------------------------------------

    async def write(self, entry: Entry) -> int:
        """Write one line; never raises for a database that does not take it.

        Returns the line's number, 0 while it waits in the buffer.
        """
        try:
            return await self._together(entry)
        except StorageError:
            if (waits := self._waiting.add(entry)) is None:
                self._waiting.lose()
            else:
                await self._waiting.put_by(waits)
            return 0

    async def foretell(self, entry: Entry) -> bool:
        """Have `entry` on the disk before what it tells is done; the database gets it as soon as it can.

        False: neither the buffer nor the database took it in time, and it is written nowhere.
        """
        waits = self._waiting.add(
            entry
        )  # before it is in the buffer: as long as one waits the buffer does not begin anew
        if waits is None:
            return False
        if await self._waiting.put_by(waits):
            self._flush_soon()
            return True
        with suppress(TimeoutError):
            async with asyncio.timeout(KEEPING_LIMIT):
                await self.replay()
        return not self._waiting.drop(waits)

    async def with_entries(self, work: Callable[[Connection], tuple[T, Sequence[Entry]]]) -> T:
        """Run `work` and write the lines it returns in one transaction: both happen, or neither.

        Raises:
            StorageError: the database took neither.
        """
        return (await self._commit(work))[0]

    def run(self, work: Callable[[Connection], tuple[T, Sequence[Entry]]]) -> T:
        """As `with_entries`, on the caller's thread: for the command line, also beside a running server."""
        told: list[Entry] = []
        result, newest = self._db.run(lambda connection: self._written(connection, work, [], told))
        self._settle(newest, [])
        self._anchoring.write_head()
        announce(told)
        self._anchoring.write_if_due()
        return result

    async def _together(self, *entries: Entry) -> int:
        """Write `entries`, and what waits, in one commit with all others that wait for the thread of the database; the number of the last.

        On a slow disk each would else wait for those of all before it.

        Raises:
            StorageError: the database did not take it.
        """
        place = self._next.join(entries)
        if place is None or self._writing is None or self._writing.done():
            self._next = Together()
            place = self._next.join(entries)
            self._writing = asyncio.get_running_loop().create_task(self._write_next(self._next), name="audit lines")
            self._writing.add_done_callback(lambda task: task.cancelled() or task.exception())
        together, writing = self._next, self._writing
        _, newest = await asyncio.shield(writing)  # whoever waits no more takes no line of others with them
        return newest[0] - together.after(place) if newest and place is not None else 0

    async def _write_next(self, together: Together) -> tuple[None, tuple[int, str] | None]:
        try:
            return await self._commit(together.take)
        except StorageError as error:
            self._refused(error)
            raise

    async def _commit(
        self, work: Callable[[Connection], tuple[T, Sequence[Entry]]]
    ) -> tuple[T, tuple[int, str] | None]:
        waiting: list[Kept] = []
        told: list[Entry] = []

        def write(connection: Connection) -> tuple[T, tuple[int, str] | None]:
            waiting.extend(self._waiting.all())
            return self._written(connection, work, waiting, told)

        result, newest = await self._db.write(write)
        self._settle(newest, waiting)
        self.disk.submit(self._anchoring.write_head)
        announce(told)
        if self._anchoring.due:
            await self.anchor_if_due()
        return result, newest

    def _written(
        self,
        connection: Connection,
        work: Callable[[Connection], tuple[T, Sequence[Entry]]],
        waiting: Sequence[Kept],
        told: list[Entry],
    ) -> tuple[T, tuple[int, str] | None]:
        begin_now(connection)
        result, entries = work(connection)
        late = list(self._waiting.unwritten(connection, waiting)) if waiting else []
        if waiting and (lost := self._waiting.take_lost()):
            late.append(self.entry("audit.lost", None, result="failed", lines=lost))
        newest = None
        for entry in (*late, *entries):
            newest = self._append(connection, entry)
            told.append(entry)
        return result, newest

    def _append(self, connection: Connection, entry: Entry) -> tuple[int, str]:
        with tolerant(connection):
            last = connection.execute(
                select(audit_table.c.seq, audit_table.c.mac).order_by(audit_table.c.seq.desc()).limit(1)
            ).first()
        seq, before = (last.seq + 1, last.mac) if last else (1, genesis(self._key))
        fields = {"seq": seq, **asdict(entry)}
        mac = chained(self._key, before, fields)
        connection.execute(insert(audit_table).values(**fields, mac=mac))
        return seq, mac

    def _settle(self, newest: tuple[int, str] | None, replayed: Sequence[Kept]) -> None:
        """After the commit: the lines wait no more, and the head is another one."""
        self._waiting.written(replayed)
        if not self._waiting:
            if self._overdue and replayed:
                log.warning("audit written again lines=%d", len(replayed))
            self._overdue = False
        if newest is not None:
            self._anchoring.committed(*newest)

    # ---- when the database does not take it -----------------------------------------------------------

    async def begin(self) -> None:
        """Take over what a killed server left in the buffer, put aside what others put there, and allocate the file."""
        await asyncio.get_running_loop().run_in_executor(self.disk, self._anchoring.begin)
        foreign = self._waiting.take_over()
        await self.replay()
        if foreign:
            await self.record("audit.foreign", None, result="failed", lines=foreign)

    async def replay(self) -> bool:
        """Write what waits; True when nothing waits any more."""
        if self._waiting:
            try:
                await self._together()
            except StorageError:
                return False
        return self.healthy

    def _flush_soon(self) -> None:
        if self._flushing is None or self._flushing.done():
            self._flushing = asyncio.get_running_loop().create_task(self._flush(), name="audit flush")

    async def _flush(self) -> None:
        while self._waiting and not self._overdue:
            await self.replay()

    def _refused(self, error: Exception) -> None:
        if not self._overdue:
            log.error("audit buffered reason=%s", error)
        self._overdue = True

    # ---- verifying ------------------------------------------------------------------------------------

    async def anchor_if_due(self) -> None:
        """Write an anchor, here and elsewhere, if it is time."""
        await asyncio.get_running_loop().run_in_executor(self.disk, self._anchoring.write_if_due)

    async def check(self, person: Person | None = None) -> Verdict:
        """Verify the chain, remember the verdict and write down that it was done.

        Raises:
            StorageError: the database cannot be read.
        """
        self.verdict = await self._db.read_long(self._verified)
        if not self.verdict.ok:
            log.error("audit chain broken seq=%s why=%s", self.verdict.bad, self.verdict.why)
        await self.record(
            "audit.verified",
            person,
            result="ok" if self.verdict.ok else "failed",
            reason="" if self.verdict.ok else f"audit.why.{self.verdict.why}",
            count=self.verdict.count,
            bad=self.verdict.bad or "",
        )
        return self.verdict

    def check_now(self, copied: Path | None = None) -> Verdict:
        """As `check`, on the caller's thread and without a line: for the command line, also beside a running server.

        `copied`: anchors that were kept elsewhere, which must be in the chain, too.
        """
        return self._db.run(lambda connection: self._verified(connection, copied))

    def _verified(self, connection: Connection, copied: Path | None = None) -> Verdict:
        try:
            found = self._buffer.read()
        except OSError:
            found = None
        marks = read_marks(self._data, found, copied, unread=found is None)
        return verify(connection, self._key, marks)

    def check_other_now(self, verify: Callable[[Connection, bytes], Verdict]) -> Verdict:
        """Another chain of the same database, verified by `verify` with the audit's key."""
        return self._db.run(lambda connection: verify(connection, self._key))

    def close(self) -> None:
        """A last anchor."""
        self._anchoring.write_if_due(now=True)
        self.disk.shutdown(wait=True)
        self._buffer.close()

    # ---- reading --------------------------------------------------------------------------------------

    async def find(self, wanted: Filter, limit: int = 50) -> list[Record]:
        """The newest `limit` lines that `wanted` lets through, newest first."""
        return await self._db.read_long(lambda connection: search.find(connection, wanted, limit))

    async def kinds(self) -> list[str]:
        """All kinds that occur, sorted."""
        return await self._db.read_long(search.kinds)

    async def count(self) -> int:
        """Number of lines."""
        return await self._db.read_long(search.count)


def refused_without_audit(audit: Audit) -> None:
    """Refuse what may only be done when it can be written down.

    Raises:
        Refused: 503, lines are waiting outside the database.
    """
    if not audit.healthy:
        raise Refused("access.audit_unavailable", 503)


def _now(clock: Clock, line: Callable[Concatenate[int, P], Entry]) -> Callable[P, Entry]:
    """`line` with the time of `clock`."""

    def entry(*args: P.args, **params: P.kwargs) -> Entry:
        return line(clock.micros(), *args, **params)

    return entry


def _then(entry: Callable[P, Entry], write: Callable[[Entry], Awaitable[int]]) -> Callable[P, Awaitable[int]]:
    """Make a line and write it."""

    async def record(*args: P.args, **params: P.kwargs) -> int:
        return await write(entry(*args, **params))

    return record
