"""`/screens/<name>`: a screen that the plant folder brings (app/plant/drawing.py), with live values, states and links to machines."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.exceptions import HTTPException

from app.plant.definitions import Plant
from app.plant.drawing import PRESENTATION, SVG_NUMBER, Part
from app.web.drawing import Knots
from app.web.guard import allow
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.points import EquipmentView, PointView

router = APIRouter()

WIDTH, HEIGHT = 240.0, 44.0
"""Of the box of a value, which stands at its bottom [user units]."""
BELOW = 0.24
"""Of the size of its letters, what lies below their baseline."""
PLAIN_SIZE = "16"
"""Of letters, where the drawing says nothing."""
UNKNOWN = ("d-unknown", "bad")
"""The class of a part whose value is not known, and when it has it."""
OLD = ("d-old", "uncertain")
"""Of one whose value may not be so any more: it stays as it was, with a broken outline."""


@dataclass(frozen=True, slots=True)
class Bound:
    """What a part follows, as it is drawn."""

    point: PointView
    show: str
    """Also shown while the value is not known, then dashed: a part that vanished would say that it is not so."""
    classes: tuple[tuple[str, str], ...]
    place: float | None
    """Where `map` puts it now; None while that is not known."""

    @property
    def worn(self) -> str:
        """Classes that it has now."""
        return " ".join(name for name, condition in self.classes if self.point.holds(condition))

    @property
    def rules(self) -> str:
        """For `data-class`."""
        return ";".join(f"{name}:{condition}" for name, condition in self.classes)


@router.get("/screens/{name}", dependencies=[allow("view")])
async def screen(request: Request, name: str) -> HTMLResponse:
    """One of them; without a picture it says what is wrong with its file."""
    plant, view = plant_of(request), view_of(request)
    found = plant.screens.get(name)
    if found is None:
        raise HTTPException(404)
    machines: dict[str, EquipmentView] = {}

    def machine(id: str) -> EquipmentView:
        if id not in machines:
            machines[id] = view.machine(request, plant.equipment[id])
        return machines[id]

    return view.page(
        request,
        "pages/plant_screen.html",
        title=view.runtime(request).texts.label(language_of(request), found.label),
        kind=f"screens/{name}",
        screen=found,
        machine=machine,
        bound=partial(_bound, plant, machine),
        spot=_spot,
        whole=_of_all(found.picture) if found.picture else {},
    )


def _bound(plant: Plant, machine: Callable[[str], EquipmentView], part: Part) -> Bound:
    id, _, key = part.tag.partition(".")
    point = machine(id).point(key)
    says_bad = "bad" in part.show.replace(" ", "").split(",")
    show = part.show if says_bad or not part.show else f"{part.show},bad"
    at = Knots(part.map).at(point.value) if part.map and point.usable and isinstance(point.value, int | float) else None
    return Bound(
        point,
        show,
        (*part.classes, *(() if says_bad else (UNKNOWN,)), OLD),
        at,
    )


def _of_all(picture: Part) -> dict[str, str]:
    """What the root says of the looks of all that is in it; its size is the page's."""
    kept = {"class", "transform", *PRESENTATION}
    return {key: text for key, text in sorted(picture.attributes.items()) if key in kept and text}


def _spot(part: Part) -> tuple[float, float]:
    """Left upper corner of the box of a value or a sign, from the place and the anchor of its text [user units]."""
    x, y = (_first(part.attributes.get(key, "0")) for key in ("x", "y"))
    anchor = part.attributes.get("text-anchor", "start")
    below = BELOW * _first(part.attributes.get("font-size", PLAIN_SIZE))
    return x - {"middle": WIDTH / 2, "end": WIDTH}.get(anchor, 0.0), y - HEIGHT + below


def _first(numbers: str) -> float:
    """The first of some numbers; 0 where there is none."""
    found = re.match(rf"\s*({SVG_NUMBER})", numbers, re.ASCII)
    return float(found[1]) if found else 0.0
