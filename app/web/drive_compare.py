"""The parameters of a drive beside those of another one or of a file: taken home as CSV or JSON, compared, put into the list of new values.

A file comes in pieces, because no request here is longer than 16 kB. What it says is checked line by line before anything is compared. Both
sides are read from their drives first; what differs goes into the list of the person, where it is reviewed and written like what was typed:
a comparison is the dry run of an import.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.commands.parameter_change import MOST, SAVES
from app.commands.parameter_file import (
    LARGEST,
    MOST_WRONG,
    Difference,
    Element,
    Told,
    Wrong,
    compared,
    csv_text,
    json_text,
    read_file,
)
from app.errors import LinkError, Refused
from app.historian.export import defused
from app.profidrive.parameter_access.messages import Values
from app.profidrive.parameter_access.parameter import DriveParameter
from app.web import format as fmt
from app.web.commands import operation_of, wants_fragment
from app.web.drive_mailbox import has_objects, kept_of, problem_of
from app.web.drive_parameters import Machine, begin_reading, machine_of, places
from app.web.drive_values import number_text, parameter_of, value_text
from app.web.drive_writing import drive_of
from app.web.guard import allow, fields, person_of
from app.web.operation import Operation
from app.web.pages import view_of

router = APIRouter()

PIECE = 12_000
"""Characters of a piece of a file, as it is sent."""
MOST_KEPT = 50
"""Sessions whose comparisons of one drive are kept."""
DIFFERENT, ALL, MISSING = "", "all", "missing"
"""What is shown: what differs; everything; what one side lacks."""


@dataclass(slots=True)
class Comparison:
    """What one session compares a drive with."""

    title: str = ""
    """Name of the file, or id of the other machine; empty = nothing yet."""
    other: str = ""
    """Id of the other machine; empty = a file."""
    elements: Mapping[str, Element] = field(default_factory=dict)
    """Of the file."""
    wrong: Sequence[Wrong] = ()
    pieces: list[str] = field(default_factory=list)
    """Of a file that is coming."""
    problem: str = ""


@dataclass(slots=True)
class Comparisons:
    """Of one drive, by session."""

    found: dict[str, Comparison] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the comparison, as drawn."""

    key: str
    name: str
    object: int
    label: str
    unit: str
    here: str
    there: str
    same: bool
    lacks: bool
    takes: bool
    """It can be put into the list."""
    individual: bool = False
    """It belongs to one drive alone."""


# ---- home as a file -------------------------------------------------------------------------------------------


@router.get("/equipment/{key}/drive-parameters/export.csv", dependencies=[allow("configure")])
async def export_csv(request: Request, key: str) -> Response:
    """What was read of the drive, as CSV."""
    operation = operation_of(request, key)
    await _read_what_was_written(request, operation)
    text = csv_text(_told(request, operation), _codes(operation), defused)
    return _file(operation, "\ufeff" + text, "csv", "text/csv; charset=utf-8")


@router.get("/equipment/{key}/drive-parameters/export.json", dependencies=[allow("configure")])
async def export_json(request: Request, key: str) -> Response:
    """The same as JSON."""
    operation = operation_of(request, key)
    await _read_what_was_written(request, operation)
    kind = operation.equipment.equipment.type.name
    text = json_text(_told(request, operation), _codes(operation), kind, operation.id)
    return _file(operation, text, "json", "application/json")


async def _read_what_was_written(request: Request, operation: Operation) -> None:
    """What was read before it was written is read again: a file without it would look whole.

    Raises:
        Refused: 503, the drive does not tell.
    """
    kind, machine = operation.equipment.equipment.type, machine_of(request.app, operation)
    if machine.reading is not None and machine.reading.task is not None:
        await asyncio.wait([machine.reading.task])
    old = [
        (place[0], parameter)
        for place, written in drive_of(request, operation).written.items()
        if (found := machine.found.get(place)) is not None
        and (found.time < written or not isinstance(found.outcome, Values))
        if (parameter := parameter_of(kind, place[1])) is not None
    ]
    if not old:
        return
    machine.reading = reading = begin_reading(operation, machine, lambda: old)
    assert reading.task is not None
    await asyncio.wait([reading.task])
    if reading.problem:
        raise Refused(reading.problem, 503, **reading.params)


def _file(operation: Operation, text: str, ending: str, media: str) -> Response:
    name = f"{operation.id}-parameters.{ending}"
    return Response(text, media_type=media, headers={"Content-Disposition": f'attachment; filename="{name}"'})


def _told(request: Request, operation: Operation) -> list[Told]:
    """Raises:
    Refused: 409, nothing was read yet.
    """
    machine, drawn = machine_of(request.app, operation), operation.equipment
    zone = operation.zone
    rows = [
        Told(element, drawn.t(element.parameter.text_key), fmt.iso(time, zone))
        for element, time in _elements(request, operation, machine)
    ]
    if not rows:
        raise Refused("dcmp.nothing_read", 409)
    return sorted(rows, key=lambda row: (row.element.object, row.element.parameter.number, row.element.index))


def _codes(operation: Operation) -> dict[int, str]:
    return {one.number: one.code for one in operation.equipment.equipment.type.drive_parameters.values()}


def _elements(request: Request, operation: Operation, machine: Machine) -> list[tuple[Element, int]]:
    """Every element that was read, with its time [µs UTC]."""
    kind, written = operation.equipment.equipment.type, drive_of(request, operation).written
    found = []
    for (object, code), told in machine.found.items():
        parameter = parameter_of(kind, code)
        stale = told.time < written.get((object, code), 0)
        if parameter is None or stale or not isinstance(told.outcome, Values):
            continue
        for index, value in enumerate(told.outcome.values):
            found.append((Element(object, parameter, index, parameter.in_unit(value)), told.time))
    return found


# ---- comparing ------------------------------------------------------------------------------------------------


@router.get("/equipment/{key}/drive-parameters/compare", dependencies=[allow("configure")])
async def page(request: Request, key: str) -> HTMLResponse:
    """This drive beside a file or another drive."""
    operation = operation_of(request, key)
    _check(operation)
    machine = operation.equipment
    return view_of(request).page(
        request,
        "pages/drive_compare.html",
        title=machine.text("dcmp.title"),
        kind=f"parameters/{machine.id}",
        area=machine.area,
        chip=machine.id,
        up=f"{operation.url}/drive-parameters",
        drives=_others(request, operation),
        piece=PIECE,
        largest=LARGEST,
        **_context(request, operation),
    )


@router.get("/equipment/{key}/drive-parameters/compare/rows", dependencies=[allow("configure")])
async def rows(request: Request, key: str) -> HTMLResponse:
    """The table alone, while values come in."""
    operation = operation_of(request, key)
    return view_of(request).fragment(request, "fragments/drive_compare_rows.html", **_context(request, operation))


@router.post("/equipment/{key}/drive-parameters/compare/file", dependencies=[allow("configure")])
async def take_file(request: Request, key: str) -> Response:
    """A piece of a file; with the last one it is checked, and the drive is read."""
    operation = operation_of(request, key)
    _check(operation)
    form = await fields(request, ("text", "name", "part", "parts"))
    part, parts = _count(form["part"]), _count(form["parts"])
    most = LARGEST // 1000
    if not 1 <= part <= parts <= most:
        raise Refused("dcmp.too_large", 413, size=parts * PIECE, limit=LARGEST)
    comparison = _comparison(request, operation)
    if part == 1:
        comparison.pieces = []
    if len(comparison.pieces) != part - 1:
        raise Refused("dcmp.pieces", 409)
    comparison.pieces.append(form["text"])
    if part < parts:
        return Response(status_code=204)
    data = "".join(comparison.pieces).encode()
    kind = operation.equipment.equipment.type
    read = read_file(data, lambda code: parameter_of(kind, code), kind.name)
    told = Comparison(form["name"][:120] or "–", "", {one.key: one for one in read.elements}, read.wrong)
    _put(request, operation, told)
    if not read.wrong:
        wanted = list({(one.object, one.parameter.code): (one.object, one.parameter) for one in read.elements}.values())
        _read(operation, told, machine_of(request.app, operation), lambda: wanted)
    return _answered(request, operation, form)


@router.post("/equipment/{key}/drive-parameters/compare/drive", dependencies=[allow("configure")])
async def take_drive(request: Request, key: str) -> Response:
    """Beside another drive of the same type: both are read."""
    operation = operation_of(request, key)
    _check(operation)
    form = await fields(request, ("other",))
    other = next((one for one in _others(request, operation) if one.id == form["other"]), None)
    if other is None:
        raise Refused("dcmp.no_drive", 422, text=form["other"][:40])
    told = Comparison(other.equipment.label, other.id)
    _put(request, operation, told)
    for one in (operation, other):
        machine, known = machine_of(request.app, one), one.equipment.equipment.type.drive_parameters.values()
        _read(one, told, machine, partial(_settable, machine, list(known)))
    return _answered(request, operation, form)


@router.post("/equipment/{key}/drive-parameters/compare/take", dependencies=[allow("configure")])
async def take_values(request: Request, key: str) -> Response:
    """Put what differs into the list of new values, which is reviewed and written there."""
    operation = operation_of(request, key)
    form = await fields(request, ())
    draft = drive_of(request, operation).draft(person_of(request).session)
    if draft.busy:
        raise Refused("why.busy", 409, label="dpar.change")
    taken = [one for one in _differences(request, operation) if _takes(one)]
    if len(taken) > MOST:
        raise Refused("why.par_count", 422, n=len(taken), limit=MOST)
    draft.reset()
    draft.typed.clear()
    for one in taken:
        assert one.there is not None
        draft.typed[one.key] = _typed(operation, one)
    return RedirectResponse(form["next"] or f"{operation.url}/drive-parameters", 303)


def _typed(operation: Operation, one: Difference) -> str:
    """The other side's value as a person would type it."""
    assert one.there is not None
    if one.parameter.kind not in ("binector", "connector"):
        return fmt.number(one.there, fmt.shortest(one.there, 9), operation.equipment.lang).replace(fmt.GROUP, "")
    return value_text(operation, one.parameter, one.there)


def _settable(machine: Machine, known: Iterable[DriveParameter]) -> list[tuple[int, DriveParameter]]:
    return [(object, one) for one in known if _settable_one(one) for object in places(one, machine.objects)]


def _settable_one(one: DriveParameter) -> bool:
    """Whether it is a setting of the drive: not what only tells, nor what makes it do something."""
    return one.writable and not one.trigger and one.code not in SAVES


def _read(
    operation: Operation,
    told: Comparison,
    machine: Machine,
    wanted: Callable[[], Sequence[tuple[int, DriveParameter]]],
) -> None:
    if machine.reading is not None and machine.reading.task is not None:
        machine.reading.task.cancel()
    try:
        machine.reading = begin_reading(operation, machine, wanted)
    except (LinkError, Refused) as error:
        told.problem = operation.words.text(*problem_of(error))


def _check(operation: Operation) -> None:
    """Raises:
    HTTPException: 404, the machine has no parameters.
    """
    if not operation.equipment.equipment.type.drive_parameters:
        raise HTTPException(404)


def _others(request: Request, operation: Operation) -> list[Operation]:
    """Other drives of the plant of the same type."""
    item = operation.equipment.equipment
    plant = operation.runtime.plant
    machines = plant.equipment.values() if plant else ()
    return [Operation(request, one) for one in machines if one.type.name == item.type.name and one.id != item.id]


def _count(text: str) -> int:
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 5 else 0


def _comparison(request: Request, operation: Operation) -> Comparison:
    kept = kept_of(request.app, operation, "drive_compare", Comparisons).found
    return kept.setdefault(person_of(request).session, Comparison())


def _put(request: Request, operation: Operation, comparison: Comparison) -> None:
    kept = kept_of(request.app, operation, "drive_compare", Comparisons).found
    kept.pop(person_of(request).session, None)
    while len(kept) >= MOST_KEPT:
        del kept[next(iter(kept))]
    kept[person_of(request).session] = comparison


def _answered(request: Request, operation: Operation, form: Mapping[str, str]) -> Response:
    if not wants_fragment(request):
        return RedirectResponse(f"{operation.url}/drive-parameters/compare", 303)
    return view_of(request).fragment(request, "fragments/drive_compare_rows.html", **_context(request, operation))


# ---- words ----------------------------------------------------------------------------------------------------


def _differences(request: Request, operation: Operation) -> list[Difference]:
    comparison = _comparison(request, operation)
    if not comparison.title or comparison.wrong:
        return []
    here = {one.key: one for one, _ in _elements(request, operation, machine_of(request.app, operation))}
    if comparison.other:
        other = next((one for one in _others(request, operation) if one.id == comparison.other), None)
        if other is None:
            return []
        objects = (machine_of(request.app, operation).objects, machine_of(request.app, other).objects)
        read = (_aligned(one, *objects) for one, _ in _elements(request, other, machine_of(request.app, other)))
        there = {one.key: one for one in read if _settable_one(one.parameter)}
        here = {key: one for key, one in here.items() if _settable_one(one.parameter)}
        return list(compared(here, there))
    there = dict(comparison.elements)
    return list(compared({key: one for key, one in here.items() if key in there}, there))


def _aligned(one: Element, here: Sequence[int], there: Sequence[int]) -> Element:
    """An element of the other drive in the drive object in which this one has its parameter."""
    found = places(one.parameter, here)
    return one if set(here) == set(there) or one.object in found else replace(one, object=found[0])


def _takes(one: Difference) -> bool:
    """Whether the other side's value can be put into the list."""
    return one.there is not None and not one.same and _settable_one(one.parameter) and not one.parameter.individual


def _context(request: Request, operation: Operation) -> dict[str, Any]:
    comparison, drawn = _comparison(request, operation), operation.equipment
    shown = request.query_params.get("show", DIFFERENT)
    found = _differences(request, operation)
    readings = [machine_of(request.app, operation).reading]
    if comparison.other:
        readings += [
            machine_of(request.app, one).reading for one in _others(request, operation) if one.id == comparison.other
        ]
    going = [one for one in readings if one is not None and not one.over]
    problems = [operation.words.text(one.problem, one.params) for one in readings if one is not None and one.problem]
    lacks = [one for one in found if one.here is None or one.there is None]
    picked = {ALL: found, MISSING: lacks}.get(shown, [one for one in found if not one.same])
    return {
        "operation": operation,
        "equipment": drawn,
        "comparison": comparison,
        "show": shown if shown in (ALL, MISSING) else DIFFERENT,
        "rows": [_row(operation, one) for one in picked],
        "numbers": {"": sum(not one.same for one in found), ALL: len(found), MISSING: len(lacks)},
        "takes": sum(_takes(one) for one in found),
        "most": MOST,
        "reading": going,
        "done": sum(one.done for one in going),
        "count": sum(one.count for one in going),
        "problem": comparison.problem or (problems[0] if problems and comparison.title else ""),
        "wrong": [(one.line, _why(operation, one)) for one in comparison.wrong[:MOST_WRONG]],
        "more_wrong": max(0, len(comparison.wrong) - MOST_WRONG),
        "objects": has_objects(operation),
        "read_count": len(machine_of(request.app, operation).found),
    }


def _why(operation: Operation, one: Wrong) -> str:
    params = {
        key: number_text(value, operation.equipment.lang) if isinstance(value, float) else value
        for key, value in one.params.items()
    }
    if "why" in params:
        params["why"] = operation.words.text(str(one.params["why"]), one.params)
    return operation.words.text(one.reason, params)


def _row(operation: Operation, one: Difference) -> Row:
    drawn, parameter = operation.equipment, one.parameter
    here, there = ("" if value is None else value_text(operation, parameter, value) for value in (one.here, one.there))
    return Row(
        one.key,
        one.key.partition(":")[2],
        one.object,
        drawn.t(parameter.text_key),
        fmt.unit_symbol(parameter.unit, drawn.text) if parameter.unit else "",
        here,
        there,
        one.same,
        one.here is None or one.there is None,
        _takes(one),
        parameter.individual,
    )
