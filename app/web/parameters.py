"""The parameters of a drive: read by operators, changed by engineers; the faceplate of a machine as a page and as a dialog.

What is typed is reviewed as a list of old and new (parameter_review.py) and written by one request as one set through the gate: all or none
(commands/sets.py), with a result per row.
"""

import asyncio
import logging
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.commands.lifecycle import ProgressState
from app.commands.orders import LONGEST_REASON
from app.commands.value_set import MOST, Change, Stands
from app.errors import LinkError, Refused
from app.web.commands import gate_of, number_or_none, operation_of, wants_fragment
from app.web.guard import address_of, allow, fields, person_of
from app.web.language import language_of
from app.web.operation import Operation
from app.web.pages import own_template, view_of
from app.web.parameter_review import field_names, is_reviewed, reviewed, seen_of, typed_of
from app.web.parameter_rows import groups_of

if TYPE_CHECKING:
    from app.runtime import Runtime

log = logging.getLogger(__name__)
router = APIRouter()

NOTHING: Mapping[str, str] = {}
NONE: Set[str] = frozenset()
OLD = 30.0
"""Age of the oldest parameter from which an opened page has them read again [s]."""


@dataclass(frozen=True, slots=True)
class Row:
    """What became of one parameter that was written."""

    code: str
    """The maker's name for it, else its key."""
    label: str
    done: bool
    text: str
    value: str
    """Read back, with its unit."""


# ---- faceplate ----------------------------------------------------------------------------------------------


@router.get("/equipment/{key}/faceplate", dependencies=[allow("view")])
async def faceplate(request: Request, key: str) -> HTMLResponse:
    """The faceplate: a dialog over any page, or a page of its own."""
    operation = operation_of(request, key)
    machine = operation.equipment
    template = own_template(machine.equipment.type, "faceplate", "fragments/machine_faceplate.html")
    view = view_of(request)
    context: dict[str, Any] = {"operation": operation, "equipment": machine, "body": template}
    if wants_fragment(request):
        return view.fragment(request, "fragments/faceplate.html", **context)
    return view.page(
        request,
        "pages/faceplate.html",
        title=machine.label,
        kind=f"faceplate/{machine.id}",
        area=machine.area,
        chip=machine.id,
        up=operation.url,
        message=operation.story,
        **context,
    )


# ---- parameters ---------------------------------------------------------------------------------------------


@router.get("/equipment/{key}/parameters", dependencies=[allow("diagnose")])
async def parameters(request: Request, key: str) -> HTMLResponse:
    """All parameters of a drive; older ones are being read again while the page is drawn."""
    operation = operation_of(request, key)
    machine = operation.equipment
    if not machine.equipment.type.setpoints:
        raise HTTPException(404)
    view = view_of(request)
    runtime = view.runtime(request)
    tags = runtime.tags
    names = [f"{machine.id}.{name}" for name in machine.equipment.type.setpoints]
    if max((tags.age(tags.handle(name)) for name in names if name in tags), default=0.0) > OLD:
        _read_later(request, operation)
    return view.page(
        request,
        "pages/parameters.html",
        title=machine.text("par.title"),
        kind=f"parameters/{machine.id}",
        area=machine.area,
        chip=machine.id,
        up=operation.url,
        equipment=machine,
        operation=operation,
        groups=groups_of(operation),
        lines=[],
        rows=[],
        message=operation.story,
    )


@router.post("/equipment/{key}/parameters/read", dependencies=[allow("diagnose")])
async def read_again(request: Request, key: str) -> Response:
    """Read all parameters from the drive now; their values come over the socket of the page."""
    operation = operation_of(request, key)
    form = await fields(request, ())
    runtime = view_of(request).runtime(request)
    try:
        count = await _read(runtime, operation)
        text, kind, status = operation.equipment.text("par.read", n=count), "done", 200
    except LinkError as error:
        text, kind, status = operation.words.text("why.no_answer", {"cause": f"link.error.{error.kind}"}), "error", 503
    if not wants_fragment(request):
        return RedirectResponse(form.get("next") or f"/equipment/{quote(key)}/parameters", 303)
    return view_of(request).fragment(
        request,
        "fragments/line.html",
        status=status,
        text=text,
        kind=kind,
        at=operation.words.time(runtime.clock.micros()),
    )


@router.post("/equipment/{key}/parameters/review", dependencies=[allow("configure")])
async def review(request: Request, key: str) -> Response:
    """What is typed, beside what the device holds; nothing is kept here."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("id", "nonce", "reason", *field_names(operation)))
    return _answered(request, operation, "", "", [], typed_of(form), seen_of(form))


@router.post("/equipment/{key}/parameters", dependencies=[allow("configure")])
async def write(request: Request, key: str) -> Response:
    """Write the reviewed changes as one set and say for each what the drive holds now."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("id", "nonce", "reason", *field_names(operation)))
    typed, seen = typed_of(form), seen_of(form)
    if not typed:
        raise Refused("par.form", 422)
    if len(typed) > MOST:
        raise Refused("why.par_count", 422, n=len(typed), limit=MOST)
    if not is_reviewed(form):
        return _answered(request, operation, operation.equipment.text("par.unreviewed"), "error", [], typed, seen)
    if len(form["reason"]) > LONGEST_REASON:
        raise Refused("why.reason_too_long", 422, length=len(form["reason"]), limit=LONGEST_REASON)
    try:
        progress = await gate_of(operation).set_values(
            person_of(request),
            operation.id,
            typed,
            seen={key: number for key in typed if (number := number_or_none(seen.get(key, ""))) is not None},
            id=form["id"][:64],
            nonce=form["nonce"],
            confirmed=True,
            reason=form["reason"],
            address=address_of(request.scope),
            language=language_of(request),
        )
    except Refused as refusal:
        text, rows = operation.words.refusal(refusal), _refused_rows(operation, refusal)
        return _answered(request, operation, text, "error", rows, typed)
    done = progress.state in (ProgressState.CONFIRMED, ProgressState.DRY_RUN)
    written = progress.state is ProgressState.CONFIRMED
    text = operation.equipment.text("par.written", n=len(typed)) if written else operation.words.tell(progress).text
    rows = [_row(operation, change, dry=progress.state is ProgressState.DRY_RUN) for change in progress.changes]
    over = {change.key for change, row in zip(progress.changes, rows, strict=True) if row.done}
    return _answered(request, operation, text, "done" if done else "error", rows, typed, over=over)


def _answered(
    request: Request,
    operation: Operation,
    text: str,
    kind: str,
    rows: Sequence[Row],
    typed: Mapping[str, str],
    seen: Mapping[str, str] = NOTHING,
    *,
    over: Set[str] = NONE,
) -> Response:
    """What is left of what was typed, reviewed anew; `over` are the keys whose value was written, their fields are empty again."""
    view, fresh = view_of(request), operation.fresh()
    return view.fragment(
        request,
        "fragments/parameters_answer.html",
        operation=fresh,
        equipment=fresh.equipment,
        rows=rows,
        lines=reviewed(fresh, {key: new for key, new in typed.items() if key not in over}, seen),
        written=groups_of(fresh, over),
        text=text,
        kind=kind,
        at=operation.words.time(view.runtime(request).clock.micros()),
    )


def _row(operation: Operation, change: Change, *, dry: bool) -> Row:
    machine = operation.equipment
    setpoint = machine.equipment.type.setpoints[change.key]
    value = "" if dry or change.found is None else operation.words.held(change)
    if value and change.found is not None and int(change.found) in setpoint.options:
        value = machine.t(setpoint.options[int(change.found)])
    text = machine.text("fb.dry_run" if dry else f"set.is_{change.stands}")
    return Row(change.code, machine.t(change.label), change.stands is Stands.NEW, text, value)


def _refused_rows(operation: Operation, refusal: Refused) -> list[Row]:
    """The value that was refused, when it was one of them."""
    machine, key = operation.equipment, str(refusal.params.get("argument", ""))
    setpoint = machine.equipment.type.setpoints.get(key)
    if setpoint is None or not machine.has(key):
        return []
    return [
        Row(
            setpoint.code or key,
            machine.point(key).label,
            False,
            operation.words.text(refusal.reason, refusal.params),
            "",
        )
    ]


async def _read(runtime: "Runtime", operation: Operation) -> int:
    item = operation.equipment.equipment
    link = runtime.links.get(item.link)
    if link is None:
        raise Refused("why.no_link", 503, link=item.link)
    keys = [key for key in item.type.setpoints if key in item.points and item.points[key].register]
    await link.refresh(item.id, keys)
    return len(keys)


def _read_later(request: Request, operation: Operation) -> None:
    runtime = view_of(request).runtime(request)
    tasks: set[asyncio.Task[None]] = request.app.state.__dict__.setdefault("readings", set())

    async def reading() -> None:
        try:
            await _read(runtime, operation)
        except (LinkError, Refused) as error:
            log.info("parameters not read equipment=%s error=%s", operation.id, error)

    if runtime.links:
        task = asyncio.create_task(reading(), name=f"parameters {operation.id}")
        tasks.add(task)
        task.add_done_callback(tasks.discard)
