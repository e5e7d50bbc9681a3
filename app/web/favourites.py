"""Favourites: pages and machines that somebody marked with the star beside their title; listed in one's menu, first in the search.

What a reload took out of the plant stays in the list, as gone, until its owner removes it.
"""

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
    place = _open_to(request, person).get(given["at"])
    if given["on"]:
        if place is None:
            raise Refused("own.no_page", 422, at=given["at"][:80])
        await kept.keep(person.id, FAVOURITE, given["at"], _name_of(place))
    else:
        await kept.forget(person.id, FAVOURITE, given["at"])
    if "hx-request" not in request.headers:
        return RedirectResponse(local_path(given["at"]) if place else "/", 303)
    return view.fragment(request, "fragments/favourites.html", **_drawn(request, person, given["at"]))


def around(request: Request, lang: str) -> Mapping[str, Any]:
    """What the frame of every page shows of them."""
    person: Person | None = getattr(request.state, "person", None)
    return _drawn(request, person, request.url.path, lang)


def _drawn(request: Request, person: Person | None, at: str, lang: str = "") -> dict[str, Any]:
    """What is shown of favourites.

    `star`: address of this page and whether it is marked, None where there is none; `favourites`: pages that are; `gone`: address → name
    as it was when it was marked, of those that are in the plant no more.
    """
    access = access_of(request.app)
    if person is None or access is None or not person.may("account"):
        return {"star": None, "favourites": [], "gone": {}}
    open_to, marked, there = (
        _open_to(request, person, lang),
        access.kept.of(person.id, FAVOURITE),
        _there(request, lang),
    )
    return {
        "star": {"at": at, "on": at in marked} if at in open_to and at != "/" else None,
        "favourites": [open_to[url] for url in marked if url in open_to],
        "gone": {url: name or url for url, name in marked.items() if there and url not in there},
    }


def _name_of(place: Place) -> str:
    """What is remembered of it: a page of a machine with the name of that, a machine with its id."""
    return f"{place.label} · {place.detail}" if place.detail else place.label


def _open_to(request: Request, person: Person, lang: str = "") -> Mapping[str, Place]:
    """Pages that `person` may see, by address."""
    places, simulated = _there(request, lang), _view(request).runtime(request).simulated
    return {url: place for url, place in places.items() if permitted(person, place.needs, simulated=simulated)}


def _there(request: Request, lang: str = "") -> Mapping[str, Place]:
    """Pages of the plant, by address; none while no plant is known."""
    runtime = _view(request).runtime(request)
    if runtime.plant is None:
        return {}
    return destinations(request.app.state, runtime.texts, runtime.plant, lang or language_of(request))


def _view(request: Request) -> View:
    view: View = request.app.state.view
    return view
