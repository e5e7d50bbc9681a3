"""One's own account: confirming with one's password, changing it, and what one prefers."""

from collections.abc import Callable, Sequence

from sqlalchemy import Connection, update

from app.access.accounts import Accounts, row_of
from app.access.audit.audit import Audit
from app.access.audit.line import Entry
from app.access.passwords import Passwords, normal
from app.access.roles import Person
from app.access.sessions import Sessions, hash_of
from app.access.tables import person_table
from app.access.throttle import FIRST_DELAY, Throttle
from app.db import Database
from app.errors import Refused


class OwnAccount:
    """What people do with the account that they are signed in with."""

    def __init__(
        self,
        db: Database,
        audit: Audit,
        sessions: Sessions,
        passwords: Passwords,
        throttle: Throttle,
        accounts: Accounts,
        tell: Callable[[str, str], None],
    ) -> None:
        """`tell` is told `account_locked` and whose account."""
        self._db = db
        self._audit = audit
        self._sessions = sessions
        self._passwords = passwords
        self._throttle = throttle
        self._accounts = accounts
        self._tell = tell

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
        row = await self._db.read(lambda connection: row_of(connection, person_table.c.id == person.id))
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
                self._tell("account_locked", person.name)
            raise Refused("access.current_wrong", 401)
        self._throttle.clear(key)

    async def change_password(self, person: Person, current: str, new: str, agent: str, sid: str) -> str:
        """Change one's own password; all one's sessions end and a new id is returned.

        Raises:
            Refused: the current one is wrong (401), too many attempts (429), the new one too weak or the old one again (422).
        """
        await self.confirm(person, current)
        self._passwords.check(new, person.roles, person.name, person.display)
        if normal(new) == normal(current):
            raise Refused("access.password.same", 422)
        kept = await self._passwords.hash(new)

        def work(connection: Connection) -> tuple[tuple[str, list[str]], Sequence[Entry]]:
            account, ended = self._accounts.set_password(connection, person, person.id, kept, initial=False)[0]
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
