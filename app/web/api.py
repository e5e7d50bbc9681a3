"""The interface for other programs, `/api/v1`: tags, history, alarms, commands, through the same gate and the same roles.

A program sends `Authorization: Bearer <token>` (made on the page of tokens); a signed-in browser may use it, too, with its session and
`X-CSRF-Token`. Numbers are plain JSON numbers in the unit of the tag, times ISO 8601 UTC with µs. The socket is in docs/api.md.
"""

from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

import orjson
from fastapi import APIRouter, Body, HTTPException, Query, Request
from fastapi.openapi.utils import get_openapi
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy import Connection

from app import __version__
from app.clock import to_datetime, to_micros
from app.commands.gate import Gate
from app.commands.lifecycle import Progress
from app.commands.orders import LONGEST_REASON
from app.commands.value_set import MOST
from app.errors import Refused
from app.historian import query
from app.plant.definitions import Equipment, Point
from app.plant.type_files.commands import MOST_ARGUMENTS
from app.tags import quality as q
from app.web import event_api, record_api
from app.web.guard import address_of, allow, check_points, may_read, person_of, shown_name
from app.web.history import read
from app.web.language import language_of

if TYPE_CHECKING:
    from app.alarms.watch import Standing
    from app.runtime import Runtime
    from app.web.view import View

router = APIRouter(prefix="/api/v1")
pages = APIRouter()
"""The packaged pages that describe it."""

MOST_TAGS = 500
MOST_SERIES = 8
PEOPLE = frozenset({"person", "holder", "display", "by", "who", "name"})
"""Parameters of a reason that are somebody's name."""


class TagOut(BaseModel):
    """One tag as it stands."""

    name: str = Field(examples=["m1.speed"])
    value: float | str | None = Field(description="None when the quality is bad")
    quality: str = Field(description="good, uncertain or bad, with the reason after a colon", examples=["good"])
    origin: list[str] = Field(description="simulated, forced, substituted, local")
    unit: str
    time: datetime | None = Field(description="when the value was true")
    age: float | None = Field(description="seconds since its source last made sure of it")
    label: str
    text: str = Field(description="of an enumeration, in the language asked for", default="")


class EquipmentOut(BaseModel):
    """One machine."""

    id: str
    type: str
    area: str
    link: str
    unit: int
    label: dict[str, str]
    tags: list[str]
    commands: list[str]
    setpoints: list[str]


class PlantOut(BaseModel):
    """The plant."""

    name: dict[str, str]
    timezone: str
    languages: list[str]
    revision: int
    simulated: bool
    version: str
    equipment: list[EquipmentOut]


class SeriesOut(BaseModel):
    """A decimated series: columns with first, lowest, highest, last; null breaks the line.

    A column of `count` 0 has no sample of its own: it is an edge or a break.
    """

    tag: str
    unit: str
    source: str = Field(description="sample, minute or hour")
    step: float = Field(description="width of a column [s]")
    time: list[datetime]
    first: list[float | None]
    low: list[float | None]
    high: list[float | None]
    last: list[float | None]
    quality: list[int] = Field(description="worst level: 0 good, 1 uncertain, 2 bad")
    count: list[int] = Field(description="samples in the column")


class SampleOut(BaseModel):
    """One stored sample."""

    time: datetime
    value: float | str | None
    quality: str
    origin: list[str]


class RawOut(BaseModel):
    """Stored samples in order; `next` is where to go on when there are more."""

    tag: str
    unit: str
    samples: list[SampleOut]
    next: datetime | None


class AlarmOut(BaseModel):
    """An alarm that is not normal."""

    id: str
    occurrence: int
    equipment: str
    priority: int
    state: str = Field(description="letter of ISA-18.2: B unacknowledged, C acknowledged, D returned, E/F latched")
    text: str
    came: datetime
    returned: datetime | None
    acknowledged: datetime | None
    acknowledged_by: str
    value: float | None
    limit: float | None
    count: int


class ErrorOut(BaseModel):
    """Why something was not done."""

    error: str = Field(description="key of the reason", examples=["why.confirm"])
    text: str = Field("", description="in the language of the request")
    argument: str = Field("", description="which argument of a command is wrong")
    reference: str = Field("", description="under which the log of the server has an error of ours")
    fields: list[dict[str, str]] = Field([], description="fields of the request that are wrong: field, expected")


class AckOut(BaseModel):
    """What became of an acknowledgement."""

    occurrence: int
    outcome: str = Field(description="done, already, gone or hidden")
    by: str
    at: datetime | None


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


class ReasonOut(BaseModel):
    """Why a command is not possible now."""

    key: str
    params: dict[str, Any]
    text: str


@router.get("/plant", dependencies=[allow("view")])
async def plant(request: Request) -> PlantOut:
    """The plant and its machines."""
    runtime = runtime_of(request)
    if runtime.plant is None:
        raise Refused("error.unavailable", 503)
    return PlantOut(
        name=dict(runtime.plant.name),
        timezone=runtime.plant.timezone,
        languages=list(runtime.plant.languages),
        revision=runtime.tags.revision,
        simulated=runtime.simulated,
        version=__version__,
        equipment=[_equipment(runtime, item) for item in runtime.plant.equipment.values()],
    )


@router.get("/equipment/{key}", dependencies=[allow("view")])
async def equipment(request: Request, key: str) -> EquipmentOut:
    """One machine."""
    return _equipment(runtime_of(request), item_of(request, key))


@router.get("/tags", dependencies=[allow("view")])
async def tags(
    request: Request,
    names: Annotated[str, Query(description="comma separated; empty: all", max_length=20_000)] = "",
    prefix: Annotated[str, Query(description="only names that begin so: m1.", max_length=200)] = "",
    after: Annotated[str, Query(description="go on after this name", max_length=200)] = "",
    limit: Annotated[int, Query(ge=1, le=MOST_TAGS)] = MOST_TAGS,
) -> list[TagOut]:
    """Tags as they stand, in order of their names."""
    runtime = runtime_of(request)
    if names.count(",") > MOST_TAGS:
        raise HTTPException(422)
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    check_points(request, wanted)
    wanted = wanted or [
        name
        for name in sorted(runtime.points)
        if name.startswith(prefix) and name > after and may_read(request, runtime.points[name])
    ]
    return [_tag(request, runtime, point_of(runtime, name)) for name in wanted[:limit]]


@router.get("/tags/{name}", dependencies=[allow("view")])
async def tag(request: Request, name: str) -> TagOut:
    """One tag as it stands."""
    runtime = runtime_of(request)
    check_points(request, [name])
    return _tag(request, runtime, point_of(runtime, name))


@router.get("/history", dependencies=[allow("view")])
async def history(
    request: Request,
    tags: Annotated[str, Query(description=f"comma separated, at most {MOST_SERIES}", max_length=2000)],
    begin: Annotated[datetime, Query(alias="from")],
    end: Annotated[datetime, Query(alias="to")],
    width: Annotated[int, Query(ge=1, le=query.MAX_WIDTH, description="columns")] = 1000,
) -> list[SeriesOut]:
    """Series as a screen needs them: no spike is lost, whatever the width."""
    runtime = runtime_of(request)
    points = [point_of(runtime, name.strip()) for name in tags.split(",") if name.strip()]
    check_points(request, [point.name for point in points])
    if not 1 <= len(points) <= MOST_SERIES:
        raise HTTPException(422)
    first, last = _range(begin, end)

    def work(connection: Connection) -> list[SeriesOut]:
        return [_series(connection, point, first, last, width) for point in points]

    return await read(runtime, work)


@router.get("/history/{name}/raw", dependencies=[allow("export")])
async def raw(
    request: Request,
    name: str,
    begin: Annotated[datetime, Query(alias="from")],
    end: Annotated[datetime, Query(alias="to")],
    limit: Annotated[int, Query(ge=1, le=50_000)] = 10_000,
) -> RawOut:
    """Every stored sample, a page at a time."""
    runtime = runtime_of(request)
    point = point_of(runtime, name)
    check_points(request, [name])
    first, last = _range(begin, end)

    def work(connection: Connection) -> list[tuple[int, float | str | None, int]]:
        known = query.find(connection, point.id)
        return query.page(connection, known.number, first - 1, last, limit + 1) if known else []

    rows = await read(runtime, work)
    return RawOut(
        tag=name,
        unit=point.unit,
        samples=[
            SampleOut(time=to_datetime(t), value=value, quality=q.name(word), origin=_origins(word))
            for t, value, word in rows[:limit]
        ],
        next=to_datetime(rows[limit][0]) if len(rows) > limit else None,
    )


@router.get("/alarms", dependencies=[allow("view")])
async def alarms(request: Request) -> list[AlarmOut]:
    """All alarms that are not normal, the most important first."""
    runtime = runtime_of(request)
    return [_alarm(request, runtime, standing) for standing in runtime.alarms.standing()]


@router.post("/alarms/acknowledge", dependencies=[allow("acknowledge")])
async def acknowledge(
    request: Request,
    occurrences: Annotated[list[int], Body(embed=True, min_length=1, max_length=500)],
    comment: Annotated[str, Body(embed=True, max_length=500)] = "",
) -> list[AckOut]:
    """Acknowledge these occurrences."""
    answers = await runtime_of(request).alarms.acknowledge(occurrences, person_of(request), comment)
    return [
        AckOut(occurrence=one.occurrence, outcome=one.outcome, by=one.by, at=to_datetime(one.at) if one.at else None)
        for one in answers
    ]


@router.post("/nonce", dependencies=[allow("operate")])
async def nonce(request: Request) -> NonceOut:
    """A nonce for the next command of this token or session."""
    return NonceOut(nonce=gate_of(request).nonces.issue(person_of(request).session))


@router.post("/equipment/{key}/control/{action}", dependencies=[allow("operate")], status_code=204)
async def control(request: Request, key: str, action: str) -> Response:
    """`take`, `request`, `refuse`, `give` or `release` the control of a machine."""
    token, item, person = gate_of(request).control, item_of(request, key), person_of(request)
    actions = {
        "take": token.take,
        "request": token.request,
        "refuse": token.refuse,
        "give": token.give,
        "release": token.release,
    }
    if action not in actions:
        raise HTTPException(404)
    actions[action](person, item.id)
    return Response(status_code=204)


@router.get("/equipment/{key}/commands/{command}/reasons", dependencies=[allow("view")])
async def reasons(request: Request, key: str, command: str) -> list[ReasonOut]:
    """Why this command is not possible now, the first missing one first; empty when it is."""
    item = item_of(request, key)
    if command not in item.type.commands and command not in item.type.setpoints:
        raise HTTPException(404)
    runtime, lang = runtime_of(request), language_of(request)
    return [
        ReasonOut(
            key=one.key,
            params={name: str(value) for name, value in params.items()},
            text=runtime.texts.of_type(lang, item.type, one.label or one.key, **params),
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
        raise HTTPException(404)
    return await _ask(request, item, command, order)


@router.post("/equipment/{key}/commands/{command}", dependencies=[allow("operate")], status_code=202)
async def command(request: Request, key: str, command: str, order: CommandIn) -> CommandOut:
    """Ask for a command; the answer says accepted, GET the command to see it confirmed."""
    item = item_of(request, key)
    if command not in item.type.commands:
        raise HTTPException(404)
    return await _ask(request, item, command, order)


@router.post("/equipment/{key}/setpoints/{setpoint}", dependencies=[allow("operate")], status_code=202)
async def setpoint(request: Request, key: str, setpoint: str, order: CommandIn) -> CommandOut:
    """Write a setpoint or parameter; confirmed is what was read back."""
    item = item_of(request, key)
    if setpoint not in item.type.setpoints:
        raise HTTPException(404)
    if order.value is None or order.arguments:
        raise HTTPException(422)
    progress = await gate_of(request).set_value(
        person_of(request), item.id, setpoint, order.value, **_given(request, order)
    )
    return _progress(progress)


@router.post("/equipment/{key}/setpoints", dependencies=[allow("operate")])
async def setpoints(request: Request, key: str, order: SetIn) -> CommandOut:
    """Write several setpoints and parameters as one: all, or none. Answered when it is over, with what the device holds of each."""
    item = item_of(request, key)
    if not order.values.keys() <= item.type.setpoints.keys():
        raise HTTPException(404)
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


@router.get("/equipment/{key}/commands", dependencies=[allow("view")])
async def commands(request: Request, key: str) -> list[CommandOut]:
    """The last commands of a machine, the newest first."""
    item = item_of(request, key)
    gate = gate_of(request)
    current = gate.progress(item.id)
    past = [one for one in gate.history(item.id) if current is None or one.id != current.id]
    told = [_progress(one) for one in ([current] if current else []) + sorted(past, key=lambda one: -one.requested)]
    return [one.model_copy(update={"person": shown_name(request, one.person)}) for one in told]


@router.get("/openapi.json", dependencies=[allow("configure")], include_in_schema=False)
async def openapi(request: Request) -> Response:
    """The description of this interface."""
    return Response(described(), media_type="application/json")


@cache
def described() -> bytes:
    """The description as JSON, made once: it takes long."""
    routes = [route for part in (router, record_api.router, event_api.router) for route in part.routes]
    schema = get_openapi(title="Pogon", version=__version__, description=__doc__, routes=routes)
    schema["components"]["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
    schema["security"] = [{"token": []}]
    schema["components"]["schemas"]["ErrorOut"] = ErrorOut.model_json_schema()
    content = {"application/json": {"schema": {"$ref": "#/components/schemas/ErrorOut"}}}
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            for status in errors_of(path, method):
                operation["responses"][str(status)] = {"description": ERRORS[status], "content": content}
    return orjson.dumps(schema)


ERRORS: Mapping[int, str] = {
    400: "the body cannot be read",
    401: "the token is unknown or over, or nobody is signed in",
    403: "the token or the person may not do this",
    404: "there is no such machine, tag, command or setpoint",
    408: "the body did not arrive in time",
    409: "not possible now, or it has to be confirmed first (`why.confirm`: ask again with `confirmed` true)",
    410: "the nonce is unknown, used or older than 10 s",
    413: "the body is too large",
    415: "the body is no JSON in utf-8",
    422: "a value is missing, out of range or not understood",
    423: "somebody else has the control of this machine",
    429: "too many commands in a short time",
    503: "the device is silent, or the server cannot do it now",
}
"""What an answer other than the good one means."""


def errors_of(path: str, method: str) -> list[int]:
    """The errors that a road of the interface may answer with."""
    if method == "get":
        return [401, 403, *([404] if "{" in path or path.endswith(("/tags", "/history")) else []), 422, 503]
    ordering = "/equipment/" in path
    return [400, 401, 403, 408, *([404, 409, 410, 423] if ordering else []), 413, 415, 422, 429, 503]


DOCS_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; object-src 'none'; frame-ancestors 'none'"
)
"""Of the packaged API pages alone: they style themselves."""


@pages.get("/docs", dependencies=[allow("configure")], include_in_schema=False)
async def docs(request: Request) -> HTMLResponse:
    """The API pages, packaged with the product."""
    view: View = request.app.state.view
    response = view.fragment(request, "pages/api.html")
    response.headers["content-security-policy"] = DOCS_POLICY
    return response


# ---- what is asked of the runtime -------------------------------------------------------------------------


def runtime_of(request: Request) -> "Runtime":
    """The running plant."""
    runtime: Runtime = request.app.state.runtime
    return runtime


def gate_of(request: Request) -> Gate:
    """The gate.

    Raises:
        Refused: 503 while there is no plant.
    """
    gate = runtime_of(request).gate
    if gate is None:
        raise Refused("error.unavailable", 503)
    return gate


def item_of(request: Request, key: str) -> Equipment:
    """The machine `key`, or 404."""
    plant = runtime_of(request).plant
    if plant is None or key not in plant.equipment:
        raise HTTPException(404)
    return plant.equipment[key]


def point_of(runtime: "Runtime", name: str) -> Point:
    """The point `name`, or 404."""
    if name not in runtime.points:
        raise HTTPException(404)
    return runtime.points[name]


async def _ask(request: Request, item: Equipment, command: str, order: CommandIn) -> CommandOut:
    given = _given(request, order) | {"argument": order.value, "arguments": order.arguments}
    try:
        return _progress(await gate_of(request).ask(person_of(request), item.id, command, **given))
    except Refused as error:
        if label := error.params.get("label"):
            error.params["label"] = runtime_of(request).texts.of_type(language_of(request), item.type, str(label))
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


def _range(begin: datetime, end: datetime) -> tuple[int, int]:
    if begin.tzinfo is None or end.tzinfo is None or end <= begin:
        raise HTTPException(422)
    return to_micros(begin), to_micros(end)


# ---- what is answered -------------------------------------------------------------------------------------


def _equipment(runtime: "Runtime", item: Equipment) -> EquipmentOut:
    return EquipmentOut(
        id=item.id,
        type=item.type.name,
        area=item.area,
        link=item.link,
        unit=item.unit,
        label=dict(item.label),
        tags=[point.name for point in item.points.values() if point.name in runtime.points],
        commands=list(item.type.commands),
        setpoints=list(item.type.setpoints),
    )


def _tag(request: Request, runtime: "Runtime", point: Point) -> TagOut:
    handle = runtime.tags.handle(point.name)
    sample, age, lang = runtime.tags.read(handle), runtime.tags.age(handle), language_of(request)
    item = runtime.plant.equipment.get(point.equipment) if runtime.plant else None

    def text(key: str) -> str:
        return runtime.texts.of_type(lang, item.type, key) if item else runtime.texts.text(lang, key)

    key = point.texts.get(int(sample.value)) if isinstance(sample.value, int | float) else None
    return TagOut(
        name=point.name,
        value=None if q.is_bad(sample.quality) else sample.value,
        quality=q.name(sample.quality),
        origin=_origins(sample.quality),
        unit=point.unit,
        time=to_datetime(sample.time) if sample.time else None,
        age=None if age == float("inf") else round(age, 3),
        label=text(point.label),
        text=text(key) if key else "",
    )


def _origins(word: int) -> list[str]:
    return [flag.name.lower() for flag in q.origin(word) if flag.name]


def _series(connection: Connection, point: Point, begin: int, end: int, width: int) -> SeriesOut:
    known = query.find(connection, point.id)
    found = query.columns(connection, known.number, begin, end, width) if known else query.Columns()
    return SeriesOut(
        tag=point.name,
        unit=point.unit,
        source=found.source,
        step=found.step / 1e6,
        time=[to_datetime(t) for t in found.time],
        first=found.first,
        low=found.low,
        high=found.high,
        last=found.last,
        quality=found.quality,
        count=found.count,
    )


def _alarm(request: Request, runtime: "Runtime", one: "Standing") -> AlarmOut:
    lang = language_of(request)
    text = (
        runtime.texts.of_type(lang, one.type, one.label, **one.params)
        if one.type
        else runtime.texts.text(lang, one.label, **one.params)
    )
    return AlarmOut(
        id=one.id,
        occurrence=one.occurrence,
        equipment=one.equipment,
        priority=one.priority,
        state=one.state.value,
        text=text,
        came=to_datetime(one.first_true),
        returned=to_datetime(one.returned) if one.returned else None,
        acknowledged=to_datetime(one.acked_at) if one.acked_at else None,
        acknowledged_by=shown_name(request, one.acked_by),
        value=one.value,
        limit=one.limit,
        count=one.count,
    )


def _moment(time: int | None) -> datetime | None:
    return None if time is None else to_datetime(time)


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


ROUTERS: Sequence[APIRouter] = (router, pages)
