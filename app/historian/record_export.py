"""Records of a kind as CSV (event_export.py), newest first: one line each, with the columns that its kind declares."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Connection

from app.errors import ConfigurationError
from app.historian import record_query as query
from app.historian.event_export import PAGE, SHIFT, ListExport, ListExportSettings
from app.historian.record_query import Asked, RecordFilter
from app.plant.definitions import Equipment, Plant
from app.plant.kept import Definition
from app.plant.record_kinds import header
from app.plant.texts import Texts
from app.records.event import Event
from app.records.kind import Column, RecordKind, Repeat, Type
from app.records.record import Part, Record, Value

PEOPLE = ("person", "reason")
GIVEN = re.compile(r"recipe_(\d+)(?:_name)?")
"""Fields of the values that a run was started with: number of the value."""
Label = Callable[[Mapping[str, str]], str]
"""A label of a definition in the reader's language."""


def _english(label: Mapping[str, str]) -> str:
    return label.get("en") or next(iter(label.values()), "")


@dataclass(frozen=True, slots=True)
class RecordExportSettings(ListExportSettings):
    """Which records somebody wants to take home, and how."""

    wanted: RecordFilter
    kind: RecordKind = field(default_factory=lambda: RecordKind("", frozenset()))
    names: Sequence[str] = ()
    """What the columns that come again are of, in their order: so many there are."""
    label: Label = _english
    words: Mapping[tuple[str, str], str] = field(default_factory=dict)
    """(field, word) → text."""
    events: Mapping[tuple[str, int], str] = field(default_factory=dict)
    """(machine, code) → the event in words; else its code."""

    def check(self) -> None:
        ListExportSettings.check(self)
        most = self.kind.repeat.most if self.kind.repeat else 0
        if len(self.names) > most:
            raise ConfigurationError(f"columns that come again: {len(self.names)}, expected at most {most}")


class RecordExport(ListExport[RecordExportSettings, Record]):
    """One export of records under way."""

    def __init__(self, settings: RecordExportSettings) -> None:
        self.title, self.stem = settings.kind.title, settings.kind.file  # type: ignore[misc]
        super().__init__(settings)
        kind, used = settings.kind, {column.of for column in settings.kind.csv}
        self._with_people = bool(used & {*PEOPLE, *(f.name for f in kind.fields.values() if f.type is Type.PERSON)})
        self._definitions: dict[str, Definition] = {}
        self._people: Mapping[int, Sequence[Asked]] = {}
        """Of the page at hand, like the next two."""
        self._csv: Sequence[Column] = kind.csv
        self._parts: Mapping[int, Mapping[int, Part]] = {}
        self._events: Mapping[int, Sequence[Event]] = {}

    def _count(self, connection: Connection, most: int) -> int:
        return query.count(connection, self.settings.kind, self.settings.wanted, most)

    @property
    def _most(self) -> int:
        """Records that are read at once: a page, or only the newest ones where no more are wanted."""
        return min(PAGE, self.settings.wanted.newest or PAGE)

    def _columns(self) -> Iterator[str]:
        headers, repeat = self.settings.headers, self.settings.kind.repeat
        self._csv = [column for column in self.settings.kind.csv if self._is_said(column)]
        yield from (headers.get(column.name, column.name) for column in self._csv)
        for n, name in enumerate(self.settings.names, 1):
            for column in repeat.columns if repeat else ():
                yield headers.get(column.name, column.name).replace("{n}", str(n)).replace("{name}", name)

    def _is_said(self, column: Column) -> bool:
        """False for the column of a value of a run where no definition ever had so many."""
        found = GIVEN.fullmatch(column.of)
        if found is None:
            return True
        assert self._connection is not None
        return int(found[1]) <= query.given_at_most(self._connection)

    def _page(self, connection: Connection, before: tuple[int, int] | None) -> Sequence[Record]:
        kind = self.settings.kind
        found = query.find(connection, kind, replace(self.settings.wanted, before=before), self._most)
        ids = [one.id for one in found]
        if self._with_people:
            self._people = query.people(connection, ids)
        if kind.repeat is not None and kind.repeat.events:
            self._events = query.events(connection, ids, kind.repeat.events)
        elif kind.repeat is not None:
            self._parts = query.parts(connection, ids)
        unknown = {one.definition for one in found if one.definition} - set(self._definitions)
        if unknown:
            self._definitions |= query.definitions(connection, unknown)
        return found

    def _place(self, one: Record) -> tuple[int, int]:
        return one.begun, one.id

    def _line(self, one: Record) -> str:
        cells = [self._shown(one, column) for column in self._csv]
        if self.settings.kind.repeat is not None:
            cells += self._repeated(one, self.settings.kind.repeat)
        return self._separator.join(cells) + "\r\n"

    def _shown(self, one: Record, column: Column) -> str:
        settings, asked = self.settings, self._people.get(one.id, ())
        match column.of:
            case "begun.utc" | "begun.local" | "ended.utc" | "ended.local":
                time = one.begun if column.of.startswith("begun") else one.ended
                utc, _, local = ("" if time is None else self._times(time)).partition(self._separator)
                return utc if column.of.endswith("utc") else local
            case "equipment":
                return self._cell(one.equipment)
            case "number":
                return str(one.number)
            case "outcome":
                return self._cell(settings.outcomes.get(one.outcome, one.outcome))
            case "duration":
                return self._maybe(one.duration)
            case "seconds":
                return self._maybe(one.seconds)
            case "paused":
                return self._maybe(one.paused / 1e6)
            case "missed":
                return str(one.missed)
            case "alarms":
                said = (settings.events.get((one.equipment, code), str(code)) for code in one.alarms)
                return self._cell(" + ".join(said))
            case "definition":
                known = self._definitions.get(one.definition, Definition())
                return self._cell(known.name if settings.locale == "machine" else settings.label(known.label))
            case "person" | "reason":
                last = query.person(None, asked)
                return self._cell(getattr(last, column.of) if last else "")
        return self._field(one, column.of, asked)

    def _field(self, one: Record, name: str, asked: Sequence[Asked]) -> str:
        of, value = self.settings.kind.fields[name], one.fields.get(name)
        match of.type:
            case Type.PERSON:
                last = query.person(of, asked)
                return self._cell(last.person if last else "")
            case Type.WORD:
                return self._cell(self.settings.words.get((name, str(value)), str(value)) if value else "")
            case Type.NAME:
                return self._cell(self._named(one, value))
            case Type.TIME:
                return self._utc(value if isinstance(value, int) else None)
        if value is None or isinstance(value, str):
            return value or ""
        return str(value) if isinstance(value, int) else self._maybe(value)

    def _named(self, one: Record, key: Value) -> str:
        if not isinstance(key, str) or self.settings.locale == "machine":
            return str(key or "")
        label = self._definitions.get(one.definition, Definition()).labels.get(key, {})
        return self.settings.label(label) or key

    def _repeated(self, one: Record, repeat: Repeat) -> Iterator[str]:
        first: dict[int, Event] = {}
        for told in self._events.get(one.id, ()):
            first.setdefault(told.source, told)
        parts = self._parts.get(one.id, {})
        for n in range(1, len(self.settings.names) + 1):
            event, part = first.get(n), parts.get(n)
            for column in repeat.columns:
                match column.of:
                    case "time":
                        yield self._utc(event.time if event else None)
                    case "value":
                        yield self._maybe(event.value if event and event.code in repeat.value else None)
                    case _:
                        yield self._maybe(part.seconds if part else None)


def keeping(plant: Plant | None, kind: str) -> list[Equipment]:
    """The machines that have records of a kind."""
    return [item for item in plant.equipment.values() if kind in item.type.records] if plant else []


def kinds(plant: Plant | None) -> Mapping[str, RecordKind]:
    """The kinds of all machines of the plant, by name."""
    return plant.records if plant else {}


def names(plant: Plant | None, kind: RecordKind, equipment: str, label: Label) -> list[str]:
    """What the columns that come again are of: the machine's parts by name; of all machines (empty) only as many as the most have."""
    repeat, machines = kind.repeat, [item for item in keeping(plant, kind.name) if equipment in ("", item.id)]
    if repeat is None:
        return []
    if repeat.points:
        counts = [sum(key.startswith(repeat.points) for key in item.points) for item in machines]
        return [""] * min(repeat.most, max(counts, default=repeat.usual) or repeat.usual)
    running = [item.sequence for item in machines if item.sequence]
    if equipment and running:
        return [label(step.label) for step in running[0].steps]
    return [""] * max((len(one.steps) for one in running), default=repeat.usual)


def words(texts: Texts, plant: Plant | None, kind: RecordKind, locale: str) -> dict[str, Any]:
    """What an export says in a language; for programs (`machine`) there are keys."""
    machines = keeping(plant, kind.name)
    if locale == "machine" or not machines:
        keys = {(item.id, code): key for item in machines for code, key in item.type.events.items()}
        return {"events": keys}
    type = machines[0].type

    def text(key: str) -> str:
        return texts.of_type(locale, type, f"record.{kind.name}.{key}", n="{n}", name="{name}")

    columns = (*kind.csv, *(kind.repeat.columns if kind.repeat else ()))
    return {
        "label": lambda label: texts.label(locale, label) if label else "",
        "headers": {column.name: text(f"csv.{header(column.name)}") for column in columns}
        | {SHIFT: texts.text(locale, "events.csv.shift")},
        "outcomes": {one: text(f"outcome.{one}") for one in kind.outcomes},
        "words": {(f.name, word): text(f"{f.name}.{word}") for f in kind.fields.values() for word in f.words},
        "events": {
            (item.id, code): texts.of_type(locale, item.type, f"event.{key}")
            for item in machines
            for code, key in item.type.events.items()
        },
    }
