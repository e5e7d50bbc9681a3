"""The history of events with the records that are made of them, and these in the words of what they tell: passages, runs, forces."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

from sqlalchemy import Connection

from app.clock import Clock
from app.db import Database
from app.historian import record_query
from app.historian.events import Delivery, Events
from app.historian.events import store as store_events
from app.historian.record_query import RecordFilter
from app.historian.records import RecordFold
from app.plant.definitions import Equipment, EquipmentType
from app.plant.events import Ring
from app.records.event import Event as Stored
from app.records.record import Part, Record
from app.records.snapshot import decode
from tests.historian.rings import BEGIN, CONVEYOR, Event
from tests.historian.sequence_rings import SEQUENCE

RINGS: WeakKeyDictionary[RecordFold, dict[str, Ring]] = WeakKeyDictionary()
"""The ring of each machine of which events were stored last."""
PASSAGE, RUN, FORCE = CONVEYOR.records["passage"], SEQUENCE.records["run"], SEQUENCE.records["force"]


class Records(Events):
    """As a server keeps them."""

    def __init__(
        self,
        database: Database,
        clock: Clock,
        changed: Callable[[str], None] = lambda equipment: None,
        machines: Sequence[Equipment] = (),
    ) -> None:
        super().__init__(database, clock, changed, (RecordFold(),))
        self.configure(machines)


@dataclass(frozen=True)
class Told:
    """A record, its fields as if they were its own."""

    record: Record

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return self.record.fields[name] if name in self.record.fields else getattr(self.record, name, None)


@dataclass(frozen=True, slots=True)
class Said:
    """An event of a record with the words of its snapshot."""

    time: int
    sequence: int
    code: int
    source: int
    value: float | None
    words: dict[str, float | int | None]
    person: str
    reason: str


def ask(history: Database, kind: Any, limit: int = 1000, **wanted: Any) -> list[Told]:
    """Records, newest first."""
    found = history.run(lambda connection: record_query.find(connection, kind, RecordFilter(**wanted), limit))
    return [Told(one) for one in found]


def events(history: Database, one: Told, of: EquipmentType) -> list[Said]:
    """What happened in a record."""
    found: list[Stored] = history.run(lambda connection: record_query.events(connection, [one.id]))[one.id]
    return [
        Said(
            e.time,
            e.sequence,
            e.code,
            e.source,
            e.value,
            dict(decode(of.snapshot, e.words, e.code)),
            e.person,
            e.reason,
        )
        for e in found
    ]


def parts(history: Database, one: Told) -> list[Part]:
    """Its parts in their order."""
    return list(history.run(lambda connection: record_query.parts(connection, [one.id]))[one.id].values())


def forces(history: Database, one: Told) -> list[Told]:
    """The forces that were active in a run."""
    found = history.run(lambda connection: record_query.overlapping(connection, FORCE, one.record))
    return [Told(each) for each in found]


def asked(history: Database, one: Told, field: str = "") -> tuple[str, str]:
    """Who asked for it, or for what the field tells, and why."""
    kind = {each.name: each for each in (PASSAGE, RUN, FORCE)}[one.kind]
    found = history.run(lambda connection: record_query.people(connection, [one.id]))[one.id]
    last = record_query.person(kind.fields[field] if field else None, found)
    return (last.person, last.reason) if last else ("", "")


def everything(history: Database, *kinds: Any) -> list[Any]:
    """All records with their parts and events, gaps and marks, without the numbers that SQLite gives."""

    def look(connection: Connection) -> list[Any]:
        made: list[Any] = []
        for kind in kinds:
            found = record_query.find(connection, kind, RecordFilter(), 10**6)
            taken = record_query.parts(connection, [one.id for one in found])
            told = record_query.events(connection, [one.id for one in found])
            made += [
                (replace(one, id=0, parts=dict(taken[one.id])), [replace(e, id=0) for e in told[one.id]])
                for one in found
            ]
        for sentence in ("SELECT * FROM event_gap ORDER BY 1, 2, 3", "SELECT * FROM event_mark ORDER BY 1"):
            made.append([tuple(row) for row in connection.exec_driver_sql(sentence)])
        return made

    return history.run(look)


def store(connection: Connection, fold: RecordFold, equipment: str, told: Sequence[Event], lost: int = 0) -> None:
    """Events of one machine, after so many that were lost; `fold` is that of one program."""
    known = RINGS.setdefault(fold, {})
    store_events(connection, Delivery(equipment, tuple(told), lost), (fold,), BEGIN, known.get(equipment))
    if told:
        known[equipment] = told[-1].ring


def caused(events: Sequence[Event], code: int, request: int, word: int | None = None) -> list[Event]:
    """`events`, those with `code` (and this first word of the snapshot) caused by command `request`."""
    return [
        replace(event, request=request) if event.code == code and word in (None, event.snapshot[0]) else event
        for event in events
    ]
