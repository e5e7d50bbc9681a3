"""Records of machines in the history: a fold of their events, in the transaction that stores these.

What an event means is said by the kinds of the machine's type (app/records); here it is read, written back and cut.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import orjson
from sqlalchemy import Connection

from app.historian.events import Fold
from app.plant.definitions import Equipment
from app.plant.kept import Kept, kept
from app.records import fold
from app.records.event import Event
from app.records.fold import Machine
from app.records.kind import RecordKind
from app.records.record import Part, Reading, Record
from app.records.snapshot import Layout, decode

RECORD = "id, kind, number, boot, sequence, begun, entry, outcome, ended, seconds, paused, pause, missed, alarms, definition, fields, memo"
PART = "number, key, state, begun, ended, seconds, paused"


@dataclass(frozen=True, slots=True)
class Source:
    """A machine whose events make records."""

    machine: Machine
    kinds: Mapping[str, RecordKind]
    events: Mapping[int, str]
    """Code → key."""
    layout: Layout
    definition: Kept

    def reading(self, event: Event) -> Reading:
        """An event in words."""
        return Reading(
            event.boot,
            event.sequence,
            event.time,
            event.code,
            self.events.get(event.code, str(event.code)),
            event.source,
            event.value,
            decode(self.layout, event.words),
            event.id,
        )


def source_of(item: Equipment) -> Source | None:
    """What makes records of a machine's events; None: its type declares no kinds."""
    if not item.type.records:
        return None
    names = kept(item.sequence) if item.sequence else Kept()
    alarms = frozenset(alarm.event for alarm in item.alarms if alarm.event)
    machine = Machine(tuple(item.type.records.values()), alarms, names)
    return Source(machine, item.type.records, item.type.events, item.type.snapshot, names)


class RecordFold(Fold):
    """Makes records of the events of all machines, as they are stored."""

    def __init__(self, machines: Iterable[Equipment] = ()) -> None:
        self._sources: Mapping[str, Source] = {}
        self.configure(machines)

    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant: those whose types declare kinds of records."""
        found = ((item.id, source_of(item)) for item in machines)
        self._sources = {id: source for id, source in found if source is not None}
        self.machines = frozenset(self._sources)

    def lose(self, connection: Connection, equipment: str, number: int, lost: int) -> None:
        """So many events of a machine were lost before the next one."""
        if source := self._sources.get(equipment):
            fold.lose(source.machine, Shelf(connection, equipment, number, source), lost)

    def begin_again(self, connection: Connection, equipment: str, number: int, event: Event) -> None:
        """The ring of a machine counts from 1 again with `event`."""
        if source := self._sources.get(equipment):
            fold.begin_again(source.machine, Shelf(connection, equipment, number, source), source.reading(event))

    def put(self, connection: Connection, equipment: str, number: int, event: Event) -> None:
        """A new event, which is stored already (`Event.id`)."""
        if source := self._sources.get(equipment):
            fold.take(source.machine, Shelf(connection, equipment, number, source), source.reading(event))


class Shelf:
    """The records of one machine, for one event: what was read is known until it is over."""

    def __init__(self, connection: Connection, equipment: str, number: int, source: Source) -> None:
        self._connection, self._equipment, self._machine, self._source = connection, equipment, number, source
        self._known: dict[int, Record] = {}

    def latest(self, kind: RecordKind, number: int) -> Record | None:
        row = self._connection.exec_driver_sql(
            f"SELECT {RECORD} FROM record WHERE machine = ? AND kind = ? AND number = ? ORDER BY id DESC LIMIT 1",
            (self._machine, kind.name, number),
        ).first()
        return None if row is None else self._read(kind, row)

    def open(self, kind: RecordKind) -> list[Record]:
        rows = self._connection.exec_driver_sql(
            f"SELECT {RECORD} FROM record WHERE machine = ? AND kind = ? AND outcome = 'open' ORDER BY id",
            (self._machine, kind.name),
        ).all()
        return [self._read(kind, row) for row in rows]

    def lasting(self, kind: str, time: int) -> int:
        rows = self._connection.exec_driver_sql(
            "SELECT count(*) FROM record WHERE machine = ? AND kind = ? AND begun <= ? AND (ended IS NULL OR ended > ?)",
            (self._machine, kind, time, time),
        )
        return int(rows.scalar_one())

    def add(self, record: Record) -> Record:
        kind = self._source.kinds[record.kind]
        if record.definition:
            self._connection.exec_driver_sql(
                "INSERT OR IGNORE INTO definition (id, text) VALUES (?, ?)",
                (record.definition, self._source.definition.text),
            )
        record.id = int(
            self._connection.exec_driver_sql(
                "INSERT INTO record (machine, kind, number, boot, sequence, begun, entry, outcome, ended, seconds, paused, pause, missed, "
                f"alarms, definition, key, value, fields, memo) VALUES ({', '.join('?' * 19)}) RETURNING id",
                (
                    self._machine,
                    record.kind,
                    record.number,
                    record.boot,
                    record.sequence,
                    record.begun,
                    *_said(kind, record),
                ),
            ).scalar_one()
        )
        self._known[record.id] = record
        return record

    def put(self, record: Record) -> None:
        former = self._known.get(record.id)
        if record == former:
            return
        self._connection.exec_driver_sql(
            "UPDATE record SET entry = ?, outcome = ?, ended = ?, seconds = ?, paused = ?, pause = ?, missed = ?, alarms = ?, "
            "definition = ?, key = ?, value = ?, fields = ?, memo = ? WHERE id = ?",
            (*_said(self._source.kinds[record.kind], record), record.id),
        )
        changed = [part for number, part in record.parts.items() if former is None or former.parts.get(number) != part]
        if changed:
            self._connection.exec_driver_sql(
                f"INSERT OR REPLACE INTO record_part (record, {PART}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                [
                    (record.id, part.number, part.key, part.state, part.begun, part.ended, part.seconds, part.paused)
                    for part in changed
                ],
            )
        self._known[record.id] = record

    def note(self, record: Record, event: Reading) -> None:
        self._connection.exec_driver_sql(
            "INSERT OR IGNORE INTO record_event (record, event) VALUES (?, ?)", (record.id, event.id)
        )

    def _read(self, kind: RecordKind, row: Sequence[Any]) -> Record:
        record = from_row(row, self._equipment)
        if kind.parts is not None:
            record.parts = parts(self._connection, [record.id])[record.id]
        return self._known.setdefault(record.id, record)


def from_row(row: Sequence[Any], equipment: str) -> Record:
    """A record of the columns `RECORD`, without its parts."""
    (
        id,
        kind,
        number,
        boot,
        sequence,
        begun,
        entry,
        outcome,
        ended,
        seconds,
        paused,
        pause,
        missed,
        alarms,
        definition,
        fields,
        memo,
    ) = row
    return Record(
        kind=kind,
        number=number,
        boot=boot,
        sequence=sequence,
        begun=begun,
        entry=entry,
        outcome=outcome,
        ended=ended,
        seconds=seconds,
        paused=paused,
        pause=pause,
        missed=missed,
        alarms=tuple(map(int, alarms.split())),
        definition=definition,
        fields=orjson.loads(fields) if fields else {},
        memo=orjson.loads(memo) if memo else {},
        id=id,
        equipment=equipment,
    )


def parts(connection: Connection, numbers: Sequence[int]) -> dict[int, dict[int, Part]]:
    """Record → its parts in their order."""
    found: dict[int, dict[int, Part]] = {number: {} for number in numbers}
    rows = connection.exec_driver_sql(
        f"SELECT record, {PART} FROM record_part WHERE record IN ({', '.join('?' * len(numbers))}) ORDER BY record, number",
        tuple(numbers),
    )
    for row in rows:
        found[row[0]][row[1]] = Part(*row[1:])
    return found


def _said(kind: RecordKind, record: Record) -> tuple[object, ...]:
    """The columns that may change."""
    key, value = record.fields.get(kind.key), record.fields.get(kind.value)
    return (
        record.entry,
        record.outcome,
        record.ended,
        record.seconds,
        record.paused,
        record.pause,
        record.missed,
        f" {' '.join(map(str, record.alarms))} " if record.alarms else "",
        record.definition,
        key if isinstance(key, str) else "",
        None if isinstance(value, str) else value,
        orjson.dumps(record.fields).decode() if record.fields else "",
        orjson.dumps(record.memo).decode() if record.memo else "",
    )


def oldest(connection: Connection) -> int | None:
    """When the oldest record began [µs UTC]."""
    time: int | None = connection.exec_driver_sql(
        "SELECT min(begun) FROM (SELECT (SELECT min(begun) FROM record WHERE kind = k.kind) AS begun "
        "FROM (SELECT DISTINCT kind FROM record) k)"
    ).scalar()
    return time


def cut(connection: Connection, before: int, at_once: int) -> tuple[int, bool]:
    """Remove records that began before `before` [µs UTC], at most `at_once` of each kind; how many, and whether all are removed."""
    removed, done = 0, True
    for (kind,) in connection.exec_driver_sql("SELECT DISTINCT kind FROM record").all():
        numbers = [
            (row[0],)
            for row in connection.exec_driver_sql(
                "SELECT id FROM record WHERE kind = ? AND begun < ? ORDER BY begun LIMIT ?", (kind, before, at_once)
            )
        ]
        if numbers:
            for table, column in (("record_event", "record"), ("record_part", "record"), ("record", "id")):
                connection.exec_driver_sql(f"DELETE FROM {table} WHERE {column} = ?", numbers)
        removed, done = removed + len(numbers), done and len(numbers) < at_once
    return removed, done
