"""What people keep for themselves: pages they marked, filters they named, where they were last.

Of everybody, by kind and name, in the order it was kept.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import delete, select
from sqlalchemy.dialects.sqlite import insert

from app.access.tables import kept_table
from app.clock import Clock
from app.db import Database
from app.errors import Refused

LONGEST_NAME = 200
"""Of something kept [characters]."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of thing that people keep."""

    name: str
    most: int
    """Of each person."""


FAVOURITE = Kind("favourite", 24)
ALARM_FILTER = Kind("alarm filter", 12)
TREND_LAST = Kind("trend", 1)


class Kept:
    """Everything that is kept, in memory as in the database: every page of a person draws some of it."""

    def __init__(self, db: Database, clock: Clock) -> None:
        self._db, self._clock = db, clock
        self._all: dict[tuple[int, str], dict[str, Any]] = {}

    async def load(self) -> None:
        """Read what was kept.

        Raises:
            StorageError: the database cannot be read.
        """
        query = select(kept_table).order_by(kept_table.c.since, kept_table.c.name)
        rows = await self._db.read(lambda connection: connection.execute(query).all())
        self._all.clear()
        for row in rows:
            self._all.setdefault((row.person, row.kind), {})[row.name] = row.value

    def of(self, person: int, kind: Kind) -> Mapping[str, Any]:
        """What `person` keeps, by name, the oldest first."""
        return self._all.get((person, kind.name), {})

    async def keep(self, person: int, kind: Kind, name: str, value: Any = None) -> None:
        """Keep `value` under `name`, in place of what was kept so.

        Raises:
            Refused: 422, the name is empty or too long; 409, this person keeps as many as one may.
            StorageError: the database did not take it.
        """
        if not 0 < len(name) <= LONGEST_NAME:
            raise Refused("own.name", 422, most=LONGEST_NAME)
        mine = self.of(person, kind)
        if name not in mine and len(mine) >= kind.most:
            raise Refused("own.too_many", 409, most=kind.most)
        row = {"person": person, "kind": kind.name, "name": name, "since": self._clock.micros(), "value": value}
        put = insert(kept_table).values(row).on_conflict_do_update(set_={"value": value})
        await self._db.write(lambda connection: connection.execute(put) and None)
        self._all.setdefault((person, kind.name), {})[name] = value

    async def forget(self, person: int, kind: Kind, name: str) -> None:
        """Keep `name` no longer; what is not kept is gone already.

        Raises:
            StorageError: the database did not take it.
        """
        table = kept_table.c
        gone = delete(kept_table).where(table.person == person, table.kind == kind.name, table.name == name)
        await self._db.write(lambda connection: connection.execute(gone) and None)
        self._all.get((person, kind.name), {}).pop(name, None)
