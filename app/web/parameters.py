"""The parameters of a drive: read by operators, changed by engineers; the faceplate of a machine as a page and as a dialog.

Parameters are edited locally, reviewed as a list of old and new, and written by one request as one set through the gate: all or none
(commands/sets.py), with a result per row.
"""

import asyncio
import logging
from collections.abc import Mapping, Sequence
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
from app.plant import expression
from app.plant.definitions import Setpoint
from app.web.commands import gate_of, number_or_none, operation_of, wants_fragment
from app.web.guard import address_of, allow, field_list, fields, person_of
from app.web.language import language_of
from app.web.operation import Operation
from app.web.pages import own_template, view_of
from app.web.points import PointView

if TYPE_CHECKING:
    from app.runtime import Runtime

log = logging.getLogger(__name__)
router = APIRouter()

OLD = 30.0
"""Age of the oldest parameter from which an opened page has them read again [s]."""
CONFIRMED = frozenset("MTCX")
"""Marks of the reference sheet that stand for a source; G alone, or a question mark, is unconfirmed."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter as a row."""

    key: str
    code: str
    """The maker's name for it, else its key."""
    point: PointView
    low: float | None
    """Least value now [EU]; None = not known."""
    high: float | None
    default: str
    options: Mapping[str, str]
    """Value → text; empty when it is a number."""
    confirmed: bool
    marks: str
    warning: str
    stopped_only: bool
    depends: Sequence[str]
    """Other setpoints that its limits come from: with a new value of one of them they are others than drawn."""
    reason: str
    """Why this person cannot write it at all; empty = they can."""

    @property
    def mark(self) -> str:
        """The maker's name for it, as it is shown; empty when there is none."""
        return "" if self.code == self.key else self.code

    @property
    def permitted(self) -> str:
        """The permitted range as drawn."""
        if self.low is None or self.high is None:
            return "– –"
        return f"{self.point.number(self.low)} … {self.point.number(self.high)}"


@dataclass(frozen=True, slots=True)
class Group:
    """Parameters that belong together."""

    key: str
    label: str
    rows: Sequence[Parameter]

    @property
    def codes(self) -> str:
        """First and last code: `F900 – F905`."""
        codes = sorted(row.mark for row in self.rows)
        return codes[0] if codes[0] == codes[-1] else f"{codes[0]} – {codes[-1]}"


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


def groups_of(operation: Operation) -> list[Group]:
    """The setpoints of the machine by group, in the order of the type's file."""
    item, machine = operation.equipment.equipment, operation.equipment
    found: dict[str, list[Parameter]] = {}
    for key, setpoint in item.type.setpoints.items():
        if key in item.points:
            found.setdefault(setpoint.group, []).append(_parameter(operation, key, setpoint))
    return [
        Group(key or "other", machine.t(key) if key else machine.text("par.other"), rows) for key, rows in found.items()
    ]


def _parameter(operation: Operation, key: str, setpoint: Setpoint) -> Parameter:
    machine, person = operation.equipment, operation.person
    point = machine.point(key)
    look = operation.look
    marks = setpoint.certainty
    low, high = expression.number(setpoint.low, look), expression.number(setpoint.high, look)
    item_setpoints = machine.equipment.type.setpoints.keys()
    reason = ""
    if person is None or not person.may("configure") or setpoint.role not in person.roles:
        reason = machine.text("par.engineers_write")
    return Parameter(
        key,
        setpoint.code or key,
        point,
        low,
        high,
        "" if setpoint.default is None else _default(machine.t, setpoint, point),
        {f"{value:g}": machine.t(text) for value, text in setpoint.options.items()},
        bool(CONFIRMED & set(marks)) and "?" not in marks,
        marks,
        machine.t(setpoint.warning) if setpoint.warning else "",
        setpoint.stopped_only,
        sorted(_names(setpoint) & item_setpoints),
        reason,
    )


def _names(setpoint: Setpoint) -> frozenset[str]:
    return expression.parse(setpoint.low).names | expression.parse(setpoint.high).names


def _default(t: "object", setpoint: Setpoint, point: PointView) -> str:
    assert setpoint.default is not None
    key = setpoint.options.get(int(setpoint.default)) if setpoint.options else None
    return str(t(key)) if key and callable(t) else point.number(setpoint.default)


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


@router.post("/equipment/{key}/parameters", dependencies=[allow("configure")])
async def write(request: Request, key: str) -> Response:
    """Write the reviewed changes as one set and say for each what the drive holds now."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("id", "nonce", "reason"), lists=("key", "value", "expected"))
    keys, values, expected = [await field_list(request, name) for name in ("key", "value", "expected")]
    if not keys or len(keys) > MOST or not len(keys) == len(values) == len(expected) or len(set(keys)) != len(keys):
        raise Refused("par.form", 422)
    if len(form["reason"]) > LONGEST_REASON:
        raise Refused("why.reason_too_long", 422, length=len(form["reason"]), limit=LONGEST_REASON)
    try:
        progress = await gate_of(operation).set_values(
            person_of(request),
            operation.id,
            dict(zip(keys, values, strict=True)),
            seen={
                key: number
                for key, text in zip(keys, expected, strict=True)
                if (number := number_or_none(text)) is not None
            },
            id=form["id"][:64],
            nonce=form["nonce"],
            confirmed=True,
            reason=form["reason"],
            address=address_of(request.scope),
            language=language_of(request),
        )
    except Refused as refusal:
        return _answered(
            request, operation, operation.words.refusal(refusal), "error", _refused_rows(operation, refusal)
        )
    done = progress.state in (ProgressState.CONFIRMED, ProgressState.DRY_RUN)
    written = progress.state is ProgressState.CONFIRMED
    text = operation.equipment.text("par.written", n=len(keys)) if written else operation.words.tell(progress).text
    rows = [_row(operation, change, dry=progress.state is ProgressState.DRY_RUN) for change in progress.changes]
    return _answered(request, operation, text, "done" if done else "error", rows)


def _answered(request: Request, operation: Operation, text: str, kind: str, rows: Sequence[Row]) -> Response:
    view = view_of(request)
    return view.fragment(
        request,
        "fragments/parameters_answer.html",
        operation=operation.fresh(),
        equipment=operation.equipment,
        rows=rows,
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
