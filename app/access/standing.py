"""Sessions that the database could not take: they stand in memory until it can, so that people come in while the disk is full.

Each is one of a person whose password was checked against the database, and lasts only as long as that account has this password and is
not disabled. A restart of the server ends those that were never written.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from sqlalchemy import Connection, delete, insert, select

from app.access.roles import Person
from app.access.session_times import SessionTimes, lifetime
from app.access.tables import factor_table, person_table, session_table
from app.clock import Clock
from app.db import Database

MOST = 200
"""So many at most; the oldest goes first."""


@dataclass(frozen=True, slots=True)
class Standing:
    """One of them. Times are µs UTC."""

    id_hash: str
    person: int
    name: str
    password: str
    """The hash that the account had: with another one the session is over."""
    created: int
    until: int
    address: str
    agent: str
    watching: bool
    """Nothing on a disk tells of it: it allows to watch and to stop."""

    @property
    def row(self) -> dict[str, Any]:
        """As the table of sessions has it."""
        kept = {"id_hash": self.id_hash, "person": self.person, "created": self.created, "active": self.created}
        return kept | {"until": self.until, "address": self.address, "agent": self.agent}


class StandingSessions:
    """All of them, by the hash of their id."""

    def __init__(self, db: Database, clock: Clock, times: SessionTimes) -> None:
        self._db = db
        self._clock = clock
        self._times = times
        self._open: dict[str, Standing] = {}

    def begin(
        self, person: Person, password: str, agent: str, limit: int, replaces: str | None, *, watching: bool
    ) -> list[str]:
        """One for `person`, whose session it is, in place of `replaces` (a hash); returns the hashes of those that are over by it.

        `password`: the hash that the account has; `agent`: family and system of the browser; `limit`: as many as may stand of a person, the
        oldest go; those of the database stay, for none can be ended there; `watching`: as in `Standing`.
        """
        now, until = self._clock.micros(), round(lifetime(person.roles) * 1e6)
        self._open[person.session] = Standing(
            person.session, person.id, person.name, password, now, now + until, person.address, agent, watching
        )
        self._times.begin(person.session, person.roles)
        mine = [one.id_hash for one in self._open.values() if one.person == person.id]
        over = {*mine[: max(0, len(mine) - limit)], *list(self._open)[: max(0, len(self._open) - MOST)]}
        if replaces:
            over.add(replaces)
        for id_hash in over:
            self._open.pop(id_hash, None)
            self._times.end(id_hash)
        return sorted(over)

    @property
    def all(self) -> list[Standing]:
        """Oldest first."""
        return list(self._open.values())

    def pop(self, id_hash: str) -> Standing | None:
        """Have it no more; None when there is none."""
        return self._open.pop(id_hash, None)

    def watches_only(self, id_hash: str) -> bool:
        """Whether it allows no more than to watch and to stop."""
        found = self._open.get(id_hash)
        return found is not None and found.watching

    def rows(self, connection: Connection, hashes: Collection[str]) -> Iterable[tuple[str, Any]]:
        """Hash and row, as of a session of the database joined with its person, of those among `hashes` whose account is as it was."""
        for id_hash in hashes:
            one = self._open.get(id_hash)
            found = connection.execute(_PERSON.where(person_table.c.id == one.person)).first() if one else None
            if one is not None and found is not None and found.password == one.password:
                yield id_hash, SimpleNamespace(**{**found._mapping, **one.row})

    async def write(self) -> None:
        """Put them into the database; one whose account is not as it was is over.

        Raises:
            StorageError: it does not take them yet.
        """
        for one in self.all:
            await self._db.write(lambda connection: _written(connection, one))  # noqa: B023
            if self.pop(one.id_hash) is None:  # ended meanwhile
                gone = delete(session_table).where(session_table.c.id_hash == one.id_hash)
                await self._db.write(lambda connection: connection.execute(gone) and None)  # noqa: B023


def _written(connection: Connection, session: Standing) -> None:
    kept = select(person_table.c.password).where(person_table.c.id == session.person, ~person_table.c.disabled)
    if connection.execute(kept).scalar() == session.password:
        connection.execute(insert(session_table).values(**session.row))


_PERSON = select(person_table, factor_table.c.since.label("factor_since")).outerjoin(
    factor_table, factor_table.c.person == person_table.c.id
)
