"""Questions to the records of a kind: what a person filters, newest first; events, parts and people of some; times of parts."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, String, bindparam, cast, func, literal, or_, select

from app.historian.dialect import Statement, holds, in_order, is_said, json_field, unindexed
from app.historian.event_query import AT_ONCE, comes_after, counted
from app.historian.events import COLUMNS as EVENT
from app.historian.events import lost as lost
from app.historian.records import HAS_KEY, RECORD, from_row
from app.historian.records import parts as parts_of
from app.historian.tables import definition, event, event_machine, record_event, record_part
from app.historian.tables import record as record_table
from app.plant.kept import Definition
from app.records.event import Event, unpacked
from app.records.kind import Field, Filter, RecordKind
from app.records.record import Part, Record

ANY = "any"
"""Of a filter: whatever it is."""
_r = record_table.c


@dataclass(frozen=True, slots=True)
class RecordFilter:
    """Which records of a kind a person wants to see; what is empty does not filter."""

    equipment: str = ""
    begin: int | None = None
    """Begun at or after [µs UTC]."""
    end: int | None = None
    """Begun before."""
    outcome: str = ""
    given: Mapping[str, float | str] = field(default_factory=dict)
    """Filter of the kind → what it asks for."""
    before: tuple[int, int] | None = None
    """Only what comes after this one in the list (begun, id): the next page."""
    newest: int | None = None
    """Only so many, the newest of them; lists and exports keep to it."""


@dataclass(frozen=True, slots=True)
class Asked:
    """Somebody asked for an event of a record."""

    code: int
    person: str
    reason: str


@dataclass(frozen=True, slots=True)
class Spread:
    """What something took."""

    count: int
    least: float | None
    """[s]"""
    mean: float | None
    most: float | None
    last: float | None
    """In the newest of them."""


@dataclass(frozen=True, slots=True)
class PartTimes:
    """What a part took in the records in which it was done."""

    number: int
    key: str
    spread: Spread


def find(connection: Connection, kind: RecordKind, wanted: RecordFilter, limit: int) -> list[Record]:
    """The newest `limit` records that `wanted` lets through, newest first, without their parts."""
    rows = _newest(kind, wanted)(connection, limit=limit, **_given(wanted))
    return [from_row(row[:-1], row[-1]) for row in rows]


def _newest(kind: RecordKind, wanted: RecordFilter) -> Statement:
    """The records that `wanted` lets through and the names of their machines, newest first.

    Pages are asked for in few ways: each is made into a statement once, and its values are said anew.
    """
    filters = tuple(
        (name, kind.filters[name].how, kind.filters[name].of, asked == ANY) for name, asked in wanted.given.items()
    )
    way = (kind.name, kind.key, kind.value, filters, frozenset(_given(wanted)))
    if (known := _WAYS.get(way)) is None:
        # few have a number or a key: they are found and sorted, rather than all read in their order until enough of them were met
        begun = unindexed(_r.begun) if _by_machine(kind, wanted) else _r.begun
        asked = _told().where(*_where(kind, wanted)).order_by(begun.desc(), _r.id.desc()).limit(bindparam("limit"))
        if len(_WAYS) >= MOST_WAYS:
            _WAYS.clear()
        known = _WAYS[way] = Statement(asked)
    return known


MOST_WAYS = 200
_WAYS: dict[tuple[object, ...], Statement] = {}


def count(connection: Connection, kind: RecordKind, wanted: RecordFilter, most: int) -> int:
    """How many records `wanted` lets through, counted up to `most`."""
    return counted(connection, record_table, _where(kind, wanted), min(most, wanted.newest or most))


def get(connection: Connection, kind: RecordKind, number: int) -> Record | None:
    """The record `number`, with its parts."""
    row = connection.execute(_told().where(_r.id == number, _r.kind == kind.name)).first()
    if row is None:
        return None
    record = from_row(row[:-1], row[-1])
    record.parts = parts_of(connection, [number])[number]
    return record


def parts(connection: Connection, numbers: Iterable[int]) -> Mapping[int, Mapping[int, Part]]:
    """Record → its parts in their order."""
    found: dict[int, Mapping[int, Part]] = {}
    for portion in _portions(numbers):
        found |= parts_of(connection, portion)
    return found


def events(
    connection: Connection, numbers: Iterable[int], codes: Collection[int] | None = None
) -> Mapping[int, list[Event]]:
    """Record → its events (None: all) in the order in which they came."""
    of = select(record_event.c.record, *EVENT).select_from(_EVENTS).order_by(record_event.c.record, event.c.id)
    if codes is not None:
        of = of.where(event.c.code.in_(sorted(codes)))
    found: dict[int, list[Event]] = {}
    for portion in _portions(numbers):
        found |= {number: [] for number in portion}
        for record, *row in connection.execute(of.where(record_event.c.record.in_(portion))):
            row[8] = unpacked(row[8])
            found[record].append(Event(*row))
    return found


def people(connection: Connection, numbers: Iterable[int]) -> Mapping[int, list[Asked]]:
    """Record → who asked for its events, in the order in which they came."""
    found: dict[int, list[Asked]] = {}
    for portion in _portions(numbers):
        found |= {number: [] for number in portion}
        asked = (
            select(record_event.c.record, event.c.code, event.c.person, event.c.reason)
            .join_from(record_event, event, event.c.id == record_event.c.event)
            .where(record_event.c.record.in_(portion), event.c.person != "")
            .order_by(record_event.c.record, event.c.id)
        )
        for record, *row in connection.execute(asked):
            found[record].append(Asked(*row))
    return found


def person(field: Field | None, asked: Sequence[Asked]) -> Asked | None:
    """Who asked for the last event of a record that `field` (None: any) is about."""
    meant = None if field is None or field.people is None else field.people.codes
    return next((one for one in reversed(asked) if meant is None or one.code in meant), None)


def overlapping(connection: Connection, kind: RecordKind, record: Record) -> list[Record]:
    """Records of `kind` of the same machine that were under way at any time of `record`, in their order."""
    this = record_table.alias()
    machine = select(this.c.machine).where(this.c.id == record.id).scalar_subquery()
    conditions = [_r.machine == machine, _r.kind == kind.name, or_(_r.ended.is_(None), _r.ended > record.begun)]
    if record.ended is not None:
        conditions.append(_r.begun < record.ended)
    rows = connection.execute(_told().where(*conditions).order_by(_r.begun, _r.id))
    return [from_row(row[:-1], row[-1]) for row in rows]


def definitions(connection: Connection, ids: Iterable[str]) -> dict[str, Definition]:
    """Id → the definition; one that is not there says nothing."""
    wanted = sorted(set(ids))
    rows = connection.execute(select(definition.c.id, definition.c.text).where(definition.c.id.in_(wanted)))
    found = {row[0]: Definition(row[1]) for row in rows}
    return {id: found.get(id) or Definition() for id in wanted}


def definition_at(connection: Connection, equipment: str, kinds: Iterable[str], time: int) -> Definition:
    """By what `equipment` worked at `time` [µs UTC], by a record of one of these kinds that was under way; none was: it says nothing."""
    machine = select(event_machine.c.id).where(event_machine.c.name == equipment).scalar_subquery()
    for kind in kinds:
        newest = select(_r.ended, definition.c.text).join_from(
            record_table, definition, definition.c.id == _r.definition, isouter=True
        )
        row = connection.execute(
            newest.where(_r.machine == machine, _r.kind == kind, _r.begun <= time).order_by(_r.begun.desc()).limit(1)
        ).first()
        if row is not None and row[1] and (row[0] is None or row[0] >= time):
            return Definition(row[1])
    return Definition()


def given_at_most(connection: Connection) -> int:
    """How many values a run was ever started with, by all definitions that are kept."""
    rows = connection.execute(select(definition.c.text).where(definition.c.text.like('%"recipe"%')))
    return max((len(Definition(row[0]).recipe) for row in rows), default=0)


def choices(connection: Connection, kind: RecordKind, equipment: str) -> list[Record]:
    """For each `key` that a machine's records of a kind ever had, the newest of them: what one can choose from."""
    rows = CHOICES(connection, equipment=equipment, kind=kind.name).all()
    found = [get(connection, kind, int(row[0])) for row in rows]
    return [record for record in found if record is not None]


def _choices() -> Select[*tuple[Any, ...]]:
    """The newest record of each key of a machine; the index leads from one key to the next."""
    of = (
        _r.machine
        == select(event_machine.c.id).where(event_machine.c.name == bindparam("equipment")).scalar_subquery(),
        _r.kind == bindparam("kind"),
        HAS_KEY,
    )
    keys = select(select(func.min(_r.key)).where(*of).scalar_subquery().label("text")).cte("k", recursive=True)
    following = select(func.min(_r.key)).where(*of, _r.key > keys.c.text).correlate(keys).scalar_subquery()
    keys = keys.union_all(select(following).where(keys.c.text.is_not(None)))
    newest = select(func.max(_r.id)).where(*of, _r.key == keys.c.text).correlate(keys).scalar_subquery()
    return select(newest).select_from(keys).where(keys.c.text.is_not(None))


CHOICES = Statement(_choices())


def part_times(connection: Connection, kind: RecordKind, wanted: RecordFilter) -> list[PartTimes]:
    """Times of the parts that were done in the records that `wanted` lets through, in their order."""
    where, seconds = _where(kind, wanted), record_part.c.seconds
    asked = select(_r.id).where(*where).subquery("r")
    done = record_part.c.state == "done", seconds.is_not(None)
    figures = func.count(seconds), func.min(seconds), func.avg(seconds), func.max(seconds)
    rows = connection.execute(
        select(func.max(record_part.c.number), record_part.c.key, *figures)
        .select_from(in_order(asked, record_part, record_part.c.record == asked.c.id, *done))
        .group_by(record_part.c.key)
    ).all()
    newest = (
        select(seconds)
        .select_from(in_order(record_table, record_part, record_part.c.record == _r.id, *done))
        .where(*where)
        .order_by(_r.begun.desc(), _r.id.desc())
        .limit(1)
    )
    # the index has the newest first: it ends with the first one in which the part was done
    last = {key: connection.execute(newest.where(record_part.c.key == key)).scalar() for _, key, *_ in rows}
    found = [PartTimes(row[0], row[1], Spread(row[2], row[3], row[4], row[5], last[row[1]])) for row in rows]
    return sorted(found, key=lambda one: (one.number, one.key))


def times(
    connection: Connection, kind: RecordKind, wanted: RecordFilter, outcome: str
) -> tuple[Mapping[str, int], Spread]:
    """How the records that `wanted` lets through ended, and what those that ended with `outcome` took."""
    where, seconds = _where(kind, wanted), _r.seconds
    figures = func.count(), func.min(seconds), func.avg(seconds), func.max(seconds)
    rows = connection.execute(select(_r.outcome, *figures).where(*where).group_by(_r.outcome)).all()
    whole = next((row for row in rows if row[0] == outcome), None)
    last: float | None = None
    if whole is not None:
        newest = select(seconds).where(*where, _r.outcome == outcome).order_by(_r.begun.desc(), _r.id.desc())
        last = connection.execute(newest.limit(1)).scalar()
    spread = (
        Spread(0, None, None, None, None) if whole is None else Spread(whole[1], whole[2], whole[3], whole[4], last)
    )
    return {row[0]: row[1] for row in rows}, spread


def _told() -> Select[*tuple[Any, ...]]:
    """Records with the names of their machines."""
    return select(*RECORD, event_machine.c.name).join_from(
        record_table, event_machine, event_machine.c.id == _r.machine
    )


_EVENTS = record_event.join(event, event.c.id == record_event.c.event).join(
    event_machine, event_machine.c.id == event.c.machine
)


def _portions(numbers: Iterable[int]) -> list[list[int]]:
    wanted = list(numbers)
    return [wanted[at : at + AT_ONCE] for at in range(0, len(wanted), AT_ONCE)]


def _where(kind: RecordKind, wanted: RecordFilter) -> list[ColumnElement[bool]]:
    """What `wanted` lets through; its values are those of `_given`."""
    said = {name: bindparam(name, value, literal(value).type) for name, value in _given(wanted).items()}
    conditions = [_r.kind == kind.name]
    if "equipment" in said:
        machine = select(event_machine.c.id).where(event_machine.c.name == said["equipment"]).scalar_subquery()
        conditions.append(_r.machine == machine)
    elif _by_machine(kind, wanted):
        conditions.append(_r.machine.in_(select(event_machine.c.id)))
    if "begin" in said:
        conditions.append(_r.begun >= said["begin"])
    if "end" in said:
        conditions.append(_r.begun < said["end"])
    if "outcome" in said:
        conditions.append(_r.outcome == said["outcome"])
    conditions += [
        _condition(kind, kind.filters[name], asked, said.get(f"of_{name}")) for name, asked in wanted.given.items()
    ]
    if "before" in said:
        conditions.append(comes_after(_r.begun, _r.id, (said["before"], said["after"])))
    return conditions


def _given(wanted: RecordFilter) -> dict[str, Any]:
    """What is asked for, by name."""
    before, after = wanted.before or (None, None)
    given: dict[str, Any] = {
        "equipment": wanted.equipment or None,
        "begin": wanted.begin,
        "end": wanted.end,
        "outcome": wanted.outcome or None,
        "before": before,
        "after": after,
    } | {f"of_{name}": None if asked == ANY else asked for name, asked in wanted.given.items()}
    return {name: value for name, value in given.items() if value is not None}


def _by_machine(kind: RecordKind, wanted: RecordFilter) -> bool:
    """Whether what is asked for has an index for each machine: a number, or a key that is chosen."""
    return any(
        (filter.how == "choice" and asked != ANY and filter.of == kind.key)
        or (filter.how == "is" and filter.of == "number")
        for filter, asked in ((kind.filters[name], asked) for name, asked in wanted.given.items())
    )


def _condition(kind: RecordKind, one: Filter, asked: float | str, value: Any) -> ColumnElement[bool]:
    column = _column(kind, one.of)
    condition: ColumnElement[bool]
    match one.how:
        case "above":
            condition = column > value
        case "alarm" if asked != ANY:
            condition = holds(column, " " + cast(value, String) + " ")
        case "choice":
            condition = HAS_KEY if one.of == kind.key else is_said(column)
            if asked != ANY:
                condition = (column == value) & condition
        case "is":
            condition = column == value
        case _:
            condition = is_said(column)
    return condition


def _column(kind: RecordKind, of: str) -> ColumnElement[Any]:
    if of in ("number", "seconds", "alarms"):
        return _r[of]
    if of in (kind.key, kind.value):
        return _r.key if of == kind.key else _r.value
    return json_field(_r.fields, of)
