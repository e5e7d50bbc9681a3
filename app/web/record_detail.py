"""One record with everything that happened, and who asked for it."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.historian.record_query import Asked, person
from app.historian.records import source_of
from app.plant.definitions import Equipment
from app.plant.kept import Definition
from app.records.event import Event
from app.records.kind import Shown
from app.records.record import Reading, Record
from app.web import format as fmt
from app.web.guard import shown_name, shown_words
from app.web.record_rows import row
from app.web.record_words import NOTHING, RecordWords


def detail(
    draw: RecordWords,
    one: Record,
    events: Sequence[Event],
    overlapping: Mapping[str, Sequence[Record]],
    asked: Mapping[int, Sequence[Asked]],
    known: Mapping[str, Definition],
) -> dict[str, Any]:
    """Everything of one record; `words` is this, for a template of the kind's own."""
    item, definition = draw.item(one.equipment), known.get(one.definition, Definition())
    own: Mapping[str, Any] = {}
    if draw.kind.hooks.detail is not None and (source := source_of(item) if item else None):
        own = draw.kind.hooks.detail(one, [source.reading(event) for event in events])
    return {
        "row": row(draw, one, known, asked[one.id]),
        "title": draw.label(definition.label) or draw.text("title"),
        "facts": [
            (draw.column(name), value)
            for name in draw.kind.details
            if (value := draw.value(one, name, definition, asked[one.id])) not in ("", NOTHING)
        ],
        "events": [_event(draw, item, one, event) for event in events],
        "record": one,
        "definition": definition,
        "asked": {
            event.id: (shown_name(draw.request, event.person), shown_words(draw.request, event.reason))
            for event in events
            if event.person
        },
        "overlapping": {
            name: [(each, known.get(each.definition, Definition()), person(None, asked[each.id])) for each in found]
            for name, found in overlapping.items()
        },
        "url": f"/equipment/{one.equipment}" if item else "",
        "words": draw,
        **own,
    }


def _event(draw: RecordWords, item: Equipment | None, one: Record, event: Event) -> dict[str, Any]:
    reading = _reading(item, event)
    shown = next((each for each in draw.kind.shown if event.code in each.events), Shown(frozenset()))
    named = [reading.words.get(word) for word in (draw.kind.number, draw.kind.also) if word]
    other = next((int(number) for number in named if number and number != one.number), 0)
    return {
        "time": draw.clock(event.time),
        "iso": fmt.iso(event.time, draw.zone),
        "after": fmt.duration((event.time - one.begun) / 1e6, draw.lang) if event.time > one.begun else "",
        "text": draw.event(item, event.code),
        "source": f"{shown.source}{event.source}" if shown.source and event.source else "",
        "value": _shown(draw, shown, event.value),
        "other": f"#{other}" if other else "",
        "priority": draw.priorities(item).get(event.code, 0),
        "person": shown_name(draw.request, event.person),
        "reason": shown_words(draw.request, event.reason),
    }


def _shown(draw: RecordWords, shown: Shown, value: float | None) -> str:
    if value is None or not shown.unit:
        return ""
    if shown.unit == "s":
        return fmt.duration(value, draw.lang)
    sign = "+" if shown.signed and value > 0 else ""
    return sign + fmt.quantity(value, shown.decimals, shown.unit, draw.lang)


def _reading(item: Equipment | None, event: Event) -> Reading:
    source = source_of(item) if item else None
    if source is None:
        return Reading(event.boot, event.sequence, event.time, event.code, str(event.code))
    return source.reading(event)
