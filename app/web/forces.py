"""The page "Forces": every permissive of the plant that is forced, by whom, why and for how long, and the way to take it back.

What is forced is read from the devices, which also release it. Who asked is the number that went with the command, why is in the audit
trail; only who is signed in is told either.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from app.access.audit import Filter, Record
from app.plant.definitions import Equipment, Plant
from app.web.guard import access_of, allow
from app.web.operation import Operation
from app.web.pages import view_of
from app.web.screens.sequence import BitView, SequenceView, sequence_of
from app.web.tables import RowView

router = APIRouter()

LOOKED_AT = 200
"""So many lines of the audit trail of one sequence are looked through for the reasons."""


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
        lines: list[Record] = []
        if access and sequence.forces:
            found_lines = await access.audit.find(Filter(object=f"{item.id}.force", kind="command"), 2 * LOOKED_AT)
            lines = [line for line in found_lines if line.kind == "command"]
        found = [
            ForceView(
                sequence.bit(_whole(row, "step"), _whole(row, "bit")),
                row,
                names.get(_whole(row, "owner"), ""),
                _reason(lines, _whole(row, "step"), _whole(row, "bit")),
            )
            for row in sequence.forces
        ]
        groups.append(Group(operation, sequence, found))
    return groups


def _whole(row: RowView, column: str) -> int:
    return int(row.number(column) or 0)


def _reason(lines: Sequence[Record], step: int, bit: int) -> str:
    """Why the newest force of a permissive was asked for; empty when nothing says it."""
    meant = f"step = {step}, bit = {bit},"
    return next((str(line.parameters.get("why", "")) for line in lines if line.new.startswith(meant)), "")
