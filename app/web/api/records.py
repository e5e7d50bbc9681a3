"""Records for programs: one address for all kinds, with the filters that each declares."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import BaseModel, Field
from sqlalchemy import Connection

from app.clock import to_datetime
from app.historian import record_query as query
from app.historian.record_export import keeping, kinds
from app.historian.records import source_of
from app.plant.kept import Definition
from app.plant.record_kinds import former_addresses
from app.plant.types import EQUIPMENT
from app.records.event import Event
from app.records.kind import RecordKind, Type
from app.records.record import Record
from app.web.api.lookup import Moment, declared, naming, one_of, only, open_range
from app.web.guard import allow, shown_name, shown_words
from app.web.history import read, runtime_of
from app.web.record_words import RecordWords
from app.web.records import kind_of, wanted_of

if TYPE_CHECKING:
    from app.runtime import Runtime

router = APIRouter(prefix="/api/v1")

OWN = frozenset({"equipment", "from", "to", "outcome", "before", "parts", "events", "limit"})
"""Parameters of every kind; beside them the filters of the kind."""
FILTERS = {
    "is": "a whole number",
    "above": "a number; what is above it is found",
    "any": "1; what has any is found",
    "choice": "a key that the records have",
    "alarm": "the code of an event, or any",
}
"""What the filters of a kind take, by how they compare."""
YES, NO = ("1", "true", "on", "yes", "t", "y"), ("0", "false", "off", "no", "f", "n")
"""How a program says so."""


class KindOut(BaseModel):
    """A kind of record."""

    kind: str
    title: str
    equipment: list[str]
    outcomes: list[str]
    filters: dict[str, str] = Field(description="parameter → is, above, any, choice, alarm")
    fields: dict[str, str] = Field(description="field → its unit or type")


class PartOut(BaseModel):
    """A part of a record: a step of a run."""

    number: int
    key: str
    state: str
    begun: datetime | None
    ended: datetime | None
    seconds: float | None = Field(description="how long it was active, pauses not counted [s]")
    paused: float = Field(description="s")


class EventOut(BaseModel):
    """One event of a record."""

    time: datetime
    sequence: int
    code: int
    event: str = Field(description="key of the code", examples=["head"])
    source: int
    value: float | None
    words: dict[str, float | int | None] = Field(description="what its snapshot says")
    person: str = Field(description="who asked for it")
    reason: str


class OverlapOut(BaseModel):
    """A record of another kind that lasted at any time of this one: a force in a run."""

    kind: str
    id: int
    number: int
    begun: datetime
    ended: datetime | None = Field(description="of one that has not ended: when it is to, if that is known")
    outcome: str
    fields: dict[str, Any]
    labels: dict[str, str]
    person: str = Field(description="who asked for it last")
    reason: str


class RecordOut(BaseModel):
    """What became of one thing on one machine."""

    id: int
    equipment: str
    number: int = Field(description="as the machine counts; 0 of a kind of which there is one at a time")
    boot: int
    begun: datetime
    begin_seen: bool
    outcome: str
    ended: datetime | None
    seconds: float | None = Field(description="how long it took, as the machine says or as counted [s]")
    paused: float = Field(description="s")
    events_lost: int = Field(description="events lost while it was under way")
    alarms: list[str] = Field(description="keys of its events that are alarms")
    definition: str = Field(description="name of what the machine was configured to do")
    fields: dict[str, Any] = Field(description="what its kind declares; times as ISO 8601")
    labels: dict[str, str] = Field(description="of fields that are keys, in the language of the request")
    parts: list[PartOut]
    events: list[EventOut]
    overlapping: dict[str, list[OverlapOut]] = Field(
        description="field that counts them → these records; with `events`"
    )


class RecordsOut(BaseModel):
    """A page of records, newest first; `next` is the `before` of the next page."""

    records: list[RecordOut]
    waiting: int = Field(description="events that these records miss because the history is not written at the moment")
    next: str | None


@router.get("/records", dependencies=[allow("view"), declared])
async def of_plant(request: Request) -> list[KindOut]:
    """The kinds of record that the machines of the plant have."""
    plant = runtime_of(request).plant
    machines = list(plant.equipment.values()) if plant else []
    return [
        KindOut(
            kind=name,
            title=RecordWords(request, kind).text("title"),
            equipment=[item.id for item in machines if name in item.type.records],
            outcomes=list(kind.outcomes),
            filters={key: one.how for key, one in kind.filters.items()},
            fields={key: one.unit or one.type.value for key, one in kind.fields.items()},
        )
        for name, kind in kinds(plant).items()
    ]


@router.get("/records/{kind}", dependencies=[allow("view")])
async def records(
    request: Request,
    kind: str,
    equipment: Annotated[str, Query(description="machine; empty: all", max_length=64)] = "",
    begin: Annotated[Moment | None, Query(alias="from", description="begun at or after")] = None,
    end: Annotated[Moment | None, Query(alias="to", description="begun before")] = None,
    outcome: Annotated[str, Query(description="one that the kind has", max_length=40)] = "",
    before: Annotated[str, Query(description="`next` of the page before", pattern="^(|[0-9]{1,18}-[0-9]{1,18})$")] = "",
    parts: Annotated[bool, Query(description="with the parts of each")] = True,
    events: Annotated[bool, Query(description="with all events of each")] = False,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> RecordsOut:
    """What became of things on machines, newest first; the filters of a kind are further parameters."""
    runtime, given = runtime_of(request), request.query_params
    of = kind_of(request, one_of("path.kind", kind, kinds(runtime.plant)))
    only(request, OWN | of.filters.keys())
    since, until = open_range(request, begin, end)
    typed = {name: given.get(name, "") for name in of.filters}
    typed |= {"equipment": equipment, "outcome": outcome, "before": before, "since": "", "until": ""}
    with naming(request, {name: FILTERS[one.how] for name, one in of.filters.items()}):
        wanted = replace(wanted_of(request, of, typed), begin=since, end=until)

    def work(connection: Connection) -> tuple[list[RecordOut], str | None]:
        found = query.find(connection, of, wanted, limit + 1)
        shown = found[:limit]
        ids = [one.id for one in shown]
        known = query.definitions(connection, [one.definition for one in shown if one.definition])
        asked = query.people(connection, ids)
        taken = query.parts(connection, ids if parts and of.parts else [])
        told = query.events(connection, ids if events else [])
        others = kinds(runtime.plant)
        made = []
        for one in shown:
            one.parts = dict(taken.get(one.id, {}))
            people = {
                name: shown_name(request, last.person)
                for name, field in of.fields.items()
                if field.type is Type.PERSON and (last := query.person(field, asked[one.id]))
            }
            definition = known.get(one.definition, Definition())
            said = _record(request, runtime, of, one, definition, people, told.get(one.id, []))
            if events:
                said.overlapping = {
                    field.name: _overlapping(request, connection, others[field.overlapping], one)
                    for field in of.fields.values()
                    if field.overlapping in others and one.fields.get(field.name)
                }
            made.append(said)
        return made, f"{shown[-1].begun}-{shown[-1].id}" if len(found) > limit else None

    made, following = await read(runtime, work, much=True)
    told = [equipment] if equipment else [item.id for item in keeping(runtime.plant, kind)]
    return RecordsOut(records=made, waiting=runtime.events.unstored(told), next=following)


def _moved(address: str, kind: str) -> None:
    """An address from before there were records leads to where they are now, with its parameters as they are called there."""

    async def moved(request: Request) -> Response:
        given = former_parameters(kind_of(request, kind), request.query_params.multi_items())
        return RedirectResponse(f"/api/v1/records/{kind}" + (f"?{urlencode(given)}" if given else ""), 308)

    router.add_api_route(f"/{address}", moved, methods=["GET"], dependencies=[allow("view")], include_in_schema=False)


for _address, _kind in former_addresses(EQUIPMENT).items():
    _moved(_address, _kind)


def former_parameters(kind: RecordKind, given: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Parameters as they were before there were records → as they are: steps are parts, or, of what has none, all events, and came
    unasked; what is only asked for is said with 1."""
    steps = "parts" if kind.parts else "events"
    found = []
    for name, value in given:
        if name in kind.filters and kind.filters[name].how == "any":
            if value.lower() in NO:
                continue
            value = "1" if value.lower() in YES else value
        found.append((steps if name == "steps" else name, value))
    if not kind.parts and not any(name == "events" for name, _ in found):
        found.append(("events", "true"))
    return found


def _record(
    request: Request,
    runtime: "Runtime",
    kind: RecordKind,
    one: Record,
    definition: Definition,
    people: dict[str, str],
    events: Sequence[Event],
) -> RecordOut:
    item = runtime.plant.equipment.get(one.equipment) if runtime.plant else None
    keys = item.type.events if item else {}
    draw = RecordWords(request, kind)
    fields, labels = _fields(draw, one, definition)
    fields |= {name: people.get(name, "") for name, field in kind.fields.items() if field.type is Type.PERSON}
    return RecordOut(
        id=one.id,
        equipment=one.equipment,
        number=one.number,
        boot=one.boot,
        begun=to_datetime(one.begun),
        begin_seen=one.entry > 0,
        outcome=one.outcome,
        ended=_moment(one.ended),
        seconds=one.seconds,
        paused=one.paused / 1e6,
        events_lost=one.missed,
        alarms=[keys.get(code, str(code)) for code in one.alarms],
        definition=definition.name,
        fields=fields,
        labels=labels,
        parts=[
            PartOut(
                number=part.number,
                key=part.key,
                state=part.state,
                begun=_moment(part.begun),
                ended=_moment(part.ended),
                seconds=part.seconds,
                paused=part.paused / 1e6,
            )
            for _, part in sorted(one.parts.items())
        ],
        events=[_event(request, runtime, event) for event in events],
        overlapping={},
    )


def _overlapping(request: Request, connection: Connection, kind: RecordKind, one: Record) -> list[OverlapOut]:
    found = query.overlapping(connection, kind, one)
    asked = query.people(connection, [each.id for each in found])
    known = query.definitions(connection, [each.definition for each in found])
    draw = RecordWords(request, kind)
    made = []
    for each in found:
        fields, labels = _fields(draw, each, known.get(each.definition, Definition()))
        last = query.person(None, asked[each.id])
        made.append(
            OverlapOut(
                kind=kind.name,
                id=each.id,
                number=each.number,
                begun=to_datetime(each.begun),
                ended=_moment(each.ended),
                outcome=each.outcome,
                fields=fields,
                labels=labels,
                person=shown_name(request, last.person) if last else "",
                reason=shown_words(request, last.reason) if last else "",
            )
        )
    return made


def _fields(draw: RecordWords, one: Record, definition: Definition) -> tuple[dict[str, Any], dict[str, str]]:
    """What a kind declares of a record, without people; labels of those that are keys."""
    fields: dict[str, Any] = {}
    labels: dict[str, str] = {}
    for name, field in draw.kind.fields.items():
        value = one.fields.get(name)
        if field.type is not Type.PERSON:
            fields[name] = to_datetime(value) if field.type is Type.TIME and isinstance(value, int) else value
        if field.type is Type.NAME and value:
            labels[name] = draw.label(definition.labels.get(str(value), {})) or str(value)
    return fields, labels


def _event(request: Request, runtime: "Runtime", event: Event) -> EventOut:
    item = runtime.plant.equipment.get(event.equipment) if runtime.plant else None
    source = source_of(item) if item else None
    reading = source.reading(event) if source else None
    return EventOut(
        time=to_datetime(event.time),
        sequence=event.sequence,
        code=event.code,
        event=reading.key if reading else str(event.code),
        source=event.source,
        value=event.value,
        words=dict(reading.words) if reading else {},
        person=shown_name(request, event.person),
        reason=shown_words(request, event.reason),
    )


def _moment(time: int | None) -> datetime | None:
    return None if time is None else to_datetime(time)
