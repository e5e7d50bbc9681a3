"""The page on which an engineer adjusts the absolute encoder of a drive: what the drive holds, every step with its state, value and times.

The page has parts that are drawn anew for everybody who looks at it whenever the gate tells a change of the machine; the steps are the same
for all, what went wrong with one's own order is told to oneself.
"""

import asyncio
from collections.abc import Coroutine, Mapping
from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.commands import encoder_story as steps
from app.commands.encoder_adjustment import COORDINATE, POSITION, STATE, WINDOW, Held
from app.commands.encoder_story import STEPS, WAIT_LIMIT, Step, StepState, Story
from app.commands.gate import Gate
from app.commands.lifecycle import ProgressState
from app.commands.parameter_change import saving_of
from app.errors import Refused
from app.web import format as fmt
from app.web.commands import gate_of, operation_of, wants_fragment
from app.web.drive_mailbox import drive_among, kept_of, mailbox_of, objects_of
from app.web.drive_values import permitted_text, value_text
from app.web.drive_writing import Draft, Drive, at_work, drive_of, given_of, typed_value
from app.web.guard import allow, fields, person_of
from app.web.language import language_of
from app.web.operation import Operation
from app.web.pages import view_of

router = APIRouter()

REASON = "reason"
SOON = 0.15
"""After the end of an order, when what became of it is kept [s]."""
MARKS: Mapping[StepState, str] = {StepState.DONE: "i-check", StepState.FAILED: "i-cross", StepState.ACTIVE: "i-auto"}
REMEDIES: Mapping[str, str] = {
    "why.enc_error": "error",
    "why.enc_not_adjusted": "not_adjusted",
    "why.enc_timeout": "timeout",
    "why.enc_unread": "unread",
    "why.enc_running": "running",
    "why.enc_position": "position",
    "why.enc_position_unread": "unread",
}
"""Cause → what to do about it; of every other one only that it is to be removed."""


@dataclass(frozen=True, slots=True)
class Row:
    """A step in words."""

    key: str
    label: str
    state: StepState
    mark: str
    """Symbol; empty = it waits."""
    state_text: str
    value: str
    """What was read or written."""
    former: str
    time: str
    """When it ended, else began."""
    took: str
    reason: str
    remedy: str


# ---- routes ---------------------------------------------------------------------------------------------------


@router.get("/equipment/{key}/encoder", dependencies=[allow("configure")])
async def page(request: Request, key: str) -> HTMLResponse:
    """The sequence as it stands."""
    operation = _operation(request, key)
    machine = operation.equipment
    return view_of(request).page(
        request,
        "pages/encoder.html",
        title=machine.text("enc.title"),
        kind=f"parameters/{machine.id}",
        area=machine.area,
        chip=machine.id,
        up=operation.url,
        message=operation.story,
        **_context(request, operation),
    )


@router.get("/equipment/{key}/encoder/parts", dependencies=[allow("configure")])
async def parts(request: Request, key: str) -> HTMLResponse:
    """Everything of the page that changes."""
    return _drawn(request, _operation(request, key))


@router.post("/equipment/{key}/encoder/read", dependencies=[allow("configure")])
async def read(request: Request, key: str) -> Response:
    """Read what the drive holds now."""
    operation = _operation(request, key)
    form = await fields(request, ())
    gate, draft, drive = gate_of(operation), _draft(request, operation), drive_of(request, operation)

    async def work() -> None:
        await gate.encoders.look(operation.id, await _object(operation, drive))

    if not draft.busy:
        draft.reset()
        await at_work(operation, draft, "read", _told(gate, operation, work()))
    return _answered(request, operation, form)


@router.post("/equipment/{key}/encoder/start", dependencies=[allow("configure")])
async def start(request: Request, key: str) -> Response:
    """Adjust the encoder: make the coordinate that was typed the position of the axis."""
    operation = _operation(request, key)
    form = await fields(request, (), ("coordinate", "id", "nonce", "reason", "password"))
    gate, draft, drive = gate_of(operation), _free(request, operation), drive_of(request, operation)
    draft.reset()
    draft.typed = {COORDINATE: form["coordinate"], REASON: form["reason"]}
    coordinate = _typed(request, operation, draft)
    given = await given_of(request, form, draft, operation) if coordinate is not None else None
    if coordinate is None or given is None:
        return _answered(request, operation, form)
    wanted, order = coordinate, given

    async def work() -> None:
        object = await _object(operation, drive)
        draft.ended = ended = await gate.encoders.adjust(
            person_of(request), operation.id, wanted, object=object, **order
        )
        drive.unsaved |= {change.key for change in ended.changes if change.found != change.old}
        if ended.state is ProgressState.CONFIRMED:
            draft.typed.clear()
        await gate.encoders.look(operation.id, object)

    await at_work(operation, draft, "adjust", _told(gate, operation, work()))
    return _answered(request, operation, form)


@router.post("/equipment/{key}/encoder/cancel", dependencies=[allow("configure")])
async def cancel(request: Request, key: str) -> Response:
    """End the adjustment at work."""
    operation = _operation(request, key)
    form = await fields(request, ())
    gate_of(operation).encoders.cancel(operation.id)
    return _answered(request, operation, form)


@router.post("/equipment/{key}/encoder/save", dependencies=[allow("configure")])
async def save(request: Request, key: str) -> Response:
    """Have the drive keep its values without power."""
    operation = _operation(request, key)
    form = await fields(request, (), ("id", "nonce", "reason", "password"))
    gate, draft, drive = gate_of(operation), _free(request, operation), drive_of(request, operation)
    draft.reset()
    given = await given_of(request, form, draft, operation)
    if given is None:
        return _answered(request, operation, form)
    order, before = given, set(drive.unsaved)

    async def work() -> None:
        draft.ended = ended = await gate.parameters.save(person_of(request), operation.id, **order)
        if ended.state is ProgressState.CONFIRMED:
            drive.unsaved -= before

    await at_work(operation, draft, "save", _told(gate, operation, work()))
    return _answered(request, operation, form)


# ---- what belongs to whoever asks -----------------------------------------------------------------------------


def _operation(request: Request, key: str) -> Operation:
    """Raises:
    HTTPException: 404, drives of its type have no encoder to be adjusted.
    """
    operation = operation_of(request, key)
    if not operation.adjustable:
        raise HTTPException(404)
    return operation


def _draft(request: Request, operation: Operation) -> Draft:
    return kept_of(request.app, operation, "encoder_orders", Drive).draft(person_of(request).session)


def _free(request: Request, operation: Operation) -> Draft:
    """Raises:
    Refused: 409, an order of this session is at work.
    """
    draft = _draft(request, operation)
    if draft.busy:
        raise Refused("why.busy", 409, label="enc.title", display=person_of(request).display)
    return draft


async def _told(gate: Gate, operation: Operation, work: Coroutine[Any, Any, None]) -> None:
    """Do `work`; its end is drawn, whatever it is: the next turn of the loop has what went wrong with it, too."""
    try:
        await work
    finally:
        asyncio.get_running_loop().call_later(SOON, gate.encoders.tell, operation.id)


def _typed(request: Request, operation: Operation, draft: Draft) -> float | None:
    """The coordinate; None where it is none, which the page tells."""
    parameter = operation.equipment.equipment.type.drive_parameters[COORDINATE]
    try:
        return typed_value(parameter, draft.typed[COORDINATE].strip(), language_of(request))
    except Refused as refusal:
        draft.problem = operation.words.refusal(refusal)
        return None


async def _object(operation: Operation, drive: Drive) -> int:
    """The drive object of the axis.

    Raises:
        LinkError, Refused: the drive does not answer.
    """
    drive.objects = drive.objects or await objects_of(operation, mailbox_of(operation))
    return drive_among(drive.objects)


# ---- words ----------------------------------------------------------------------------------------------------


def _context(request: Request, operation: Operation) -> dict[str, Any]:
    gate, draft = operation.gate, _draft(request, operation)
    held = gate.encoders.held(operation.id) if gate else None
    story = gate.encoders.story(operation.id) if gate else None
    known = operation.equipment.equipment.type.drive_parameters
    why = operation.words.explain_first(gate.encoders.why_not(operation.person, operation.id)) if gate else ""
    return {
        "operation": operation,
        "equipment": operation.equipment,
        "draft": draft,
        "busy": gate is not None and gate.encoders.busy(operation.id),
        "saving": draft.busy and draft.what == "save",
        "looking": (draft.busy and draft.what == "read") or (gate is not None and gate.encoders.looking(operation.id)),
        "absent": held is not None and STATE not in held.values,
        "read_at": _time(operation, held.time) if held else "",
        "values": _values(operation, held) if held else [],
        "rows": _rows(operation, story),
        "save_row": _row(operation, story or Story(0, ""), steps.SAVE),
        "by": _by(operation, story),
        "succeeded": story is not None and story.succeeded,
        "saved": story is not None and story.save.state is StepState.DONE,
        "ended": _end(operation, gate, story),
        "why": why,
        "typed": draft.typed.get(COORDINATE, ""),
        "reason": draft.typed.get(REASON, ""),
        "permitted": permitted_text(known[COORDINATE], operation.equipment.lang),
        "saves": saving_of(operation.equipment.equipment.type),
    }


def _values(operation: Operation, held: Held) -> list[tuple[str, str, str]]:
    """(code, name, value) of what was read."""
    known, drawn = operation.equipment.equipment.type.drive_parameters, operation.equipment
    found = []
    for code in (POSITION, STATE, COORDINATE, WINDOW):
        if code in held.values:
            unit = f"\u00a0{known[code].unit}" if known[code].unit else ""
            value = value_text(operation, known[code], held.values[code]) + unit
            found.append((code, drawn.t(known[code].text_key), value))
    return found


def _rows(operation: Operation, story: Story | None) -> list[Row]:
    told = story or Story(0, "")
    return [_row(operation, told, key) for key in STEPS]


def _row(operation: Operation, story: Story, key: str) -> Row:
    step, drawn, words = story.step(key), operation.equipment, operation.words
    deeper = dict(step.params)
    reason = words.text(step.reason, deeper) if step.reason else ""
    return Row(
        key,
        drawn.text(f"enc.step.{key}"),
        step.state,
        MARKS.get(step.state, ""),
        drawn.text(f"enc.state.{step.state}"),
        _value(operation, step),
        _former(operation, story, key),
        _time(operation, step.ended or step.began),
        _took(operation, step),
        reason,
        drawn.text(f"enc.remedy.{REMEDIES.get(step.reason, 'other')}") if step.reason else "",
    )


def _value(operation: Operation, step: Step) -> str:
    if step.value is None:
        return ""
    known = operation.equipment.equipment.type.drive_parameters
    if step.key in (steps.START, steps.WAIT):
        return f"{STATE} = {value_text(operation, known[STATE], step.value)}"
    code = COORDINATE if step.key == steps.COORDINATE else POSITION
    return f"{code} = {value_text(operation, known[code], step.value)}\u00a0LU"


def _former(operation: Operation, story: Story, key: str) -> str:
    """What the drive held before, of the steps that write."""
    code = {steps.COORDINATE: COORDINATE, steps.START: STATE}.get(key, "")
    if code not in story.former:
        return ""
    known = operation.equipment.equipment.type.drive_parameters[code]
    return operation.equipment.text("enc.former", value=value_text(operation, known, story.former[code]))


def _took(operation: Operation, step: Step) -> str:
    if not step.began:
        return ""
    lang = operation.equipment.lang
    until = step.ended or operation.runtime.clock.micros()
    seconds = fmt.number(max(0.0, (until - step.began) / 1e6), 1, lang)
    if step.state is StepState.ACTIVE and step.key == steps.WAIT:
        return operation.equipment.text("enc.of", seconds=seconds, limit=fmt.number(WAIT_LIMIT, 0, lang))
    return operation.equipment.text("enc.took", seconds=seconds)


def _by(operation: Operation, story: Story | None) -> str:
    if story is None:
        return ""
    value = fmt.number(story.coordinate, 0, operation.equipment.lang)
    return operation.equipment.text("enc.by", display=story.person, value=value)


def _end(operation: Operation, gate: Gate | None, story: Story | None) -> str:
    """How an adjustment that failed has left the drive."""
    if gate is None or story is None or story.failed is None:
        return ""
    ended = next((one for one in gate.history(operation.id) if one.id == story.id), None)
    return operation.words.tell(ended).text if ended else ""


def _time(operation: Operation, micros: int) -> str:
    return operation.words.time(micros)


def _answered(request: Request, operation: Operation, form: Mapping[str, str]) -> Response:
    if not wants_fragment(request):
        return RedirectResponse(form.get("next") or f"{operation.url}/encoder", 303)
    return _drawn(request, operation)


def _drawn(request: Request, operation: Operation) -> HTMLResponse:
    return view_of(request).fragment(request, "fragments/encoder.html", **_context(request, operation.fresh()))
