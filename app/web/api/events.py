"""Events of machines for programs: what every event ring told, newest first, found as on the page."""

from dataclasses import replace
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field
from sqlalchemy import Connection

from app.clock import to_datetime
from app.historian import event_search as search
from app.historian import events as history
from app.historian.event_gaps import MOST, Gap, Place, gaps
from app.records.event import Event
from app.records.snapshot import decode
from app.web.api.lookup import Moment, declared, naming, open_range
from app.web.events import EventWords, wanted_of
from app.web.guard import allow, shown_name, shown_words
from app.web.history import read, runtime_of

router = APIRouter(prefix="/api/v1")


class RingEventOut(BaseModel):
    """One event as the ring of a machine told it."""

    id: int
    equipment: str
    boot: int = Field(description="start of the device that it belongs to")
    sequence: int
    time: datetime
    code: int
    event: str = Field(description="key of the code; the code when the machine has no name for it", examples=["head"])
    text: str = Field(description="the event in the language of the request")
    source: int
    value: float | None
    words: dict[str, float | int | None] = Field(description="what its snapshot says")
    raw: list[int] = Field(description="the words of the snapshot as they came")
    command: int = Field(description="number of the command that caused it; 0 = none")
    person: str = Field(description="who asked for it")
    reason: str


class PlaceOut(BaseModel):
    """A place in an event ring: the event that is there is known."""

    boot: int
    sequence: int
    time: datetime


class GapOut(BaseModel):
    """Events that were overwritten before they were read."""

    equipment: str
    count: int
    after: PlaceOut | None = Field(description="the last event before them; null: there is none")
    before: PlaceOut | None = Field(description="the first event after them; null: none came")


class EventsOut(BaseModel):
    """A page of events, newest first; `next` is the `before` of the next page."""

    events: list[RingEventOut]
    lost: int = Field(description="events of these machines and this time that were overwritten before they were read")
    gaps: list[GapOut] = Field(description=f"where they are missing, newest first, at most {MOST}")
    waiting: int = Field(
        description="events of these machines that are missing here because the history is not written at the moment"
    )
    next: str | None


@router.get("/events", dependencies=[allow("view"), declared])
async def events(
    request: Request,
    equipment: Annotated[str, Query(description="machine; empty: all", max_length=64)] = "",
    event: Annotated[str, Query(description="key or code of an event", max_length=80)] = "",
    begin: Annotated[Moment | None, Query(alias="from", description="happened at or after")] = None,
    end: Annotated[Moment | None, Query(alias="to", description="happened before")] = None,
    text: Annotated[
        str, Query(alias="q", description="in the event's words, its person or reason", max_length=80)
    ] = "",
    before: Annotated[str, Query(description="`next` of the page before", pattern="^(|[0-9]{1,18}-[0-9]{1,18})$")] = "",
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> EventsOut:
    """What machines told with their event rings, newest first."""
    since, until = open_range(request, begin, end)
    typed = {"equipment": equipment, "event": event, "q": text.strip(), "before": before, "since": "", "until": ""}
    with naming(request):
        wanted = replace(wanted_of(request, typed), begin=since, end=until)

    def work(connection: Connection) -> tuple[list[Event], int, list[Gap]]:
        lost = history.lost(connection, equipment, since, until)
        missing = gaps(connection, equipment, since, until) if lost else []
        return search.find(connection, wanted, limit + 1), lost, missing

    found, lost, missing = await read(runtime_of(request), work, much=True)
    shown, draw = found[:limit], EventWords(request)
    return EventsOut(
        events=[_event(request, draw, one) for one in shown],
        lost=lost,
        gaps=[
            GapOut(equipment=one.equipment, count=one.count, after=_place(one.after), before=_place(one.before))
            for one in missing
        ],
        waiting=runtime_of(request).events.unstored([equipment] if equipment else None),
        next=f"{shown[-1].time}-{shown[-1].id}" if len(found) > limit else None,
    )


def _place(one: Place | None) -> PlaceOut | None:
    return None if one is None else PlaceOut(boot=one.boot, sequence=one.sequence, time=to_datetime(one.time))


def _event(request: Request, draw: EventWords, one: Event) -> RingEventOut:
    item = draw.item(one.equipment)
    kind = item.type if item else None
    return RingEventOut(
        id=one.id,
        equipment=one.equipment,
        boot=one.boot,
        sequence=one.sequence,
        time=to_datetime(one.time),
        code=one.code,
        event=kind.events.get(one.code, str(one.code)) if kind else str(one.code),
        text=draw.text(kind, one.code),
        source=one.source,
        value=one.value,
        words=decode(kind.snapshot, one.words, one.code) if kind else {},
        raw=list(one.words),
        command=one.request,
        person=shown_name(request, one.person),
        reason=shown_words(request, one.reason),
    )
