"""The audit: one line for everything that somebody did, chained by HMAC so that a changed, removed or reordered line is found.

    rec_n  = canonical JSON of the line (sorted keys, UTF-8, numbers as text)
    mac_n  = HMAC-SHA256(K, mac_{n-1} || SHA-256(rec_n))        mac_0 = HMAC(K, "genesis")

K is `POGON_DATA/audit.key`, outside the database: who can write the database cannot compute the chain anew. What tells that the tail was
cut off, or everything wiped:

    audit.head     the newest line, after every commit; once more in front of audit.buffer
    audit.anchors  a line every 1000 lines and every hour, each signed together with the one before, and sent elsewhere (`Anchors`)
    audit.key      behind the key: the id of the installation and the newest anchor, signed

Who can write all of these files, and so reads the key, can go back to an older state of all of them; only anchors elsewhere tell that.
Source: reference/security.md section 6, with HMAC instead of Ed25519 for the anchors.

A command is written down twice: as sent, on the disk before its telegram leaves (`foretell`, first in `audit.buffer`), and with its
outcome. When the database does not take a line it waits there and is written later, in order and marked; meanwhile `healthy` is False.
"""

import asyncio
import hashlib
import hmac
import json
import logging
import os
import sqlite3
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from sqlalchemy import Connection, Select, func, insert, select

from app import chance
from app.access.audit_buffer import Buffer, Found
from app.access.keys import Mark, read_key, read_mark, write_mark
from app.access.private import write_private
from app.access.roles import SYSTEM, Person
from app.access.tables import audit_table
from app.clock import Clock
from app.db import Database
from app.errors import ConfigurationError, Refused, StorageError
from app.logs import security
from app.threads import Threads, threads

log = logging.getLogger(__name__)

SECURITY_KINDS = (
    "signin.", "session.", "person.", "password.", "token.", "factor.", "access.", "audit.", "backup.", "clock.", "server.",
    "plant.reloaded",
)  # fmt: skip
"""Beginnings of the kinds of lines that the log tells as security events, too."""
GRAVE_KINDS = (
    "person.", "token.created", "factor.removed", "factor.reset", "factor.recovery", "audit.lost", "audit.foreign",
    "backup.restor", "clock.",
)  # fmt: skip
"""Of these, told as warnings whatever their result."""

T = TypeVar("T")

ANCHOR_LINES = 1000
ANCHOR_PERIOD = 3600.0
"""An anchor is written after so many lines and after so much time [s], if there was a line."""
MOST_BUFFERED = 10_000
KEEPING_LIMIT = 2.0
"""A line that the disk has not taken by then is kept nowhere [s]."""
FOREIGN = "audit.foreign"
"""In POGON_DATA, what the server found in the buffer at its start and did not put there; the chain counts as broken while it lies there."""
LONGEST_TEXT = 500
"""Characters of a field; what is longer is cut and ends with …."""
LONGEST_PARAMS = 40 * LONGEST_TEXT
"""Of all parameters of a line together, when it is read."""
WATCH_PERIOD = 1.0
RETRY_PERIOD = 5.0
VERIFY_FIRST, VERIFY_PERIOD = 60.0, 86_400.0
"""The chain is verified a minute after start and once a day [s]."""
CLOCK_STEP = 1.0
"""A wall clock that moves by more than this against the monotonic one is written down [s]."""

_HIDDEN = ("password", "secret", "token", "cookie", "csrf", "sid", "hash", "code")
_BACKWARDS = {0x2028, 0x2029, *range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F, 0xFEFF}


@dataclass(frozen=True, slots=True)
class Entry:
    """What is to be written down; texts are already safe to print on one line."""

    time: int
    kind: str
    """Key under `audit.kind.` of the product texts."""
    person_id: int
    person: str
    address: str
    session: str
    """First 12 digits of the session's hash."""
    object: str
    old: str
    new: str
    result: str
    """`ok`, `refused`, `failed` or what a command became; key under `audit.result.`."""
    reason: str
    """Key of the product texts, or words of a person."""
    params: str
    """JSON object of texts for the placeholders."""


@dataclass(frozen=True, slots=True)
class Record(Entry):
    """A written line."""

    seq: int = 0

    @property
    def parameters(self) -> Mapping[str, str]:
        """`params` as a mapping of texts."""
        return {str(name): str(value) for name, value in _parameters(self.params).items()}


@dataclass(frozen=True, slots=True)
class Verdict:
    """What verifying found."""

    count: int
    """Lines that are in order, from the first on."""
    bad: int | None = None
    """Number of the first line that is not."""
    why: str = ""
    """`changed`, `removed`, `inserted`, `cut`, `head`, `anchor`, `mark`, `wiped` or `buffer`."""
    newest: int = 0
    """Number of the newest line that was looked at."""

    @property
    def ok(self) -> bool:
        """Whether every line is in order."""
        return self.bad is None


@dataclass(frozen=True, slots=True)
class Filter:
    """Which lines a person wants to see; empty fields do not filter."""

    person: str = ""
    object: str = ""
    """Part of the object's name."""
    kind: str = ""
    """A kind, or the first part of one (`signin`)."""
    since: int | None = None
    """µs UTC."""
    until: int | None = None
    before: int | None = None
    """Only lines with a smaller number: the next page."""


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
        self._head = data / "audit.head"
        self._anchors = data / "audit.anchors"
        self._elsewhere = elsewhere
        self._buffer = Buffer(data, self._key)
        self._found = self._read_buffer()
        self._waiting: dict[str, dict[str, object]] = {str(line["id"]): line for line in self._found.lines}
        self._overdue = bool(self._waiting)
        self._disk = threads(1, "audit-buffer")
        self._keeping = 0
        """Lines on their way to the buffer."""
        self._flushing: asyncio.Task[None] | None = None
        self._lost = 0
        self._mark = read_mark(data / "audit.key")
        self._anchored, self._last_sign = self._last_anchor()
        self._anchored_at = clock.monotonic()
        self._newest: tuple[int, str] = (0, "")
        self.verdict: Verdict | None = None
        """What the last verifying found; None before the first."""

    # ---- writing --------------------------------------------------------------------------------------

    @property
    def healthy(self) -> bool:
        """False while the database takes no lines: then engineering is refused (503), Stop and acknowledge go on."""
        return not self._overdue

    @property
    def intact(self) -> bool:
        """False once verifying found a line that is not in order."""
        return self.verdict is None or self.verdict.ok

    async def record(
        self,
        kind: str,
        person: Person | None,
        object: str = "",
        old: object = "",
        new: object = "",
        result: str = "ok",
        reason: str = "",
        address: str = "",
        **params: object,
    ) -> int:
        """Write one line; never raises for a database that does not take it.

        `person` None is the server itself. A parameter whose name sounds like a secret is not written. Returns the line's number, 0
        while it waits in the buffer.
        """
        entry = self.entry(kind, person, object, old, new, result, reason, address, **params)
        try:
            _, newest = await self._commit(lambda _connection: (None, [entry]))
            return newest[0] if newest else 0
        except StorageError as error:
            self._refused(error)
            line = _kept(entry)
            if len(self._waiting) < MOST_BUFFERED:
                self._waiting[str(line["id"])] = line
                await self._put_by(line)
            else:
                self._lost += 1
            return 0

    async def foretell(self, entry: Entry) -> bool:
        """Have `entry` on the disk before what it tells is done; the database gets it as soon as it can.

        False: neither the buffer nor the database took it in time, and it is written nowhere.
        """
        line = _kept(entry)
        id_ = str(line["id"])
        if len(self._waiting) >= MOST_BUFFERED:
            return False
        self._waiting[id_] = line  # before it is in the buffer: as long as one waits the buffer does not begin anew
        if await self._put_by(line):
            self._flush_soon()
            return True
        with suppress(TimeoutError):
            async with asyncio.timeout(KEEPING_LIMIT):
                await self.replay()
        return self._waiting.pop(id_, None) is None

    async def _put_by(self, line: dict[str, object]) -> bool:
        """Put a line that waits into the buffer; False when it does not take it in time."""
        self._keeping += 1
        work = asyncio.get_running_loop().run_in_executor(self._disk, self._buffer.append, line)
        work.add_done_callback(self._put)
        try:
            await asyncio.wait_for(asyncio.shield(work), KEEPING_LIMIT)
        except OSError as problem:  # TimeoutError, too
            log.error("audit buffer not written reason=%s", problem.strerror or "the disk does not answer")
            return False
        return True

    def _put(self, work: "asyncio.Future[None]") -> None:
        self._keeping -= 1
        if not work.cancelled():
            work.exception()

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

    def entry(
        self,
        kind: str,
        person: Person | None,
        object: str = "",
        old: object = "",
        new: object = "",
        result: str = "ok",
        reason: str = "",
        address: str = "",
        **params: object,
    ) -> Entry:
        """The line that `record` would write, now, for `with_entries`."""
        who = person or SYSTEM
        safe = {printable(name, 60): printable(_as_text(value)) for name, value in params.items() if not _secret(name)}
        return Entry(
            time=self._clock.micros(),
            kind=printable(kind, 64),
            person_id=who.id,
            person=printable(who.name, 64),
            address=printable(address or who.address, 64),
            session=printable(who.session, 12) if not who.session.startswith("token-") else printable(who.session, 16),
            object=printable(object, 120),
            old=printable(_as_text(old)),
            new=printable(_as_text(new)),
            result=printable(result, 32),
            reason=printable(reason),
            params=json.dumps(safe, ensure_ascii=False, sort_keys=True, separators=(",", ":")),
        )

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
        _announce(told)
        self._anchor_if_due()
        return result

    async def _commit(
        self, work: Callable[[Connection], tuple[T, Sequence[Entry]]]
    ) -> tuple[T, tuple[int, str] | None]:
        waiting = list(self._waiting.values())
        told: list[Entry] = []
        result, newest = await self._db.write(lambda connection: self._written(connection, work, waiting, told))
        self._settle(newest, waiting)
        _announce(told)
        if self._anchor_due():
            await asyncio.get_running_loop().run_in_executor(self._disk, self._anchor_if_due)
        return result, newest

    def _written(
        self,
        connection: Connection,
        work: Callable[[Connection], tuple[T, Sequence[Entry]]],
        waiting: Sequence[dict[str, object]],
        told: list[Entry],
    ) -> tuple[T, tuple[int, str] | None]:
        begin_now(connection)
        result, entries = work(connection)
        newest = None
        for entry in (*self._replayed(connection, waiting), *entries):
            newest = self._append(connection, entry)
            told.append(entry)
        return result, newest

    def _append(self, connection: Connection, entry: Entry) -> tuple[int, str]:
        with _tolerant(connection):
            last = connection.execute(
                select(audit_table.c.seq, audit_table.c.mac).order_by(audit_table.c.seq.desc()).limit(1)
            ).first()
        seq, before = (last.seq + 1, last.mac) if last else (1, genesis(self._key))
        fields = {"seq": seq, **asdict(entry)}
        mac = chained(self._key, before, fields)
        connection.execute(insert(audit_table).values(**fields, mac=mac))
        return seq, mac

    def _settle(self, newest: tuple[int, str] | None, replayed: Sequence[dict[str, object]]) -> None:
        """After the commit: the lines wait no more; note the head."""
        for kept in replayed:
            self._waiting.pop(str(kept["id"]), None)
        if not self._waiting:
            if self._overdue and replayed:
                log.warning("audit written again lines=%d", len(replayed))
            self._overdue = False
            if not self._keeping and self._buffer.used:
                self._disk.submit(self._buffer.rewind)
        if newest is None or newest[0] <= self._newest[0]:
            return
        self._newest = newest
        try:
            self._write_head(*newest)
        except OSError as error:
            log.error("audit head not written reason=%s", error.strerror)

    def _write_head(self, seq: int, mac: str) -> None:
        # in place and within one sector: after a power cut it is the old line or the new one
        line = f"{seq:020d} {mac} {self._sign('head', seq, mac)}\n".encode()
        handle = os.open(self._head, os.O_CREAT | os.O_WRONLY, 0o600)
        try:
            os.pwrite(handle, line, 0)
        finally:
            os.close(handle)
        self._buffer.write_head(line)

    def _anchor_due(self) -> bool:
        seq = self._newest[0]
        if seq and self._mark is None:
            return True
        due = seq - self._anchored >= ANCHOR_LINES or self._clock.monotonic() - self._anchored_at >= ANCHOR_PERIOD
        return seq > self._anchored and due

    def _anchor_if_due(self, *, now: bool = False) -> None:
        """Write an anchor, here and elsewhere, and mark the key file, also with the first line of an installation."""
        seq, mac = self._newest
        try:
            if seq and self._mark is None:
                self._note_mark(seq, mac)
            if seq <= self._anchored or not (now or self._anchor_due()):
                return
            time = self._clock.micros()
            before = self._last_sign[:16] or "-"
            line = f"{seq} {time} {mac} {before} {self._sign('anchor', seq, mac, time, before)}"
            with os.fdopen(os.open(self._anchors, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600), "w") as file:
                file.write(line + "\n")
                file.flush()
                os.fsync(file.fileno())
            self._anchored, self._anchored_at, self._last_sign = seq, self._clock.monotonic(), line.split()[-1]
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

    def _note_mark(self, seq: int, mac: str) -> None:
        known = read_mark(self._data / "audit.key")
        install = known.install if known else chance.token_hex(8)
        if known is None or known.seq < seq:
            known = Mark(install, seq, mac, self._sign("mark", install, seq, mac))
            write_mark(self._data / "audit.key", known)
        self._mark = known

    @property
    def install(self) -> str:
        """Id of the installation; empty before its first line."""
        return self._mark.install if self._mark else ""

    def _sign(self, what: str, *parts: object) -> str:
        return _signed(self._key, what, *parts)

    def _last_anchor(self) -> tuple[int, str]:
        """Number and signature of the newest anchor; 0 without one that can be read."""
        anchors = read_marks(self._data).anchors
        return (anchors[-1].seq, anchors[-1].sign) if anchors else (0, "")

    # ---- when the database does not take it -----------------------------------------------------------

    def _read_buffer(self) -> Found:
        try:
            found = self._buffer.read()
        except OSError as error:
            log.error("audit buffer not read reason=%s", error.strerror)
            return Found()
        good = []
        for line in found.lines:
            try:
                Entry(**{name: value for name, value in line.items() if name != "id"})  # type: ignore[arg-type]
                good.append(line)
            except TypeError:  # of another version
                log.error("audit buffer has a line that cannot be read")
        found.lines = good
        return found

    async def begin(self) -> None:
        """Take over what a killed server left in the buffer, put aside what others put there, and allocate the file."""
        foreign = self._found.foreign
        try:
            if foreign:
                log.error("audit buffer has foreign lines count=%d: they are in %s", foreign, FOREIGN)
                content = self._buffer.path.read_bytes().rstrip(b"\0")
                write_private(self._data / FOREIGN, content.decode("utf-8", "backslashreplace"))
            self._buffer.open(self._found)
        except OSError as error:
            log.error("audit buffer not written reason=%s", error.strerror)
        await self.replay()
        if foreign:
            await self.record("audit.foreign", None, result="failed", lines=foreign)

    def _replayed(self, connection: Connection, waiting: Sequence[dict[str, object]]) -> Iterator[Entry]:
        """The waiting lines that are not in the database yet (the server may have died between commit and emptying the buffer)."""
        if not waiting:
            return
        written = set()
        times = sorted({int(str(kept["time"])) for kept in waiting})
        for first in range(0, len(times), 500):
            query = select(audit_table.c.params).where(audit_table.c.time.in_(times[first : first + 500]))
            for params in connection.execute(query).scalars():
                written.add(_parameters(params).get("buffered"))
        for kept in waiting:
            if kept["id"] in written:
                continue
            fields = {name: value for name, value in kept.items() if name != "id"}
            params = {**json.loads(str(fields["params"])), "buffered": kept["id"]}
            fields["params"] = json.dumps(params, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
            yield Entry(**fields)  # type: ignore[arg-type]
        if self._lost:
            yield self.entry("audit.lost", None, result="failed", lines=self._lost)
            self._lost = 0

    async def replay(self) -> bool:
        """Write what waits; True when nothing waits any more."""
        if self._waiting:
            try:
                await self.with_entries(lambda _connection: (None, []))
            except StorageError as error:
                self._refused(error)
                return False
        return self.healthy

    # ---- by itself ------------------------------------------------------------------------------------

    async def watch(self) -> None:
        """Write again what waits, anchor every hour, verify every day, note steps of the clock; for ever."""
        offset = self._clock.micros() / 1e6 - self._clock.monotonic()
        retry = self._clock.monotonic() + RETRY_PERIOD
        verify = self._clock.monotonic() + VERIFY_FIRST
        while True:
            await asyncio.sleep(WATCH_PERIOD)
            now = self._clock.monotonic()
            offset = await self.note_clock(offset)
            if now >= retry:
                retry = now + RETRY_PERIOD
                await self.replay()
                await asyncio.get_running_loop().run_in_executor(self._disk, self._anchor_if_due)
            if now >= verify:
                verify = now + VERIFY_PERIOD
                try:
                    await self.check()
                except StorageError as error:
                    verify = now + VERIFY_FIRST
                    log.error("audit not verified reason=%s", error)

    async def note_clock(self, offset: float) -> float:
        """Write a line when wall and monotonic clock are no longer `offset` seconds apart; returns what they are apart now."""
        apart = self._clock.micros() / 1e6 - self._clock.monotonic()
        if abs(apart - offset) > CLOCK_STEP:
            await self.record("clock.stepped", None, seconds=round(apart - offset, 3))
            return apart
        return offset

    async def check(self, person: Person | None = None) -> Verdict:
        """Verify the chain, remember the verdict and write down that it was done.

        Raises:
            StorageError: the database cannot be read.
        """
        self.verdict = await self._db.read(self._verified)
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
        marks = read_marks(self._data, self._buffer.read(), copied)
        return verify(connection, self._key, marks)

    def check_other_now(self, verify: Callable[[Connection, bytes], Verdict]) -> Verdict:
        """Another chain of the same database, verified by `verify` with the audit's key."""
        return self._db.run(lambda connection: verify(connection, self._key))

    def close(self) -> None:
        """A last anchor."""
        self._anchor_if_due(now=True)
        self._disk.shutdown(wait=True)
        self._buffer.close()

    # ---- reading --------------------------------------------------------------------------------------

    async def find(self, wanted: Filter, limit: int = 50) -> list[Record]:
        """The newest `limit` lines that `wanted` lets through, newest first."""
        return await self._db.read(lambda connection: _found(connection, wanted, limit))

    async def kinds(self) -> list[str]:
        """All kinds that occur, sorted."""
        query = select(audit_table.c.kind).distinct().order_by(audit_table.c.kind)
        return await self._db.read(lambda connection: list(connection.execute(query).scalars()))

    async def count(self) -> int:
        """Number of lines."""
        query = select(func.count()).select_from(audit_table)
        return await self._db.read(lambda connection: connection.execute(query).scalar_one())


@dataclass(frozen=True, slots=True)
class Anchor:
    """A line of the chain, signed outside the database."""

    seq: int
    time: int
    mac: str
    before: str
    """Beginning of the signature of the anchor before; empty in anchors of the first versions."""
    sign: str

    def is_true(self, key: bytes) -> bool:
        """Whether it was signed with `key`."""
        return _same(self.sign, _signed(key, "anchor", self.seq, self.mac, self.time, *filter(None, [self.before])))


@dataclass(frozen=True, slots=True)
class Marks:
    """What stands outside the database, as it was before the lines were read."""

    heads: Sequence[tuple[int, str, str]] = ()
    """Number, mac, signature: from `audit.head` and from the buffer."""
    anchors: Sequence[Anchor] = field(default_factory=tuple)
    copied: Sequence[Anchor] = field(default_factory=tuple)
    """Anchors from elsewhere."""
    mark: Mark | None = None
    headless: bool = False
    """There is no `audit.head`."""
    broken: str = ""
    """`head` or `anchor`: that file cannot be understood."""
    foreign: int = 0


def read_marks(data: Path, buffer: Found | None = None, copied: Path | None = None) -> Marks:
    """Read what is outside the database; a file that is not there is an empty one."""
    broken, heads = "", []
    headless = not (data / "audit.head").exists()
    for text in (None if headless else _text(data / "audit.head"), buffer.head if buffer else ""):
        try:
            if text != "" and (text is not None or not headless):
                seq, mac, sign = (text or "").split()
                heads.append((int(seq), mac, sign))
        except ValueError:
            broken = "head"
    anchors = _read_anchors(data / "audit.anchors")
    from_elsewhere = _read_anchors(copied) if copied else ()
    if anchors is None or from_elsewhere is None:
        broken = "anchor"
    foreign = (buffer.foreign if buffer else 0) + (data / FOREIGN).exists()
    mark = read_mark(data / "audit.key")
    return Marks(heads, anchors or (), from_elsewhere or (), mark, headless, broken, foreign)


def _text(path: Path) -> str | None:
    try:
        return path.read_text("utf-8")
    except (OSError, ValueError):
        return None


def _read_anchors(path: Path) -> list[Anchor] | None:
    if not path.exists():
        return []
    lines = []
    try:
        for line in (_text(path) or "?").splitlines():
            at, time, mac, *before, sign = line.split()
            (link,) = before or [""]
            lines.append(Anchor(int(at), int(time), mac, link, sign))
    except ValueError:
        return None
    return lines


def verify(connection: Connection, key: bytes, marks: Marks) -> Verdict:
    """Walk the chain from its first line and compare it with `marks`. Whatever stands in it, there is a verdict."""
    anchors: dict[int, str] = {}
    before_sign = ""
    for anchor in (*marks.anchors, *marks.copied):
        if not anchor.is_true(key):
            return Verdict(0, anchor.seq, "anchor")
        anchors[anchor.seq] = anchor.mac
    for anchor in marks.anchors:
        if anchor.before and anchor.before != (before_sign[:16] or "-"):
            return Verdict(0, anchor.seq, "anchor")
        before_sign = anchor.sign
    if marks.broken:
        return Verdict(0, 1, marks.broken)
    for seq, mac, sign in marks.heads:
        if not _same(sign, _signed(key, "head", seq, mac)):
            return Verdict(0, seq, "head")
    mark = marks.mark
    if mark is not None and not _same(mark.sign, _signed(key, "mark", mark.install, mark.seq, mark.mac)):
        return Verdict(0, mark.seq, "mark")
    with _tolerant(connection):
        verdict = _walked(connection, key, marks, anchors)
    if not verdict.ok:
        return verdict
    last = verdict.count
    if mark is not None and not last and not marks.heads and not anchors:
        return Verdict(0, 1, "wiped")
    known = max([mark.seq if mark else 0, *(seq for seq, _, _ in marks.heads), *anchors])
    if known > last:
        return Verdict(last, last + 1, "cut", last)
    if last and marks.headless:
        return Verdict(last, last, "head", last)
    if marks.foreign:
        return Verdict(last, last + 1, "buffer", last)
    return verdict


def _walked(connection: Connection, key: bytes, marks: Marks, anchors: Mapping[int, str]) -> Verdict:
    before, expected = genesis(key), 1
    columns = [column for column in audit_table.c if column.name != "mac"]
    for row in connection.execute(select(audit_table).order_by(audit_table.c.seq)).yield_per(1000):
        if row.seq != expected:
            why, bad = ("removed", expected) if row.seq > expected else ("inserted", row.seq)
            return Verdict(expected - 1, bad, why, row.seq)
        fields = {column.name: getattr(row, column.name) for column in columns}
        if not _same(row.mac, chained(key, before, fields)):
            return Verdict(expected - 1, row.seq, "changed", row.seq)
        if anchors.get(row.seq, row.mac) != row.mac:
            return Verdict(expected - 1, row.seq, "anchor", row.seq)
        if any(seq == row.seq and mac != row.mac for seq, mac, _ in marks.heads):
            return Verdict(expected - 1, row.seq, "head", row.seq)
        if marks.mark is not None and marks.mark.seq == row.seq and marks.mark.mac != row.mac:
            return Verdict(expected - 1, row.seq, "mark", row.seq)
        before, expected = row.mac, expected + 1
    return Verdict(expected - 1, newest=expected - 1)


def genesis(key: bytes) -> str:
    """What the first line is chained to."""
    return hmac.new(key, b"genesis", hashlib.sha256).hexdigest()


def chained(key: bytes, before: object, fields: Mapping[str, object]) -> str:
    """The mac of the line `fields` that follows the line with mac `before`; what was put there instead of either gives one, too."""
    text = json.dumps(fields, ensure_ascii=False, sort_keys=True, separators=(",", ":"), default=repr)
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).digest()
    try:
        link = bytes.fromhex(str(before))
    except ValueError:
        link = hashlib.sha256(str(before).encode("utf-8", "surrogatepass")).digest()
    return hmac.new(key, link + digest, hashlib.sha256).hexdigest()


def is_mac(found: object, expected: str) -> bool:
    """Whether what stands in a chain is the mac `expected`; anything else is not, whatever its type."""
    return _same(found, expected)


def _same(found: object, expected: str) -> bool:
    return isinstance(found, str) and hmac.compare_digest(found.encode("utf-8", "surrogatepass"), expected.encode())


@contextmanager
def _tolerant(connection: Connection) -> Iterator[None]:
    """Texts that are not UTF-8 are read all the same, as something else than they should be."""
    driver = connection.connection.dbapi_connection
    assert isinstance(driver, sqlite3.Connection)
    former = driver.text_factory
    driver.text_factory = lambda raw: raw.decode("utf-8", "surrogateescape")
    try:
        yield
    finally:
        driver.text_factory = former


def _kept(entry: Entry) -> dict[str, object]:
    return {"id": chance.token_hex(8), **asdict(entry)}


def _parameters(text: object) -> Mapping[str, object]:
    try:
        found = json.loads(text) if isinstance(text, str) else None
    except ValueError:
        found = None
    return found if isinstance(found, dict) else {}


def printable(text: object, longest: int = LONGEST_TEXT) -> str:
    """`text` on one line: control signs, line separators and signs that turn the writing direction become escapes."""
    shown = "".join(_escaped(letter) for letter in str(text)[: longest + 1])
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"


def _announce(entries: Iterable[Entry]) -> None:
    """Tell the log, and with POGON_SYSLOG another machine, of lines that are about who may do what."""
    for entry in entries:
        if entry.kind.startswith(SECURITY_KINDS):
            grave = entry.result != "ok" or entry.kind.startswith(GRAVE_KINDS)
            about = {"person": entry.person, "object": entry.object, "old": entry.old, "new": entry.new}
            about |= {"result": entry.result, "reason": entry.reason, "address": entry.address}
            security(entry.kind, grave=grave, **{name: text for name, text in about.items() if text})


def begin_now(connection: Connection) -> None:
    """Take the database's write lock before reading, so that two processes cannot both append after the same line."""
    driver = connection.connection.dbapi_connection
    if driver is not None and not driver.in_transaction:
        connection.exec_driver_sql("BEGIN IMMEDIATE")


def refused_without_audit(audit: Audit) -> None:
    """Refuse what may only be done when it can be written down.

    Raises:
        Refused: 503, lines are waiting outside the database.
    """
    if not audit.healthy:
        raise Refused("access.audit_unavailable", 503)


def _signed(key: bytes, what: str, *parts: object) -> str:
    return hmac.new(key, " ".join([what, *map(str, parts)]).encode(), hashlib.sha256).hexdigest()


def _found(connection: Connection, wanted: Filter, limit: int) -> list[Record]:
    query = _filtered(select(audit_table), wanted).order_by(audit_table.c.seq.desc()).limit(limit)
    with _tolerant(connection):
        return [_record(row) for row in connection.execute(query).all()]


def _record(row: Any) -> Record:
    """A line as it can be shown, also one that somebody has put something else into."""
    numbers = ("seq", "time", "person_id")
    found: dict[str, Any] = {}
    for column in audit_table.c:
        value = getattr(row, column.name)
        if column.name in numbers:
            found[column.name] = value if isinstance(value, int) and abs(value) < 1 << 60 else 0
        else:
            most = LONGEST_PARAMS if column.name == "params" else 4 * LONGEST_TEXT
            found[column.name] = printable(value if isinstance(value, str) else repr(value), most)
    del found["mac"]
    return Record(**found)


def _filtered(query: Select[tuple[object, ...]], wanted: Filter) -> Select[tuple[object, ...]]:
    table = audit_table.c
    conditions: Iterable[tuple[object, Callable[[], object]]] = (
        (wanted.person, lambda: table.person == wanted.person),
        (wanted.object, lambda: table.object.contains(wanted.object, autoescape=True)),
        (wanted.kind, lambda: (table.kind == wanted.kind) | table.kind.startswith(wanted.kind + ".", autoescape=True)),
        (wanted.since is not None, lambda: table.time >= wanted.since),
        (wanted.until is not None, lambda: table.time <= wanted.until),
        (wanted.before is not None, lambda: table.seq < wanted.before),
    )
    for asked, condition in conditions:
        if asked:
            query = query.where(condition())  # type: ignore[arg-type]
    return query


def _as_text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "1" if value else "0"
    if isinstance(value, (set, frozenset)):
        return ", ".join(sorted(map(str, value)))
    return str(value)


def _secret(name: str) -> bool:
    return any(word in name.lower().split("_") for word in _HIDDEN)


def _escaped(letter: str) -> str:
    point = ord(letter)
    if unicodedata.category(letter) in ("Cc", "Cs") or point in _BACKWARDS:
        return f"\\x{point:02x}" if point < 0x100 else f"\\u{point:04x}"
    return letter
