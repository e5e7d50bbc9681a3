"""All parameters of a drive: searched, by group, read when somebody asks, each with the time at which it was read.

They are behind its mailbox, or registers found by their codes: then any number may be asked for, also one of which nothing is known.

Reading takes a while (a request of at most 39 parameters takes tens of milliseconds, on a serial line more), so it goes on beside the
page, which looks how far it is. One reading per machine goes on at a time: who asks for another one takes its place. What was read
stays until the server ends; it is never shown without its time, for nothing tells when it changes.

Which drive objects there are is asked first (r0102, p0101 of object 1): a drive with one has everything there.
"""

import asyncio
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.commands.parameter_change import SAVES, element_name, held
from app.errors import LinkError, Refused
from app.links.mailbox import Missed, Outcome, ParameterAccess
from app.plant.register_parameters import codes_in, unknown
from app.profidrive.parameter_access.error_numbers import key_of, shown
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Failed, Values
from app.profidrive.parameter_access.parameter import DriveParameter
from app.web import format as fmt
from app.web.commands import operation_of, wants_fragment
from app.web.drive_mailbox import (
    CONTROL_UNIT,
    drive_among,
    has_objects,
    kept_of,
    mailbox_of,
    objects_of,
    problem_of,
    told_of,
)
from app.web.drive_values import confirmed, parameter_of, permitted_text, value_text
from app.web.drive_writing import drive_of, list_context
from app.web.guard import allow, fields
from app.web.operation import Operation
from app.web.pages import view_of

router = APIRouter()

LONGEST_SEARCH = 80
ELEMENTS_SHOWN = 8
"""Of an array; how many more there are is told."""
EVERY, CHANGED = "every", "changed"
"""What is shown besides what is known: every code that a drive may have; only what is not at its default."""

Place = tuple[int, str]
"""Drive object, code."""


@dataclass(frozen=True, slots=True)
class Found:
    """What the drive said, and when [µs UTC]."""

    outcome: Outcome
    time: int


@dataclass(slots=True)
class Reading:
    """What is being read of one machine."""

    count: int
    done: int = 0
    problem: str = ""
    """Text key; empty = it goes well."""
    params: Mapping[str, object] = field(default_factory=dict)
    task: asyncio.Task[None] | None = None

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.task is None or self.task.done()


@dataclass(slots=True)
class Machine:
    """What was read of one machine, and what is being read."""

    found: dict[Place, Found] = field(default_factory=dict)
    objects: tuple[int, ...] = ()
    """Its drive objects; none = not known yet."""
    reading: Reading | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """Which parameters somebody wants to see."""

    search: str
    group: str
    show: str
    """EVERY, CHANGED or nothing."""


@dataclass(frozen=True, slots=True)
class Row:
    """One parameter of one drive object."""

    parameter: DriveParameter
    object: int
    label: str
    unit: str
    permitted: str
    elements: Sequence[tuple[str, str]]
    """(element, how it is called) that may be written."""
    confirmed: bool
    value: str
    """As read; empty when it was not."""
    more: int
    """Elements that are not shown."""
    problem: str
    """Why there is no value."""
    time: str
    default: str
    """Empty when none is known."""
    changed: bool
    """Whether it was read and is another one than the default."""


@router.get("/equipment/{key}/drive-parameters", dependencies=[allow("configure")])
async def page(request: Request, key: str) -> HTMLResponse:
    """The parameters that the search and the group let through."""
    operation = operation_of(request, key)
    machine = operation.equipment
    return view_of(request).page(
        request,
        "pages/drive_parameters.html",
        title=machine.text("dpar.title"),
        kind=f"parameters/{machine.id}",
        area=machine.area,
        chip=machine.id,
        up=operation.url,
        message=operation.story,
        groups=_groups(operation, machine_of(request.app, operation), _asked(request.query_params).show),
        **(list_context(request, operation) | _rows(request, operation, _asked(request.query_params))),
    )


@router.get("/equipment/{key}/drive-parameters/rows", dependencies=[allow("configure")])
async def rows(request: Request, key: str) -> HTMLResponse:
    """The table alone, while values come in."""
    found = _rows(request, operation_of(request, key), _asked(request.query_params))
    return view_of(request).fragment(request, "fragments/drive_parameter_rows.html", **found)


@router.post("/equipment/{key}/drive-parameters/read", dependencies=[allow("configure")])
async def read(request: Request, key: str) -> Response:
    """Read what the search and the group let through, or cancel what is being read."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("q", "group", "show", "cancel"))
    asked = _asked(form)
    machine = machine_of(request.app, operation)
    if machine.reading is not None and machine.reading.task is not None:
        machine.reading.task.cancel()
    if not form["cancel"]:
        machine.reading = begin_reading(operation, machine, lambda: _wanted(operation, machine, asked))
    if not wants_fragment(request):
        return RedirectResponse(form["next"] or f"{operation.url}/drive-parameters", 303)
    found = _rows(request, operation, asked)
    return view_of(request).fragment(request, "fragments/drive_parameter_rows.html", **found)


def _asked(given: Mapping[str, str]) -> Asked:
    show = given.get("show", "")
    return Asked(given.get("q", "")[:LONGEST_SEARCH], given.get("group", ""), show if show in (EVERY, CHANGED) else "")


def begin_reading(
    operation: Operation, machine: Machine, wanted: Callable[[], Sequence[tuple[int, DriveParameter]]]
) -> Reading:
    """Read what is `wanted` beside the page; it is asked again once the drive objects are known."""
    reading = Reading(len(wanted()))
    mailbox = mailbox_of(operation)

    async def work() -> None:
        try:
            if not machine.objects:
                machine.objects = await objects_of(operation, mailbox)
            found = wanted()
            reading.count = len(found)
            await _read(operation, machine, reading, found, mailbox)
        except (LinkError, Refused) as error:
            reading.problem, reading.params = problem_of(error)

    reading.task = asyncio.create_task(work(), name=f"drive parameters {operation.id}")
    return reading


async def _read(
    operation: Operation,
    machine: Machine,
    reading: Reading,
    wanted: Sequence[tuple[int, DriveParameter]],
    mailbox: ParameterAccess,
) -> None:
    """One drive object after the other; what came is kept, also when the rest fails."""
    clock = operation.runtime.clock
    for object in sorted({object for object, _ in wanted}):
        members = [parameter for one, parameter in wanted if one == object]
        addresses = [Address(one.number, 0, one.count) for one in members]
        formats: list[Format | None] = [one.format for one in members]
        before = reading.done

        def progress(done: int, count: int, before: int = before) -> None:
            reading.done = before + done

        told = await mailbox.read(object, addresses, formats, progress)
        for parameter, result in zip(members, told, strict=True):
            machine.found[object, parameter.code] = Found(result, clock.micros())
        missed = next((result for result in told if isinstance(result, Missed)), None)
        if missed is not None:
            raise missed.error


def machine_of(app: FastAPI, operation: Operation) -> Machine:
    """What was read of the machine."""
    return kept_of(app, operation, "drive_parameters", Machine)


def _parameters(operation: Operation) -> Mapping[str, DriveParameter]:
    """Raises:
    HTTPException: 404, the machine has none.
    """
    parameters = operation.equipment.equipment.type.drive_parameters
    if not parameters:
        raise HTTPException(404)
    return parameters


def _groups(operation: Operation, machine: Machine, show: str) -> list[tuple[str, str, int]]:
    """Key, text and number of rows of every group; where codes order them in the order of the codes, else of their texts."""
    counts = Counter(one.group for _, one in _wanted(operation, machine, Asked("", "", show)))
    t = operation.equipment.t
    found = ((key, t(f"parameter.group.{key}"), count) for key, count in counts.items())
    return sorted(found, key=lambda row: row[1] if has_objects(operation) else row[0])


def _listed(operation: Operation, show: str) -> Mapping[str, DriveParameter]:
    """By code: what is known, or every code that the drive may have."""
    known, map = _parameters(operation), operation.equipment.equipment.type.device.parameters
    if show != EVERY or map is None:
        return known
    found = {code: one for code in codes_in(map) if (one := known.get(code) or unknown(code)) is not None}
    return dict(sorted((found | dict(known)).items(), key=lambda one: one[1].number))


def places(parameter: DriveParameter, objects: Sequence[int]) -> list[int]:
    """The drive objects in which a drive with `objects` has a parameter: that of the drive is the first one beside the Control Unit."""
    if not objects:
        return list(parameter.objects)
    drive = drive_among(objects)
    return list(dict.fromkeys(CONTROL_UNIT if one == CONTROL_UNIT else drive for one in parameter.objects))


def _wanted(operation: Operation, machine: Machine, asked: Asked) -> list[tuple[int, DriveParameter]]:
    """(drive object, parameter) of everything whose number or name holds the search, in the group; all when both are empty.

    A code that is written out is found although nothing is known of it."""
    text, t = asked.search.strip().casefold(), operation.equipment.t
    listed = _listed(operation, asked.show)
    found = []
    for code, parameter in listed.items():
        named = text in code.casefold() or text == str(parameter.number) or text in t(parameter.text_key).casefold()
        if named and asked.group in ("", parameter.group):
            found += [(object, parameter) for object in places(parameter, machine.objects)]
    alone = None if found else parameter_of(operation.equipment.equipment.type, text.upper())
    return [(object, alone) for object in alone.objects] if alone is not None else found


def _rows(request: Request, operation: Operation, asked: Asked) -> dict[str, Any]:
    machine = machine_of(request.app, operation)
    reading = machine.reading
    wanted = _wanted(operation, machine, asked)
    written = drive_of(request, operation).written
    problem = ""
    if reading is not None and reading.problem:
        problem = operation.words.text(reading.problem, reading.params)
    rows = [_row(operation, machine, written, *one) for one in wanted]
    return {
        "operation": operation,
        "equipment": operation.equipment,
        "rows": [row for row in rows if row.changed] if asked.show == CHANGED else rows,
        "reading": reading if reading is not None and not reading.over else None,
        "problem": problem,
        "search": asked.search,
        "group": asked.group if any(asked.group == one.group for _, one in wanted) else "",
        "show": asked.show,
        "unread": sum(not row.time for row in rows),
        "changed_count": sum(row.changed for row in rows),
        "objects": has_objects(operation),
        "numbered": operation.equipment.equipment.type.device.parameters is not None,
    }


def _row(
    operation: Operation, machine: Machine, written: Mapping[Place, int], object: int, parameter: DriveParameter
) -> Row:
    drawn, found = operation.equipment, machine.found.get((object, parameter.code))
    if found is not None and found.time < written.get((object, parameter.code), 0):
        found = None
    value, more, problem, changed = "", 0, "", False
    has_default = parameter.has_default and parameter.writable and not parameter.count
    if found is not None and isinstance(found.outcome, Values):
        numbers = [parameter.in_unit(one) for one in found.outcome.values]
        values = [value_text(operation, parameter, one) for one in numbers]
        value, more = " · ".join(values[:ELEMENTS_SHOWN]), max(0, len(values) - ELEMENTS_SHOWN)
        changed = has_default and numbers[0] != held(parameter, parameter.default)
    elif found is not None and isinstance(found.outcome, Failed):
        said = shown(found.outcome.number)
        problem = f"{said} {drawn.text(key_of(found.outcome.number), number=said)}"
    elif found is not None and isinstance(found.outcome, Missed):
        problem = operation.words.text(*told_of(found.outcome.error))
    return Row(
        parameter,
        object,
        drawn.t(parameter.text_key),
        fmt.unit_symbol(parameter.unit, drawn.text) if parameter.unit else "",
        permitted_text(parameter, drawn.lang),
        _keys(object, parameter),
        confirmed(parameter),
        value,
        more,
        problem,
        operation.words.time(found.time) if found is not None else "",
        _default_text(operation, parameter) if has_default else "",
        changed,
    )


def _default_text(operation: Operation, parameter: DriveParameter) -> str:
    """Without the text of an option, which stands where the value is chosen."""
    plain = replace(parameter, options={})
    return value_text(operation, plain, plain.default)


def _keys(object: int, parameter: DriveParameter) -> list[tuple[str, str]]:
    """(element, how it is called) of what may be put into the list of new values."""
    if not parameter.writable or parameter.code in SAVES:
        return []
    names = [element_name(parameter, index) for index in range(parameter.elements)]
    return [(f"{object}:{name}", name) for name in names]
