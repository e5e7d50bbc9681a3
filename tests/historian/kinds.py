"""Kinds of records of our types, told from their rings."""

from collections.abc import Iterable
from typing import Any

from sqlalchemy import Connection

from app.db import Database
from app.historian import record_query
from app.historian.record_query import RecordFilter
from app.historian.records import RecordFold
from app.plant import types
from app.plant.definitions import Alarm, Equipment
from app.records.record import Record
from tests.historian import books
from tests.historian.sequence_rings import definition
from tests.historian.stories import Portion

CONVEYOR = types.read_type("conveyor", ["en"])[0].type


SEQUENCE = types.read_type("sequence", ["en"])[0].type


PASSAGE, RUN, FORCE = CONVEYOR.records["passage"], SEQUENCE.records["run"], SEQUENCE.records["force"]


ALARMS = [Alarm(f"a{code}", "a", "", 3, event=code) for code in (10, 11, 12, 20)]


def item(id: str) -> Equipment:
    """A conveyor, or a machine that runs a sequence."""
    if id.startswith("seq"):
        return Equipment(id, SEQUENCE, "hall", 1, {"en": id}, "line", {}, [], sequence=definition(), machine="cc1")
    return Equipment(id, CONVEYOR, "hall", 1, {"en": id}, "line", {}, ALARMS)


def tell(history: Database, equipment: str, portions: Iterable[Portion]) -> None:
    made = RecordFold([item(equipment)])

    def work(connection: Connection) -> None:
        for one in portions:
            if one.events or one.lost:
                books.store(connection, made, equipment, one.events, one.lost)

    history.run(work)


def ask(history: Database, kind: Any, limit: int = 1000, **wanted: Any) -> list[Record]:
    return history.run(lambda connection: record_query.find(connection, kind, RecordFilter(**wanted), limit))
