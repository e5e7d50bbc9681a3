"""Questions to the records of a kind: what a person filters, newest first; events, parts and people of some; times of parts."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection

from app.historian.event_query import AT_ONCE, counted, filtered
from app.historian.events import lost as lost
from app.historian.records import RECORD, from_row
from app.historian.records import parts as parts_of
from app.plant.kept import Definition
from app.records.event import Event, unpacked
from app.records.kind import Field, Filter, RecordKind
from app.records.record import Part, Record

ANY = "any"
"""Of a filter: whatever it is."""
ROWS = "record r JOIN event_machine m ON m.id = r.machine"
COLUMNS = ", ".join(f"r.{name}" for name in RECORD.split(", "))
EVENT = "e.id, m.name, e.boot, e.sequence, e.time, e.code, e.source, e.value, e.words, e.request, e.person, e.reason"


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
    where, given = _where(kind, wanted)
    # few have a number or a key: they are found and sorted, rather than all read in their order until enough of them were met
    order = "+r.begun DESC, r.id DESC" if _by_machine(kind, wanted) else "r.begun DESC, r.id DESC"
    rows = connection.exec_driver_sql(
        f"SELECT {COLUMNS}, m.name FROM {ROWS} {where} ORDER BY {order} LIMIT ?", (*given, limit)
    )
    return [from_row(row[:-1], row[-1]) for row in rows]


def count(connection: Connection, kind: RecordKind, wanted: RecordFilter, most: int) -> int:
    """How many records `wanted` lets through, counted up to `most`."""
    return counted(connection, "record r", *_where(kind, wanted), min(most, wanted.newest or most))


def get(connection: Connection, kind: RecordKind, number: int) -> Record | None:
    """The record `number`, with its parts."""
    row = connection.exec_driver_sql(
        f"SELECT {COLUMNS}, m.name FROM {ROWS} WHERE r.id = ? AND r.kind = ?", (number, kind.name)
    ).first()
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
    only = "" if codes is None else f" AND e.code IN ({', '.join(str(int(code)) for code in codes) or 'NULL'})"
    found: dict[int, list[Event]] = {}
    for portion in _portions(numbers):
        found |= {number: [] for number in portion}
        rows = connection.exec_driver_sql(
            f"SELECT b.record, {EVENT} FROM record_event b JOIN event e ON e.id = b.event JOIN event_machine m ON m.id = e.machine "
            f"WHERE b.record IN ({', '.join('?' * len(portion))}){only} ORDER BY b.record, e.id",
            tuple(portion),
        )
        for record, *row in rows:
            row[8] = unpacked(row[8])
            found[record].append(Event(*row))
    return found


def people(connection: Connection, numbers: Iterable[int]) -> Mapping[int, list[Asked]]:
    """Record → who asked for its events, in the order in which they came."""
    found: dict[int, list[Asked]] = {}
    for portion in _portions(numbers):
        found |= {number: [] for number in portion}
        rows = connection.exec_driver_sql(
            "SELECT b.record, e.code, e.person, e.reason FROM record_event b JOIN event e ON e.id = b.event "
            f"WHERE b.record IN ({', '.join('?' * len(portion))}) AND e.person <> '' ORDER BY b.record, e.id",
            tuple(portion),
        )
        for record, *row in rows:
            found[record].append(Asked(*row))
    return found


def person(field: Field | None, asked: Sequence[Asked]) -> Asked | None:
    """Who asked for the last event of a record that `field` (None: any) is about."""
    meant = None if field is None or field.people is None else field.people.codes
    return next((one for one in reversed(asked) if meant is None or one.code in meant), None)


def overlapping(connection: Connection, kind: RecordKind, record: Record) -> list[Record]:
    """Records of `kind` of the same machine that were under way at any time of `record`, in their order."""
    rows = connection.exec_driver_sql(
        f"SELECT {COLUMNS}, m.name FROM {ROWS} WHERE r.machine = (SELECT machine FROM record WHERE id = ?) AND r.kind = ? "
        "AND (r.ended IS NULL OR r.ended > ?) AND r.begun < ? ORDER BY r.begun, r.id",
        (record.id, kind.name, record.begun, 2**62 if record.ended is None else record.ended),
    )
    return [from_row(row[:-1], row[-1]) for row in rows]


def definitions(connection: Connection, ids: Iterable[str]) -> dict[str, Definition]:
    """Id → the definition; one that is not there says nothing."""
    wanted = sorted(set(ids))
    rows = connection.exec_driver_sql(
        f"SELECT id, text FROM definition WHERE id IN ({', '.join('?' * len(wanted))})", tuple(wanted)
    )
    found = {row[0]: Definition(row[1]) for row in rows}
    return {id: found.get(id) or Definition() for id in wanted}


def choices(connection: Connection, kind: RecordKind, equipment: str) -> list[Record]:
    """For each `key` that a machine's records of a kind ever had, the newest of them: what one can choose from."""
    machine = connection.exec_driver_sql("SELECT id FROM event_machine WHERE name = ?", (equipment,)).scalar()
    of = (machine, kind.name)
    rows = connection.exec_driver_sql(
        "WITH RECURSIVE k (text) AS (SELECT min(key) FROM record WHERE machine = ? AND kind = ? AND key <> '' UNION ALL "
        "SELECT (SELECT min(key) FROM record WHERE machine = ? AND kind = ? AND key > text AND key <> '') FROM k WHERE text IS NOT NULL) "
        "SELECT (SELECT max(id) FROM record WHERE machine = ? AND kind = ? AND key = text AND key <> '') FROM k WHERE text IS NOT NULL",
        of * 3,
    ).all()
    found = [get(connection, kind, int(row[0])) for row in rows]
    return [record for record in found if record is not None]


def part_times(connection: Connection, kind: RecordKind, wanted: RecordFilter) -> list[PartTimes]:
    """Times of the parts that were done in the records that `wanted` lets through, in their order."""
    where, given = _where(kind, wanted)
    source = f"(SELECT r.id, r.begun FROM record r {where}) r CROSS JOIN record_part p ON p.record = r.id AND p.state = 'done'"
    rows = connection.exec_driver_sql(
        "SELECT max(p.number), p.key, count(p.seconds), min(p.seconds), avg(p.seconds), max(p.seconds) "
        f"FROM {source} WHERE p.seconds IS NOT NULL GROUP BY p.key",
        tuple(given),
    ).all()
    last = {
        key: connection.exec_driver_sql(  # the index has the newest first: it ends with the first one in which the part was done
            f"SELECT p.seconds FROM record r CROSS JOIN record_part p ON p.record = r.id AND p.state = 'done' {where} "
            "AND p.key = ? AND p.seconds IS NOT NULL ORDER BY r.begun DESC, r.id DESC LIMIT 1",
            (*given, key),
        ).scalar()
        for _, key, *_ in rows
    }
    found = [PartTimes(row[0], row[1], Spread(row[2], row[3], row[4], row[5], last[row[1]])) for row in rows]
    return sorted(found, key=lambda one: (one.number, one.key))


def times(
    connection: Connection, kind: RecordKind, wanted: RecordFilter, outcome: str
) -> tuple[Mapping[str, int], Spread]:
    """How the records that `wanted` lets through ended, and what those that ended with `outcome` took."""
    where, given = _where(kind, wanted)
    rows = connection.exec_driver_sql(
        f"SELECT outcome, count(*), min(seconds), avg(seconds), max(seconds) FROM record r {where} GROUP BY outcome",
        tuple(given),
    ).all()
    whole = next((row for row in rows if row[0] == outcome), None)
    last: float | None = None
    if whole is not None:
        last = connection.exec_driver_sql(
            f"SELECT seconds FROM record r {where} AND outcome = ? ORDER BY begun DESC, id DESC LIMIT 1",
            (*given, outcome),
        ).scalar()
    spread = (
        Spread(0, None, None, None, None) if whole is None else Spread(whole[1], whole[2], whole[3], whole[4], last)
    )
    return {row[0]: row[1] for row in rows}, spread


def _portions(numbers: Iterable[int]) -> list[list[int]]:
    wanted = list(numbers)
    return [wanted[at : at + AT_ONCE] for at in range(0, len(wanted), AT_ONCE)]


def _where(kind: RecordKind, wanted: RecordFilter) -> tuple[str, list[object]]:
    own = [_sentence(kind, kind.filters[name], asked) for name, asked in wanted.given.items()]
    machines = (
        ["r.machine IN (SELECT id FROM event_machine)"] if not wanted.equipment and _by_machine(kind, wanted) else []
    )
    return filtered(
        (
            ("r.kind = ?", kind.name),
            ("r.machine = (SELECT id FROM event_machine WHERE name = ?)", wanted.equipment or None),
            ("r.begun >= ?", wanted.begin),
            ("r.begun < ?", wanted.end),
            ("r.outcome = ?", wanted.outcome or None),
            *((sentence, value) for sentence, value in own if value is not None),
            ("(r.begun, r.id) < (?, ?)", wanted.before),
        ),
        [*machines, *(sentence for sentence, value in own if value is None)],
    )


def _by_machine(kind: RecordKind, wanted: RecordFilter) -> bool:
    """Whether what is asked for has an index for each machine: a number, or a key that is chosen."""
    return any(
        (filter.how == "choice" and asked != ANY and filter.of == kind.key)
        or (filter.how == "is" and filter.of == "number")
        for filter, asked in ((kind.filters[name], asked) for name, asked in wanted.given.items())
    )


def _sentence(kind: RecordKind, one: Filter, asked: float | str) -> tuple[str, Any]:
    column = _column(kind, one.of)
    match one.how:
        case "above":
            return f"{column} > ?", asked
        case "alarm" if asked != ANY:
            return f"instr({column}, ?) > 0", f" {asked} "
        case "choice":  # the index is of those that have one
            return (f"({column} = ? AND {column} <> '')", asked) if asked != ANY else (f"{column} <> ''", None)
        case "is":
            return f"{column} = ?", asked
    return f"coalesce({column}, '') NOT IN ('', 0)", None


def _column(kind: RecordKind, of: str) -> str:
    if of in ("number", "seconds", "alarms"):
        return f"r.{of}"
    if of in (kind.key, kind.value):
        return "r.key" if of == kind.key else "r.value"
    return f"json_extract(nullif(r.fields, ''), '$.{of}')"
