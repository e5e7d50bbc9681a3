"""What stood before and what stands after a line of the audit, in the reader's words: names, numbers with units, texts of a state.

What nobody can put into words any more, because the plant has no such machine or value now, stays as it was written down.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan

from fastapi import Request

from app.access.audit.line import Record
from app.commands import parameter_change
from app.commands.open_sets import values_of
from app.errors import Refused
from app.plant.definitions import Equipment, Point, TrainingWord
from app.plant.training import text_of_code
from app.sim import training
from app.web import format as fmt
from app.web.drive_values import element_in, number_text, value_text
from app.web.language import language_of
from app.web.operation import Operation
from app.web.points import EquipmentView
from app.web.signin import view_of

MOST_INLINE = 2
"""So many values stand in a cell; more are unfolded from it."""
_PAIR = re.compile(r"(\w+) = ([^,]+)")
_WORD = re.compile(r"0x([0-9A-F]{4}) = (\d+)")
_AS_WRITTEN = re.compile(r"-?[0-9]+(\.[0-9]+)?(e[+-][0-9]+)?")
"""A number as Python writes one."""
_CHANGE = re.compile(r"(added|removed|changed) (\w+)")
_JOIN = " · "


@dataclass(frozen=True, slots=True)
class Told:
    """One cell."""

    text: str
    parts: Sequence[str] = ()
    """What unfolds from it, one a line; empty = the text is all."""


def told(request: Request, line: Record) -> tuple[Told, Told]:
    """Before and after."""
    machine, _, key = line.object.partition(".")
    plant = view_of(request).runtime(request).plant
    item = plant.equipment.get(machine) if plant else None
    family = line.kind.partition(".")[0]
    if family == "command" and item is not None:
        return _of_command(request, line, item, key)
    if family == "plant":
        parts = [_of_plant(request, part) for part in line.new.split(_JOIN) if part]
        return Told(""), _listed(request, parts, "audit.changes", 0 if line.kind == "plant.edited" else MOST_INLINE)
    say = _teller(request, line, item)
    return Told(say(line.old)), Told(say(line.new))


def _teller(request: Request, line: Record, item: Equipment | None) -> Callable[[str], str]:
    """What puts a value of such a line into words."""
    view, family = view_of(request), line.kind.partition(".")[0]
    if family == "person" and line.kind != "person.renamed":
        return lambda text: _each(request, text, "access.role")
    if line.kind == "token.created":
        return lambda text: _each(request, text, "access.permission")
    if line.kind in ("alarm.acknowledged", "alarm.reset"):
        return lambda _occurrence: ""  # a number that says nothing to a person
    if line.kind == "alarm.shelved":
        return lambda text: text.replace(" one-shot", f", {view.text(request, 'alarm.once')}")
    if line.kind == "lesson.begun":
        return lambda name: _lesson(request, name)
    if line.kind == "instructor.speed":
        return lambda text: f"{text}×" if text else ""
    if item is None:
        return str
    drawn = view.machine(request, item)
    if line.kind == "lesson.cause":
        return lambda text: _fault(drawn, item.type.training.faults.get(text, 0)) if text else ""
    if family == "instructor":
        return lambda text: _WORD.sub(lambda word: _trained(drawn, int(word[1], 16), int(word[2])), text)
    return str


def _lesson(request: Request, name: str) -> str:
    """The title of a lesson; of one that is no more its name."""
    runtime = view_of(request).runtime(request)
    lesson = runtime.classroom.lessons.get(name)
    return runtime.texts.label(language_of(request), lesson.title) if lesson else name


def _of_command(request: Request, line: Record, item: Equipment, key: str) -> tuple[Told, Told]:
    drawn = view_of(request).machine(request, item)
    if values := values_of(line.parameters, parameter_change.MOST):
        of = _element if key == parameter_change.KEY else _setpoint
        operation = Operation(request, item)
        both = [(of(operation, name, old), of(operation, name, new)) for name, old, new, *_ in values]
        return (
            _listed(request, [old for old, _ in both], "audit.values"),
            _listed(request, [new for _, new in both], "audit.values"),
        )
    command = item.type.commands.get(key)
    point = item.points.get(command.argument if command else key)
    arguments = {one.name: one for one in command.arguments} if command else {}

    def pair(name: str, text: str) -> str:
        value, argument = number_of(text), arguments.get(name)
        if argument is not None:
            unit = fmt.unit_symbol(argument.unit, drawn.text)
            said = text if value is None else fmt.quantity(value, argument.decimals, unit, drawn.lang)
            return f"{drawn.t(argument.label)} {said}"
        held = item.points.get(name)
        return f"{drawn.t(held.label)} {of_point(drawn, held, text)}" if held else f"{name} {text}"

    def say(text: str) -> Told:
        if pairs := _PAIR.findall(text):
            return _listed(request, [pair(*one) for one in pairs], "audit.values")
        return Told(of_point(drawn, point, text) if point else text)

    return say(line.old), say(line.new)


def of_point(drawn: EquipmentView, point: Point, text: str) -> str:
    """A value of `point` that is written down as `text`: the text of a state, or a number with its unit."""
    value = number_of(text)
    if value is None:
        return text
    if (label := point.texts.get(int(value))) and value.is_integer():
        return drawn.t(label)
    return fmt.quantity(value, point.decimals, fmt.unit_symbol(point.unit, drawn.text), drawn.lang)


def _setpoint(operation: Operation, key: str, value: float) -> str:
    drawn = operation.equipment
    point = drawn.equipment.points.get(key)
    if point is None:
        return f"{key} {number_text(value, drawn.lang)}"
    return f"{drawn.t(point.label)} {of_point(drawn, point, repr(value))}"


def _element(operation: Operation, key: str, value: float) -> str:
    drawn = operation.equipment
    try:
        _, parameter, _ = element_in(drawn.equipment.type, key)
    except Refused:
        return f"{key} {number_text(value, drawn.lang)}"
    unit = fmt.unit_symbol(parameter.unit, drawn.text)
    label = f" {drawn.t(parameter.label)}" if parameter.label else ""
    said = value_text(operation, parameter, value)
    return f"{key.partition(':')[2]}{label} {said}{fmt.SPACE if unit else ''}{unit}"


def _listed(request: Request, parts: Sequence[str], key: str, inline: int = MOST_INLINE) -> Told:
    if len(parts) <= inline:
        return Told(", ".join(parts))
    return Told(view_of(request).text(request, key, count=len(parts)), parts) if parts else Told("")


def _of_plant(request: Request, text: str) -> str:
    """A change of the plant files with the name of the machine; a detail of an edited sequence stays as it stands in the file."""
    found = _CHANGE.fullmatch(text)
    if found is None:
        return text
    view = view_of(request)
    plant = view.runtime(request).plant
    item = plant.equipment.get(found[2]) if plant else None
    name = view.machine(request, item).label if item else found[2]
    return view.text(request, f"plant.{found[1]}", what="", name=name).strip()


def _each(request: Request, text: str, family: str) -> str:
    view = view_of(request)
    texts, lang = view.runtime(request).texts, language_of(request)
    parts = text.split(", ")
    return ", ".join(
        view.text(request, f"{family}.{one}") if texts.has(lang, f"{family}.{one}") else one for one in parts
    )


def _trained(drawn: EquipmentView, register: int, value: int) -> str:
    """A training register in words: the fault by its name, what is set by its label."""
    trained = drawn.equipment.type.training
    if register == training.REG_MACHINE_FAULT:
        return _fault(drawn, value)
    if register == training.REG_LINE_FAULT:
        return drawn.text(f"instructor.mode.{value}")
    words: Mapping[str, TrainingWord] = {**trained.world, **trained.acts, **trained.switches}
    for name, word in words.items():
        if word.register == register:
            label = drawn.t(f"{drawn.type}.training.{name}")
            return f"{label} {fmt.quantity(value, 0, fmt.unit_symbol(word.unit, drawn.text), drawn.lang)}"
    return str(value)


def _fault(drawn: EquipmentView, code: int) -> str:
    kind = drawn.equipment.type
    if not code:
        return drawn.text("instructor.mode.0")
    if kind.training.names:
        key = drawn.equipment.points[kind.training.names].texts.get(code, "")
        return drawn.t(key) if key else str(code)
    key = text_of_code(kind.texts, "training.fault", code)
    return drawn.t(key).replace("{n}", str(code % (10 if code < 100 else 100))) if key else str(code)


def number_of(text: str) -> float | None:
    """The number that was written down as `text`. What somebody typed and the gate refused, such as `nan` or `1_000`, is none."""
    value = float(text) if _AS_WRITTEN.fullmatch(text) else nan
    return value if isfinite(value) else None
