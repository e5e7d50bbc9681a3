"""Alarms for programs: those that are not normal, and their acknowledgement."""

from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from app.clock import to_datetime
from app.web.alarm_view import Drawing
from app.web.api.lookup import declared, runtime_of
from app.web.guard import allow, person_of, shown_name
from app.web.language import language_of

if TYPE_CHECKING:
    from app.alarms.watch import ListedAlarm

router = APIRouter(prefix="/api/v1")


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


class AckIn(BaseModel):
    """What somebody has seen."""

    model_config = ConfigDict(extra="forbid")

    occurrences: list[int] = Field(min_length=1, max_length=500)
    comment: str = Field("", max_length=500)


class AckOut(BaseModel):
    """What became of an acknowledgement."""

    occurrence: int
    outcome: str = Field(description="done, already, gone or hidden")
    by: str
    at: datetime | None
    stored: bool = Field(
        description="false: in memory only, the database takes nothing now; lost if the server stops before"
    )


@router.get("/alarms", dependencies=[allow("view"), declared])
async def alarms(request: Request) -> list[AlarmOut]:
    """All alarms that are not normal, the most important first."""
    runtime = runtime_of(request)
    view = Drawing(runtime, runtime.texts, language_of(request), partial(shown_name, request))
    return [_alarm(request, view, one) for one in runtime.alarms.list.active()]


@router.post("/alarms/acknowledge", dependencies=[allow("acknowledge"), declared])
async def acknowledge(request: Request, seen: AckIn) -> list[AckOut]:
    """Acknowledge these occurrences."""
    answers = await runtime_of(request).alarms.acknowledge(seen.occurrences, person_of(request), seen.comment)
    return [
        AckOut(
            occurrence=one.occurrence,
            outcome=one.outcome,
            by=one.by,
            at=to_datetime(one.at) if one.at else None,
            stored=one.stored,
        )
        for one in answers
    ]


def _alarm(request: Request, view: Drawing, one: "ListedAlarm") -> AlarmOut:
    return AlarmOut(
        id=one.id,
        occurrence=one.occurrence,
        equipment=one.equipment,
        priority=one.priority,
        state=one.state.value,
        text=view.text(one),
        came=to_datetime(one.first_true),
        returned=to_datetime(one.returned) if one.returned else None,
        acknowledged=to_datetime(one.acked_at) if one.acked_at else None,
        acknowledged_by=shown_name(request, one.acked_by),
        value=one.value,
        limit=one.limit,
        count=one.count,
    )
