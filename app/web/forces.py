"""The page "Forces": every permissive of the plant that is forced, by whom, why and for how long, and the way to take it back.

What is forced is read from the devices, which also release it. Who asked is the number that went with the command; why stands at the event
with which the force began, which carries the id of the command that caused it. Only who is signed in is told either.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection

from app.errors import Refused
from app.historian import record_query as query
from app.historian.record_export import kinds
from app.historian.record_query import Wanted
from app.plant.definitions import Equipment, Plant
from app.records.record import OPEN
from app.web.guard import access_of, allow
from app.web.history import read
from app.web.operation import Operation
from app.web.pages import view_of
from app.web.screens.sequence import BitView, SequenceView, sequence_of
from app.web.tables import RowView

router = APIRouter()

FORCE = "force"
"""The kind of record that tells why."""
BITS = 16
"""Permissives of a step."""
MOST_FORCES = 200
"""Records that are looked at for the reasons: a device keeps 32 forces at a time."""


@dataclass(frozen=True, slots=True)
class ForceView:
    """One force that holds."""

    bit: BitView
    row: RowView
    who: str
    why: str


@dataclass(frozen=True, slots=True)
class Group:
    """The forces of one sequence."""

    operation: Operation
    sequence: SequenceView
    forces: Sequence[ForceView]

    @property
    def known(self) -> bool:
        """Whether the device tells them at all."""
        return self.sequence.value("forces") is not None


@router.get("/forces", dependencies=[allow("view")])
async def forces(request: Request) -> HTMLResponse:
    """All forces of the plant."""
    view = view_of(request)
    title = view.text(request, "forces.title")
    return view.page(request, "pages/forces.html", title=title, kind="forces", groups=await _groups(request))


@router.get("/forces/list", dependencies=[allow("view")])
async def rows(request: Request) -> HTMLResponse:
    """The lists alone, after a change."""
    return view_of(request).fragment(request, "fragments/force_rows.html", groups=await _groups(request))


def sequences(plant: Plant | None) -> list[Equipment]:
    """Machines that run a sequence."""
    return [item for item in plant.equipment.values() if item.sequence] if plant else []


async def _groups(request: Request) -> list[Group]:
    runtime = view_of(request).runtime(request)
    person = getattr(request.state, "person", None)
    access = access_of(request.app) if person is not None else None
    names = {one.id & 0xFFFF: one.display for one in await access.people.all()} if access else {}
    groups = []
    for item in sequences(runtime.plant):
        operation = Operation(request, item)
        sequence = sequence_of(operation.equipment)
        if sequence is None:
            continue
        reasons = await _reasons(request, item.id) if access and sequence.forces else {}
        found = [
            ForceView(
                sequence.bit(_whole(row, "step"), _whole(row, "bit")),
                row,
                names.get(_whole(row, "owner"), ""),
                reasons.get(_whole(row, "step") * BITS + _whole(row, "bit"), ""),
            )
            for row in sequence.forces
        ]
        groups.append(Group(operation, sequence, found))
    return groups


def _whole(row: RowView, column: str) -> int:
    return int(row.number(column) or 0)


async def _reasons(request: Request, equipment: str) -> dict[int, str]:
    """Place of a permissive → why the force that stands was asked for."""
    runtime = view_of(request).runtime(request)
    kind = kinds(runtime.plant).get(FORCE)
    if kind is None:
        return {}

    def work(connection: Connection) -> dict[int, str]:
        found = query.find(connection, kind, Wanted(equipment, outcome=OPEN), MOST_FORCES)
        asked = query.people(connection, [one.id for one in found])
        return {one.number: last.reason for one in found if (last := query.person(None, asked[one.id]))}

    try:
        return await read(runtime, work)
    except Refused:  # a history that cannot be read hides no force
        return {}
