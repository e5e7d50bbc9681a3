"""What the tests of recording share."""

from typing import Any

from sqlalchemy import Connection

from app.db import Database
from app.historian import query
from app.historian.recorder import Recorder
from app.plant.definitions import Point
from tests.historian.conftest import Source

QUOTA = 1 << 30


async def recording(history: Database, *points: Point, later: float = 0.0, **limits: Any) -> tuple[Source, Recorder]:
    """A recorder that begins so much later than others [s], with what it records."""
    source = Source(*points)
    source.clock.step_wall(later)
    made = Recorder(source.tags, history, source.clock, keep_days=400, quota=QUOTA, **limits)
    await made.configure(points)
    return source, made


def rows_of(history: Database, name: str = "m1.speed") -> list[tuple[int, float | str | None, int]]:
    def look(connection: Connection) -> list[tuple[int, float | str | None, int]]:
        found = query.find(connection, name)
        return list(query.raw(connection, found.number, 0, 1 << 62)) if found else []

    return history.run(look)
