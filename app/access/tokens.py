"""Tokens for programs: 256 random bits shown once, kept as SHA-256, with permissions of their own and an end."""

import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, insert, select, update

from app.access.audit import Audit, Entry, printable, refused_without_audit
from app.access.roles import PERMISSIONS, Person, permissions_of
from app.access.sessions import hash_of, roles_of
from app.access.tables import person_table, token_table
from app.clock import Clock
from app.db import Database
from app.errors import Refused

PREFIX = "pogon_"
LONGEST_LIFE = 400.0
"""Days that a token is good for at most."""
GRANTABLE = ("view", "export", "acknowledge", "stop", "operate", "configure")
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
        secret = PREFIX + secrets.token_urlsafe(32)
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
        return await self._db.read(lambda connection: self._found(connection, hash_of(secret), address))

    async def again(self, person: Person) -> Person | None:
        """The holder of a token as of now, for a socket that stays open; None when the token is over."""
        id_ = int(person.session.removeprefix("token-"))
        query = select(token_table.c.hash).where(token_table.c.id == id_)
        kept = await self._db.read(lambda connection: connection.execute(query).scalar())
        return await self._db.read(lambda connection: self._found(connection, kept, person.address)) if kept else None

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

    def _found(self, connection: Connection, kept: str, address: str) -> Person | None:
        row = connection.execute(
            select(token_table, person_table.c.disabled)
            .join(person_table, token_table.c.person == person_table.c.id)
            .where(token_table.c.hash == kept)
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
