"""Signing in and out, the first account, and one's own account.

The sign-in is a sheet over the plant (hmi-design.md 22.1): who may watch without signing in goes on seeing it. The text of a failure is
the same for every cause.
"""

from contextlib import suppress
from typing import Any
from urllib.parse import quote
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.access.accounts import Account
from app.access.roles import Person
from app.access.sessions import Session
from app.access.signin import HalfIn, SignedIn
from app.errors import Refused, StorageError
from app.web import format as fmt
from app.web import language
from app.web.guard import (
    address_of,
    allow,
    fields,
    forget_cookies,
    guests_allowed,
    half_cookie,
    half_ticket,
    people_access,
    person_of,
    session_cookie,
    session_id,
)
from app.web.view import THEME_COOKIE, View

router = APIRouter()

SHOWN_ID = 16
"""Digits of a session's hash by which its owner names it."""


@router.get("/signin", dependencies=[allow("open")])
async def sign_in_page(request: Request, next: str = "/") -> Response:
    """The sheet; to the first account while there is none."""
    if await people_access(request).awaits_first():
        return RedirectResponse("/first", 303)
    return sign_in_sheet(request, next)


@router.post("/signin", dependencies=[allow("open")])
async def sign_in(request: Request) -> Response:
    """Take name and password, give a session."""
    access, given = people_access(request), await fields(request, ["name", "password"])
    try:
        signed_in = await access.sign_in.with_password(
            given["name"], given["password"], address_of(request.scope), agent_of(request), session_id(request)
        )
    except Refused as refused:
        return sign_in_sheet(request, given["next"], refused, given["name"])
    if isinstance(signed_in, HalfIn):
        response = RedirectResponse(f"/signin/code?next={quote(language.local_path(given['next']), safe='/')}", 303)
        half_cookie(response, request, signed_in.ticket)
        return response
    return welcomed(request, signed_in, "/account" if signed_in.account.must_change else given["next"])


@router.get("/signin/code", dependencies=[allow("open")])
async def code_page(request: Request, next: str = "/") -> Response:
    """The sheet for the code, once the password was right."""
    if people_access(request).sign_in.half(half_ticket(request), agent_of(request)) is None:
        return RedirectResponse(f"/signin?next={quote(language.local_path(next), safe='/')}", 303)
    return code_sheet(request, next)


@router.post("/signin/code", dependencies=[allow("open")])
async def give_code(request: Request) -> Response:
    """Take the code, give a session."""
    access, given, ticket = people_access(request), await fields(request, ["code"]), half_ticket(request)
    try:
        signed_in = await access.sign_in.give_code(ticket, given["code"], address_of(request.scope), agent_of(request))
    except Refused as refused:
        if access.sign_in.half(ticket, agent_of(request)) is None:
            response = sign_in_sheet(request, given["next"], refused)
            half_cookie(response, request, "")
            return response
        return code_sheet(request, given["next"], refused)
    response = welcomed(request, signed_in, "/account" if signed_in.account.must_change else given["next"])
    half_cookie(response, request, "")
    return response


@router.post("/signout", dependencies=[allow("open")])
async def sign_out(request: Request) -> Response:
    """End this session here and in the browser."""
    person: Person | None = request.state.person
    if person is not None:
        with suppress(StorageError):  # it is over here, and the browser forgets it
            await people_access(request).sessions.end(person, person.session, "signout")
    if ticket := half_ticket(request):
        people_access(request).sign_in.forget_half(ticket)
    response = RedirectResponse("/" if guests_allowed(request.app) else "/signin", 303)
    forget_cookies(response, request)
    response.headers["Clear-Site-Data"] = '"cache", "storage"'
    return response


@router.get("/first", dependencies=[allow("open")])
async def first_page(request: Request) -> Response:
    """The sheet for the first account, while there is none."""
    if not await people_access(request).awaits_first():
        return RedirectResponse("/signin", 303)
    return first_sheet(request)


@router.post("/first", dependencies=[allow("open")])
async def first(request: Request) -> Response:
    """Make the first account with the code of the terminal."""
    access = people_access(request)
    given = await fields(request, ["code", "name", "password", "again"], ["display"])
    try:
        if given["password"] != given["again"]:
            raise Refused("access.password.differ", 422)
        signed_in = await access.sign_in.first(
            given["code"],
            given["name"],
            given["display"],
            given["password"],
            address_of(request.scope),
            agent_of(request),
            session_id(request),
        )
    except Refused as refused:
        return first_sheet(request, refused, given)
    return welcomed(request, signed_in, "/welcome")


@router.post("/session/active", dependencies=[allow("open")])
async def active(request: Request) -> Response:
    """Somebody is at this page: the idle time starts anew (guard.py has noted it). Answers how long it is now [s]."""
    person: Person | None = request.state.person
    if person is not None:
        person = await people_access(request).sessions.again(person)
    left = 0 if person is None else round(person.idle_in)
    return Response(str(left), media_type="text/plain", headers={"X-Idle": "1" if person and person.idle else "0"})


@router.get("/account", dependencies=[allow("account")])
async def account_page(request: Request) -> Response:
    """One's own name, password, sessions, language."""
    return await account_sheet(request)


@router.post("/account/password", dependencies=[allow("account")])
async def change_password(request: Request) -> Response:
    """Change one's own password; the browser gets a new session, all others end."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["current", "password", "again"])
    try:
        if given["password"] != given["again"]:
            raise Refused("access.password.differ", 422)
        sid = await access.own.change_password(
            person, given["current"], given["password"], agent_of(request), session_id(request)
        )
    except Refused as refused:
        return await account_sheet(request, refused)
    response = RedirectResponse("/account?done=password" if not person.must_change else "/welcome", 303)
    session_cookie(response, request, sid)
    return response


@router.post("/account/sessions/end", dependencies=[allow("account")])
async def end_own_session(request: Request) -> Response:
    """End one of one's own sessions."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["session"])
    for session in await access.sessions.of(person.id):
        if session.id_hash[:SHOWN_ID] == given["session"]:
            await access.sessions.end(person, session.id_hash)
            return RedirectResponse("/account?done=session", 303)
    raise Refused("access.no_session", 404)


def sign_in_sheet(request: Request, next: str, refused: Refused | None = None, name: str = "") -> Response:
    """The sheet, with what was wrong and the name that was typed."""
    person: Person | None = request.state.person
    return _over_the_plant(
        request,
        "pages/signin.html",
        refused,
        title_key="access.sign_in",
        next=language.local_path(next),
        name=name or (person.name if person else ""),
        again=person is not None,
        notice=view_of(request).runtime(request).settings.notice,
    )


def code_sheet(request: Request, next: str, refused: Refused | None = None) -> Response:
    """The sheet for the code, with what was wrong with the one before; the code does not come back."""
    return _over_the_plant(
        request, "pages/signin_code.html", refused, title_key="access.sign_in", next=language.local_path(next)
    )


def first_sheet(request: Request, refused: Refused | None = None, given: dict[str, str] | None = None) -> Response:
    """The sheet of the first account, with what was wrong and what was typed; passwords and a wrong code do not come back."""
    typed = given or {}
    return _over_the_plant(
        request,
        "pages/first.html",
        refused,
        title_key="access.first",
        next="/",
        code="" if refused and refused.reason == "access.code_wrong" else typed.get("code", ""),
        name=typed.get("name", ""),
        display=typed.get("display", ""),
    )


async def account_sheet(request: Request, refused: Refused | None = None) -> Response:
    """One's own account."""
    view, access, person = view_of(request), people_access(request), person_of(request)
    known = await access.people.get(person.id)
    sessions = [] if person.must_change else await access.sessions.of(person.id)
    done = request.query_params.get("done", "")
    return view.page(
        request,
        "pages/account.html",
        status=refused.status if refused else 200,
        title=view.text(request, "access.account"),
        kind="frame",
        account=known,
        sessions=[session_row(request, session) for session in sessions],
        error=explained(request, refused),
        done=view.text(request, f"access.done.{done}") if done in ("password", "session") and not refused else "",
        last_seen=moment(request, known.last_seen),
        factor_visible=person.may("factor"),
        least=15 if {"admin", "engineer"} & known.roles else 12,
    )


def welcomed(request: Request, signed_in: SignedIn, next: str) -> Response:
    """On to where the person wanted to go, with the new session and the person's own language and colours."""
    response = RedirectResponse(quote(language.local_path(next), safe="/?&=%+,;:@!$'()*~-._#"), 303)
    session_cookie(response, request, signed_in.sid)
    secure = request.url.scheme == "https"
    for name, value in (
        (language.COOKIE, signed_in.account.language),
        (THEME_COOKIE, signed_in.account.theme),
    ):
        if value:
            response.set_cookie(name, value, max_age=language.YEAR, httponly=True, samesite="lax", secure=secure)
    return response


def _over_the_plant(
    request: Request, template: str, refused: Refused | None, *, title_key: str, **context: Any
) -> Response:
    view = view_of(request)
    plant = view.runtime(request).plant
    person: Person | None = request.state.person
    visible = plant is not None and ((person is not None and person.may("view")) or guests_allowed(request.app))
    machines = [view.machine(request, item) for item in plant.equipment.values()] if plant and visible else []
    response = view.page(
        request,
        template,
        status=refused.status if refused else 200,
        title=view.text(request, title_key),
        kind="overview" if visible else "frame",
        machines=machines,
        plant_picture=None,
        today=None,
        visible=visible,
        error=explained(request, refused),
        over=request.state.over,
        **context,
    )
    if refused is not None and refused.status == 429:
        response.headers["Retry-After"] = "60"
    return response


# ---- what these pages share -------------------------------------------------------------------------------


def view_of(request: Request) -> View:
    """What renders our pages."""
    view: View = request.app.state.view
    return view


def agent_of(request: Request) -> str:
    """What the browser says it is."""
    return request.headers.get("user-agent", "")[:400]


def explained(request: Request, refused: Refused | None) -> str:
    """Why not, for the person."""
    return view_of(request).refusal(request, refused) if refused else ""


def zone_of(request: Request) -> ZoneInfo:
    """The plant's time zone."""
    plant = view_of(request).runtime(request).plant
    return ZoneInfo(plant.timezone) if plant else ZoneInfo("UTC")


def moment(request: Request, micros: int | None) -> str:
    """A time as lists show it; empty when there was none."""
    if micros is None:
        return ""
    now = view_of(request).runtime(request).clock.micros()
    return fmt.date_time(micros, zone_of(request), language.language_of(request), now)


def session_row(request: Request, session: Session) -> dict[str, Any]:
    """A session as lists show it."""
    person: Person | None = request.state.person
    return {
        "id": session.id_hash[:SHOWN_ID],
        "current": person is not None and session.id_hash == person.session,
        "created": moment(request, session.created),
        "active": moment(request, session.active),
        "address": session.address,
        "agent": session.agent,
    }


def role_names(request: Request, account: Account) -> str:
    """`Administrator, Engineer`."""
    return ", ".join(view_of(request).text(request, f"access.role.{role}") for role in sorted(account.roles))
