"""Tokens for programs: 256 random bits shown once, kept as SHA-256, with permissions of their own and an end."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import ColumnElement, Connection, insert, select, update

from app import chance
from app.access.audit.audit import Audit, refused_without_audit
from app.access.audit.line import Entry, printable
from app.access.roles import PERMISSIONS, Person, permissions_of
from app.access.sessions import IN_USE, hash_of, roles_of
from app.access.tables import person_table, token_table
from app.clock import Clock
from app.db import Database
from app.errors import Refused, StorageError

PREFIX = "pogon_"
LONGEST_LIFE = 400.0
"""Days that a token is good for at most."""
GRANTABLE = ("view", "diagnose", "export", "acknowledge", "stop", "operate", "configure")
"""What a token can be given; looking after people and reading the audit stay with people."""
USED_PERIOD = 60.0
"""The time of the last use is written at most so often [s]."""


@dataclass(frozen=True, slots=True)
class Token:
    """A token without its secret."""

    id: int
    name: str
    permissions: frozenset[str]
    person: int
    """Who made it: it never allows more than this person may."""
    created: int
    until: int
    last_used: int | None
    revoked: bool


class Tokens:
    """The tokens of one installation."""

    def __init__(self, db: Database, clock: Clock, audit: Audit) -> None:
        self._db = db
        self._clock = clock
        self._audit = audit
        self._known: dict[str, Person] = {}
        self._used: dict[str, float] = {}
        self._ended: list[Callable[[Collection[str]], None]] = []

    def subscribe(self, ended: Callable[[Collection[str]], None]) -> None:
        """Have `ended` called with the tokens (`token-<id>`) that are over or allow other things now."""
        self._ended.append(ended)

    async def create(self, by: Person, name: str, permissions: Iterable[str], days: float) -> tuple[Token, str]:
        """A new token and its secret, which is shown once.

        Raises:
            Refused: 422 for the name, the permissions or the days; 403 for what `by` may not do; 503 without audit.
        """
        refused_without_audit(self._audit)
        label = printable(" ".join(name.split()), 64)
        wanted = frozenset(permissions)
        if not label:
            raise Refused("access.token_name", 422)
        if not wanted or wanted - set(GRANTABLE):
            raise Refused("access.token_permissions", 422)
        if wanted - permissions_of(by.roles):
            raise Refused("access.denied", 403)
        if not 0 < days <= LONGEST_LIFE:
            raise Refused("access.token_days", 422, most=round(LONGEST_LIFE))
        secret = PREFIX + chance.token_urlsafe(32)
        now = self._clock.micros()

        def work(connection: Connection) -> tuple[Token, list[Entry]]:
            values = {
                "name": label,
                "hash": hash_of(secret),
                "permissions": " ".join(sorted(wanted)),
                "person": by.id,
                "created": now,
                "until": now + round(days * 86_400e6),
                "revoked": False,
            }
            connection.execute(insert(token_table).values(**values))
            row = connection.execute(select(token_table).where(token_table.c.hash == hash_of(secret))).one()
            return _token(row), [self._audit.entry("token.created", by, label, new=wanted, days=days)]

        return await self._audit.with_entries(work), secret

    async def find(self, secret: str, address: str = "") -> Person | None:
        """Whoever holds `secret`, with what the token and its maker both may; None when it is unknown, over or revoked."""
        if not secret.startswith(PREFIX) or len(secret) > 100:
            return None
        of_secret = token_table.c.hash == hash_of(secret)
        return self._note(await self._db.read(lambda connection: self._found(connection, of_secret, address)))

    async def again(self, person: Person) -> Person | None:
        """The holder of a token as of now, for a socket that stays open; None when the token is over."""
        return self._note(await self._db.read(lambda connection: self._found_again(connection, person)))

    def current(self, person: Person) -> Person | None:
        """The holder of a token as of now without asking the database; None when it is over, or was not found lately."""
        if person.session not in self._known:
            return None
        self._used[person.session] = self._clock.monotonic()
        return replace(self._known[person.session], address=person.address)

    async def renew(self) -> None:
        """Read again the tokens that are in use; tell which are over or allow other things now. Called every half second."""
        oldest = self._clock.monotonic() - IN_USE
        for gone in [session for session, used in self._used.items() if used < oldest]:
            del self._known[gone], self._used[gone]
        before = dict(self._known)
        if not before:
            return
        try:
            found = await self._db.read(
                lambda connection: {key: self._found_again(connection, person) for key, person in before.items()}
            )
        except StorageError:
            return
        changed = []
        for session, person in found.items():
            if self._known.get(session) is not before[session]:
                continue  # found anew meanwhile
            if person is None:
                del self._known[session], self._used[session]
            else:
                self._known[session] = person
            if person is None or person.permissions != before[session].permissions:
                changed.append(session)
        self._tell(changed)

    def _tell(self, changed: Collection[str]) -> None:
        for ended in self._ended if changed else ():
            ended(changed)

    def _note(self, person: Person | None) -> Person | None:
        if person is not None:
            before = self._known.get(person.session)
            self._known[person.session] = person
            self._used[person.session] = self._clock.monotonic()
            if before is not None and before.permissions != person.permissions:  # `renew` will see no change
                self._tell([person.session])
        return person

    async def all(self) -> list[Token]:
        """All tokens, newest first."""
        rows = await self._db.read(
            lambda connection: connection.execute(select(token_table).order_by(token_table.c.id.desc())).all()
        )
        return [_token(row) for row in rows]

    async def revoke(self, by: Person, token_id: int) -> None:
        """End a token at once.

        Raises:
            Refused: 404, there is none with this id; 403, it is another's and `by` is no administrator.
        """

        def work(connection: Connection) -> tuple[None, list[Entry]]:
            row = connection.execute(select(token_table).where(token_table.c.id == token_id)).first()
            if row is None:
                raise Refused("access.no_token", 404, id=token_id)
            if row.person != by.id and "admin" not in by.roles:
                raise Refused("access.denied", 403)
            connection.execute(update(token_table).where(token_table.c.id == token_id).values(revoked=True))
            return None, [self._audit.entry("token.revoked", by, row.name)]

        await self._audit.with_entries(work)
        await self.renew()

    def _found_again(self, connection: Connection, person: Person) -> Person | None:
        id_ = int(person.session.removeprefix("token-"))
        return self._found(connection, token_table.c.id == id_, person.address)

    def _found(self, connection: Connection, which: ColumnElement[bool], address: str) -> Person | None:
        row = connection.execute(
            select(token_table, person_table.c.disabled)
            .join(person_table, token_table.c.person == person_table.c.id)
            .where(which)
        ).first()
        now = self._clock.micros()
        if row is None or row.disabled or row.revoked or row.until <= now:
            return None
        if row.last_used is None or now - row.last_used > USED_PERIOD * 1e6:
            change = update(token_table).where(token_table.c.id == row.id).values(last_used=now)
            self._db.submit(lambda writing: writing.execute(change) and None)
        allowed = frozenset(row.permissions.split()) & permissions_of(roles_of(connection, row.person))
        name = f"token:{row.name}"[:64]
        return Person(0, name, row.name, frozenset(), allowed & set(PERMISSIONS), f"token-{row.id}", address=address)


def revoke_all(connection: Connection, person_id: int) -> list[str]:
    """End all tokens of a person in this transaction; the names of those that were good."""
    mine = (token_table.c.person == person_id) & token_table.c.revoked.is_(False)
    names = list(connection.execute(select(token_table.c.name).where(mine)).scalars())
    connection.execute(update(token_table).where(mine).values(revoked=True))
    return names


def _token(row: Any) -> Token:
    return Token(
        id=row.id,
        name=row.name,
        permissions=frozenset(row.permissions.split()),
        person=row.person,
        created=row.created,
        until=row.until,
        last_used=row.last_used,
        revoked=bool(row.revoked),
    )
