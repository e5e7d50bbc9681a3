"""The jog speeds of a drive with the basic positioner, beside its jog buttons: read from the drive, typed, and put into the reviewed list.

They are parameters, and written as all others are: former value beside the new one, by the engineer in control, all or none.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.errors import Refused
from app.profidrive.parameter_access.messages import Values
from app.profidrive.parameter_access.parameter import DriveParameter
from app.web import format as fmt
from app.web.commands import operation_of
from app.web.drive_mailbox import drive_among
from app.web.drive_parameters import begin_reading, machine_of
from app.web.drive_values import permitted_text
from app.web.drive_writing import LONGEST_VALUE, drive_of
from app.web.errors import answer as error_answer
from app.web.guard import allow, fields, person_of
from app.web.operation import Operation
from app.web.pages import view_of

router = APIRouter()

CODES = ("p2585", "p2586")
"""Setpoint velocity of jog 1 and of jog 2 (reference/profidrive.md section 6)."""
AT_ONCE = 1.5
"""So long the page waits for the drive [s]; after that it asks again."""


@dataclass(frozen=True, slots=True)
class Speed:
    """One of them as it is drawn."""

    code: str
    label: str
    unit: str
    value: str
    """As read; empty where it could not be."""
    range: str


@router.get("/equipment/{key}/jog-speeds", dependencies=[allow("configure")])
async def speeds(request: Request, key: str) -> HTMLResponse:
    """What the drive holds now."""
    operation = operation_of(request, key)
    parameters = _parameters(operation)
    machine = machine_of(request.app, operation)
    if machine.reading is None or machine.reading.over:
        machine.reading = begin_reading(
            operation, machine, lambda: [(drive_among(machine.objects), one) for one in parameters]
        )
        if machine.reading.task is not None:
            await asyncio.wait([machine.reading.task], timeout=AT_ONCE)
    reading = machine.reading
    drive = drive_among(machine.objects)
    found = [machine.found.get((drive, one.code)) for one in parameters]
    lang, now = operation.equipment.lang, operation.runtime.clock.micros()
    drawn = []
    for one, told in zip(parameters, found, strict=True):
        told_value = told.outcome.values[0] if told is not None and isinstance(told.outcome, Values) else None
        drawn.append(
            Speed(
                one.code,
                operation.equipment.t(one.text_key),
                one.unit,
                "" if told_value is None else fmt.number(told_value, one.decimals, lang),
                permitted_text(one, lang),
            )
        )
    return view_of(request).fragment(
        request,
        "fragments/jog_speeds.html",
        operation=operation,
        speeds=drawn,
        waiting=not reading.over,
        problem=operation.words.text(reading.problem, dict(reading.params)) if reading.problem else "",
        read_at=fmt.moment_or_time(found[0].time, operation.zone, lang, now)
        if found[0] is not None and drawn[0].value
        else "",
    )


@router.post("/equipment/{key}/jog-speeds", dependencies=[allow("configure")])
async def change(request: Request, key: str) -> Response:
    """Put what was typed into the list of new values; it is reviewed and written there."""
    operation = operation_of(request, key)
    parameters = _parameters(operation)
    form = await fields(request, (), CODES)
    typed = {one.code: form[one.code].strip()[:LONGEST_VALUE] for one in parameters if form[one.code].strip()}
    if not typed:
        machine = operation.equipment
        back, title = (machine.label, operation.url), machine.text("jog.title")
        return error_answer(request, 422, "why.argument_missing", back=back, label=title)
    draft = drive_of(request, operation).draft(person_of(request).session)
    if draft.busy:
        raise Refused("why.busy", 409, label="dpar.change")
    drive = drive_among(machine_of(request.app, operation).objects)
    draft.typed |= {f"{drive}:{code}": value for code, value in typed.items()}
    draft.reset()
    return RedirectResponse(f"{operation.url}/drive-parameters?q=p258", 303)


def _parameters(operation: Operation) -> Sequence[DriveParameter]:
    """Raises:
    HTTPException: 404, the machine has no jog speeds.
    """
    known = operation.equipment.equipment.type.drive_parameters
    if any(code not in known for code in CODES):
        raise HTTPException(404)
    return [known[code] for code in CODES]
