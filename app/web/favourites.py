"""Favourites: pages and machines that somebody marked with the star beside their title; listed in one's menu, first in the search."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.access.kept import FAVOURITE
from app.access.roles import Person, permitted
from app.errors import Refused
from app.web.guard import access_of, allow, fields, people_access, person_of
from app.web.language import language_of, local_path
from app.web.palette import Place, destinations
from app.web.view import View

router = APIRouter()


@router.post("/favourites", dependencies=[allow("account")])
async def mark(request: Request) -> Response:
    """Mark the page `at` as a favourite, or no longer (`on` empty); answered with its star and the list in the menu."""
    given = await fields(request, ["at", "on"])
    person, kept, view = person_of(request), people_access(request).kept, _view(request)
    if given["on"]:
        if given["at"] not in _open_to(request, person):
            raise Refused("own.no_page", 422, at=given["at"][:80])
        await kept.keep(person.id, FAVOURITE, given["at"])
    else:
        await kept.forget(person.id, FAVOURITE, given["at"])
    if "hx-request" not in request.headers:
        return RedirectResponse(local_path(given["at"]), 303)
    return view.fragment(request, "fragments/favourites.html", **_drawn(request, person, given["at"]))


def around(request: Request, lang: str) -> Mapping[str, Any]:
    """What the frame of every page shows of them."""
    person: Person | None = getattr(request.state, "person", None)
    return _drawn(request, person, request.url.path, lang)


def _drawn(request: Request, person: Person | None, at: str, lang: str = "") -> dict[str, Any]:
    """`star`: address of this page and whether it is marked, None where there is none; `favourites`: pages that are."""
    access = access_of(request.app)
    if person is None or access is None or not person.may("account"):
        return {"star": None, "favourites": []}
    open_to, marked = _open_to(request, person, lang), access.kept.of(person.id, FAVOURITE)
    return {
        "star": {"at": at, "on": at in marked} if at in open_to and at != "/" else None,
        "favourites": [open_to[url] for url in marked if url in open_to],
    }


def _open_to(request: Request, person: Person, lang: str = "") -> Mapping[str, Place]:
    """Pages that `person` may see, by address."""
    runtime = _view(request).runtime(request)
    if runtime.plant is None:
        return {}
    places = destinations(request.app.state, runtime.texts, runtime.plant, lang or language_of(request))
    return {url: place for url, place in places.items() if permitted(person, place.needs, simulated=runtime.simulated)}


def _view(request: Request) -> View:
    view: View = request.app.state.view
    return view
