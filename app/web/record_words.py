"""What is known of records in the words of a request: labels, outcomes, fields, events, times."""

from collections.abc import Iterator, Mapping, Sequence

from fastapi import Request

from app.historian.record_export import keeping
from app.historian.record_query import Asked, person
from app.plant.definitions import Equipment
from app.plant.kept import Definition
from app.plant.record_kinds import COMMON
from app.plant.sequence_recipe import MOST_VALUES, point_of
from app.records.kind import RecordKind, Type
from app.records.record import Part, Record
from app.web import format as fmt
from app.web.guard import shown_name, shown_words
from app.web.language import language_of
from app.web.pages import view_of
from app.web.signin import zone_of

GLYPHS: Mapping[str, str] = {"done": "i-check", "aborted": "i-cross", "timed_out": "i-clock", "active": "i-right"}
"""Outcome of a record or state of a part → its sign."""
NOTHING = "–"
AT_RIGHT = ("duration", "seconds", "number", "missed")
"""Columns that are numbers, beside fields that are."""


class RecordWords:
    """Records of one kind in the language of a request."""

    def __init__(self, request: Request, kind: RecordKind) -> None:
        self.view, self.request, self.kind = view_of(request), request, kind
        self.runtime = self.view.runtime(request)
        self.lang, self.zone = language_of(request), zone_of(request)
        self.now = self.runtime.clock.micros()
        machines = keeping(self.runtime.plant, kind.name)
        self.type = machines[0].type if machines else None

    def text(self, key: str, **values: object) -> str:
        """A text that the type has for this kind."""
        return self.of_type(f"record.{self.kind.name}.{key}", **values)

    def of_type(self, key: str, **values: object) -> str:
        """A text of the type."""
        return self.runtime.texts.of_type(self.lang, self.type or "", key, **values)

    def own(self, key: str, **values: object) -> str:
        """A text of the product about records."""
        return self.view.text(self.request, f"records.{key}", **values)

    def label(self, label: Mapping[str, str]) -> str:
        """A label in the reader's language; empty for none."""
        return self.runtime.texts.label(self.lang, label) if label else ""

    def column(self, name: str) -> str:
        """The head of a column, or the name of a line above the events."""
        return self.own(name) if name in COMMON else self.text(f"column.{name}")

    def value(self, one: Record, name: str, definition: Definition, asked: Sequence[Asked]) -> str:
        """What a column of the list, or a line above the events, says of a record."""
        match name:
            case "begun":
                return self.moment(one.begun)
            case "ended":
                return "" if one.ended is None else self.moment(one.ended)
            case "equipment":
                return one.equipment
            case "number":
                return f"#{one.number}"
            case "outcome":
                return self.outcome(one)
            case "duration":
                return "" if one.duration is None else fmt.duration(one.duration, self.lang)
            case "seconds":
                return "" if one.seconds is None else self.seconds(one.seconds)
            case "paused":
                return self.seconds(one.paused / 1e6) if one.paused else ""
            case "missed":
                return str(one.missed)
            case "alarms":
                item = self.item(one.equipment)
                return ", ".join(self.event(item, code) for code in one.alarms)
            case "definition":
                return self.label(definition.label)
            case "person":
                last = person(None, asked)
                return self.named(last.person) if last else ""
            case "reason":
                last = person(None, asked)
                return self.said(last.reason) if last else ""
        return self._field(one, name, definition, asked)

    def _field(self, one: Record, name: str, definition: Definition, asked: Sequence[Asked]) -> str:
        field, value = self.kind.fields[name], one.fields.get(name)
        match field.type:
            case Type.PERSON:
                last = person(field, asked)
                return shown_name(self.request, last.person) if last else ""
            case Type.WORD:
                return self.text(f"{name}.{value}") if value else ""
            case Type.NAME:
                told = self.label(definition.labels.get(str(value), {})) or str(value or "")
                missing = f"page.missing_{name}"
                return self.text(missing, name=told) if told and self._says(missing) else told
            case Type.PART:
                if not value:
                    return ""
                named = self.part_names(one.equipment).get(f"{value:.0f}", "") if isinstance(value, int | float) else ""
                return named or f"{value} {self.label(definition.part(int(value)))}".strip()
            case Type.TIME:
                return self.moment(value) if isinstance(value, int) else ""
            case Type.IDENTITY:
                return f"{value:.0f}" if isinstance(value, int | float) else ""
        if value is None or isinstance(value, str):
            return value or (NOTHING if field.unit else "")
        if field.unit == "s":
            return fmt.duration(value, self.lang)
        return fmt.quantity(value, field.decimals, field.unit, self.lang)

    def _says(self, key: str) -> bool:
        """Whether the type has the text: what a field names is called by its good state, and stood in the way."""
        return self.type is not None and self.runtime.texts.has(self.lang, f"record.{self.kind.name}.{key}", self.type)

    def outcome(self, one: Record) -> str:
        """What became of a record; one whose time is over has ended, although nothing told it."""
        over = one.open and one.ended is not None and one.ended <= self.now
        return self.text(f"outcome.{self.kind.expired if over else one.outcome}")

    def event(self, item: Equipment | None, code: int) -> str:
        """An event in words."""
        if item is None or code not in item.type.events:
            return self.own("event", n=code)
        return self.runtime.texts.of_type(self.lang, item.type, f"event.{item.type.events[code]}")

    def priorities(self, item: Equipment | None) -> Mapping[int, int]:
        """Code of an event that is an alarm → its priority."""
        return {alarm.event: alarm.priority for alarm in item.alarms if alarm.event} if item else {}

    def moment(self, micros: int) -> str:
        """A time, with its day unless that is today."""
        return fmt.moment_or_time(micros, self.zone, self.lang, self.now, milliseconds=True)

    def clock(self, micros: int | None) -> str:
        """A time of the day; empty for none."""
        return "" if micros is None else fmt.clock_time(micros, self.zone, milliseconds=True, lang=self.lang)

    def iso(self, micros: int | None) -> str:
        """A time as programs read it."""
        return "" if micros is None else fmt.iso(micros, self.zone)

    def seconds(self, value: float) -> str:
        """A time as fine as one compares it: hundredths below ten seconds, tenths below a minute."""
        if value >= 59.95:
            return fmt.duration(value, self.lang)
        return fmt.quantity(value, 2 if value < 9.995 else 1, "s", self.lang)

    def short(self, value: float) -> str:
        """A time to the millisecond, where it is below ten seconds."""
        return fmt.quantity(value, 3, "s", self.lang) if value < 10 else self.seconds(value)

    def named(self, name: str) -> str:
        """A person as this reader may know them."""
        return shown_name(self.request, name)

    def said(self, words: str) -> str:
        """What a person wrote, as this reader may read it."""
        return shown_words(self.request, words)

    def part_names(self, id: str) -> Mapping[str, str]:
        """Part by its key → its name, of a machine whose parts an enumeration names."""
        item, parts = self.item(id), self.kind.parts
        point = item.type.points.get(parts.named) if item and parts else None
        return {str(number): self.of_type(key) for number, key in point.texts.items()} if point else {}

    def parts(self, one: Record) -> list[Part]:
        """The parts of a record in their order."""
        return [part for _, part in sorted(one.parts.items())]

    def glyph(self, state: str) -> str:
        """The sign of a state."""
        return GLYPHS.get(state, "")

    def value_behind(self, equipment: str, definition: Definition, part: int, bit: int, value: float | None) -> str:
        """The value behind a bit with its unit, while the machine that it is of still has the point."""
        key = definition.value(part, bit)
        if value is None or not key:
            return ""
        item = self.item(equipment)
        machine = self.item(item.machine) if item else None
        point = machine.points.get(key) if machine else None
        if point is None:
            return f"{key} {fmt.number(value, 2, self.lang)}"
        unit = fmt.unit_symbol(point.unit, lambda name, **given: self.view.text(self.request, name, **given))
        return fmt.quantity(value, point.decimals, unit, self.lang)

    def recipe(self, record: Record, definition: Definition) -> Iterator[tuple[str, str]]:
        """(label, value with its unit) of every value that a run was started with."""
        for number in range(1, MOST_VALUES + 1):
            point = point_of(number)
            value, key = record.fields.get(point), str(record.fields.get(f"{point}_name") or "")
            if isinstance(value, int | float):
                known = definition.recipe.get(key, {})
                unit = fmt.unit_symbol(
                    known.get("unit", ""), lambda name, **given: self.view.text(self.request, name, **given)
                )
                label = self.label(known.get("label", {})) or key or str(number)
                yield label, fmt.quantity(value, int(known.get("decimals", 1)), unit, self.lang)

    def item(self, equipment: str) -> Equipment | None:
        """The machine of this name, if the plant has it."""
        return self.runtime.plant.equipment.get(equipment) if self.runtime.plant else None
