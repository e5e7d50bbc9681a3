"""Looking after accounts: they are made, changed, shut out and removed. An id is never given twice."""

from collections.abc import Callable, Iterable, Sequence

from sqlalchemy import Connection, delete, update

from app.access.accounts import (
    Account,
    Accounts,
    account_name,
    admin_names,
    all_accounts,
    count_accounts,
    find_account,
    id_of,
    keeping_an_admin,
    known_account,
    usable_display,
    usable_name,
    usable_roles,
)
from app.access.audit.audit import Audit, refused_without_audit
from app.access.audit.kinds import Kind
from app.access.audit.line import Entry, printable
from app.access.factors import Factors
from app.access.first_code import FirstCode
from app.access.passwords import Passwords, initial_password
from app.access.roles import Person
from app.access.sessions import Sessions, end_all
from app.access.tables import person_table
from app.access.throttle import Throttle
from app.access.tokens import Tokens
from app.db import Database
from app.errors import Refused


class People:
    """The accounts of one installation, as administrators and the terminal change them."""

    def __init__(
        self,
        db: Database,
        audit: Audit,
        sessions: Sessions,
        passwords: Passwords,
        throttle: Throttle,
        first_code: FirstCode,
        tokens: Tokens,
        factors: Factors,
        accounts: Accounts,
        tell: Callable[[str, str], None],
    ) -> None:
        """`tell` is told `admin_added` and whose account."""
        self._db = db
        self._audit = audit
        self._sessions = sessions
        self._passwords = passwords
        self._throttle = throttle
        self._first_code = first_code
        self._tokens = tokens
        self._factors = factors
        self._accounts = accounts
        self._tell = tell
        self._admins: frozenset[str] | None = None
        self.hand_over: Callable[[Connection, Person, Account], Sequence[Entry]] = lambda connection, by, account: ()
        """Gives whoever deletes an account what others use of it, in the same transaction; returns the lines of it."""

    async def count(self) -> int:
        """Number of accounts, disabled ones too."""
        return await self._db.read(count_accounts)

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
        found = await self._db.read(lambda connection: find_account(connection, person_id))
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
        account = await self._audit.with_entries(lambda connection: self._accounts.add(connection, by, *prepared, kept))
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
                account, entries = self._accounts.add(connection, by, *one, kept)
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
        account = await self._audit.with_entries(
            lambda connection: self._accounts.set_roles(connection, by, person_id, roles)
        )
        await self._follow()
        return account

    def set_roles_now(self, by: Person, name: str, roles: Iterable[str]) -> Account:
        """As `set_roles`, by name, on the caller's thread: for the command line."""
        return self._audit.run(
            lambda connection: self._accounts.set_roles(connection, by, id_of(connection, name), roles)
        )

    async def disable(self, by: Person, person_id: int, disabled: bool) -> None:
        """Shut a person out, with all sessions at once, or let them in again.

        Raises:
            Refused: nobody of this id (404), oneself or the last administrator (409), no audit (503).
        """
        refused_without_audit(self._audit)

        def work(connection: Connection) -> tuple[list[str], Sequence[Entry]]:
            account = known_account(connection, person_id)
            if disabled and account.id == by.id:
                raise Refused("access.not_yourself", 409)
            with keeping_an_admin(connection):
                connection.execute(update(person_table).where(person_table.c.id == person_id).values(disabled=disabled))
            kind: Kind = "person.disabled" if disabled else "person.enabled"
            ended = end_all(connection, person_id) if disabled else []
            return ended, [self._audit.entry(kind, by, account.name)]

        self._sessions.announce(await self._audit.with_entries(work))
        await self._follow()

    async def delete(self, by: Person, person_id: int) -> None:
        """Remove an account for good; its lines in the audit stay, its id is never given again. What others use of it is handed over.

        Raises:
            Refused: nobody of this id (404), oneself or the last administrator (409), no audit (503).
        """
        refused_without_audit(self._audit)

        def work(connection: Connection) -> tuple[list[str], Sequence[Entry]]:
            account = known_account(connection, person_id)
            if account.id == by.id:
                raise Refused("access.not_yourself", 409)
            ended = end_all(connection, person_id)
            handed_over = self.hand_over(connection, by, account)
            with keeping_an_admin(connection):
                connection.execute(delete(person_table).where(person_table.c.id == person_id))
            deleted = self._audit.entry("person.deleted", by, account.name, old=account.roles, id=account.id)
            return ended, [deleted, *handed_over]

        self._sessions.announce(await self._audit.with_entries(work))
        await self._follow()

    async def rename(self, by: Person, person_id: int, display: str) -> None:
        """Change the name that others read.

        Raises:
            Refused: nobody of this id (404), an unusable name (422), no audit (503).
        """
        refused_without_audit(self._audit)

        def work(connection: Connection) -> tuple[None, Sequence[Entry]]:
            account = known_account(connection, person_id)
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
            lambda connection: self._accounts.set_password(connection, by, person_id, kept, initial=True)
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
            self._passwords.check(password, account.roles, account.name, account.display)
        chosen = password if password is not None else initial_password()
        kept = self._passwords.hash_now(chosen)
        self._audit.run(
            lambda connection: self._accounts.set_password(connection, by, account.id, kept, initial=password is None)
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

    async def watch_admins(self) -> None:
        """Tell of an administrator who was none before, whoever made them one, the terminal too.

        Raises:
            StorageError: the database cannot be read.
        """
        found = await self._db.read(admin_names)
        for name in sorted(found - self._admins) if self._admins is not None else ():
            self._tell("admin_added", name)
        self._admins = found

    async def _follow(self) -> None:
        """Accounts have changed: whoever loses a right by it loses it now, also where no request is made."""
        await self._sessions.people_changed()
        await self._tokens.renew()

    def _prepared(self, name: str, display: str, roles: Iterable[str]) -> tuple[str, str, frozenset[str]]:
        key = usable_name(name)
        return key, usable_display(display, key), usable_roles(roles)
