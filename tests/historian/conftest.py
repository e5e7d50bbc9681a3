"""A history of its own for each test, and rows made by hand."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from sqlalchemy import Connection

from app.clock import ManualClock
from app.db import Database
from app.historian import store
from app.historian.store import Row
from app.plant.definitions import Kind, Point
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase
from app.tags.quality import GOOD
from tests.virtual import inline


@pytest.fixture
def history(tmp_path: Path) -> Iterator[Database]:
    database = Database(tmp_path / "history.db", "history", inline)
    database.migrate()
    yield database
    database.close()


def point(name: str = "m1.speed", kind: Kind = Kind.ANALOG, dead_band: float = 0.0, unit: str = "rpm") -> Point:
    equipment, _, key = name.partition(".")
    return Point(name, name, equipment, key, key, kind=kind, dead_band=dead_band, unit=unit)


class Source:
    """A link of one block, with a clock that the test moves."""

    def __init__(self, *points: Point) -> None:
        self.clock = ManualClock()
        self.tags = TagDatabase(self.clock)
        self.points = points
        self.tags.configure(Tag(item.name, item.id, "link.a") for item in points)
        self.last: dict[str, tuple[Value, int]] = {}

    def publish(self, quality: int = GOOD, **values: Value) -> None:
        """What a scan does now: list what changed, and say that the block was seen. `m1_speed=…` is `m1.speed`."""
        now = self.clock.micros()
        named = {key.replace("_", ".", 1): (value, quality) for key, value in values.items()}
        changed = {name: value for name, (value, _) in named.items() if self.last.get(name) != (value, quality)}
        self.last |= named
        handles = [self.tags.handle(name) for name in changed]
        self.tags.publish(Batch("link.a", 0, now, now, handles, list(changed.values()), quality))


def fill(connection: Connection, rows: Sequence[Row], *points: Point, alive: int | None = None) -> None:
    """Put `rows` in as a recorder would that ran from the first to the last of them."""
    store.register(connection, points or [point()])
    first, last = (rows[0][1], rows[-1][1]) if rows else (0, 0)
    store.append(connection, sorted(rows), min(first, last), alive if alive is not None else max(first, last))


Publish = Callable[..., None]
