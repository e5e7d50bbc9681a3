"""Accounts: made, changed, disabled, and let in with a password. An id is never given twice."""

import re
import unicodedata
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NoReturn

from sqlalchemy import ColumnElement, Connection, delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from app import chance
from app.access.audit.audit import Audit, refused_without_audit
from app.access.audit.line import Entry, printable
from app.access.factors import GOOD, Factors, factor_of, recovery_used
from app.access.first_code import FirstCode
from app.access.passwords import Passwords, check_policy, initial_password, normal
from app.access.roles import FIRST_ROLES, Person, known_roles
from app.access.sessions import ID_BYTES, Sessions, end_all, family, hash_of, roles_of
from app.access.tables import person_table, role_table
from app.access.throttle import FIRST_DELAY, Throttle
from app.access.tokens import Tokens, revoke_all
from app.clock import Clock
from app.db import Database
from app.errors import Refused

INITIAL_LIFE = 24 * 3600.0
"""An initial password is good for one sign-in within so long [s]."""
RESERVED = frozenset({"system", "guest"})
HALF_LIFE = 300.0
"""Between the right password and the code may be so long [s]."""
MOST_HALF = 1000
FIRST = "first sign-in"
"""Under this name wrong codes of the first sign-in are counted."""


@dataclass(frozen=True, slots=True)
class Account:
    """A person's account, without its password."""

    id: int
    name: str
    display: str
    roles: frozenset[str]
    disabled: bool
    must_change: bool
    initial_until: int | None
    """Until when the initial password is good [µs UTC]; None when it was changed."""
    created: int
    last_seen: int | None
    """Last sign-in [µs UTC]."""
    language: str = ""
    theme: str = ""
    factor: bool = False
    """Whether a code is asked for after the password."""


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


class People:
    """The accounts of one installation."""

    def __init__(
        self,
        db: Database,
        clock: Clock,
        audit: Audit,
        sessions: Sessions,
        passwords: Passwords,
        throttle: Throttle,
        first_code: FirstCode,
        tokens: Tokens,
        factors: Factors,
    ) -> None:
        self._db = db
        self._clock = clock
        self._audit = audit
        self._sessions = sessions
        self._passwords = passwords
        self._throttle = throttle
        self._first_code = first_code
        self._tokens = tokens
        self._factors = factors
        self._halves: OrderedDict[str, _Half] = OrderedDict()
        self.tell: Callable[[str, str], None] = lambda alarm, name: None
        """Told what people who look after the plant should know at once: `account_locked` or `admin_added`, and whose account."""
        self._admins: frozenset[str] | None = None
        self.plant_name = ""
        """A password may not be made of it."""

    # ---- signing in -----------------------------------------------------------------------------------

    async def sign_in(self, name: str, password: str, address: str, agent: str, old_sid: str = "") -> SignedIn | HalfIn:
        """Open a session, in place of `old_sid`; for who has a second factor, only after `give_code`.

        Raises:
            Refused: 401 `access.failed`, the same for every cause; 429 `access.too_many`.
            StorageError: the database did not take it.
        """
        await self._take(address)
        key = account_name(name)
        wait = self._throttle.wait(key)
        if wait > 0:
            await self._failed(key, address, "locked", wait)
        # counted before the slow check, so that attempts side by side do not share one
        delay = self._throttle.failed(key)
        row = await self._db.read(lambda connection: _row(connection, person_table.c.name == key))
        good = await self._passwords.verify(password, row.password if row else None)
        now = self._clock.micros()
        if row is not None and delay == FIRST_DELAY:
            self.tell("account_locked", key)
        if row is None or not good:
            await self._failed(key, address, "wrong", delay)
        elif row.disabled:
            await self._failed(key, address, "disabled", delay)
        elif row.must_change and (row.initial_until is None or row.initial_until <= now):
            await self._failed(key, address, "expired", delay)
        assert row is not None
        fresh = await self._passwords.hash(password) if self._passwords.outdated(row.password) else None

        def work(connection: Connection) -> tuple[tuple[SignedIn, list[str]] | str, Sequence[Entry]]:
            again = _row(connection, person_table.c.id == row.id)
            spent = again is not None and again.initial_until != row.initial_until
            if again is None or again.disabled or again.password != row.password or spent:
                return "", ()
            if fresh:
                change = update(person_table).where(person_table.c.id == row.id)
                connection.execute(change.values(password=fresh))
            if factor_of(connection, row.id) is not None:
                who = _as_person(_account(connection, again), "", address)
                return fresh or row.password, [self._audit.entry("signin.password", who, key)]
            return self._opened(connection, again, address, agent, old_sid)

        done = await self._audit.with_entries(work)
        if not done:
            await self._failed(key, address, "changed", delay)
        self._throttle.clear(key)
        if isinstance(done, str):
            return self._half_in(_Half(row.id, key, done, self._clock.monotonic() + HALF_LIFE, family(agent), old_sid))
        return self._entered(*done, old_sid)

    async def give_code(self, ticket: str, code: str, address: str, agent: str) -> SignedIn:
        """Open the session for which the password was right, with a code or a recovery code.

        Raises:
            Refused: 401 `access.factor.wrong`; 401 `access.factor.over` when the sign-in has to begin anew; 429 after too many attempts.
            StorageError: the database did not take it.
        """
        await self._take(address)
        half = self.half(ticket, agent)
        if half is None:
            raise Refused("access.factor.over", 401)
        delay = self._factors.trying(half.name, code)

        def work(connection: Connection) -> tuple[tuple[SignedIn, list[str]] | str, Sequence[Entry]]:
            row = _row(connection, person_table.c.id == half.person)
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
                who = _as_person(done[0].account, hash_of(done[0].sid), address)
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
        await self._take(address)
        if self._throttle.wait(FIRST) > 0:
            raise Refused("access.wait", 429, seconds=round(self._throttle.wait(FIRST) + 0.5))
        if not self._first_code.open or await self.count():
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
        check_policy(password, FIRST_ROLES, [key, label, self.plant_name])
        kept = await self._passwords.hash(password)

        def work(connection: Connection) -> tuple[SignedIn | None, Sequence[Entry]]:
            if connection.execute(select(func.count()).select_from(person_table)).scalar_one():
                return None, ()
            account = self._insert(connection, key, label, FIRST_ROLES, kept, None)
            seen = update(person_table).where(person_table.c.id == account.id)
            connection.execute(seen.values(last_seen=self._clock.micros()))
            sid, _ = self._sessions.open(
                connection, account.id, account.roles, address, agent, hash_of(old_sid) if old_sid else None
            )
            who = _as_person(account, hash_of(sid), address)
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

    # ---- looking after accounts -----------------------------------------------------------------------

    async def count(self) -> int:
        """Number of accounts, disabled ones too."""
        query = select(func.count()).select_from(person_table)
        return await self._db.read(lambda connection: connection.execute(query).scalar_one())

    async def all(self) -> list[Account]:
        """All accounts by name."""
        return await self._db.read(all_accounts)

    def now(self) -> list[Account]:
        """As `all`, on the caller's thread: for the command line."""
        return self._db.run(all_accounts)

    async def get(self, person_id: int) -> Account:
        """One account.

        Raises:
            Refused: 404, there is none with this id.
        """
        found = await self._db.read(lambda connection: _find(connection, person_id))
        if found is None:
            raise Refused("access.no_person", 404, id=person_id)
        return found

    async def add(self, by: Person, name: str, display: str, roles: Iterable[str]) -> tuple[Account, str]:
        """Make an account; returns it and its initial password, which is shown once and kept nowhere.

        Raises:
            Refused: the name is taken (409) or unusable, no or unknown roles (422), or the audit cannot be written (503).
            StorageError: the database did not take it.
        """
        refused_without_audit(self._audit)
        prepared = self._prepared(name, display, roles)
        initial = initial_password()
        kept = await self._passwords.hash(initial)
        account = await self._audit.with_entries(lambda connection: self._added(connection, by, *prepared, kept))
        self._first_code.used()
        return account, initial

    def add_now(self, by: Person, rows: Sequence[tuple[str, str, Iterable[str]]]) -> list[tuple[Account, str]]:
        """As `add`, for many at once, all or none, on the caller's thread: for the command line.

        Raises:
            Refused: one of them cannot be made; none is.
        """
        prepared = [self._prepared(*row) for row in rows]
        initials = [initial_password() for _ in rows]
        hashes = [self._passwords.hash_now(initial) for initial in initials]

        def work(connection: Connection) -> tuple[list[Account], Sequence[Entry]]:
            accounts: list[Account] = []
            lines: list[Entry] = []
            for one, kept in zip(prepared, hashes, strict=True):
                account, entries = self._added(connection, by, *one, kept)
                accounts.append(account)
                lines += entries
            return accounts, lines

        return list(zip(self._audit.run(work), initials, strict=True))

    async def set_roles(self, by: Person, person_id: int, roles: Iterable[str]) -> Account:
        """Give a person another set of roles; it counts from the next request on.

        Raises:
            Refused: unknown role (422), nobody of this id (404), the last administrator would be gone (409), no audit (503).
        """
        refused_without_audit(self._audit)
        account = await self._audit.with_entries(lambda connection: self._roles_set(connection, by, person_id, roles))
        await self._follow()
        return account

    def set_roles_now(self, by: Person, name: str, roles: Iterable[str]) -> Account:
        """As `set_roles`, by name, on the caller's thread: for the command line."""
        return self._audit.run(lambda connection: self._roles_set(connection, by, _id_of(connection, name), roles))

    async def disable(self, by: Person, person_id: int, disabled: bool) -> None:
        """Shut a person out, with all sessions at once, or let them in again.

        Raises:
            Refused: nobody of this id (404), oneself or the last administrator (409), no audit (503).
        """
        refused_without_audit(self._audit)

        def work(connection: Connection) -> tuple[list[str], Sequence[Entry]]:
            account = _known(connection, person_id)
            if disabled and account.id == by.id:
                raise Refused("access.not_yourself", 409)
            with _keeping_an_admin(connection):
                connection.execute(update(person_table).where(person_table.c.id == person_id).values(disabled=disabled))
            kind = "person.disabled" if disabled else "person.enabled"
            ended = end_all(connection, person_id) if disabled else []
            return ended, [self._audit.entry(kind, by, account.name)]

        self._sessions.announce(await self._audit.with_entries(work))
        await self._follow()

    async def delete(self, by: Person, person_id: int) -> None:
        """Remove an account for good; its lines in the audit stay, its id is never given again.

        Raises:
            Refused: nobody of this id (404), oneself or the last administrator (409), no audit (503).
        """
        refused_without_audit(self._audit)

        def work(connection: Connection) -> tuple[list[str], Sequence[Entry]]:
            account = _known(connection, person_id)
            if account.id == by.id:
                raise Refused("access.not_yourself", 409)
            ended = end_all(connection, person_id)
            with _keeping_an_admin(connection):
                connection.execute(delete(person_table).where(person_table.c.id == person_id))
            return ended, [self._audit.entry("person.deleted", by, account.name, old=account.roles, id=account.id)]

        self._sessions.announce(await self._audit.with_entries(work))
        await self._follow()

    async def rename(self, by: Person, person_id: int, display: str) -> None:
        """Change the name that others read.

        Raises:
            Refused: nobody of this id (404), an unusable name (422), no audit (503).
        """
        refused_without_audit(self._audit)

        def work(connection: Connection) -> tuple[None, Sequence[Entry]]:
            account = _known(connection, person_id)
            label = usable_display(display, account.name)
            connection.execute(update(person_table).where(person_table.c.id == person_id).values(display=label))
            return None, [self._audit.entry("person.renamed", by, account.name, account.display, label)]

        await self._audit.with_entries(work)
        await self._follow()

    async def new_initial(self, by: Person, person_id: int) -> str:
        """A new initial password, in place of a forgotten one; all sessions of the person end. Shown once, kept nowhere.

        Raises:
            Refused: nobody of this id (404), oneself (409), no audit (503).
        """
        refused_without_audit(self._audit)
        if person_id == by.id:
            raise Refused("access.not_yourself", 409)
        initial = initial_password()
        kept = await self._passwords.hash(initial)
        account, ended = await self._audit.with_entries(
            lambda connection: self._password_set(connection, by, person_id, kept, initial=True)
        )
        self._throttle.clear(account.name)
        self._sessions.announce(ended)
        await self._follow()
        return initial

    def set_password_now(self, by: Person, name: str, password: str | None) -> str:
        """Set a password by name on the caller's thread, for the command line; None sets an initial one and returns it.

        Raises:
            Refused: nobody of this name (404), or the password is too weak (422).
        """
        accounts = {account.name: account for account in self.now()}
        account = accounts.get(account_name(name))
        if account is None:
            raise Refused("access.no_person", 404, id=printable(name, 40))
        if password is not None:
            check_policy(password, account.roles, [account.name, account.display, self.plant_name])
        chosen = password if password is not None else initial_password()
        kept = self._passwords.hash_now(chosen)
        self._audit.run(
            lambda connection: self._password_set(connection, by, account.id, kept, initial=password is None)
        )
        return chosen

    async def unlock(self, by: Person, person_id: int) -> None:
        """Let a person try again at once after wrong passwords or codes.

        Raises:
            Refused: nobody of this id (404).
        """
        account = await self.get(person_id)
        self._throttle.clear(account.name)
        self._factors.unlock(account.name)
        await self._audit.record("person.unlocked", by, account.name)

    def locked(self, name: str) -> float:
        """Seconds that an account still has to wait after wrong passwords or codes."""
        return max(self._throttle.wait(account_name(name)), self._factors.locked(account_name(name)))

    # ---- one's own account ----------------------------------------------------------------------------

    async def confirm(self, person: Person, password: str) -> None:
        """Ask for one's own password before something weighty (confirmation level C4).

        Raises:
            Refused: it is wrong (401), or there were too many wrong ones (429).
        """
        key = f"{person.name} {person.session}"  # of the session: a stranger's tries at the sign-in hold nobody up who is in
        wait = self._throttle.wait(key)
        if wait > 0:
            raise Refused("access.wait", 429, seconds=round(wait + 0.5))
        delay = self._throttle.failed(key)
        row = await self._db.read(lambda connection: _row(connection, person_table.c.id == person.id))
        if row is None or not await self._passwords.verify(password, row.password):
            await self._audit.record(
                "password.refused",
                person,
                person.name,
                result="refused",
                reason="access.cause.wrong",
                delay=round(delay),
            )
            if delay == FIRST_DELAY:
                self.tell("account_locked", person.name)
            raise Refused("access.current_wrong", 401)
        self._throttle.clear(key)

    async def change_password(self, person: Person, current: str, new: str, agent: str, sid: str) -> str:
        """Change one's own password; all one's sessions end and a new id is returned.

        Raises:
            Refused: the current one is wrong (401), too many attempts (429), the new one too weak or the old one again (422).
        """
        await self.confirm(person, current)
        check_policy(new, person.roles, [person.name, person.display, self.plant_name])
        if normal(new) == normal(current):
            raise Refused("access.password.same", 422)
        kept = await self._passwords.hash(new)

        def work(connection: Connection) -> tuple[tuple[str, list[str]], Sequence[Entry]]:
            account, ended = self._password_set(connection, person, person.id, kept, initial=False)[0]
            fresh, _ = self._sessions.open(connection, account.id, account.roles, person.address, agent, hash_of(sid))
            return (fresh, ended), [self._audit.entry("password.changed", person, person.name)]

        fresh, ended = await self._audit.with_entries(work)
        self._sessions.announce(ended)
        return fresh

    async def prefer(self, person: Person, language: str | None = None, theme: str | None = None) -> None:
        """Keep language and theme with the account, for the next browser that this person signs in with."""
        values = {name: value[:8] for name, value in (("language", language), ("theme", theme)) if value is not None}
        if values:
            change = update(person_table).where(person_table.c.id == person.id).values(**values)
            await self._db.write(lambda connection: connection.execute(change) and None)

    async def watch_admins(self) -> None:
        """Tell of an administrator who was none before, whoever made them one, the terminal too.

        Raises:
            StorageError: the database cannot be read.
        """
        found = await self._db.read(_admin_names)
        for name in sorted(found - self._admins) if self._admins is not None else ():
            self.tell("admin_added", name)
        self._admins = found

    # ---- details --------------------------------------------------------------------------------------

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
        account, now = _account(connection, row), self._clock.micros()
        changed: dict[str, object] = {"last_seen": now}
        if account.must_change:
            changed["initial_until"] = now  # good for this one sign-in
        connection.execute(update(person_table).where(person_table.c.id == row.id).values(**changed))
        replaces = hash_of(old_sid) if old_sid else None
        sid, ended = self._sessions.open(connection, account.id, account.roles, address, agent, replaces)
        who = _as_person(account, hash_of(sid), address)
        lines = [self._audit.entry("signin.ok", who, account.name, agent=printable(agent, 200))]
        over = [old for old in ended if old != replaces]
        lines += [self._audit.entry("session.limit", who, account.name, ended=old[:12]) for old in over]
        return (SignedIn(sid, account, row.last_seen), ended), lines

    def _entered(self, signed_in: SignedIn, ended: list[str], old_sid: str) -> SignedIn:
        """Tell of the sessions that a new one ended."""
        self._sessions.note_over((one for one in ended if not old_sid or one != hash_of(old_sid)), "limit")
        self._sessions.announce(ended)
        return signed_in

    async def _follow(self) -> None:
        """Accounts have changed: whoever loses a right by it loses it now, also where no request is made."""
        await self._sessions.people_changed()
        await self._tokens.renew()

    async def _take(self, address: str) -> None:
        if not self._throttle.take(address):
            raise Refused("access.too_many", 429)

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

    def _prepared(self, name: str, display: str, roles: Iterable[str]) -> tuple[str, str, frozenset[str]]:
        key = usable_name(name)
        return key, usable_display(display, key), _usable_roles(roles)

    def _added(
        self, connection: Connection, by: Person, key: str, label: str, roles: frozenset[str], kept: str
    ) -> tuple[Account, Sequence[Entry]]:
        until = self._clock.micros() + round(INITIAL_LIFE * 1e6)
        account = self._insert(connection, key, label, roles, kept, until)
        return account, [self._audit.entry("person.added", by, key, new=roles, display=label)]

    def _insert(
        self, connection: Connection, key: str, label: str, roles: frozenset[str], kept: str, initial_until: int | None
    ) -> Account:
        values = {
            "name": key,
            "display": label,
            "password": kept,
            "must_change": initial_until is not None,
            "initial_until": initial_until,
            "disabled": False,
            "language": "",
            "theme": "",
            "created": self._clock.micros(),
        }
        try:
            connection.execute(insert(person_table).values(**values))
        except IntegrityError as error:
            raise Refused("access.name_taken", 409, name=key) from error
        row = _row(connection, person_table.c.name == key)
        connection.execute(insert(role_table), [{"person": row.id, "role": role} for role in sorted(roles)])
        return _account(connection, row)

    def _roles_set(
        self, connection: Connection, by: Person, person_id: int, roles: Iterable[str]
    ) -> tuple[Account, Sequence[Entry]]:
        account, held = _known(connection, person_id), _usable_roles(roles)
        with _keeping_an_admin(connection):
            connection.execute(delete(role_table).where(role_table.c.person == person_id))
            connection.execute(insert(role_table), [{"person": person_id, "role": role} for role in sorted(held)])
        return _known(connection, person_id), [self._audit.entry("person.roles", by, account.name, account.roles, held)]

    def _password_set(
        self, connection: Connection, by: Person, person_id: int, kept: str, *, initial: bool
    ) -> tuple[tuple[Account, list[str]], Sequence[Entry]]:
        account = _known(connection, person_id)
        until = self._clock.micros() + round(INITIAL_LIFE * 1e6) if initial else None
        change = update(person_table).where(person_table.c.id == person_id)
        connection.execute(change.values(password=kept, must_change=initial, initial_until=until))
        ended = end_all(connection, person_id)
        kind = "password.initial" if initial else "password.set"
        lines = [self._audit.entry(kind, by, account.name)]
        if by.id != person_id:  # reset by somebody else: what was given out under the old one ends, too
            lines += [self._audit.entry("token.revoked", by, name) for name in revoke_all(connection, person_id)]
        return (account, ended), lines


def account_name(name: str) -> str:
    """`name` as accounts are looked up: one spelling for all ways to type it."""
    return unicodedata.normalize("NFKC", name).strip().casefold()[:64]


def usable_name(name: str) -> str:
    """A name for an account: 2 to 32 letters, digits, dots, dashes, underscores.

    Raises:
        Refused: 422.
    """
    key = account_name(name)
    if not re.fullmatch(r"\w[\w.-]{1,31}", key) or key in RESERVED:
        raise Refused("access.name_unusable", 422, name=printable(name, 40))
    return key


def usable_display(display: str, name: str) -> str:
    """The name that others read, at most 80 characters; without one the account's name.

    Raises:
        Refused: 422, too long.
    """
    label = " ".join(unicodedata.normalize("NFC", display).split()) or name
    if len(label) > 80:
        raise Refused("access.display_long", 422, most=80)
    return printable(label, 80)


def all_accounts(connection: Connection) -> list[Account]:
    """All accounts by name."""
    rows = connection.execute(select(person_table).order_by(person_table.c.name)).all()
    return [_account(connection, row) for row in rows]


def _usable_roles(roles: Iterable[str]) -> frozenset[str]:
    try:
        held = known_roles(roles)
    except ValueError as error:
        raise Refused("access.no_role", 422, roles=printable(", ".join(roles), 80)) from error
    if not held:
        raise Refused("access.needs_role", 422)
    return held


def _row(connection: Connection, condition: ColumnElement[bool]) -> Any:
    return connection.execute(select(person_table).where(condition)).first()


def _account(connection: Connection, row: Any) -> Account:
    return Account(
        id=row.id,
        name=row.name,
        display=row.display,
        roles=roles_of(connection, row.id),
        disabled=bool(row.disabled),
        must_change=bool(row.must_change),
        initial_until=row.initial_until,
        created=row.created,
        last_seen=row.last_seen,
        language=row.language,
        theme=row.theme,
        factor=factor_of(connection, row.id) is not None,
    )


def _find(connection: Connection, person_id: int) -> Account | None:
    row = _row(connection, person_table.c.id == person_id)
    return _account(connection, row) if row else None


def _known(connection: Connection, person_id: int) -> Account:
    account = _find(connection, person_id)
    if account is None:
        raise Refused("access.no_person", 404, id=person_id)
    return account


def _id_of(connection: Connection, name: str) -> int:
    row = _row(connection, person_table.c.name == account_name(name))
    if row is None:
        raise Refused("access.no_person", 404, id=printable(name, 40))
    return int(row.id)


def _admin_names(connection: Connection) -> frozenset[str]:
    query = (
        select(person_table.c.name)
        .join(role_table, role_table.c.person == person_table.c.id)
        .where(role_table.c.role == "admin", person_table.c.disabled.is_(False))
    )
    return frozenset(connection.execute(query).scalars())


def _admins(connection: Connection) -> int:
    query = (
        select(func.count())
        .select_from(person_table.join(role_table, role_table.c.person == person_table.c.id))
        .where(role_table.c.role == "admin", person_table.c.disabled.is_(False))
    )
    return connection.execute(query).scalar_one()


@contextmanager
def _keeping_an_admin(connection: Connection) -> Iterator[None]:
    """Refuse what would leave no administrator who can sign in."""
    before = _admins(connection)
    yield
    if before and not _admins(connection):
        raise Refused("access.last_admin", 409)


def _as_person(account: Account, session: str, address: str) -> Person:
    return Person(account.id, account.name, account.display, account.roles, frozenset(), session, address=address)
