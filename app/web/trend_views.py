"""Saved views of trends: one's own and those that others share; what is done with them from the page of trends."""

from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.access.kept import TREND_LAST
from app.access.roles import Person
from app.errors import Refused, StorageError
from app.historian.saved_views import LONGEST_NAME, SavedView, SavedViews
from app.web.guard import allow, fields, people_access, person_of
from app.web.pages import view_of
from app.web.signin import zone_of
from app.web.trend_address import kept

router = APIRouter(prefix="/trends")
LAST = "last"
"""Under which name the view is kept that somebody had last."""


def last_view(request: Request, person: Person) -> str:
    """The view that `person` had last; empty when there was none."""
    return str(people_access(request).kept.of(person.id, TREND_LAST).get(LAST, ""))


@dataclass(frozen=True, slots=True)
class Shelf:
    """The views that somebody may use, as they are drawn."""

    own: list[SavedView]
    others: list[SavedView]
    """Shared by others."""
    may_share: bool
    longest: int = LONGEST_NAME


async def views_of(request: Request) -> Shelf:
    """For whoever asks. When they cannot be read there are none: the curves do not need them."""
    person = person_of(request)
    found: Sequence[SavedView] = ()
    with suppress(StorageError):
        found = await saved_views(request).of(person)
    own = [one for one in found if one.person == person.id]
    return Shelf(own, [one for one in found if one.person != person.id], person.may("share"))


@router.post("/views", dependencies=[allow("views")])
async def save(request: Request) -> Response:
    """Keep the view as `name`, for oneself."""
    given = await fields(request, ["name", "view"])
    return await _do(
        request, given, lambda saved: saved.save(person_of(request), given["name"], _view(request, given["view"]))
    )


@router.post("/views/{number:int}/rename", dependencies=[allow("views")])
async def rename(request: Request, number: int) -> Response:
    """Call one's own view otherwise."""
    given = await fields(request, ["name"], ["view"])
    return await _do(request, given, lambda saved: saved.rename(person_of(request), number, given["name"]), number)


@router.post("/views/{number:int}/replace", dependencies=[allow("views")])
async def replace(request: Request, number: int) -> Response:
    """Have one's own view show what is on the screen now."""
    given = await fields(request, ["view"])
    return await _do(
        request, given, lambda saved: saved.replace(person_of(request), number, _view(request, given["view"])), number
    )


@router.post("/views/{number:int}/share", dependencies=[allow("share")])
async def share(request: Request, number: int) -> Response:
    """Let everybody use one's own view."""
    given = await fields(request, [], ["view"])
    return await _do(request, given, lambda saved: saved.share(person_of(request), number, True), number)


@router.post("/views/{number:int}/unshare", dependencies=[allow("views")])
async def unshare(request: Request, number: int) -> Response:
    """Keep one's own view to oneself again."""
    given = await fields(request, [], ["view"])
    return await _do(request, given, lambda saved: saved.share(person_of(request), number, False), number)


@router.post("/views/{number:int}/delete", dependencies=[allow("views")])
async def remove(request: Request, number: int) -> Response:
    """Delete one's own view."""
    given = await fields(request, [], ["view"])
    return await _do(request, given, lambda saved: saved.remove(person_of(request), number), number)


@router.post("/last", dependencies=[allow("views")])
async def last(request: Request) -> Response:
    """What one looks at now: the page of trends begins with it next time."""
    given = await fields(request, ["view"])
    person, at, own = person_of(request), _view(request, given["view"]), people_access(request).kept
    if own.of(person.id, TREND_LAST).get(LAST) != at:
        await own.keep(person.id, TREND_LAST, LAST, at)
    return Response(status_code=204)


def saved_views(request: Request) -> SavedViews:
    """The views of everybody."""
    runtime = view_of(request).runtime(request)
    return SavedViews(runtime.db, runtime.access.audit, runtime.clock)


def _view(request: Request, text: str) -> str:
    return kept(text, view_of(request).runtime(request).clock.micros(), zone_of(request))


async def _do(
    request: Request, given: dict[str, str], work: Callable[[SavedViews], Awaitable[Any]], number: int = 0
) -> Response:
    """Do it and draw the list anew, with what was wrong and the name that was typed; without htmx the page.

    `number` is the view that it was done with: the focus stays there.
    """
    drawn, problem, name = request.headers.get("hx-request") == "true", "", ""
    try:
        await work(saved_views(request))
    except Refused as refused:
        if not drawn:
            raise
        problem, name = view_of(request).refusal(request, refused), given.get("name", "")
    if drawn:
        context: dict[str, Any] = {
            "views": await views_of(request),
            "problem": problem,
            "typed": name,
            "done_with": number,
        }
        return view_of(request).fragment(request, "fragments/trend_views.html", **context)
    return RedirectResponse(f"/trends?{quote(given['view'], safe='=&,:%')}", 303)
