"""Filters of the alarm list that a person keeps under a name: chosen from a menu, on every browser that this person signs in with."""

from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.access.kept import ALARM_FILTER
from app.errors import Refused
from app.web.alarms import FIELDS, checked
from app.web.guard import allow, fields, people_access, person_of

router = APIRouter()


@router.post("/alarms/filters", dependencies=[allow("account")])
async def keep(request: Request) -> Response:
    """Keep what the list is filtered by now under a name, in place of what was kept so."""
    given = await fields(request, ["kept_as"], FIELDS)
    name = " ".join(given["kept_as"].split())[:60]
    found = checked({field: given[field].strip()[:120] for field in FIELDS})
    wanted = {field: value for field, value in found.items() if value}
    if not wanted.keys() - {"tab"}:
        raise Refused("own.no_filter", 422)
    await people_access(request).kept.keep(person_of(request).id, ALARM_FILTER, name, wanted)
    return _back(request, f"/alarms?{urlencode(wanted)}")


@router.post("/alarms/filters/forget", dependencies=[allow("account")])
async def forget(request: Request) -> Response:
    """Keep a filter no longer."""
    given = await fields(request, ["kept_as"])
    await people_access(request).kept.forget(person_of(request).id, ALARM_FILTER, given["kept_as"])
    return _back(request, "/alarms")


def _back(request: Request, url: str) -> Response:
    if "hx-request" in request.headers:
        return Response(status_code=204, headers={"HX-Redirect": url})
    return RedirectResponse(url, 303)
