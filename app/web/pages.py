"""The pages that are not about one subject: machine; language and theme; static files and health."""

from contextlib import suppress
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Form, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app import bundled
from app.errors import StorageError
from app.historian.events import has_ring
from app.plant.definitions import Equipment, EquipmentType, Plant
from app.plant.sequence_plant import commanding
from app.running.instruction import says_simulated
from app.web import language, screens
from app.web.errors import PlantBroken
from app.web.guard import allow, people_access
from app.web.operation import Operation
from app.web.tables import tables_of
from app.web.view import (
    PANEL,
    PANEL_COOKIE,
    PROFILE_COOKIE,
    PROFILES,
    THEME_COOKIE,
    THEMES,
    Tab,
    View,
    address_of_area,
    areas,
)

router = APIRouter()

MAIN = ""
"""Name of the page of a type that has no name."""
VALUES = "values"
"""That of the page that every machine has without a tab: all that it reports, also what its own pages do not draw."""


def view_of(request: Request) -> View:
    """What renders our pages."""
    view: View = request.app.state.view
    return view


def plant_of(request: Request) -> Plant:
    """The running plant.

    Raises:
        PlantBroken: its files have mistakes; the answer lists them.
    """
    plant = view_of(request).runtime(request).plant
    if plant is None:
        raise PlantBroken
    return plant


@router.get("/equipment/{key}", dependencies=[allow("view")])
async def equipment(request: Request, key: str) -> HTMLResponse:
    """The screen of one machine."""
    return await _screen(request, key, MAIN)


@router.get("/equipment/{key}/page/{name}", dependencies=[allow("view")])
async def equipment_page(request: Request, key: str, name: str) -> HTMLResponse:
    """A further page of one machine: `page_<name>.html` of its type."""
    return await _screen(request, key, name)


def pages_of(kind: EquipmentType) -> list[str]:
    """The pages of an equipment type by name: the main one, then every `page_<name>.html` in the order of their words (`page.<name>`)."""
    folder = bundled("templates") / "screens" / kind.name
    told = [key.removeprefix("page.") for key in next(iter(kind.texts.values()), ()) if key.startswith("page.")]
    found = (path.stem.removeprefix("page_") for path in folder.glob("page_*.html"))
    return [MAIN, *sorted(found, key=lambda name: (told.index(name) if name in told else len(told), name))]


def own_template(kind: EquipmentType, name: str, common: str) -> str:
    """The template `name` of an equipment type, else the one that all types without share."""
    own = f"screens/{kind.name}/{name}.html"
    return own if (bundled("templates") / own).is_file() else common


async def _screen(request: Request, key: str, name: str) -> HTMLResponse:
    plant, view = plant_of(request), view_of(request)
    machine = plant.equipment.get(key)
    pages = pages_of(machine.type) if machine else []
    if machine is None or name not in (*pages, VALUES):
        raise HTTPException(404)
    operation = Operation(request, machine)
    drawn = operation.equipment
    members = areas(plant)[machine.area]
    up = "/" if len(members) == 1 else address_of_area(machine.area, members)
    if name not in pages:
        up = operation.url
    return view.page(
        request,
        own_template(machine.type, f"page_{name}" if name else "page", "layouts/machine.html"),
        title=drawn.label,
        kind=f"equipment/{machine.id}",
        area=machine.area,
        chip=machine.id,
        up=up,
        equipment=drawn,
        operation=operation,
        pages=[
            Tab(
                view.text(request, f"{machine.type.name}.page.{page}" if page else "screen.main"),
                f"{operation.url}/page/{page}" if page else operation.url,
                page == name,
            )
            for page in pages
        ],
        histories=_histories(request, machine),
        stepped=[Operation(request, item) for item in commanding(plant, machine.id)],
        tables=tables_of(drawn),
        query=request.query_params,
        worked=await screens.worked(machine.type.name, name, request.state.person, request.query_params),
        message=operation.story,
    )


def _histories(request: Request, machine: Equipment) -> list[Tab]:
    """Where one reads what became of things on a machine, and all that it told: the kinds of record of its type, then its events;
    and where an instructor breaks it."""
    runtime, lang = view_of(request).runtime(request), language.language_of(request)
    texts = runtime.texts
    records = [
        Tab(texts.of_type(lang, machine.type, f"record.{kind}.title"), f"/records/{quote(kind)}?equipment={machine.id}")
        for kind in machine.type.records
    ]
    told = [Tab(texts.text(lang, "events.title"), f"/equipment/{machine.id}/events")] if has_ring(machine) else []
    person = request.state.person
    if machine.sequence and person is not None and person.may("configure"):
        told.append(Tab(texts.text(lang, "editor.title"), f"/equipment/{quote(machine.id)}/definition"))
    trained = person is not None and person.may("instruct") and says_simulated(runtime.links[machine.link], machine)
    taught = [Tab(texts.text(lang, "instructor.title"), f"/instructor/{quote(machine.id)}")] if trained else []
    return records + told + taught


@router.post("/language", dependencies=[allow("open")])
async def set_language(request: Request, to: Annotated[str, Form()], next: Annotated[str, Form()] = "/") -> Response:
    """Keep the choice of a language and go back to where it was made."""
    if to not in view_of(request).languages(request):
        raise HTTPException(400)
    if request.state.person is not None:
        with suppress(StorageError):  # this browser has it
            await people_access(request).own.prefer(request.state.person, language=to)
    return _kept(request, next, {language.COOKIE: to})


@router.post("/theme", dependencies=[allow("open")])
async def set_theme(
    request: Request,
    to: Annotated[str, Form()] = "",
    profile: Annotated[str, Form()] = "",
    panel: Annotated[str, Form()] = "",
    next: Annotated[str, Form()] = "/",
) -> Response:
    """Keep the choice of colours, of the size of the panel or of panel mode and go back to where it was made."""
    chosen = {THEME_COOKIE: to, PROFILE_COOKIE: profile, PANEL_COOKIE: panel}
    chosen = {name: value for name, value in chosen.items() if value}
    if (
        not chosen
        or (to and to not in THEMES)
        or (profile and profile not in PROFILES)
        or (panel and panel not in PANEL)
    ):
        raise HTTPException(400)
    if to and request.state.person is not None:
        with suppress(StorageError):
            await people_access(request).own.prefer(request.state.person, theme=to)
    return _kept(request, next, chosen)


@router.api_route("/static/{name:path}", methods=["GET", "HEAD"], dependencies=[allow("open")])
async def static(request: Request, name: str) -> Response:
    """A file of the pages."""
    return view_of(request).assets.respond(request, name)


@router.get("/favicon.ico", dependencies=[allow("open")])
async def favicon(request: Request) -> Response:
    """Browsers ask for it by themselves; ours is the icon that every page names."""
    return view_of(request).assets.respond(request, "icon.svg")


def _kept(request: Request, next: str, cookies: dict[str, str]) -> Response:
    response = RedirectResponse(quote(language.local_path(next), safe="/?&=%+,;:@!$'()*~-._#"), 303)
    for name, value in cookies.items():
        response.set_cookie(
            name,
            value,
            max_age=language.YEAR,
            httponly=True,
            samesite="lax",
            secure=request.url.scheme == "https",
        )
    return response
