"""The second factor: codes of an authenticator (TOTP, RFC 6238) after the password, and recovery codes for when it is lost.

What an authenticator knows is a key of 160 bits. It is kept in `pogon.db`, encrypted (age, X25519) to `factor.identity` beside it, and
bound to the person; so neither a copy of the database nor a backup without keys makes codes. A code is good one step early or late (30 s),
once: the step of the last one that was taken is kept, and only later ones are taken after it, also after a restart. Recovery codes have 80
random bits, are kept as SHA-256, and each is good once.

Source: RFC 6238 sections 4 and 5.2; reference/security.md sections 3 and 4.5.
"""

import base64
import errno
import hmac
import logging
import unicodedata
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from sqlalchemy import Connection, delete, func, insert, select, update

from app import chance
from app.access.audit.audit import Audit, refused_without_audit
from app.access.audit.line import Entry, printable
from app.access.first_code import ALPHABET
from app.access.keys import LARGEST_KEY_FILE
from app.access.private import write_private
from app.access.roles import Person
from app.access.sessions import Sessions, end_all, hash_of, roles_of
from app.access.tables import factor_table, person_table, recovery_table
from app.access.throttle import FIRST_DELAY, Throttle
from app.clock import Clock
from app.db import Database
from app.errors import ConfigurationError, Refused
from app.files import read_text

log = logging.getLogger(__name__)

STEP = 30
"""A code is shown for so long [s]."""
EARLY, LATE = 1, 1
"""Steps by which the clocks of telephone and server may differ."""
DIGITS = 6
KEY_BYTES = 20
"""RFC 4226 section 4, R6 recommends 160 bits."""
CODES, GROUPS, GROUP = 10, 4, 4
"""Recovery codes, each of four groups of four of the first code's signs: 80 bits."""
ENROLLING_TIME = 600.0
"""A key that was shown is forgotten unless a code of it comes within so long [s]."""
MOST_ENROLLING = 1000
LONGEST_CODE_DELAY = 900.0
"""After many wrong codes one may try so seldom [s]: of a million codes three are good, so a day of guessing finds one with 0.03 %."""
LONGEST_TYPED = 64
IDENTITY = "factor.identity"
"""Of POGON_DATA; made by the first enrolment."""

Taken = Literal["code", "recovery", "wrong", "replayed", "unreadable"]
"""What became of a code: the first two are good."""
GOOD = frozenset({"code", "recovery"})


@dataclass(frozen=True, slots=True)
class Factor:
    """The second factor of a person, without its key."""

    since: int
    """When it was confirmed [µs UTC]."""
    recovery: int
    """Recovery codes that are left."""


@dataclass(frozen=True, slots=True)
class _Enrolment:
    key: str
    until: float


class Factors:
    """The second factors of one installation."""

    def __init__(
        self, db: Database, clock: Clock, audit: Audit, sessions: Sessions, throttle: Throttle, data: Path
    ) -> None:
        self._db = db
        self._clock = clock
        self._audit = audit
        self._sessions = sessions
        self._throttle = throttle
        self._seal = Seal(data / IDENTITY)
        self._enrolments: OrderedDict[str, _Enrolment] = OrderedDict()
        self.tell: Callable[[str, str], None] = lambda alarm, name: None
        """As that of `People`."""

    async def of(self, person_id: int) -> Factor | None:
        """The second factor of a person; None when there is none.

        Raises:
            StorageError: the database cannot be read.
        """
        return await self._db.read(lambda connection: factor_of(connection, person_id))

    async def check(self) -> None:
        """Say in the log at a start when nobody's codes can be checked, because the key to them is lost.

        Raises:
            StorageError: the database cannot be read.
        """
        sealed = await self._db.read(lambda connection: connection.execute(select(factor_table)).all())
        lost = sum(not self._seal.opened(row.sealed, row.person) for row in sealed)
        if lost:
            log.error("second factors cannot be checked, only recovery codes are taken lost=%d key=%s", lost, IDENTITY)

    # ---- one's own --------------------------------------------------------------------------------------

    def begin(self, person: Person) -> str:
        """A new key [base32] for an authenticator; it counts for nothing until `enrol`."""
        key = base64.b32encode(chance.token_bytes(KEY_BYTES)).decode("ascii")
        self._enrolments[person.session] = _Enrolment(key, self._clock.monotonic() + ENROLLING_TIME)
        self._enrolments.move_to_end(person.session)
        while len(self._enrolments) > MOST_ENROLLING:
            self._enrolments.popitem(last=False)
        return key

    def begun(self, person: Person) -> str:
        """The key that this session was shown; empty when there is none or it was too long ago."""
        found = self._enrolments.get(person.session)
        if found is None or found.until <= self._clock.monotonic():
            self._enrolments.pop(person.session, None)
            return ""
        return found.key

    async def enrol(self, person: Person, code: str, agent: str, sid: str) -> tuple[str, list[str]]:
        """Turn the second factor on with a first code of the key that was shown; returns a new session id and the recovery codes.

        All sessions of the person end: none of them gave a code.

        Raises:
            Refused: the code is wrong (401), no key was shown (409), there is a factor already (409), too many attempts (429), or
                the audit or the key file cannot be written (503).
            StorageError: the database did not take it.
        """
        refused_without_audit(self._audit)
        key = self.begun(person)
        if not key:
            raise Refused("access.factor.begin_again", 409)
        delay = self.trying(person.name, code)
        step = self._step_of(key, _normal(code))
        if step is None:
            await self._refused(person, "wrong", delay)
        try:
            sealed = self._seal.sealed(key, person.id)
        except OSError as error:
            log.error("%s not written reason=%s", IDENTITY, error.strerror)
            raise Refused("error.unavailable", 503) from error

        def work(connection: Connection) -> tuple[tuple[str, list[str], list[str]], Sequence[Entry]]:
            if factor_of(connection, person.id) is not None:
                raise Refused("access.factor.already", 409)
            values = {"person": person.id, "sealed": sealed, "since": self._clock.micros(), "last_step": step}
            connection.execute(insert(factor_table).values(**values))
            codes = _fresh_codes(connection, person.id)
            ended = end_all(connection, person.id)
            roles = roles_of(connection, person.id)
            fresh, _ = self._sessions.open(connection, person.id, roles, person.address, agent, hash_of(sid))
            return (fresh, codes, ended), [self._audit.entry("factor.enrolled", person, person.name)]

        fresh, codes, ended = await self._audit.with_entries(work)
        self._enrolments.pop(person.session, None)
        self._throttle.clear(_key(person.name))
        self._sessions.announce(ended)
        return fresh, codes

    async def remove(self, person: Person, code: str) -> None:
        """Turn one's own second factor off with a code, or a recovery code; the password was asked for before.

        Raises:
            Refused: the code is wrong (401), there is no factor (409), too many attempts (429), no audit (503).
            StorageError: the database did not take it.
        """

        def change(connection: Connection) -> Sequence[Entry]:
            _delete(connection, person.id)
            return [self._audit.entry("factor.removed", person, person.name)]

        await self._with_code(person, code, change)
        await self._sessions.people_changed()

    async def renew_codes(self, person: Person, code: str) -> list[str]:
        """Ten new recovery codes in place of those that are left, with a code.

        Raises:
            Refused, StorageError: as `remove`.
        """
        codes: list[str] = []

        def change(connection: Connection) -> Sequence[Entry]:
            codes[:] = _fresh_codes(connection, person.id)
            return [self._audit.entry("factor.codes", person, person.name)]

        await self._with_code(person, code, change)
        return codes

    # ---- somebody else's --------------------------------------------------------------------------------

    async def reset(self, by: Person, person_id: int) -> None:
        """Take the second factor of somebody away who lost it; all their sessions end.

        Raises:
            Refused: nobody of this id (404), oneself or no factor there (409), no audit (503).
            StorageError: the database did not take it.
        """
        refused_without_audit(self._audit)
        if person_id == by.id:
            raise Refused("access.not_yourself", 409)
        name, ended = await self._audit.with_entries(
            lambda connection: self._reset(
                connection, by, _person(connection, person_table.c.id == person_id, person_id)
            )
        )
        self._throttle.clear(_key(name))
        self._sessions.announce(ended)

    def reset_now(self, by: Person, name: str) -> None:
        """As `reset`, by name, on the caller's thread: for the command line."""
        key = unicodedata.normalize("NFKC", name).strip().casefold()[:64]
        self._audit.run(
            lambda connection: self._reset(
                connection, by, _person(connection, person_table.c.name == key, printable(name, 40))
            )
        )

    def unlock(self, name: str) -> None:
        """Let a person try codes again at once."""
        self._throttle.clear(_key(name))

    def locked(self, name: str) -> float:
        """Seconds that a person still has to wait after wrong codes."""
        return self._throttle.wait(_key(name))

    # ---- codes ------------------------------------------------------------------------------------------

    def trying(self, name: str, code: str) -> float:
        """Count an attempt before it is looked at; returns the delay that it brings if it fails [s].

        A recovery code is never made to wait: it cannot be guessed, and whoever has the password could else keep its owner out.

        Raises:
            Refused: 429, too many wrong ones.
        """
        wait = self._throttle.wait(_key(name))
        if wait > 0 and not _is_recovery(_normal(code)):
            raise Refused("access.wait", 429, seconds=round(wait + 0.5))
        delay = self._throttle.failed(_key(name), LONGEST_CODE_DELAY)
        if delay == FIRST_DELAY:
            self.tell("account_locked", name)
        return delay

    def right(self, name: str) -> None:
        """The attempt was good: forget the failures before it."""
        self._throttle.clear(_key(name))

    def take(self, connection: Connection, person_id: int, code: str) -> Taken:
        """Look at a code in this transaction; a good one is used up by it."""
        typed = _normal(code)
        if _is_recovery(typed):
            mine = (recovery_table.c.person == person_id) & (recovery_table.c.hash == hash_of(typed))
            return "recovery" if connection.execute(delete(recovery_table).where(mine)).rowcount == 1 else "wrong"
        row = connection.execute(select(factor_table).where(factor_table.c.person == person_id)).first()
        key = self._seal.opened(row.sealed, person_id) if row is not None else ""
        if row is not None and not key:
            return "unreadable"
        step = self._step_of(key, typed) if key else None
        if step is None:
            return "wrong"
        later = (factor_table.c.person == person_id) & (factor_table.c.last_step < step)
        spent = connection.execute(update(factor_table).where(later).values(last_step=step))
        return "code" if spent.rowcount == 1 else "replayed"

    def _step_of(self, key: str, typed: str) -> int | None:
        """The step whose code this is, the latest that fits; None when there is none near now."""
        if len(typed) != DIGITS or not (typed.isascii() and typed.isdigit()):
            return None
        from pyotp import TOTP  # a start does not need it

        codes = TOTP(key, digits=DIGITS, interval=STEP)
        now = self._clock.micros() // (STEP * 1_000_000)
        found = None
        for step in range(max(0, now - EARLY), now + LATE + 1):  # all of them, so that the time says nothing
            if hmac.compare_digest(codes.generate_otp(step), typed):
                found = step
        return found

    async def _with_code(self, person: Person, code: str, change: Callable[[Connection], Sequence[Entry]]) -> None:
        refused_without_audit(self._audit)
        if await self.of(person.id) is None:
            raise Refused("access.factor.none", 409)
        delay = self.trying(person.name, code)

        def work(connection: Connection) -> tuple[Taken, Sequence[Entry]]:
            taken = self.take(connection, person.id, code)
            if taken not in GOOD:
                return taken, ()
            used = recovery_used(self._audit, connection, person) if taken == "recovery" else []
            return taken, [*used, *change(connection)]

        taken = await self._audit.with_entries(work)
        if taken not in GOOD:
            await self._refused(person, taken, delay)
        self.right(person.name)

    async def _refused(self, person: Person, cause: str, delay: float) -> None:
        """Write a wrong code down.

        Raises:
            Refused: always.
        """
        await self._audit.record(
            "factor.refused",
            person,
            person.name,
            result="refused",
            reason=f"access.cause.code_{cause}",
            delay=round(delay),
        )
        raise Refused("access.factor.wrong", 401)

    def _reset(self, connection: Connection, by: Person, row: Any) -> tuple[tuple[str, list[str]], Sequence[Entry]]:
        if factor_of(connection, row.id) is None:
            raise Refused("access.factor.none", 409)
        _delete(connection, row.id)
        return (row.name, end_all(connection, row.id)), [self._audit.entry("factor.reset", by, row.name)]


class Seal:
    """Encrypts the keys of authenticators with one that lies beside the database, not in it."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._identity: Any = None
        """pyrage.x25519.Identity."""

    @property
    def usable(self) -> bool:
        """Whether the identity is there and is one."""
        return self._read() is not None

    def sealed(self, key: str, person_id: int) -> str:
        """`key` as it is stored [base64 of age].

        Raises:
            OSError: the identity cannot be written, or what is in its place is none.
        """
        import pyrage

        if self._identity is None or not self._file.exists():
            self._identity = self._kept(self._identity or self._read() or pyrage.x25519.Identity.generate())
        text = pyrage.encrypt(f"{person_id} {key}".encode(), [self._identity.to_public()])
        return base64.b64encode(text).decode("ascii")

    def opened(self, sealed: str, person_id: int) -> str:
        """The key; empty when it was not sealed here, or for another person."""
        import pyrage

        if self._identity is None:
            self._identity = self._read()
        if self._identity is None:
            return ""
        try:
            text = pyrage.decrypt(base64.b64decode(sealed, validate=True), [self._identity]).decode("ascii")
        except (pyrage.DecryptError, ValueError):
            return ""
        owner, _, key = text.partition(" ")
        return key if owner == str(person_id) else ""

    def _read(self) -> Any:
        import pyrage

        try:
            lines = read_text(self._file, LARGEST_KEY_FILE).split()
            return pyrage.x25519.Identity.from_str(lines[-1]) if lines else None
        except (OSError, ConfigurationError, pyrage.IdentityError):
            return None

    def _kept(self, identity: Any) -> Any:
        """`identity`, now on the disk; what is there and cannot be read is not replaced, for it may be mended."""
        if not self._file.exists():
            write_private(self._file, f"{identity}\n", exclusive=True)
        elif str(self._read()) != str(identity):
            raise OSError(errno.EEXIST, "it is there and no private key of age")
        return identity


def factor_of(connection: Connection, person_id: int) -> Factor | None:
    """The second factor of a person; None when there is none."""
    since = connection.execute(select(factor_table.c.since).where(factor_table.c.person == person_id)).scalar()
    if since is None:
        return None
    left = select(func.count()).select_from(recovery_table).where(recovery_table.c.person == person_id)
    return Factor(since, connection.execute(left).scalar_one())


def recovery_used(audit: Audit, connection: Connection, person: Person) -> list[Entry]:
    """The line of a recovery code that was used in this transaction."""
    factor = factor_of(connection, person.id)
    return [audit.entry("factor.recovery", person, person.name, left=factor.recovery if factor else 0)]


def _key(name: str) -> str:
    """Of the throttle; no name that somebody types at the sign-in is in capitals there, so a stranger cannot touch it."""
    return f"CODE OF {name}"


def _normal(code: str) -> str:
    """What was typed, however it was grouped and in whichever case."""
    text = unicodedata.normalize("NFKC", code[:LONGEST_TYPED])
    return "".join(text.split()).replace("-", "").upper()


def _is_recovery(typed: str) -> bool:
    return len(typed) == GROUPS * GROUP and set(typed) <= set(ALPHABET)


def _fresh_codes(connection: Connection, person_id: int) -> list[str]:
    """New recovery codes in place of the old ones; only their hashes are kept."""
    codes = ["".join(chance.choice(ALPHABET) for _ in range(GROUPS * GROUP)) for _ in range(CODES)]
    connection.execute(delete(recovery_table).where(recovery_table.c.person == person_id))
    connection.execute(insert(recovery_table), [{"person": person_id, "hash": hash_of(code)} for code in codes])
    return ["-".join(code[at : at + GROUP] for at in range(0, len(code), GROUP)) for code in codes]


def _delete(connection: Connection, person_id: int) -> None:
    connection.execute(delete(recovery_table).where(recovery_table.c.person == person_id))
    connection.execute(delete(factor_table).where(factor_table.c.person == person_id))


def _person(connection: Connection, condition: Any, named: object) -> Any:
    row = connection.execute(select(person_table).where(condition)).first()
    if row is None:
        raise Refused("access.no_person", 404, id=named)
    return row
