"""The page "Plant": what the plant files would change, or what is wrong with them, and the button that takes them while everything runs;
and which machines run, of which type, on which link.
"""

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.plant.changes import Change
from app.running.plant_files import Reading
from app.web.guard import address_of, allow, fields, person_of
from app.web.language import language_of
from app.web.points import EquipmentView
from app.web.signin import view_of
from app.web.view import area_label

router = APIRouter()


@router.get("/plant", dependencies=[allow("configure")])
async def plant(request: Request) -> Response:
    """The files as they are now beside the plant that runs."""
    return _page(request, await view_of(request).runtime(request).plant_files.look())


@router.post("/plant", dependencies=[allow("configure")])
async def reload(request: Request) -> Response:
    """Take the changes that the page showed; others than those are shown instead."""
    given = await fields(request, ["digest"], ["read"])
    runtime = view_of(request).runtime(request)
    if not given["read"]:
        return _page(request, await runtime.plant_files.look(), 422, "plant.refused.unread")
    reading = await runtime.plant_files.reload(person_of(request), given["digest"], address_of(request.scope))
    if reading.done:
        return RedirectResponse("/plant?done=1", 303)
    return _page(request, reading, 409, reading.refused)


def _page(request: Request, reading: Reading, status: int = 200, refused: str = "") -> Response:
    view = view_of(request)
    runtime = view.runtime(request)
    return view.page(
        request,
        "pages/plant.html",
        status=status,
        title=view.text(request, "plant.title"),
        kind="frame",
        reading=reading,
        changes=[drawn(request, change) for change in reading.changes],
        folder=str(runtime.settings.plant),
        running=runtime.plant,
        machines=_machines(request),
        refused=view.text(request, refused) if refused else "",
        done=bool(request.query_params.get("done")) and not reading.changes and not reading.problems,
    )


def _machines(request: Request) -> list[tuple[EquipmentView, str, str]]:
    """Each machine that runs, the name of its area, and the transport of its link."""
    view, lang = view_of(request), language_of(request)
    runtime = view.runtime(request)
    plant, texts = runtime.plant, runtime.texts
    if plant is None:
        return []
    return [
        (view.machine(request, item), area_label(texts, plant, lang, item.area), plant.links[item.link].transport)
        for item in plant.equipment.values()
    ]


def drawn(request: Request, change: Change) -> dict[str, Any]:
    """A change as its page shows it."""
    text = view_of(request).text
    return {
        "text": text(
            request, f"plant.{change.kind}", what=text(request, f"plant.what.{change.what}"), name=change.name
        ),
        "details": change.details,
        "effects": [text(request, f"plant.effect.{effect.key}", **effect.params) for effect in change.effects],
    }
