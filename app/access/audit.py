"""The audit: one line for everything that somebody did, chained by HMAC so that a changed, removed or reordered line is found.

    rec_n  = canonical JSON of the line (sorted keys, UTF-8, numbers as text)
    mac_n  = HMAC-SHA256(K, mac_{n-1} || SHA-256(rec_n))        mac_0 = HMAC(K, "genesis")

K is `POGON_DATA/audit.key`, outside the database: who can write the database cannot compute the chain anew. That the tail was cut
off is told by `audit.head` (the newest line, after every commit) and by the anchors in `audit.anchors` (every 1000 lines and every
hour), which a site copies to another machine. Who can write all of these files can still go back to an older state of all of them; only
copied anchors tell that. Source: reference/security.md section 6, with HMAC instead of Ed25519 for the anchors.

When the database does not take a line, it goes to `audit.buffer` and is written later, in order and marked; meanwhile `healthy` is False.
"""

import asyncio
import hashlib
import hmac
import json
import logging
import os
import unicodedata
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TypeVar

from sqlalchemy import Connection, Select, func, insert, select

from app import chance
from app.access.keys import read_key
from app.access.roles import SYSTEM, Person
from app.access.tables import audit_table
from app.clock import Clock
from app.db import Database
from app.errors import Refused, StorageError

log = logging.getLogger(__name__)

T = TypeVar("T")

ANCHOR_LINES = 1000
ANCHOR_PERIOD = 3600.0
"""An anchor is written after so many lines and after so much time [s], if there was a line."""
MOST_BUFFERED = 10_000
LONGEST_TEXT = 500
"""Characters of a field; what is longer is cut and ends with …."""
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
        """`params` as a mapping."""
        try:
            found = json.loads(self.params)
        except ValueError:
            return {}
        return found if isinstance(found, dict) else {}


@dataclass(frozen=True, slots=True)
class Verdict:
    """What verifying found."""

    count: int
    """Lines that are in order, from the first on."""
    bad: int | None = None
    """Number of the first line that is not."""
    why: str = ""
    """`changed`, `removed`, `inserted`, `cut`, `head` or `anchor`."""
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

    def __init__(self, db: Database, clock: Clock, data: Path) -> None:
        self._db = db
        self._clock = clock
        self._key = read_key(data / "audit.key")
        self._head = data / "audit.head"
        self._anchors = data / "audit.anchors"
        self._buffer = data / "audit.buffer"
        self._waiting: deque[dict[str, object]] = deque(self._read_buffer(), maxlen=MOST_BUFFERED)
        self._lost = 0
        self._anchored = self._last_anchor()
        self._anchored_at = clock.monotonic()
        self._newest: tuple[int, str] = (0, "")
        self.verdict: Verdict | None = None
        """What the last verifying found; None before the first."""

    # ---- writing --------------------------------------------------------------------------------------

    @property
    def healthy(self) -> bool:
        """False while lines wait outside the database: then engineering is refused (503), Stop and acknowledge go on."""
        return not self._waiting

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
            self._keep(entry, error)
            return 0

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
        result, newest = self._db.run(lambda connection: self._written(connection, work, []))
        self._settle(newest, [])
        return result

    async def _commit(
        self, work: Callable[[Connection], tuple[T, Sequence[Entry]]]
    ) -> tuple[T, tuple[int, str] | None]:
        waiting = list(self._waiting)
        result, newest = await self._db.write(lambda connection: self._written(connection, work, waiting))
        self._settle(newest, waiting)
        return result, newest

    def _written(
        self,
        connection: Connection,
        work: Callable[[Connection], tuple[T, Sequence[Entry]]],
        waiting: Sequence[dict[str, object]],
    ) -> tuple[T, tuple[int, str] | None]:
        begin_now(connection)
        result, entries = work(connection)
        newest = None
        for entry in (*self._replayed(connection, waiting), *entries):
            newest = self._append(connection, entry)
        return result, newest

    def _append(self, connection: Connection, entry: Entry) -> tuple[int, str]:
        last = connection.execute(
            select(audit_table.c.seq, audit_table.c.mac).order_by(audit_table.c.seq.desc()).limit(1)
        ).first()
        seq, before = (last.seq + 1, last.mac) if last else (1, genesis(self._key))
        fields = {"seq": seq, **asdict(entry)}
        mac = chained(self._key, before, fields)
        connection.execute(insert(audit_table).values(**fields, mac=mac))
        return seq, mac

    def _settle(self, newest: tuple[int, str] | None, replayed: Sequence[dict[str, object]]) -> None:
        """After the commit: note the head, an anchor if one is due, and empty the buffer."""
        done = {kept["id"] for kept in replayed}
        if any(kept["id"] in done for kept in self._waiting):
            self._waiting = deque((kept for kept in self._waiting if kept["id"] not in done), maxlen=MOST_BUFFERED)
            self._save_buffer()
            log.warning("audit written again lines=%d", len(done))
        if newest is None or newest[0] <= self._newest[0]:
            return
        self._newest = newest
        try:
            self._write_head(*newest)
            self._anchor_if_due()
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

    def _anchor_if_due(self, *, now: bool = False) -> None:
        seq, mac = self._newest
        due = seq - self._anchored >= ANCHOR_LINES or self._clock.monotonic() - self._anchored_at >= ANCHOR_PERIOD
        if seq <= self._anchored or not (due or now):
            return
        time = self._clock.micros()
        line = f"{seq} {time} {mac} {self._sign('anchor', seq, mac, time)}\n"
        handle = os.open(self._anchors, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600)
        with os.fdopen(handle, "w") as file:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        self._anchored, self._anchored_at = seq, self._clock.monotonic()

    def _sign(self, what: str, *parts: object) -> str:
        return _signed(self._key, what, *parts)

    def _last_anchor(self) -> int:
        try:
            lines = self._anchors.read_text().split("\n")
        except OSError:
            return 0
        return max((int(line.split()[0]) for line in lines if line and line.split()[0].isdigit()), default=0)

    # ---- when the database does not take it -----------------------------------------------------------

    def _keep(self, entry: Entry, error: Exception) -> None:
        if self.healthy:
            log.error("audit buffered reason=%s", error)
        if len(self._waiting) == MOST_BUFFERED:
            self._lost += 1
            return
        kept: dict[str, object] = {"id": chance.token_hex(8), **asdict(entry)}
        self._waiting.append(kept)
        try:
            handle = os.open(self._buffer, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600)
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(json.dumps(kept, ensure_ascii=False) + "\n")
        except OSError as problem:
            log.error("audit buffer not written reason=%s", problem.strerror)

    def _read_buffer(self) -> Iterator[dict[str, object]]:
        try:
            lines = self._buffer.read_text("utf-8").splitlines()
        except OSError:
            return
        for line in lines:
            try:
                kept = json.loads(line)
                Entry(**{name: value for name, value in kept.items() if name != "id"})
            except (ValueError, TypeError, AttributeError):
                log.error("audit buffer has a line that cannot be read")
                continue
            yield kept

    def _save_buffer(self) -> None:
        try:
            if not self._waiting:
                self._buffer.unlink(missing_ok=True)
                return
            handle = os.open(self._buffer, os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o600)
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.writelines(json.dumps(kept, ensure_ascii=False) + "\n" for kept in self._waiting)
        except OSError as problem:
            log.error("audit buffer not written reason=%s", problem.strerror)

    def _replayed(self, connection: Connection, waiting: Sequence[dict[str, object]]) -> Iterator[Entry]:
        """The waiting lines that are not in the database yet (the server may have died between commit and emptying the buffer)."""
        if not waiting:
            return
        tail = connection.execute(
            select(audit_table.c.params).order_by(audit_table.c.seq.desc()).limit(2 * MOST_BUFFERED)
        ).scalars()
        written = {json.loads(params).get("buffered") for params in tail if '"buffered"' in params}
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
            except StorageError:
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
                await asyncio.to_thread(self._anchor_if_due)
            if now >= verify:
                verify = now + VERIFY_PERIOD
                await self.check()

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
        marks = read_marks(self._head, self._anchors)
        self.verdict = await self._db.read(lambda connection: verify(connection, self._key, marks))
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

    def check_now(self) -> Verdict:
        """As `check`, on the caller's thread and without a line: for the command line, also beside a running server."""
        marks = read_marks(self._head, self._anchors)
        return self._db.run(lambda connection: verify(connection, self._key, marks))

    def check_other_now(self, verify: Callable[[Connection, bytes], Verdict]) -> Verdict:
        """Another chain of the same database, verified by `verify` with the audit's key."""
        return self._db.run(lambda connection: verify(connection, self._key))

    def close(self) -> None:
        """A last anchor."""
        try:
            self._anchor_if_due(now=True)
        except OSError as error:
            log.error("audit anchor not written reason=%s", error.strerror)

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
class Marks:
    """What stands outside the database: the head and the anchors, as they were before the lines were read."""

    head: tuple[int, str, str] | None
    anchors: Sequence[tuple[int, int, str, str]] = field(default_factory=tuple)
    broken: bool = False
    """True when one of the files cannot be understood."""


def read_marks(head: Path, anchors: Path) -> Marks:
    """Read both files; a file that is not there is an empty one."""
    try:
        seq, mac, sign = head.read_text().split()
        newest: tuple[int, str, str] | None = (int(seq), mac, sign)
    except FileNotFoundError:
        newest = None
    except (ValueError, OSError):
        return Marks(None, (), broken=True)
    lines: list[tuple[int, int, str, str]] = []
    try:
        for line in anchors.read_text().splitlines():
            at, time, mac, sign = line.split()
            lines.append((int(at), int(time), mac, sign))
    except FileNotFoundError:
        pass
    except (ValueError, OSError):
        return Marks(newest, (), broken=True)
    return Marks(newest, lines)


def verify(connection: Connection, key: bytes, marks: Marks) -> Verdict:
    """Walk the chain from its first line and compare it with `marks`."""
    anchors = {}
    for seq, time, mac, sign in marks.anchors:
        if not hmac.compare_digest(sign, _signed(key, "anchor", seq, mac, time)):
            return Verdict(0, seq, "anchor")
        anchors[seq] = mac
    if marks.broken:
        return Verdict(0, 1, "anchor")
    if marks.head and not hmac.compare_digest(marks.head[2], _signed(key, "head", marks.head[0], marks.head[1])):
        return Verdict(0, marks.head[0], "head")
    before, expected = genesis(key), 1
    columns = [column for column in audit_table.c if column.name != "mac"]
    for row in connection.execute(select(audit_table).order_by(audit_table.c.seq)).yield_per(1000):
        if row.seq != expected:
            why, bad = ("removed", expected) if row.seq > expected else ("inserted", row.seq)
            return Verdict(expected - 1, bad, why, row.seq)
        fields = {column.name: getattr(row, column.name) for column in columns}
        if not hmac.compare_digest(row.mac, chained(key, before, fields)):
            return Verdict(expected - 1, row.seq, "changed", row.seq)
        if anchors.get(row.seq, row.mac) != row.mac:
            return Verdict(expected - 1, row.seq, "anchor", row.seq)
        if marks.head and marks.head[0] == row.seq and marks.head[1] != row.mac:
            return Verdict(expected - 1, row.seq, "head", row.seq)
        before, expected = row.mac, expected + 1
    last = expected - 1
    known = max([marks.head[0] if marks.head else 0, *anchors])
    if known > last:
        return Verdict(last, last + 1, "cut", last)
    if last and marks.head is None:
        return Verdict(last, last, "head", last)
    return Verdict(last, newest=last)


def genesis(key: bytes) -> str:
    """What the first line is chained to."""
    return hmac.new(key, b"genesis", hashlib.sha256).hexdigest()


def chained(key: bytes, before: str, fields: Mapping[str, object]) -> str:
    """The mac of the line `fields` that follows the line with mac `before`."""
    text = json.dumps(fields, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).digest()
    return hmac.new(key, bytes.fromhex(before) + digest, hashlib.sha256).hexdigest()


def printable(text: object, longest: int = LONGEST_TEXT) -> str:
    """`text` on one line: control signs, line separators and signs that turn the writing direction become escapes."""
    shown = "".join(_escaped(letter) for letter in str(text)[: longest + 1])
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"


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
    names = [column.name for column in audit_table.c if column.name != "mac"]
    return [Record(**{name: getattr(row, name) for name in names}) for row in connection.execute(query)]


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
