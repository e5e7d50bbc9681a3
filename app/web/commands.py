"""Commands in the browser: what buttons post to, what is asked back, who holds the machine, hold-to-run.

Everything is decided by the gate (app/commands); here its answers become words in the person's language. A button posts, and gets back the
line for the operator with the whole column, so that every part that changed is drawn anew. The column is fetched again by everybody who
looks at the machine when its revision tag `sys.commands.<equipment>` changes. Stop needs neither script nor nonce: it is a form.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app import bundled
from app.commands.gate import Gate, Question
from app.commands.hold import CAUSES
from app.commands.lifecycle import Progress, ProgressState
from app.errors import Refused
from app.plant import expression
from app.plant.definitions import Command
from app.web import format as fmt
from app.web.errors import answer as error_answer
from app.web.guard import address_of, allow, fields, people_access, person_of
from app.web.language import language_of, local_path
from app.web.operation import Operation
from app.web.pages import plant_of, view_of
from app.web.screens import check_asked
from app.web.tables import tables_of

router = APIRouter()

STATUS: Mapping[ProgressState, int] = {
    ProgressState.REQUESTED: 202,
    ProgressState.ACCEPTED: 202,
    ProgressState.CONFIRMED: 200,
    ProgressState.DRY_RUN: 200,
    ProgressState.UNKNOWN: 503,
    ProgressState.FAILED: 409,
    ProgressState.UNCONFIRMED: 409,
    ProgressState.SUPERSEDED: 409,
    ProgressState.REFUSED: 409,
}
"""HTTP status of an answer by where the command stands (hmi-design.md section 11)."""


def operation_of(request: Request, key: str) -> Operation:
    """The machine `key` for whoever asks.

    Raises:
        HTTPException: 404, there is no such machine.
    """
    item = plant_of(request).equipment.get(key)
    if item is None:
        raise HTTPException(404)
    return Operation(request, item)


def gate_of(operation: Operation) -> Gate:
    """The gate of the running plant.

    Raises:
        Refused: 503 while there is none.
    """
    if operation.gate is None:
        raise Refused("operate.not_ready", 503)
    return operation.gate


ARGUMENT = "arg_"
"""Before the name of an argument in a form."""
OWN_FIELD: Mapping[str, str] = {"access.current_wrong": "password", "why.reason_too_long": "reason"}
"""Refusal → what of the form it is about, where that is no value."""
BY_SCRIPT = frozenset({"why.expired", "why.no_token"})
"""Refusals of who has no script to get what is missing."""
ROW = re.compile("[0-9]{1,18}")
"""How the row of a table is named in an address."""


# ---- routes -------------------------------------------------------------------------------------------------


@router.get("/nonce", dependencies=[allow("operate")])
async def nonce(request: Request) -> JSONResponse:
    """A one-time number for the next command; fetched when a button goes down, so that none is ever old."""
    person = person_of(request)
    gate: Gate | None = getattr(view_of(request).runtime(request), "gate", None)
    if gate is None:
        raise Refused("operate.not_ready", 503)
    return JSONResponse({"nonce": gate.nonces.issue(person.session)})


@router.get("/equipment/{key}/commands", dependencies=[allow("view")])
async def commands(request: Request, key: str) -> HTMLResponse:
    """The command column of one machine as it stands for whoever asks."""
    operation = operation_of(request, key)
    return view_of(request).fragment(
        request, "fragments/commands.html", operation=operation, equipment=operation.equipment, elsewhere=True
    )


@router.post("/equipment/{key}/command/{command}", dependencies=[allow("operate")])
async def command(request: Request, key: str, command: str) -> Response:
    """Give a command."""
    return await _ask(request, operation_of(request, key), command)


@router.get("/equipment/{key}/ask/{command}", dependencies=[allow("operate")])
async def ask_for(request: Request, key: str, command: str) -> HTMLResponse:
    """The dialog for the arguments of a command, filled with what the address gives and, of a row of a table, with what stands there; the
    type's own (`ask_<command>.html`) when it has one."""
    operation = operation_of(request, key)
    kind = operation.equipment.equipment.type.commands.get(command)
    if kind is None or not kind.arguments or operation.gate is None:
        raise HTTPException(404)
    view = view_of(request)
    own = f"screens/{operation.equipment.type}/ask_{command}.html"
    reason, status = operation.buttons[command].reason, 409
    try:
        check_asked(operation.equipment, kind, request.query_params)
    except Refused as error:
        reason, status = operation.words.refusal(error), error.status
    if reason:
        at = operation.words.time(operation.runtime.clock.micros())
        return view.fragment(request, "fragments/line.html", status=status, text=reason, kind="error", at=at)
    level = operation.gate.level(operation.id, command)
    return view.fragment(
        request,
        own if (bundled("templates") / own).is_file() else "fragments/arguments.html",
        operation=operation,
        equipment=operation.equipment,
        key=command,
        level=level,
        needs_reason=kind.needs_reason or level >= "C3",
        label=operation.equipment.t(kind.label),
        effect=operation.effect(command),
        url=f"{operation.url}/command/{command}",
        arguments=arguments_of(operation, kind, dict(request.query_params)),
        given=request.query_params,
    )


@router.post("/equipment/{key}/stop", dependencies=[allow("stop")])
async def stop(request: Request, key: str) -> Response:
    """Stop the machine: no token, no nonce, no question, and without any script."""
    operation = operation_of(request, key)
    kinds = operation.equipment.equipment.type.commands
    found = next((name for name, command in kinds.items() if command.stop), None)
    if found is None:
        raise HTTPException(404)
    return await _ask(request, operation, found)


@router.post("/equipment/{key}/setpoint/{setpoint}", dependencies=[allow("operate")])
async def setpoint(request: Request, key: str, setpoint: str) -> Response:
    """Write one parameter or setpoint and read it back."""
    return await _ask(request, operation_of(request, key), setpoint, value=True)


@router.post("/equipment/{key}/token/{action}", dependencies=[allow("operate")])
async def token(request: Request, key: str, action: str) -> Response:
    """Take the machine, ask for it, ask no more, hand it over, keep it, let it go."""
    operation = operation_of(request, key)
    form = await fields(request, ())
    control, person = gate_of(operation).control, person_of(request)
    actions = {
        "take": control.take,
        "request": control.request,
        "withdraw": control.withdraw,
        "refuse": control.refuse,
        "give": control.give,
        "release": control.release,
    }
    if action not in actions:
        raise HTTPException(404)
    try:
        actions[action](person, operation.id)
    except Refused as error:
        return _answered(
            request, operation, form, operation.named(operation.words.refusal(error)), "error", error.status
        )
    if action == "request" and control.holds(person, operation.id):
        action = "take"
    number, of = control.number(person, operation.id), len(control.line(operation.id))
    did = "operate.did.stand" if action == "request" and number > 1 else f"operate.did.{action}"
    return _answered(
        request, operation, form, operation.named(operation.equipment.text(did, number=number, of=of)), "done", 200
    )


@router.post("/equipment/{key}/hold/{command}", dependencies=[allow("operate")])
async def arm(request: Request, key: str, command: str) -> Response:
    """A lease for one press of a hold-to-run button; nothing moves before its first keep-alive on the socket of the page."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("id", "nonce", "confirmed", "argument", "expected", "reason"))
    try:
        lease = await gate_of(operation).hold.arm(
            person_of(request),
            operation.id,
            command,
            id=form["id"],
            nonce=form["nonce"],
            confirmed=form["confirmed"] == "1",
            address=address_of(request.scope),
        )
    except Question as question:
        return _question(request, operation, form, command, question)
    except Refused as error:
        why = operation.words.refusal(error)
        return _answered(request, operation, form, operation.about(command, why), "error", error.status, hint=why)
    return JSONResponse({"lease": lease})


@router.post("/equipment/{key}/release", dependencies=[allow("stop")])
async def release(request: Request, key: str) -> Response:
    """End a hold-to-run: the second way beside the socket. A lease that is over stays over."""
    operation = operation_of(request, key)
    form = await fields(request, ("lease",), ("cause",))
    cause = form["cause"] if form["cause"] in CAUSES else "released"
    gate_of(operation).hold.release(form["lease"], person_of(request).session, cause)
    return Response(status_code=204)


@dataclass(frozen=True, slots=True)
class ArgumentView:
    """An argument of a command as a field."""

    name: str
    label: str
    unit: str
    value: str
    """As it is written in the field."""
    low: float | None
    high: float | None
    decimals: int
    lang: str
    row: bool = False
    """It says which row of a table is meant, and is not to be changed."""

    @property
    def permitted(self) -> str:
        """The permitted range as drawn; empty when it is not known."""
        if self.low is None or self.high is None or self.row:
            return ""
        decimals = max(fmt.shortest(bound, self.decimals) for bound in (self.low, self.high))
        return fmt.span(self.low, self.high, decimals, self.lang)


def arguments_of(operation: Operation, command: Command, given: Mapping[str, str]) -> list[ArgumentView]:
    """The arguments of `command` as fields; one that is called as a table names a row, whose columns fill the others."""
    machine, found = operation.equipment, []
    tables = tables_of(machine)
    row = next(
        (tables[name].row(int(text)) for name, text in given.items() if name in tables and ROW.fullmatch(text)), None
    )
    for argument in command.arguments:
        low, high = (
            expression.number(bound, operation.look) if bound else None for bound in (argument.low, argument.high)
        )
        value = given.get(argument.name, "")[:40]
        number = row.number(argument.name) if row and not value else None
        if number is not None:
            value = fmt.number(number, argument.decimals, machine.lang).replace(fmt.GROUP, "")
        found.append(
            ArgumentView(
                argument.name,
                machine.t(argument.label),
                fmt.unit_symbol(argument.unit, machine.text),
                value,
                low,
                high,
                argument.decimals,
                machine.lang,
                argument.name in tables,
            )
        )
    return found


async def _ask(request: Request, operation: Operation, key: str, *, value: bool = False) -> Response:
    kinds = operation.equipment.equipment.type.commands
    names = [argument.name for argument in kinds[key].arguments] if key in kinds and not value else []
    optional = ("argument", "id", "nonce", "expected", "confirmed", "reason", "password")
    form = await fields(request, (), (*optional, *(f"{ARGUMENT}{name}" for name in names)))
    gate, person = gate_of(operation), person_of(request)
    given: dict[str, object] = {
        "id": form["id"][:64],
        "nonce": form["nonce"],
        "expected": number_or_none(form["expected"]),
        "confirmed": form["confirmed"] == "1",
        "reason": form["reason"],
        "address": address_of(request.scope),
        "language": language_of(request),
    }
    try:
        # A hash is 0.2 s of a processor: what is refused anyway is not worth it.
        if form["password"] and not gate.why_not(person, operation.id, key):
            access = people_access(request)
            await access.own.confirm(person, form["password"])
            given["proven"] = True
        if value:
            progress = await gate.set_value(person, operation.id, key, form["argument"], **given)  # type: ignore[arg-type]
        else:
            argument = form["argument"] or None
            if names:
                given["arguments"] = {name: form[f"{ARGUMENT}{name}"] for name in names}
            progress = await gate.ask(person, operation.id, key, argument=argument, **given)  # type: ignore[arg-type]
    except Question as question:
        return _question(request, operation, form, key, question)
    except Refused as error:
        without_script = not wants_fragment(request) and not form["nonce"] and error.reason in BY_SCRIPT
        why = operation.equipment.text("operate.needs_script") if without_script else operation.words.refusal(error)
        return _answered(
            request,
            operation,
            form,
            operation.about(key, why),
            "error",
            error.status,
            key,
            field=_field_of(error),
            hint=why,
            told=error.reason == "why.changed",
        )
    story = operation.words.tell(progress)
    return _answered(request, operation, form, story.text, story.kind, STATUS[progress.state], key, progress)


def number_or_none(text: str) -> float | None:
    """A number as scripts write it, or None."""
    try:
        return float(text)
    except ValueError:
        return None


def wants_fragment(request: Request) -> bool:
    """Whether a script asks, as against a form without one."""
    return request.headers.get("hx-request") == "true"


def _answered(
    request: Request,
    operation: Operation,
    form: Mapping[str, str],
    text: str,
    kind: str,
    status: int,
    key: str = "",
    progress: Progress | None = None,
    *,
    field: str = "",
    hint: str = "",
    told: bool = False,
) -> Response:
    """The line for the operator with the column anew; a form without script goes back to its page, or reads why not.

    `field` is what of the form is wrong, `hint` what is said beside it where `text` says more than that.
    `told`: the line says what the setpoint is now, so who sends again knows; as after any write.
    """
    view = view_of(request)
    if not wants_fragment(request):
        if status >= 400:
            back = operation.equipment.label, operation.url
            return error_answer(request, status, "operate.said", back=back, text=text)
        return RedirectResponse(local_path(form.get("next") or operation.url), 303)
    fresh = operation.fresh()
    response = view.fragment(
        request,
        "fragments/commands_answer.html",
        status=status,
        operation=fresh,
        equipment=fresh.equipment,
        text=text,
        kind=kind,
        at=fresh.words.time(operation.runtime.clock.micros()),
        key=key,
        field=field,
        hint=hint if hint != text else "",
        elsewhere=True,
    )
    if progress is not None:
        response.headers["X-Command"] = progress.id
    if told or progress is not None:
        response.headers["X-Value-Told"] = "1"
    return response


def _field_of(refusal: Refused) -> str:
    """The field of the form that a refusal is about; empty when it is about none."""
    if "argument" in refusal.params:
        return f"{ARGUMENT}{refusal.params['argument']}"
    if own := OWN_FIELD.get(refusal.reason):
        return own
    return "argument" if refusal.status == 422 or refusal.reason == "why.changed" else ""


def _question(
    request: Request, operation: Operation, form: Mapping[str, str], key: str, question: Question
) -> Response:
    """What the gate asks back: a dialog, or for a value the card with now and new."""
    params = question.params
    if "argument" in params:  # the field stays; the person writes it so that it means one thing
        said = operation.words.refusal(question)
        text = operation.about(key, said)
        return _answered(request, operation, form, text, "error", 422, key, field=_field_of(question), hint=said)
    machine = operation.equipment
    commands = machine.equipment.type.commands
    command = commands.get(key)
    point_key = command.argument if command else key
    point = machine.point(point_key) if point_key and machine.has(point_key) else None
    why = params.get("why")
    warning, effect = params.get("warning"), operation.effect(key)
    old, new = params.get("old"), params.get("new")
    context = {
        "operation": operation,
        "equipment": machine,
        "key": key,
        "url": request.url.path,
        "form": form,
        "level": str(params.get("level", "C2")),
        "label": machine.t(str(params.get("label", ""))),
        "question": question.reason,
        "effect": effect,
        "why": [machine.text(str(line)) for line in why if line != "ask.situation" or not effect]
        if isinstance(why, tuple)
        else [],
        "warning": machine.t(str(warning)) if warning else "",
        "needs_reason": bool(params.get("needs_reason")) or str(params.get("level", "")) >= "C3",
        "point": point,
        "old": old if isinstance(old, int | float) else None,
        "new": new if isinstance(new, int | float) else None,
        "part": _part_of_range(params),
        "choices": [
            (value, operation.words.text("operate.number", {"value": value, "unit": params.get("unit", "")}))
            for value in (params.get("a"), params.get("b"))
        ]
        if question.reason == "why.ambiguous"
        else [],
        "text": operation.words.refusal(question),
    }
    return view_of(request).fragment(request, "fragments/confirm.html", status=question.status, **context)


def _part_of_range(params: Mapping[str, object]) -> float | None:
    """How much of its range a value changes [%]: what a large change is told by; None when there is no range."""
    old, new, low, high = (params.get(name) for name in ("old", "new", "low", "high"))
    if not all(isinstance(one, int | float) and math.isfinite(one) for one in (old, new, low, high)):
        return None
    assert isinstance(old, int | float) and isinstance(new, int | float)
    assert isinstance(low, int | float) and isinstance(high, int | float)
    return 100 * (new - old) / (high - low) if high > low else None
