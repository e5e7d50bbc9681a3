"""Help on every page (F1): what it is, what one can do there, what colours and signs mean; of a machine what its type says of itself."""

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.plant.definitions import Plant
from app.web.guard import allow, person_of
from app.web.language import language_of
from app.web.view import View

router = APIRouter()

OTHER = "other"
PAGES = frozenset(
    {
        *("trends", "alarms", "events", "records", "communication", "forces", "storage", "plant", "instructor"),
        *("audit", "users", "tokens", "account", "lessons", "area", "screens"),
    }
)
"""Pages that have a help of their own, by the first part of their address."""
OF_MACHINES: Mapping[str, str] = {"": "machine", "faceplate": "machine", "page": "machine", "events": "events"}
"""The same by what follows the machine in an address; everything else there is about parameters."""
KEYS: tuple[tuple[str, str], ...] = (
    ("F1", "F1"),
    ("F2", "F2"),
    ("F4", "F4"),
    ("F6", "F6"),
    ("F8", "F8"),
    ("Ctrl+K", "search"),
)
"""Key, name of its text."""


@router.get("/help", dependencies=[allow("view")])
async def help_on(request: Request, of: str = "/") -> Response:
    """The help on the page at the address `of`: to be shown over it, or a page of its own for who opened the address."""
    view: View = request.app.state.view
    topic, machine = subject(of)
    said: dict[str, Any] = {
        "topic": topic,
        "about": _about(request, view.runtime(request).plant, machine),
        "keys": KEYS,
    }
    if "hx-request" in request.headers:
        return view.fragment(request, "fragments/help_body.html", **said)
    return view.page(request, "pages/help.html", title=view.text(request, "help.title"), **said)


@router.get("/welcome", dependencies=[allow("account")])
async def welcome(request: Request) -> Response:
    """What somebody who is here for the first time may do next."""
    view: View = request.app.state.view
    plant, person = view.runtime(request).plant, person_of(request)
    steps = [(name, url) for name, url, needed in _first_steps(plant) if person.may(needed)]
    return view.page(request, "pages/welcome.html", title=view.text(request, "welcome.title"), steps=steps)


def _first_steps(plant: Plant | None) -> list[tuple[str, str, str]]:
    """Text key, address, permission."""
    machine = next(iter(plant.equipment), "") if plant else ""
    simulated = plant is not None and any(link.simulated for link in plant.links.values())
    return [
        *([("machine", f"/equipment/{quote(machine)}", "operate")] if machine else []),
        *([("lessons", "/lessons", "operate")] if plant and plant.lessons and simulated else []),
        *([("instructor", "/instructor", "instruct")] if simulated else []),
        ("users", "/users", "administer"),
        ("plant", "/", "view"),
    ]


def subject(address: str) -> tuple[str, str]:
    """What a page is about, and its machine (empty: of none)."""
    parts = address.partition("?")[0].strip("/").split("/")
    if parts == [""]:
        return "overview", ""
    if parts[0] == "equipment" and len(parts) > 1:
        return OF_MACHINES.get(parts[2] if len(parts) > 2 else "", "parameters"), parts[1]
    if parts[0] == "instructor" and len(parts) > 1:
        return "instructor", parts[1]
    return (parts[0] if parts[0] in PAGES else OTHER), ""


def _about(request: Request, plant: Plant | None, machine: str) -> tuple[str, str] | None:
    """Name of a machine and what its type says of itself; None when there is no such machine, or it says nothing."""
    item = plant.equipment.get(machine) if plant else None
    if item is None or not any("help.what" in own for own in item.type.texts.values()):
        return None
    view: View = request.app.state.view
    texts, lang = view.runtime(request).texts, language_of(request)
    return texts.label(lang, item.label) or item.id, texts.of_type(lang, item.type, "help.what")
