"""The plant at a glance: its picture, today's figures, a tile of every machine; the same of one area."""

from collections.abc import Sequence
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.exceptions import HTTPException

from app.plant.definitions import Equipment, Plant
from app.plant.picture import MOST_MACHINES, Picture, arrange
from app.web.guard import allow
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.today import PATIENCE, drawn, told
from app.web.view import area_label, areas

router = APIRouter()


@router.get("/", dependencies=[allow("view")])
async def overview(request: Request) -> HTMLResponse:
    """All machines."""
    plant, view = plant_of(request), view_of(request)
    title = view.runtime(request).texts.label(language_of(request), plant.name)
    return await _page(request, list(plant.equipment.values()), "", title)


@router.get("/area/{key}", dependencies=[allow("view")])
async def area(request: Request, key: str) -> HTMLResponse:
    """The machines of one area."""
    plant, view = plant_of(request), view_of(request)
    members = _members(plant, key)
    return await _page(request, members, key, area_label(view.runtime(request).texts, plant, language_of(request), key))


@router.get("/today", dependencies=[allow("view")])
async def today(request: Request, area: str = "") -> HTMLResponse:
    """Today's figures alone, of all machines or of those of `area`: the page asks for them again."""
    plant = plant_of(request)
    members = _members(plant, area) if area else list(plant.equipment.values())
    return view_of(request).fragment(request, "fragments/today.html", today=await drawn(request, members))


@router.get("/why", dependencies=[allow("view")])
async def why(request: Request, area: str = "") -> HTMLResponse:
    """Why machines do not go on, all machines or those of `area`, each line for its tile: the page asks for all of them again at once."""
    plant, view = plant_of(request), view_of(request)
    members = _members(plant, area) if area else list(plant.equipment.values())
    machines = [view.machine(request, item) for item in members]
    return view.fragment(request, "fragments/tile_whys.html", machines=machines)


def picture_of(plant: Plant, machines: Sequence[Equipment]) -> Picture | None:
    """`machines` in their flow, each sequence before the machine that it moves; None for one machine, or too many."""
    if not 1 < len(machines) <= MOST_MACHINES:
        return None
    moved = [(item.id, item.machine) for item in machines if item.machine]
    return arrange([item.id for item in machines], [*plant.flow, *moved])


def flow_of(plant: Plant, area: str, machines: Sequence[Equipment]) -> Picture | None:
    """The picture of an area: of those of its machines that the flow joins; None where it joins none."""
    picture = picture_of(plant, machines)
    if not area or picture is None:
        return picture
    joined = {id for pair in picture.lines for id in pair}
    return picture_of(plant, [item for item in machines if item.id in joined])


async def _page(request: Request, members: list[Equipment], area: str, title: str) -> HTMLResponse:
    plant, view = plant_of(request), view_of(request)
    return view.page(
        request,
        "pages/overview.html",
        title=title,
        kind="overview",
        area=area,
        machines=[view.machine(request, item) for item in members],
        plant_picture=flow_of(plant, area, members),
        tells_today=bool(told(members)),
        today=await drawn(request, members, PATIENCE),
        today_url=f"/today?area={quote(area)}" if area else "/today",
    )


def _members(plant: Plant, area: str) -> list[Equipment]:
    """The machines of an area.

    Raises:
        HTTPException: 404, there is no such area.
    """
    found = areas(plant).get(area)
    if found is None:
        raise HTTPException(404)
    return list(found)
