"""What derived points remember over a restart: running hours, starts, extremes of the day. Kept in `pogon.db`."""

import logging
from collections.abc import Mapping
from typing import Any

from sqlalchemy import JSON, Column, Connection, String, Table, delete, insert, select

from app.db import Database, pogon_tables
from app.errors import StorageError

log = logging.getLogger(__name__)

retained = Table(
    "retained",
    pogon_tables,
    Column("id", String, primary_key=True),
    Column("state", JSON, nullable=False),
)
"""State of a derived point by its lasting id."""


class RetainedStates:
    """Reads what was kept and writes what changed since."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._written: dict[str, Any] = {}

    async def read(self) -> dict[str, Any]:
        """Everything that was kept, by lasting id; empty when the database cannot be read."""
        try:
            rows = await self._database.read(lambda connection: connection.execute(select(retained)).all())
        except StorageError as error:
            log.error("retained states not read reason=%s", error)
            return {}
        self._written = {row.id: row.state for row in rows}
        return dict(self._written)

    async def write(self, states: Mapping[str, Any]) -> None:
        """Keep `states`; those that have not changed since the last time cost nothing, others in the table stay.

        Raises:
            StorageError: the disk does not take it; the next call tries again.
        """
        changed = {id: dict(state) for id, state in states.items() if self._written.get(id) != state}
        if not changed:
            return

        def work(connection: Connection) -> None:
            connection.execute(delete(retained).where(retained.c.id.in_(changed)))
            connection.execute(insert(retained), [{"id": id, "state": state} for id, state in changed.items()])

        await self._database.write(work)
        self._written |= changed
