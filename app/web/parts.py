"""Parts of the screen of a machine that are fetched by themselves: what is drawn anew when something changes, and rows of its tables."""

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.exceptions import HTTPException

from app import bundled
from app.errors import Refused
from app.plant.definitions import Equipment
from app.web.guard import allow
from app.web.operation import Operation
from app.web.pages import plant_of, view_of
from app.web.tables import TableView, tables_of

LONGEST_NAME = 64
"""Of a part [characters]; a system refuses to look for files with names much longer."""

router = APIRouter()


@router.get("/equipment/{key}/part/{part}", dependencies=[allow("view")])
async def part(request: Request, key: str, part: str) -> HTMLResponse:
    """A part of the screen of a machine as it is now: `part_<name>.html` of its type, else the one that all types share."""
    machine = _machine(request, key)
    places = (f"screens/{machine.type.name}", "fragments")
    named = part.isascii() and part.isidentifier() and len(part) <= LONGEST_NAME
    templates = [f"{place}/part_{part}.html" for place in places] if named else []
    for template in templates:
        if (bundled("templates") / template).is_file():
            return _drawn(request, machine, template)
    raise HTTPException(404)


@router.get("/equipment/{key}/table/{table}/{id}", dependencies=[allow("view")])
async def row(request: Request, key: str, table: str, id: int) -> HTMLResponse:
    """One row as a dialog over the screen of its machine: `row_<table>.html` of its type.

    Raises:
        Refused: 404, there is no such row any more.
    """
    machine = _machine(request, key)
    template = f"screens/{machine.type.name}/row_{table}.html"
    if table not in machine.tables or not (bundled("templates") / template).is_file():
        raise HTTPException(404)
    found = TableView(view_of(request).machine(request, machine), table).row(id)
    if found is None:
        raise Refused("table.gone", 404, id=id)
    return _drawn(request, machine, template, row=found)


def _machine(request: Request, key: str) -> Equipment:
    machine = plant_of(request).equipment.get(key)
    if machine is None:
        raise HTTPException(404)
    return machine


def _drawn(request: Request, machine: Equipment, template: str, **more: Any) -> HTMLResponse:
    operation = Operation(request, machine)
    return view_of(request).fragment(
        request,
        template,
        operation=operation,
        equipment=operation.equipment,
        tables=tables_of(operation.equipment),
        query=request.query_params,
        **more,
    )
