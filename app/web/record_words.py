"""Records in the words of a request: rows, one with everything that happened, times of parts."""

from collections.abc import Mapping, Sequence
from typing import Any
from zlib import crc32

from fastapi import Request

from app.historian.record_export import keeping
from app.historian.record_query import Asked, PartTimes, Spread, person
from app.historian.records import source_of
from app.plant.definitions import Equipment
from app.plant.kept import Definition
from app.plant.record_kinds import COMMON, OR
from app.records.event import Event
from app.records.kind import Kind, Shown, Type
from app.records.record import OPEN, Part, Reading, Record
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


class Words:
    """Records of one kind in the language of a request."""

    def __init__(self, request: Request, kind: Kind) -> None:
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

    # ---- the list ---------------------------------------------------------------------------------------

    @property
    def columns(self) -> list[dict[str, Any]]:
        """Names and looks of the columns."""
        return [
            {
                "key": name.partition(OR)[0],
                "label": self._column(name.partition(OR)[0]),
                "minor": name in self.kind.minor,
                "right": self._at_right(name),
            }
            for name in self.kind.columns
        ]

    def _at_right(self, name: str) -> bool:
        field = self.kind.fields.get(name)
        return name in AT_RIGHT[:2] or (field is not None and field.type is Type.NUMBER)

    def _column(self, name: str) -> str:
        return self.own(name) if name in COMMON else self.text(f"column.{name}")

    def row(self, one: Record, known: Mapping[str, Definition], asked: Sequence[Asked]) -> dict[str, Any]:
        """One record as a line of the list."""
        item = self.item(one.equipment)
        definition = known.get(one.definition, Definition())
        cells = {
            name.partition(OR)[0]: next(
                (shown for part in name.split(OR) if (shown := self.value(one, part, definition, asked))), ""
            )
            for name in self.kind.columns
        }
        head = "number" if "number" in self.kind.columns else "begun"
        badges = [
            (field.badge, self.text(f"badge.{field.name}", n=one.fields[field.name]), field.badge.isalpha())
            for field in self.kind.fields.values()
            if field.badge and one.fields.get(field.name)
        ]
        return {
            "id": one.id,
            "equipment": one.equipment,
            "machine": self.label(item.label) if item else one.equipment,
            "iso": fmt.iso(one.begun, self.zone),
            "open": one.open,
            "seen": one.entry > 0,
            "missed": one.missed,
            "priority": min((self.priorities(item).get(code, 4) for code in one.alarms), default=0),
            "glyph": GLYPHS.get("active" if one.open else one.outcome, ""),
            "badges": badges,
            "cells": cells,
            "head": head,
            "mark": crc32(
                repr(
                    (one.outcome, one.ended, one.paused, one.missed, one.alarms, one.fields, cells, list(asked))
                ).encode()
            ),
        }

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
                return self.label(definition.labels.get(str(value), {})) or str(value or "")
            case Type.PART:
                label = self.label(definition.part(int(value or 0)))
                return f"{value} {label}".strip() if value else ""
            case Type.TIME:
                return self.moment(value) if isinstance(value, int) else ""
        if value is None or isinstance(value, str):
            return value or (NOTHING if field.unit else "")
        if field.unit == "s":
            return fmt.duration(value, self.lang)
        return fmt.quantity(value, field.decimals, field.unit, self.lang)

    def outcome(self, one: Record) -> str:
        """What became of a record; one whose time is over has ended, although nothing told it."""
        over = one.open and one.ended is not None and one.ended <= self.now
        return self.text(f"outcome.{self.kind.expired if over else one.outcome}")

    def choices(self, found: Sequence[Record], known: Mapping[str, Definition]) -> dict[str, str]:
        """Key by which one can filter → its name, in the order of the definition."""
        ranked = []
        for one in found:
            key, definition = str(one.fields[self.kind.key]), known[one.definition]
            place = list(definition.labels).index(key) if key in definition.labels else len(definition.labels)
            part = key.partition(".")[0]
            where = self.label(definition.parts.get(part, {}))
            name = self.label(definition.labels.get(key, {})) or key
            ranked.append((place, key, f"{where} · {name}" if where else name))
        return {key: name for _, key, name in sorted(ranked)}

    def alarm_choices(self) -> dict[str, str]:
        """Code of an event that is an alarm, and may be in a record → the event in words."""
        return {
            str(alarm.event): self.event(item, alarm.event)
            for item in keeping(self.runtime.plant, self.kind.name)
            for alarm in item.alarms
            if alarm.event
        }

    # ---- times of parts ---------------------------------------------------------------------------------

    def times(
        self,
        id: str,
        parts: Sequence[PartTimes],
        outcomes: Mapping[str, int],
        whole: Spread,
        newest: Definition | None = None,
    ) -> dict[str, Any]:
        """What the parts of a machine's records took."""
        item = self.item(id)
        labels = newest.parts if newest else {}
        order = {key: number for number, key in enumerate(labels, 1)}
        return {
            "equipment": id,
            "machine": self.label(item.label) if item else id,
            "outcomes": [
                (
                    self.text(f"outcome.{one}"),
                    fmt.number(outcomes[one], 0, self.lang),
                    GLYPHS.get("active" if one == OPEN else one, ""),
                )
                for one in self.kind.outcomes
                if one in outcomes
            ],
            "whole": None if whole.mean is None else self._spread(whole),
            "parts": [
                {
                    "number": order.get(one.key, NOTHING),
                    "label": self.label(labels.get(one.key, {})) or one.key,
                    **self._spread(one.spread),
                }
                for one in sorted(parts, key=lambda one: (order.get(one.key, 1000), one.number))
            ],
        }

    def _spread(self, one: Spread) -> dict[str, str]:
        said = {
            name: NOTHING if (value := getattr(one, name)) is None else self.seconds(value)
            for name in ("least", "mean", "most", "last")
        }
        return {"count": fmt.number(one.count, 0, self.lang)} | said

    # ---- one record -------------------------------------------------------------------------------------

    def detail(
        self,
        one: Record,
        events: Sequence[Event],
        overlapping: Mapping[str, Sequence[Record]],
        asked: Mapping[int, Sequence[Asked]],
        known: Mapping[str, Definition],
    ) -> dict[str, Any]:
        """Everything of one record; `words` is this, for a template of the kind's own."""
        item, definition = self.item(one.equipment), known.get(one.definition, Definition())
        own: Mapping[str, Any] = {}
        if self.kind.hooks.detail is not None and (source := source_of(item) if item else None):
            own = self.kind.hooks.detail(one, [source.reading(event) for event in events])
        return {
            "row": self.row(one, known, asked[one.id]),
            "title": self.label(definition.label) or self.text("title"),
            "facts": [
                (self._column(name), value)
                for name in self.kind.details
                if (value := self.value(one, name, definition, asked[one.id])) not in ("", NOTHING)
            ],
            "events": [self._event(item, one, event) for event in events],
            "record": one,
            "definition": definition,
            "asked": {
                event.id: (shown_name(self.request, event.person), shown_words(self.request, event.reason))
                for event in events
                if event.person
            },
            "overlapping": {
                name: [(each, known.get(each.definition, Definition()), person(None, asked[each.id])) for each in found]
                for name, found in overlapping.items()
            },
            "url": f"/equipment/{one.equipment}" if item else "",
            "words": self,
            **own,
        }

    def _event(self, item: Equipment | None, one: Record, event: Event) -> dict[str, Any]:
        reading = self._reading(item, event)
        shown = next((each for each in self.kind.shown if event.code in each.events), Shown(frozenset()))
        named = [reading.words.get(word) for word in (self.kind.number, self.kind.also) if word]
        other = next((int(number) for number in named if number and number != one.number), 0)
        return {
            "time": self.clock(event.time),
            "iso": fmt.iso(event.time, self.zone),
            "after": fmt.duration((event.time - one.begun) / 1e6, self.lang) if event.time > one.begun else "",
            "text": self.event(item, event.code),
            "source": f"{shown.source}{event.source}" if shown.source and event.source else "",
            "value": self._shown(shown, event.value),
            "other": f"#{other}" if other else "",
            "priority": self.priorities(item).get(event.code, 0),
            "person": shown_name(self.request, event.person),
            "reason": shown_words(self.request, event.reason),
        }

    def _shown(self, shown: Shown, value: float | None) -> str:
        if value is None or not shown.unit:
            return ""
        if shown.unit == "s":
            return fmt.duration(value, self.lang)
        sign = "+" if shown.signed and value > 0 else ""
        return sign + fmt.quantity(value, shown.decimals, shown.unit, self.lang)

    def _reading(self, item: Equipment | None, event: Event) -> Reading:
        source = source_of(item) if item else None
        if source is None:
            return Reading(event.boot, event.sequence, event.time, event.code, str(event.code))
        return source.reading(event)

    # ---- small words ------------------------------------------------------------------------------------

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
        if fmt.date(micros, self.zone, self.lang) == fmt.date(self.now, self.zone, self.lang):
            return self.clock(micros)
        return fmt.date_time(micros, self.zone, self.lang, self.now)

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

    def item(self, equipment: str) -> Equipment | None:
        """The machine of this name, if the plant has it."""
        return self.runtime.plant.equipment.get(equipment) if self.runtime.plant else None
