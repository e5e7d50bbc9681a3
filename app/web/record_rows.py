"""The list of the records of a kind: its columns, its rows, and what one can filter by."""

from collections.abc import Mapping, Sequence
from typing import Any
from zlib import crc32

from app.historian.record_export import keeping
from app.historian.record_query import Asked
from app.plant.kept import Definition
from app.plant.record_kinds import OR
from app.records.kind import Type
from app.records.record import Record
from app.web import format as fmt
from app.web.record_words import GLYPHS, RecordWords

AT_RIGHT = ("duration", "seconds")
"""Columns that are numbers, beside fields that are."""


def columns(draw: RecordWords) -> list[dict[str, Any]]:
    """Names and looks of the columns."""
    return [
        {
            "key": name.partition(OR)[0],
            "label": draw.column(name.partition(OR)[0]),
            "minor": name in draw.kind.minor,
            "right": _at_right(draw, name),
        }
        for name in draw.kind.columns
    ]


def row(draw: RecordWords, one: Record, known: Mapping[str, Definition], asked: Sequence[Asked]) -> dict[str, Any]:
    """One record as a line of the list."""
    item = draw.item(one.equipment)
    definition = known.get(one.definition, Definition())
    cells = {
        name.partition(OR)[0]: next(
            (shown for part in name.split(OR) if (shown := draw.value(one, part, definition, asked))), ""
        )
        for name in draw.kind.columns
    }
    head = "number" if "number" in draw.kind.columns else "begun"
    badges = [
        (field.badge, draw.text(f"badge.{field.name}", n=one.fields[field.name]), field.badge.isalpha())
        for field in draw.kind.fields.values()
        if field.badge and one.fields.get(field.name)
    ]
    return {
        "id": one.id,
        "equipment": one.equipment,
        "machine": draw.label(item.label) if item else one.equipment,
        "iso": fmt.iso(one.begun, draw.zone),
        "open": one.open,
        "seen": one.entry > 0,
        "missed": one.missed,
        "priority": min((draw.priorities(item).get(code, 4) for code in one.alarms), default=0),
        "glyph": GLYPHS.get("active" if one.open else one.outcome, ""),
        "badges": badges,
        "cells": cells,
        "head": head,
        "mark": crc32(
            repr((one.outcome, one.ended, one.paused, one.missed, one.alarms, one.fields, cells, list(asked))).encode()
        ),
    }


def key_choices(draw: RecordWords, found: Sequence[Record], known: Mapping[str, Definition]) -> dict[str, str]:
    """Key by which one can filter → its name, in the order of the definition."""
    ranked = []
    for one in found:
        key, definition = str(one.fields[draw.kind.key]), known[one.definition]
        place = list(definition.labels).index(key) if key in definition.labels else len(definition.labels)
        part = key.partition(".")[0]
        where = draw.label(definition.parts.get(part, {}))
        name = draw.label(definition.labels.get(key, {})) or key
        ranked.append((place, key, f"{where} · {name}" if where else name))
    return {key: name for _, key, name in sorted(ranked)}


def alarm_choices(draw: RecordWords) -> dict[str, str]:
    """Code of an event that is an alarm, and may be in a record → the event in words."""
    return {
        str(alarm.event): draw.event(item, alarm.event)
        for item in keeping(draw.runtime.plant, draw.kind.name)
        for alarm in item.alarms
        if alarm.event
    }


def _at_right(draw: RecordWords, name: str) -> bool:
    field = draw.kind.fields.get(name)
    return name in AT_RIGHT or (field is not None and field.type is Type.NUMBER)
