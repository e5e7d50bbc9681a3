"""The newest records of a kind beside one another: a line for everything that is known of them, a column for each."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.historian.record_query import Asked
from app.plant.kept import Definition
from app.plant.record_kinds import OR
from app.records.record import Part, Record
from app.web import format as fmt
from app.web.record_words import GLYPHS, NOTHING, RecordWords

COUNT = 10
"""Records."""
APART = ("begun", "outcome", "ended")
"""What stands above the columns, or follows from it and the duration."""


def table(
    draw: RecordWords,
    found: Sequence[Record],
    known: Mapping[str, Definition],
    asked: Mapping[int, Sequence[Asked]],
    parts: Mapping[int, Mapping[int, Part]],
) -> dict[str, Any]:
    """Columns and lines of `found`, newest first. A line that says nothing of any of them is left out."""
    definitions = {one.id: known.get(one.definition, Definition()) for one in found}
    names = _names(draw, len({one.equipment for one in found}) > 1)
    told = {name: [draw.value(one, name, definitions[one.id], asked[one.id]) for one in found] for name in names}
    lines = [(draw.column(name), cells) for name, cells in told.items() if any(cells)]
    lines += _parts(draw, found, definitions, parts)
    return {
        "columns": [
            {
                "id": one.id,
                "begun": draw.value(one, "begun", definitions[one.id], ()),
                "iso": fmt.iso(one.begun, draw.zone),
                "outcome": draw.outcome(one),
                "glyph": GLYPHS.get("active" if one.open else one.outcome, ""),
            }
            for one in found
        ],
        "lines": [{"label": label, "cells": [cell or NOTHING for cell in cells]} for label, cells in lines],
    }


def _names(draw: RecordWords, several: bool) -> list[str]:
    """Lines before those of the parts: the columns of the list, then what else is told of one; times of parts are lines of their own."""
    kind = draw.kind
    listed = [part for name in kind.columns for part in name.split(OR) if several or part != "equipment"]
    of_parts = {name for name, one in kind.fields.items() if kind.parts and one.unit == "s"}
    return [
        name for name in dict.fromkeys((*listed, *kind.details, "alarms")) if name not in APART and name not in of_parts
    ]


def _parts(
    draw: RecordWords,
    found: Sequence[Record],
    definitions: Mapping[int, Definition],
    parts: Mapping[int, Mapping[int, Part]],
) -> list[tuple[str, list[str]]]:
    """Name of a part → what it took in each of `found`; one that came more than once in a record with all that it took."""
    seconds: dict[str, dict[int, float]] = {}
    labels: dict[str, str] = {}
    order: dict[str, tuple[int, int]] = {}
    for one in found:
        named, given = draw.part_names(one.equipment), definitions[one.id].parts
        places = {key: number for number, key in enumerate(given)}
        for part in parts[one.id].values():
            labels.setdefault(part.key, draw.label(given.get(part.key, {})) or named.get(part.key, part.key))
            order.setdefault(part.key, (places.get(part.key, 1000), part.number))
            if part.seconds is not None:
                took = seconds.setdefault(part.key, {})
                took[one.id] = took.get(one.id, 0.0) + part.seconds
    return [
        (labels[key], [draw.seconds(took[one.id]) if one.id in took else "" for one in found])
        for key in sorted(order, key=lambda key: order[key])
        for took in [seconds.get(key, {})]
    ]
