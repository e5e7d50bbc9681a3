"""Everything about people in one place: accounts, sessions, tokens, the audit, and the secret that signs forms."""

import asyncio
import hmac
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from app import chance
from app.access.accounts import Accounts
from app.access.audit.audit import Audit
from app.access.audit.watch import AuditWatch
from app.access.factors import Factors
from app.access.first_code import FirstCode
from app.access.former import check_former
from app.access.kept import Kept
from app.access.keys import check_files, check_kinds, lock, read_key
from app.access.keys import prepare as prepare_files
from app.access.own_account import OwnAccount
from app.access.passwords import Cost, Passwords
from app.access.people import People
from app.access.restoring import finish_restore, told, untold
from app.access.roles import Person
from app.access.sessions import Sessions
from app.access.signin import SignIn
from app.access.throttle import Throttle
from app.access.tokens import Tokens
from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.threads import Threads, threads

__all__ = ["Access", "lock", "prepare"]

FOLLOW_PERIOD = 0.5
"""How often what the terminal may have changed is read [s]."""


def prepare(data: Path) -> None:
    """Make the data folder and what has to be in it, if missing, and check what is there; end an interrupted restore first.

    Raises:
        ConfigurationError: others may read or write it, it cannot be made, or the plant in it has lost its database.
    """
    check_kinds(data)
    finish_restore(data)  # between its moves there is no database, which is not lost
    check_former(data)
    prepare_files(data)


class Access:
    """Who may come in, and what they did. `prepare(data)` and `db.migrate()` come first."""

    def __init__(
        self,
        db: Database,
        clock: Clock,
        data: Path,
        cost: Cost | None = None,
        anchors: Sequence[Callable[[str], None]] = (),
        threads: Threads = threads,
        factor_roles: Iterable[str] = (),
    ) -> None:
        """Reads or makes the keys in `data`; `anchors` are told every anchor of the audit (`app/access/audit/anchors.py`).

        Who has one of `factor_roles` needs a second factor.

        Raises:
            ConfigurationError: a key, the database or the folder may be read or written by others, or a key is broken.
        """
        check_files(data)
        self._data = data
        self._secret = read_key(data / "secret.key")
        self.audit = Audit(db, clock, data, anchors, threads)
        self.audit_watch = AuditWatch(self.audit, clock)
        self.passwords = Passwords(cost, threads)
        self.throttle = Throttle(clock)
        self.first_code = FirstCode(data)
        self.sessions = Sessions(db, clock, self.audit, factor_roles)
        self.tokens = Tokens(db, clock, self.audit)
        self.factors = Factors(db, clock, self.audit, self.sessions, self.throttle, data)
        self.factors.tell = self._tell
        accounts = Accounts(clock, self.audit)
        self.sign_in = SignIn(
            db,
            clock,
            self.audit,
            self.sessions,
            self.passwords,
            self.throttle,
            self.first_code,
            self.factors,
            accounts,
            self._tell,
        )
        self.own = OwnAccount(db, self.audit, self.sessions, self.passwords, self.throttle, accounts, self._tell)
        self.kept = Kept(db, clock)
        self.people = People(
            db,
            self.audit,
            self.sessions,
            self.passwords,
            self.throttle,
            self.first_code,
            self.tokens,
            self.factors,
            accounts,
            self._tell,
        )
        self.tell: Callable[[str, str], None] = lambda alarm, name: None
        """Told what people who look after the plant should know at once: `account_locked` or `admin_added`, and whose account."""

    def _tell(self, alarm: str, name: str) -> None:
        self.tell(alarm, name)

    async def start(self, version: str = "") -> str:
        """Note the start; returns the one-time code while there is no account, else nothing."""
        await self.sessions.load()
        await self.kept.load()
        await self.audit.begin()
        await self.factors.check()
        if (restored := untold(self._data)) is not None:
            archive, made, signed = restored.values()
            if await self.audit.record("backup.restored", None, str(archive), made=made, signed=signed):
                told(self._data)
        await self.audit.record("server.started", None, version=version, install=self.audit.install)
        if await self.people.count():
            self.first_code.used()
            return ""
        return self.first_code.renew()

    async def stop(self) -> None:
        """Note the end, anchor the audit."""
        await self.audit.record("server.stopped", None)
        self.close()

    def close(self) -> None:
        """End the threads and anchor the audit, without a line."""
        self.audit.close()
        self.passwords.close()

    def current(self, person: Person) -> Person | None:
        """`person` as of now without asking the database; None when the session or the token is over."""
        return (self.tokens if person.session.startswith("token-") else self.sessions).current(person)

    def subscribe(self, ended: Callable[[Collection[str]], None], changed: Callable[[Collection[str]], None]) -> None:
        """Have `ended` called with sessions and tokens that are over, `changed` with those that allow other things now."""
        self.sessions.subscribe(ended)
        self.sessions.subscribe_changes(changed)
        self.tokens.subscribe(changed)

    async def watch(self) -> None:
        """Follow what another process does to people, sessions and tokens, for ever."""
        while True:
            await asyncio.sleep(FOLLOW_PERIOD)
            await self.sessions.renew()
            await self.tokens.renew()
            with suppress(StorageError):
                await self.people.watch_admins()
                await self.sessions.standing.write()
                await self.sessions.write_ends()

    async def awaits_first(self) -> bool:
        """Whether the first account is still to be made; the terminal may have made one beside this server."""
        if self.first_code.open and await self.people.count():
            self.first_code.used()
        return self.first_code.open

    # ---- signed form tokens (OWASP: HMAC, bound to the session) ----------------------------------------

    def form_token(self, bound_to: str) -> str:
        """A token for forms of the session id, or of the pre-session id, `bound_to`; never the same twice."""
        salt = chance.token_urlsafe(12)
        return f"{self._form_mac(bound_to, salt)}.{salt}"

    def is_form_token(self, token: str, bound_to: str) -> bool:
        """Whether `token` was made for `bound_to`."""
        mac, _, salt = token.partition(".")
        good = hmac.compare_digest(mac.encode("utf-8", "replace"), self._form_mac(bound_to, salt).encode())
        return good and bool(bound_to) and bool(salt)

    def _form_mac(self, bound_to: str, salt: str) -> str:
        text = f"{len(bound_to)}!{bound_to}!{len(salt)}!{salt}".encode("utf-8", "replace")
        return hmac.new(self._secret, text, sha256).hexdigest()
