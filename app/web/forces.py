"""The page "Forces": every intervention of the plant that stands, by whom, why and for how long, and the way to take it back.

Which tables hold interventions is said by the types (`[<table>.interventions]`). What stands is read from the devices, which also end it.
Who asked is the number that went with the command; why stands at the event with which the record of it began, which carries the id of the
command that caused it. Only who is signed in is told either.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection

from app.errors import Refused
from app.historian import record_query as query
from app.historian.record_export import kinds
from app.historian.record_query import RecordFilter
from app.plant.definitions import Interventions
from app.plant.system import EVENTS, SYSTEM
from app.records.record import OPEN
from app.web.guard import access_of, allow
from app.web.history import read
from app.web.operation import Button, Operation
from app.web.pages import view_of
from app.web.points import PointView
from app.web.screens import row_name
from app.web.tables import RowName, RowView, TableView
from app.web.view import force_count

router = APIRouter()

MOST_FORCES = 200
"""Records that are looked at for the reasons: a device keeps 32 forces at a time."""


@dataclass(frozen=True, slots=True)
class ForceView:
    """One intervention that stands."""

    name: RowName
    row: RowView
    left: PointView
    who: str
    why: str
    url: str
    """Where taking it back is asked for."""


@dataclass(frozen=True, slots=True)
class Group:
    """What stands in one machine."""

    operation: Operation
    table: TableView
    of: Interventions
    forces: Sequence[ForceView]

    @property
    def known(self) -> bool:
        """Whether the device tells them at all."""
        return self.operation.equipment.point(self.of.count).usable

    @property
    def release(self) -> Button:
        """What takes one back."""
        return self.operation.buttons[self.of.release]

    @property
    def release_all(self) -> Button:
        """What takes all back."""
        return self.operation.buttons[self.of.release_all]

    @property
    def tags(self) -> str:
        """Tags after whose change the list is another one, as `data-tags` takes them."""
        id = self.operation.id
        names = [f"{id}.{self.of.count}", self.operation.revision_tag, f"{SYSTEM}.{EVENTS}.{id}"]
        return " ".join([*names, self.table.identities])


@router.get("/forces", dependencies=[allow("view")])
async def forces(request: Request) -> HTMLResponse:
    """Everything that stands in the plant."""
    view = view_of(request)
    title = view.text(request, "forces.title")
    return view.page(request, "pages/forces.html", title=title, kind="forces", groups=await _groups(request))


@router.get("/forces/list", dependencies=[allow("view")])
async def rows(request: Request) -> HTMLResponse:
    """The lists alone, after a change."""
    return view_of(request).fragment(request, "fragments/force_rows.html", groups=await _groups(request))


@router.get("/forces/count", dependencies=[allow("view")])
async def count(request: Request) -> HTMLResponse:
    """How many there are, for the foot of every page."""
    view = view_of(request)
    return view.fragment(request, "fragments/force_count.html", text=force_count(view.runtime(request)))


async def _groups(request: Request) -> list[Group]:
    plant = view_of(request).runtime(request).plant
    person = getattr(request.state, "person", None)
    access = access_of(request.app) if person is not None else None
    names = {one.id & 0xFFFF: one.display for one in await access.people.all()} if access else {}
    groups = []
    for item in plant.equipment.values() if plant else ():
        for key, of in item.type.interventions.items():
            operation = Operation(request, item)
            table = TableView(operation.equipment, key)
            found = table.rows
            reasons = await _reasons(request, item.id, of.record) if access and found else {}
            forces = [_force(operation, key, of, row, names, reasons) for row in found]
            groups.append(Group(operation, table, of, forces))
    return groups


def _force(
    operation: Operation,
    table: str,
    of: Interventions,
    row: RowView,
    names: Mapping[int, str],
    reasons: Mapping[int, str],
) -> ForceView:
    name = row_name(operation.equipment, table, row)
    command = operation.equipment.equipment.type.commands[of.release]
    given = {argument.name: int(row.number(argument.name) or 0) for argument in command.arguments}
    return ForceView(
        name,
        row,
        row[of.remaining],
        names.get(int(row.number(of.owner) or 0), ""),
        reasons.get(name.number, ""),
        f"{operation.url}/ask/{of.release}?{urlencode(given)}",
    )


async def _reasons(request: Request, equipment: str, record: str) -> dict[int, str]:
    """Number of a record that is open → why it was asked for."""
    runtime = view_of(request).runtime(request)
    kind = kinds(runtime.plant).get(record)
    if kind is None:
        return {}

    def work(connection: Connection) -> dict[int, str]:
        found = query.find(connection, kind, RecordFilter(equipment, outcome=OPEN), MOST_FORCES)
        asked = query.people(connection, [one.id for one in found])
        return {one.number: last.reason for one in found if (last := query.person(None, asked[one.id]))}

    try:
        return await read(runtime, work)
    except Refused:  # a history that cannot be read hides nothing that stands
        return {}
