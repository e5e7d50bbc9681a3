"""Records of machines in the history: a fold of their events, in the transaction that stores these.

What an event means is said by the kinds of the machine's type (app/records); here it is read, written back and cut.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import orjson
from sqlalchemy import Connection, bindparam, delete, func, insert, literal_column, or_, select, update

from app.historian.dialect import Statement, adding, replacing
from app.historian.events import Fold
from app.historian.tables import definition, record_event, record_part
from app.historian.tables import record as record_table
from app.plant.definitions import Equipment
from app.plant.kept import Kept, kept
from app.records import fold
from app.records.event import Event
from app.records.fold import Machine
from app.records.kind import RecordKind
from app.records.record import Part, Reading, Record
from app.records.snapshot import Layout, decode

_r = record_table.c
RECORD = (
    _r.id, _r.kind, _r.number, _r.boot, _r.sequence, _r.begun, _r.entry, _r.outcome, _r.ended, _r.seconds, _r.paused, _r.pause, _r.missed,
    _r.alarms, _r.definition, _r.fields, _r.memo,
)  # fmt: skip
"""Of a record, as `from_row` takes them."""
IS_OPEN = _r.outcome == literal_column("'open'")
HAS_KEY = _r.key != literal_column("''")
"""Said in the statement itself: there are indexes of those rows only."""


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
            decode(self.layout, event.words, event.code),
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
        row = LATEST(self._connection, machine=self._machine, kind=kind.name, number=number).first()
        return None if row is None else self._read(kind, row)

    def open(self, kind: RecordKind) -> list[Record]:
        rows = OPEN(self._connection, machine=self._machine, kind=kind.name).all()
        return [self._read(kind, row) for row in rows]

    def lasting(self, kind: str, time: int) -> int:
        return int(LASTING(self._connection, machine=self._machine, kind=kind, time=time).scalar_one())

    def add(self, record: Record) -> Record:
        kind = self._source.kinds[record.kind]
        if record.definition:
            DEFINE(self._connection, id=record.definition, text=self._source.definition.text)
        made = NEW(
            self._connection,
            machine=self._machine,
            kind=record.kind,
            number=record.number,
            boot=record.boot,
            sequence=record.sequence,
            begun=record.begun,
            **_said(kind, record),
        )
        record.id = int(made.scalar_one())
        self._known[record.id] = record
        return record

    def put(self, record: Record) -> None:
        former = self._known.get(record.id)
        if record == former:
            return
        CHANGE(self._connection, this=record.id, **_said(self._source.kinds[record.kind], record))
        changed = [part for number, part in record.parts.items() if former is None or former.parts.get(number) != part]
        if changed:
            PUT_PART.rows(
                self._connection,
                [
                    (record.id, part.number, part.key, part.state, part.begun, part.ended, part.seconds, part.paused)
                    for part in changed
                ],
            )
        self._known[record.id] = record

    def note(self, record: Record, event: Reading) -> None:
        NOTE(self._connection, record=record.id, event=event.id)

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
    if len(numbers) == 1:
        rows = PARTS(connection, record=numbers[0])
    else:
        rows = connection.execute(_parts.where(record_part.c.record.in_(numbers)))
    for row in rows:
        found[row[0]][row[1]] = Part(*row[1:])
    return found


_parts = select(*(record_part.c)).order_by(record_part.c.record, record_part.c.number)
PARTS = Statement(_parts.where(record_part.c.record == bindparam("record")))


def _said(kind: RecordKind, record: Record) -> dict[str, object]:
    """The columns that may change."""
    key, value = record.fields.get(kind.key), record.fields.get(kind.value)
    return {
        "entry": record.entry,
        "outcome": record.outcome,
        "ended": record.ended,
        "seconds": record.seconds,
        "paused": record.paused,
        "pause": record.pause,
        "missed": record.missed,
        "alarms": f" {' '.join(map(str, record.alarms))} " if record.alarms else "",
        "definition": record.definition,
        "key": key if isinstance(key, str) else "",
        "value": None if isinstance(value, str) else value,
        "fields": orjson.dumps(record.fields).decode() if record.fields else "",
        "memo": orjson.dumps(record.memo).decode() if record.memo else "",
    }


SAID = (
    "entry", "outcome", "ended", "seconds", "paused", "pause", "missed", "alarms", "definition", "key", "value", "fields", "memo",
)  # fmt: skip
_of = _r.machine == bindparam("machine"), _r.kind == bindparam("kind")
LATEST = Statement(select(*RECORD).where(*_of, _r.number == bindparam("number")).order_by(_r.id.desc()).limit(1))
OPEN = Statement(select(*RECORD).where(*_of, IS_OPEN).order_by(_r.id))
LASTING = Statement(
    select(func.count())
    .select_from(record_table)
    .where(*_of, _r.begun <= bindparam("time"), or_(_r.ended.is_(None), _r.ended > bindparam("time")))
)
DEFINE = Statement(adding(definition), "id", "text")
NEW = Statement(insert(record_table).returning(_r.id), "machine", "kind", "number", "boot", "sequence", "begun", *SAID)
CHANGE = Statement(update(record_table).where(_r.id == bindparam("this")), *SAID)
PUT_PART = Statement(replacing(record_part), *record_part.c.keys())
NOTE = Statement(adding(record_event), "record", "event")


def oldest(connection: Connection) -> int | None:
    """When the oldest record began [µs UTC]."""
    time: int | None = OLDEST(connection).scalar()
    return time


def cut(connection: Connection, before: int, at_once: int) -> tuple[int, bool]:
    """Remove records that began before `before` [µs UTC], at most `at_once` of each kind; how many, and whether all are removed."""
    removed, done = 0, True
    for kind in KINDS(connection).scalars().all():
        numbers = [(row[0],) for row in OLD(connection, kind=kind, before=before, at_once=at_once)]
        if numbers:
            for gone in CUT:
                gone.rows(connection, numbers)
        removed, done = removed + len(numbers), done and len(numbers) < at_once
    return removed, done


KINDS = Statement(select(_r.kind).distinct())
OLD = Statement(
    select(_r.id)
    .where(_r.kind == bindparam("kind"), _r.begun < bindparam("before"))
    .order_by(_r.begun)
    .limit(bindparam("at_once"))
)
CUT = [
    Statement(delete(column.table).where(column == bindparam("this")), "this")
    for column in (record_event.c.record, record_part.c.record, _r.id)
]
_kinds = select(_r.kind).distinct().subquery()
_each = record_table.alias()
_least = select(func.min(_each.c.begun)).where(_each.c.kind == _kinds.c.kind).correlate(_kinds).scalar_subquery()
_of_each = select(_least.label("begun")).select_from(_kinds).subquery()
OLDEST = Statement(select(func.min(_of_each.c.begun)))
