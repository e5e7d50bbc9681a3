"""Commands and setpoints for programs, through the same gate and the same roles as a person's."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Request
from fastapi.responses import Response
from pydantic import BaseModel, ConfigDict, Field

from app.clock import to_datetime
from app.commands.lifecycle import Progress
from app.commands.orders import LONGEST_REASON
from app.commands.value_set import MOST
from app.errors import Refused
from app.plant.definitions import Equipment
from app.plant.type_files.arguments import MOST_ARGUMENTS
from app.web.api.lookup import declared, gate_of, item_of, one_of
from app.web.errors import Wrong
from app.web.guard import address_of, allow, person_of, shown_name
from app.web.operation import Operation

router = APIRouter(prefix="/api/v1")

PEOPLE = frozenset({"person", "holder", "display", "by", "who", "name"})
"""Parameters of a reason that are somebody's name."""


class CommandIn(BaseModel):
    """A command as asked."""

    model_config = ConfigDict(extra="forbid")

    id: str = Field(description="made once per press: the same id is not executed again", min_length=8, max_length=64)
    nonce: str = Field("", description="from POST /nonce, lives 10 s, single use; Stop needs none", max_length=128)
    value: float | None = Field(None, description="argument, in the unit of its point", allow_inf_nan=False)
    arguments: dict[str, Annotated[float, Field(allow_inf_nan=False)]] = Field(
        {}, description="of a command that takes several, by name", max_length=MOST_ARGUMENTS
    )
    expected: float | None = Field(
        None, description="what the setpoint was seen at; 409 when it is not", allow_inf_nan=False
    )
    confirmed: bool = Field(False, description="true: what asks for it (409 `why.confirm`) is meant so")
    reason: str = Field("", description="why, for the audit trail", max_length=LONGEST_REASON)


class SetIn(BaseModel):
    """Several setpoints as asked: all are written, or none."""

    model_config = ConfigDict(extra="forbid")

    id: str = Field(description="made once per press: the same id is not executed again", min_length=8, max_length=64)
    nonce: str = Field("", description="from POST /nonce, lives 10 s, single use", max_length=128)
    values: dict[str, Annotated[float, Field(allow_inf_nan=False)]] = Field(
        description="by setpoint, in the unit of its point", min_length=1, max_length=MOST
    )
    expected: dict[str, Annotated[float, Field(allow_inf_nan=False)]] = Field(
        {}, description="what the setpoints were seen at; 409 when one is not", max_length=MOST
    )
    confirmed: bool = Field(False, description="true: what asks for it (409 `why.confirm`) is meant so")
    reason: str = Field("", description="why, for the audit trail", max_length=LONGEST_REASON)


class ChangeOut(BaseModel):
    """One value of a set of setpoints."""

    setpoint: str
    old: float
    new: float
    found: float | None = Field(description="what the device holds; null: not read yet, or not to be read")
    stands: str = Field(description="new, old, other or unknown; unknown also while the set is being written")


class CommandOut(BaseModel):
    """Where a command stands. `accepted` is not done: `confirmed` is, and only that."""

    id: str
    equipment: str
    command: str
    state: str = Field(
        description="requested, accepted, confirmed, failed, unconfirmed, refused, unknown, dry_run, superseded"
    )
    person: str
    requested: datetime
    accepted: datetime | None
    ended: datetime | None
    value: float | None
    arguments: dict[str, float]
    reason: str = Field(description="key of the text")
    changes: list[ChangeOut] = Field([], description="of a set of setpoints, each with what the device holds of it")


class NonceOut(BaseModel):
    """Allows one command within 10 s."""

    nonce: str


class ControlOut(BaseModel):
    """Who has control of a machine, and who waits for it."""

    holder: str = Field(description="empty: nobody")
    since: datetime | None
    yours: bool
    line: list[str] = Field(description="who waits, the next one first")
    place: int = Field(description="yours in the line, from 1; 0: you do not wait")
    asked: bool = Field(description="the first in line is put to the holder, who may refuse")
    left: float | None = Field(
        description="seconds after which the first has it if the holder keeps silent; null: nobody waits, or it cannot be told"
    )


class ReasonOut(BaseModel):
    """Why a command is not possible now."""

    key: str
    params: dict[str, Any]
    text: str


@router.post("/nonce", dependencies=[allow("operate"), declared])
async def nonce(request: Request) -> NonceOut:
    """A nonce for the next command of this token or session."""
    return NonceOut(nonce=gate_of(request).nonces.issue(person_of(request).session))


@router.post("/equipment/{key}/control/{action}", dependencies=[allow("operate"), declared], status_code=204)
async def control(request: Request, key: str, action: str) -> Response:
    """`take`, `request`, `withdraw`, `refuse`, `give` or `release` the control of a machine."""
    token, item, person = gate_of(request).control, item_of(request, key), person_of(request)
    actions = {
        "take": token.take,
        "request": token.request,
        "withdraw": token.withdraw,
        "refuse": token.refuse,
        "give": token.give,
        "release": token.release,
    }
    actions[one_of("path.action", action, actions)](person, item.id)
    return Response(status_code=204)


@router.get("/equipment/{key}/control", dependencies=[allow("view"), declared])
async def control_of(request: Request, key: str) -> ControlOut:
    """Who has control of a machine, and who waits for it."""
    token, item, person = gate_of(request).control, item_of(request, key), request.state.person
    holder = token.holder(item.id)
    return ControlOut(
        holder=shown_name(request, holder.display) if holder else "",
        since=to_datetime(holder.since) if holder else None,
        yours=person is not None and token.holds(person, item.id),
        line=[shown_name(request, place.display) for place in token.line(item.id)],
        place=token.number(person, item.id) if person is not None else 0,
        asked=token.request_for(item.id) is not None,
        left=token.yields_in(item.id),
    )


@router.get("/equipment/{key}/commands/{command}/reasons", dependencies=[allow("view"), declared])
async def reasons(request: Request, key: str, command: str) -> list[ReasonOut]:
    """Why this command is not possible now, the first missing one first; empty when it is."""
    item = item_of(request, key)
    one_of("path.command", command, [*item.type.commands, *item.type.setpoints])
    words = Operation(request, item).words
    return [
        ReasonOut(
            key=one.key,
            params={name: str(value) for name, value in params.items()},
            text=words.text(one.key, params, one.label),
        )
        for one in gate_of(request).why_not(request.state.person, item.id, command)
        for params in [
            {name: shown_name(request, str(value)) if name in PEOPLE else value for name, value in one.params.items()}
        ]
    ]


@router.post("/equipment/{key}/stop", dependencies=[allow("stop")])
async def stop(request: Request, key: str, order: CommandIn) -> CommandOut:
    """Stop the machine: no control, no nonce, no question."""
    item = item_of(request, key)
    command = next((name for name, one in item.type.commands.items() if one.stop), None)
    if command is None:
        raise Wrong("path.key", key, "a machine with a stop", 404)
    return await _ask(request, item, command, order)


@router.post("/equipment/{key}/commands/{command}", dependencies=[allow("operate"), declared], status_code=202)
async def command(request: Request, key: str, command: str, order: CommandIn) -> CommandOut:
    """Ask for a command; the answer says accepted, GET the command to see it confirmed."""
    item = item_of(request, key)
    one_of("path.command", command, item.type.commands)
    return await _ask(request, item, command, order)


@router.post("/equipment/{key}/setpoints/{setpoint}", dependencies=[allow("operate"), declared], status_code=202)
async def setpoint(request: Request, key: str, setpoint: str, order: CommandIn) -> CommandOut:
    """Write a setpoint or parameter; confirmed is what was read back."""
    item = item_of(request, key)
    one_of("path.setpoint", setpoint, item.type.setpoints)
    if order.value is None:
        raise Wrong("body.value", order.value, "a number")
    if order.arguments:
        raise Wrong("body.arguments", order.arguments, "none: a setpoint has one value")
    with _in_words(request, item):
        progress = await gate_of(request).set_value(
            person_of(request), item.id, setpoint, order.value, **_given(request, order)
        )
    return _progress(progress)


@router.post("/equipment/{key}/setpoints", dependencies=[allow("operate"), declared])
async def setpoints(request: Request, key: str, order: SetIn) -> CommandOut:
    """Write several setpoints and parameters as one: all, or none. Answered when it is over, with what the device holds of each."""
    item = item_of(request, key)
    for name in order.values:
        one_of("body.values", name, item.type.setpoints)
    with _in_words(request, item):
        progress = await gate_of(request).set_values(
            person_of(request),
            item.id,
            order.values,
            seen=order.expected,
            id=order.id,
            nonce=order.nonce,
            confirmed=order.confirmed,
            reason=order.reason,
            address=address_of(request.scope),
        )
    return _progress(progress)


@router.get("/equipment/{key}/commands", dependencies=[allow("view"), declared])
async def commands(request: Request, key: str) -> list[CommandOut]:
    """The last commands of a machine, the newest first."""
    item = item_of(request, key)
    gate = gate_of(request)
    current = gate.progress(item.id)
    past = [one for one in gate.history(item.id) if current is None or one.id != current.id]
    told = [_progress(one) for one in ([current] if current else []) + sorted(past, key=lambda one: -one.requested)]
    return [one.model_copy(update={"person": shown_name(request, one.person)}) for one in told]


async def _ask(request: Request, item: Equipment, command: str, order: CommandIn) -> CommandOut:
    given = _given(request, order) | {"argument": order.value, "arguments": order.arguments}
    with _in_words(request, item):
        return _progress(await gate_of(request).ask(person_of(request), item.id, command, **given))


@contextmanager
def _in_words(request: Request, item: Equipment) -> Iterator[None]:
    """Who is refused reads what is missing by the name that it has at this machine, with its numbers."""
    try:
        yield
    except Refused as error:
        if label := error.params.get("label"):
            error.params["label"] = Operation(request, item).words.told(str(label), error.params)
        raise


def _given(request: Request, order: CommandIn) -> dict[str, Any]:
    return {
        "id": order.id,
        "nonce": order.nonce,
        "expected": order.expected,
        "confirmed": order.confirmed,
        "reason": order.reason,
        "address": address_of(request.scope),
    }


def _progress(progress: Progress) -> CommandOut:
    return CommandOut(
        id=progress.id,
        equipment=progress.equipment,
        command=progress.command,
        state=progress.state.value,
        person=progress.person,
        requested=to_datetime(progress.requested),
        accepted=to_datetime(progress.accepted) if progress.accepted else None,
        ended=to_datetime(progress.ended) if progress.ended else None,
        value=progress.argument,
        arguments=dict(progress.arguments),
        reason=progress.reason,
        changes=[
            ChangeOut(setpoint=one.key, old=one.old, new=one.new, found=one.found, stands=one.stands.value)
            for one in progress.changes
        ],
    )
