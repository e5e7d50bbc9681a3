"""The review of what was typed on the parameter page: each new value beside what the device holds, and why it cannot be written."""

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass

from app.commands.entry import parse_number
from app.errors import Refused
from app.web import format as fmt
from app.web.operation import Operation
from app.web.parameter_rows import Parameter, groups_of

NEW, SEEN, SAID = "new.", "seen.", "said."
"""Before the key of a parameter, the field of: what is typed; what the device held when that began; what was typed when it was reviewed."""
NO_VALUE = "\u2013"
"""Drawn where the device's own value is not known."""


@dataclass(frozen=True, slots=True)
class Line:
    """A new value as it was typed."""

    row: Parameter
    typed: str
    was: str
    """What the device holds now, as drawn."""
    now: str
    part: str
    """How much more or less that is, in % of what it was; empty = not to be said."""
    problem: str
    """Why it cannot be written; empty = nothing is known against it."""
    seen: str
    """What the device held when the edit began, as scripts write it; empty = not known."""


def field_names(operation: Operation) -> list[str]:
    """Every field that the page may send of its parameters."""
    return [f"{part}{key}" for key in operation.equipment.equipment.type.setpoints for part in (NEW, SEEN, SAID)]


def typed_of(form: Mapping[str, str]) -> dict[str, str]:
    """Key → what was typed, of the fields that are not empty."""
    return {
        name.removeprefix(NEW): text.strip() for name, text in form.items() if name.startswith(NEW) and text.strip()
    }


def seen_of(form: Mapping[str, str]) -> dict[str, str]:
    """Key → what the device held when the edit began, as the last review has kept it."""
    return {name.removeprefix(SEEN): text for name, text in form.items() if name.startswith(SEEN) and text}


def is_reviewed(form: Mapping[str, str]) -> bool:
    """Whether what is typed is what the person was shown beside the values of the device."""
    return all(form[f"{SAID}{key}"] == text for key, text in typed_of(form).items())


def reviewed(operation: Operation, typed: Mapping[str, str], seen: Mapping[str, str]) -> list[Line]:
    """What was typed, in the order of the page. Whoever drops a value from the list begins anew with it."""
    rows: Iterable[Parameter] = (row for group in groups_of(operation, typed) for row in group.rows)
    return [_line(operation, row, typed, seen.get(row.key, "")) for row in rows]


def _line(operation: Operation, row: Parameter, typed: Mapping[str, str], seen: str) -> Line:
    point, text = row.point, typed[row.key]
    held = float(point.value) if point.usable and isinstance(point.value, int | float) else None
    value, problem = _read(operation, row, text, typed)
    part = ""
    if not row.options and held and value is not None:
        part = f"{'+' if value > held else ''}{fmt.percent(100 * (value - held) / abs(held), 0, point.lang)}"
    now = row.options.get(text, text)
    was = NO_VALUE if held is None else row.options.get(f"{held:g}", point.text)
    return Line(row, text, was, now, part, problem, seen or ("" if held is None else repr(held)))


def _read(operation: Operation, row: Parameter, text: str, typed: Container[str]) -> tuple[float | None, str]:
    """What was typed as a number, None when it is none; and what is wrong with it."""
    permitted = operation.equipment.text("par.out", permitted=f"{row.permitted} {row.point.unit}".rstrip())
    if row.options:
        return (None, "") if text in row.options else (None, permitted)
    try:
        value = parse_number(text, row.point.lang, operation.equipment.equipment.points[row.key].unit)
    except Refused as refusal:
        return None, operation.words.refusal(refusal)
    if any(key in typed for key in row.depends):
        return value, ""  # limits that come from another value of this set are for the gate to judge
    low = float("-inf") if row.low is None else row.low
    high = float("inf") if row.high is None else row.high
    return value, "" if low <= value <= high else permitted
