"""Signing in: a password, for some a code after it, and the first account of an installation."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from sqlalchemy import Connection, update

from app import chance
from app.access.accounts import (
    Account,
    Accounts,
    account_name,
    account_of,
    as_person,
    count_accounts,
    row_of,
    usable_display,
    usable_name,
)
from app.access.attempts import Attempts
from app.access.audit.audit import Audit
from app.access.audit.line import Entry, printable
from app.access.factors import GOOD, Factors, factor_of, recovery_used
from app.access.first_code import FirstCode
from app.access.passwords import Passwords
from app.access.roles import FIRST_ROLES
from app.access.sessions import ID_BYTES, Sessions, family, hash_of, limit_of
from app.access.tables import person_table
from app.access.throttle import FIRST_DELAY, Throttle
from app.clock import Clock
from app.db import Database
from app.errors import Refused, StorageError

HALF_LIFE = 300.0
"""Between the right password and the code may be so long [s]."""
MOST_HALF = 1000
FIRST = "first sign-in"
"""Under this name wrong codes of the first sign-in are counted."""


@dataclass(frozen=True, slots=True)
class HalfIn:
    """The password was right, and a code is still to come: no session, and no right."""

    ticket: str
    """The id for a cookie; kept nowhere else, good for `HALF_LIFE`."""


@dataclass(frozen=True, slots=True)
class _Half:
    person: int
    name: str
    password: str
    """The hash: with another password the sign-in begins anew."""
    until: float
    """On the monotonic clock [s]."""
    agent: str
    old_sid: str


@dataclass(frozen=True, slots=True)
class SignedIn:
    """What a sign-in gives."""

    sid: str
    """The id for the cookie; kept nowhere else."""
    account: Account
    last_seen: int | None
    """The sign-in before this one [µs UTC]."""


class SignIn:
    """Lets people in; remembers whose code is awaited."""

    def __init__(
        self,
        db: Database,
        clock: Clock,
        audit: Audit,
        sessions: Sessions,
        passwords: Passwords,
        throttle: Throttle,
        first_code: FirstCode,
        factors: Factors,
        accounts: Accounts,
        tell: Callable[[str, str], None],
    ) -> None:
        """`tell` is told `account_locked` and whose account."""
        self._db = db
        self._clock = clock
        self._audit = audit
        self._sessions = sessions
        self._passwords = passwords
        self._throttle = throttle
        self._first_code = first_code
        self._factors = factors
        self._accounts = accounts
        self._tell = tell
        self._halves: OrderedDict[str, _Half] = OrderedDict()
        self._attempts = Attempts(throttle)

    async def with_password(
        self, name: str, password: str, address: str, agent: str, old_sid: str = ""
    ) -> SignedIn | HalfIn:
        """Open a session, in place of `old_sid`; for who has a second factor, only after `give_code`.

        A database that takes nothing keeps out nobody whom it knows: the session stands in memory until it is written.

        Raises:
            Refused: 401 `access.failed`, the same for every cause; 429 `access.too_many`.
            StorageError: the database cannot be read, or takes nothing and the person has an initial password or a second factor.
        """
        async with self._attempts.one(address):
            return await self._with_password(name, password, address, agent, old_sid)

    async def _with_password(
        self, name: str, password: str, address: str, agent: str, old_sid: str
    ) -> SignedIn | HalfIn:
        key = account_name(name)
        wait = self._throttle.wait(key)
        if wait > 0:
            await self._failed(key, address, "locked", wait)
        # counted before the slow check, so that attempts side by side do not share one
        delay = self._throttle.failed(key)
        row = await self._db.read(lambda connection: row_of(connection, person_table.c.name == key))
        good = await self._passwords.verify(password, row.password if row else None)
        now = self._clock.micros()
        if row is not None and delay == FIRST_DELAY:
            self._tell("account_locked", key)
        if row is None or not good:
            await self._failed(key, address, "wrong", delay)
        elif row.disabled:
            await self._failed(key, address, "disabled", delay)
        elif row.must_change and (row.initial_until is None or row.initial_until <= now):
            await self._failed(key, address, "expired", delay)
        assert row is not None
        fresh = await self._passwords.hash(password) if self._passwords.outdated(row.password) else None

        def work(connection: Connection) -> tuple[tuple[SignedIn, list[str]] | str, Sequence[Entry]]:
            again = row_of(connection, person_table.c.id == row.id)
            spent = again is not None and again.initial_until != row.initial_until
            if again is None or again.disabled or again.password != row.password or spent:
                return "", ()
            if fresh:
                change = update(person_table).where(person_table.c.id == row.id)
                connection.execute(change.values(password=fresh))
            if factor_of(connection, row.id) is not None:
                who = as_person(account_of(connection, again), "", address)
                return fresh or row.password, [self._audit.entry("signin.password", who, key)]
            return self._opened(connection, again, address, agent, old_sid)

        try:
            done = await self._audit.with_entries(work)
        except StorageError:
            standing = await self._unwritten(row, address, agent, old_sid)
            if standing is None:
                raise
            done = standing
        if not done:
            await self._failed(key, address, "changed", delay)
        self._throttle.clear(key)
        self._throttle.give_back(address)
        if isinstance(done, str):
            return self._half_in(_Half(row.id, key, done, self._clock.monotonic() + HALF_LIFE, family(agent), old_sid))
        return self._entered(*done, old_sid)

    async def give_code(self, ticket: str, code: str, address: str, agent: str) -> SignedIn:
        """Open the session for which the password was right, with a code or a recovery code.

        Raises:
            Refused: 401 `access.factor.wrong`; 401 `access.factor.over` when the sign-in has to begin anew; 429 after too many attempts.
            StorageError: the database did not take it.
        """
        async with self._attempts.one(address):
            return await self._give_code(ticket, code, address, agent)

    async def _give_code(self, ticket: str, code: str, address: str, agent: str) -> SignedIn:
        half = self.half(ticket, agent)
        if half is None:
            raise Refused("access.factor.over", 401)
        delay = self._factors.trying(half.name, code)

        def work(connection: Connection) -> tuple[tuple[SignedIn, list[str]] | str, Sequence[Entry]]:
            row = row_of(connection, person_table.c.id == half.person)
            late = row is not None and row.must_change and (row.initial_until or 0) <= self._clock.micros()
            if row is None or row.disabled or late or row.password != half.password:
                return "changed", ()
            if factor_of(connection, half.person) is None:
                return "changed", ()
            taken = self._factors.take(connection, half.person, code)
            if taken not in GOOD:
                return taken, ()
            done, lines = self._opened(connection, row, address, agent, half.old_sid)
            if taken == "recovery":
                who = as_person(done[0].account, hash_of(done[0].sid), address)
                lines = [*lines, *recovery_used(self._audit, connection, who)]
            return done, lines

        done = await self._audit.with_entries(work)
        if done == "changed":
            self.forget_half(ticket)
            await self._failed(half.name, address, "changed", 0.0, "access.factor.over")
        elif isinstance(done, str):
            await self._failed(half.name, address, f"code_{done}", delay, "access.factor.wrong")
        assert not isinstance(done, str)
        self.forget_half(ticket)
        self._factors.right(half.name)
        self._throttle.give_back(address)
        return self._entered(*done, half.old_sid)

    def half(self, ticket: str, agent: str) -> _Half | None:
        """Whose code is awaited in the browser with this ticket; None when nobody's is, or no more."""
        found = self._halves.get(hash_of(ticket)) if ticket else None
        if found is None or found.until <= self._clock.monotonic() or found.agent != family(agent):
            return None
        return found

    def forget_half(self, ticket: str) -> None:
        """No code is awaited any more."""
        self._halves.pop(hash_of(ticket), None)

    async def first(
        self, code: str, name: str, display: str, password: str, address: str, agent: str, old_sid: str = ""
    ) -> SignedIn:
        """Make the first account, administrator, engineer and operator at once, and sign in.

        Raises:
            Refused: the code is wrong (401), there is an account already (409), the name or password cannot be used (422), or there were
                too many attempts (429).
            StorageError: the database did not take it.
        """
        async with self._attempts.one(address):
            return await self._first(code, name, display, password, address, agent, old_sid)

    async def _first(
        self, code: str, name: str, display: str, password: str, address: str, agent: str, old_sid: str
    ) -> SignedIn:
        if self._throttle.wait(FIRST) > 0:
            raise Refused("access.wait", 429, seconds=round(self._throttle.wait(FIRST) + 0.5))
        if not self._first_code.open or await self._db.read(count_accounts) > 0:
            raise Refused("access.first_done", 409)
        if not self._first_code.matches(code):
            delay = self._throttle.failed(FIRST)
            await self._audit.record(
                "signin.failed",
                None,
                FIRST,
                result="refused",
                reason="access.cause.wrong",
                address=address,
                delay=delay,
            )
            raise Refused("access.code_wrong", 401)
        key = usable_name(name)
        label = usable_display(display, key)
        self._passwords.check(password, FIRST_ROLES, key, label)
        kept = await self._passwords.hash(password)

        def work(connection: Connection) -> tuple[SignedIn | None, Sequence[Entry]]:
            if count_accounts(connection):
                return None, ()
            account = self._accounts.insert(connection, key, label, FIRST_ROLES, kept, None)
            seen = update(person_table).where(person_table.c.id == account.id)
            connection.execute(seen.values(last_seen=self._clock.micros()))
            sid, _ = self._sessions.open(
                connection, account.id, account.roles, address, agent, hash_of(old_sid) if old_sid else None
            )
            who = as_person(account, hash_of(sid), address)
            return SignedIn(sid, account, None), [
                self._audit.entry("person.first", who, key, new=account.roles),
                self._audit.entry("signin.ok", who, key, agent=printable(agent, 200)),
            ]

        done = await self._audit.with_entries(work)
        if done is None:
            raise Refused("access.first_done", 409)
        self._first_code.used()
        self._throttle.clear(FIRST)
        return done

    async def _unwritten(self, row: Any, address: str, agent: str, old_sid: str) -> tuple[SignedIn, list[str]] | None:
        """A session in memory for who gave the right password while the database took nothing; None when it is to tell of that itself.

        Initial passwords and codes are good once, which only the database can say. The line of the others is on the disk before they are
        let in; where nothing takes that, they watch and stop.

        Raises:
            StorageError: the database cannot be read.
        """
        account, second = await self._db.read(
            lambda connection: (account_of(connection, row), factor_of(connection, row.id))
        )
        if account.must_change or second is not None:
            return None
        sid = chance.token_urlsafe(ID_BYTES)
        who = as_person(account, hash_of(sid), address)
        line = self._audit.entry("signin.ok", who, account.name, agent=printable(agent, 200))
        on_disk = await self._audit.foretell(line)
        if not on_disk:
            await self._audit.write(line)
        replaces = hash_of(old_sid) if old_sid else None
        limit = limit_of(account.roles)
        standing = self._sessions.standing
        ended = standing.begin(who, row.password, family(agent), limit, replaces, watching=not on_disk)
        if replaces:
            self._sessions.replaced(replaces)
        return SignedIn(sid, account, row.last_seen), ended

    def _half_in(self, half: _Half) -> HalfIn:
        now = self._clock.monotonic()
        for over in [key for key, one in self._halves.items() if one.until <= now]:
            del self._halves[over]
        while len(self._halves) >= MOST_HALF:
            self._halves.popitem(last=False)
        ticket = chance.token_urlsafe(ID_BYTES)
        self._halves[hash_of(ticket)] = half
        return HalfIn(ticket)

    def _opened(
        self, connection: Connection, row: Any, address: str, agent: str, old_sid: str
    ) -> tuple[tuple[SignedIn, list[str]], list[Entry]]:
        """A session for the person of `row` in this transaction, the sessions that it ended, and the lines of it."""
        account, now = account_of(connection, row), self._clock.micros()
        changed: dict[str, object] = {"last_seen": now}
        if account.must_change:
            changed["initial_until"] = now  # good for this one sign-in
        connection.execute(update(person_table).where(person_table.c.id == row.id).values(**changed))
        replaces = hash_of(old_sid) if old_sid else None
        sid, ended = self._sessions.open(connection, account.id, account.roles, address, agent, replaces)
        who = as_person(account, hash_of(sid), address)
        lines = [self._audit.entry("signin.ok", who, account.name, agent=printable(agent, 200))]
        over = [old for old in ended if old != replaces]
        lines += [self._audit.entry("session.limit", who, account.name, ended=old[:12]) for old in over]
        return (SignedIn(sid, account, row.last_seen), ended), lines

    def _entered(self, signed_in: SignedIn, ended: list[str], old_sid: str) -> SignedIn:
        """Tell of the sessions that a new one ended."""
        self._sessions.note_over((one for one in ended if not old_sid or one != hash_of(old_sid)), "limit")
        self._sessions.announce(ended)
        return signed_in

    async def _failed(self, key: str, address: str, cause: str, delay: float, said: str = "access.failed") -> NoReturn:
        """Write down why, tell only that.

        Raises:
            Refused: always.
        """
        await self._audit.record(
            "signin.failed",
            None,
            key,
            result="refused",
            reason=f"access.cause.{cause}",
            address=address,
            delay=round(delay),
        )
        raise Refused(said, 401)
