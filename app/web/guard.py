"""Who gets in: a person is found for every request, and every route says what it asks of them. Nothing is allowed by silence.

`Gatekeeper` is the layer that finds the person (session cookie, or an API token under /api/) and leaves in `request.state`: `person`
(None: not signed in), `csrf` (a fresh signed token for forms) and `bound` (what it is bound to). `allow("…")` is the dependency of a route:
it checks the permission, and on unsafe methods where the request comes from and that its token is ours. A route without one is found by
`check_declared` when the server starts. Identity never comes from another header (Referer, X-Forwarded-User, X-Original-URL …).
"""

import logging
import re
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING
from urllib.parse import quote, urlsplit

from fastapi import Depends, FastAPI, Request
from fastapi.params import Depends as Dependency
from fastapi.responses import RedirectResponse, Response
from fastapi.routing import iter_route_contexts
from starlette.datastructures import FormData, Headers, MutableHeaders, UploadFile
from starlette.exceptions import WebSocketException
from starlette.requests import HTTPConnection, cookie_parser
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from app import chance
from app.access.access import Access
from app.access.audit.line import printable
from app.access.roles import PERMISSIONS as OF_ROLES
from app.access.roles import PUBLIC, RECORDED, Person, may_watch, permissions_of, permitted
from app.access.signin import HALF_LIFE
from app.addresses import plain
from app.errors import ConfigurationError, Refused, StorageError
from app.plant.definitions import Plant, Point, Scan
from app.plant.system import FRAME, SYSTEM
from app.web.errors import answer
from app.web.language import local_path, place_of
from app.web.security import is_own_origin

if TYPE_CHECKING:
    from app.runtime import Runtime

log = logging.getLogger(__name__)

PERMISSIONS: frozenset[str] = frozenset({PUBLIC, *OF_ROLES})
"""What a route may ask for: nothing (`open`: health, static files, signing in) or a permission of app/access/roles.py."""
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
SID, PRE, HALF = "sid", "pre", "half"
"""Cookies of the session, of the browser before there is one, and between password and code; under TLS with the prefix `__Host-`."""
UNTOUCHED = ("/static/", "/healthz", "/readyz", "/favicon.ico")
"""Nobody is looked up for these."""
POLICY_VIOLATION = 1008
IN_FRAME = frozenset(key for key, *_ in FRAME)
IN_LISTS = frozenset({"commands", "events", "alarms", "records", "lessons"})
"""First part of the keys of system points that pages for everybody follow: that something in a list has changed."""
DENIALS_KEPT = 60.0
"""The same refusal of the same person is written down once in so long [s]."""
DENIALS_APART = 30
"""So many of a person are told apart in it by machine and command; further ones by their page alone."""
CONTROL = frozenset({"take", "request", "withdraw", "refuse", "give", "release"})
"""What may be asked about the control of a machine."""


class SignInFirst(Exception):
    """Nobody is signed in, or somebody only watches after idling, and the route asks for more."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class MustChange(Exception):
    """An initial password has to be changed before anything else."""


class MustEnrol(Exception):
    """A role of somebody asks for a second factor, which comes before anything else."""


class Gatekeeper:
    """The layer that finds the person behind a request."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        state = scope.setdefault("state", {})
        state |= {"person": None, "csrf": "", "bound": "", "bearer": False, "over": "", "unread": False}
        access = access_of(scope["app"])
        if access is None or scope["path"].startswith(UNTOUCHED):
            await self._app(scope, receive, send)
            return
        headers, secure = Headers(scope=scope), is_secure(scope)
        cookies = _cookies(headers)
        fresh = ""
        bearer = _bearer(scope, headers)
        if bearer is not None:
            state["bearer"] = True
            try:
                state["person"] = await access.tokens.find(bearer, address_of(scope))
            except StorageError as error:
                log.error("token not read reason=%s", error)
                await _turn_away(scope, receive, send, 503, "error.unavailable")
                return
            if state["person"] is None:
                await _turn_away(scope, receive, send, 401, "access.token_unknown")
                return
        else:
            fresh = await self._browser(scope, state, access, headers, cookies)
        if (place := state.get("place")) is not None:  # app/web/connections.py
            place.known(state["person"].session if state["person"] is not None else "")
        await self._app(scope, receive, _with_cookie(send, cookie_name(PRE, secure), fresh, secure) if fresh else send)

    async def _browser(
        self, scope: Scope, state: dict[str, object], access: Access, headers: Headers, cookies: Mapping[str, str]
    ) -> str:
        """Find who uses this browser; returns a new pre-session id when it has none."""
        secure, fresh = is_secure(scope), ""
        sid = cookies.get(cookie_name(SID, secure), "")
        person = None
        if sid:
            try:
                person = await access.sessions.find(sid, address_of(scope), headers.get("user-agent", ""))
            except StorageError as error:
                log.error("session not read reason=%s", error)
                state["unread"] = True
        state["person"] = person
        if person is not None:
            bound = sid
            if _is_deed(scope, headers):
                access.sessions.touch(person)
        else:
            state["over"] = access.sessions.why_over(sid) if sid else ""
            bound = cookies.get(cookie_name(PRE, secure), "")
            if not re.fullmatch(r"[\w-]{22}", bound, re.ASCII):
                bound = fresh = chance.token_urlsafe(16)
        state["bound"] = bound
        state["csrf"] = access.form_token(bound)
        return fresh


class Allow:
    """The dependency that a route declares: who lacks `permission` does not get in."""

    def __init__(self, permission: str) -> None:
        if permission not in PERMISSIONS:
            raise ConfigurationError(
                f'permission "{permission}" is unknown: expected one of {", ".join(sorted(PERMISSIONS))}'
            )
        self.permission = permission

    async def __call__(self, connection: HTTPConnection) -> None:
        """Let through or raise.

        Raises:
            SignInFirst: nobody is signed in, or somebody who idled.
            MustChange: an initial password comes first.
            MustEnrol: a second factor comes first.
            Refused: 403 for a missing right, a foreign origin or token; 415 for an API body that is no JSON; 503 without audit.
            WebSocketException: any of these, on a socket.
        """
        state = connection.state
        state.permission = self.permission
        person: Person | None = state.person
        if not permitted(person, self.permission, simulated=guests_allowed(connection.app)):
            if connection.scope["type"] == "websocket":
                raise WebSocketException(POLICY_VIOLATION)
            await self._refuse(connection, person)
        if connection.scope["type"] != "http":
            return
        request = Request(connection.scope) if not isinstance(connection, Request) else connection
        if request.method not in SAFE:
            await check_origin_and_token(request)
            access = access_of(request.app)
            if self.permission in RECORDED and (access is None or not access.audit.healthy):
                raise Refused("access.audit_unavailable", 503)

    async def _refuse(self, connection: HTTPConnection, person: Person | None) -> None:
        if person is None:
            raise SignInFirst("error.sign_in")
        if person.must_change:
            raise MustChange
        if person.must_enrol and self.permission != "factor":
            raise MustEnrol
        if person.idle and self.permission in permissions_of(person.roles):
            raise SignInFirst("access.idle")
        await _note_denied(connection, person, self.permission)
        raise Refused("error.forbidden", 403)


def allow(permission: str) -> Dependency:
    """For a route: `dependencies=[allow("view")]`.

    Raises:
        ConfigurationError: the permission is not one of `PERMISSIONS`.
    """
    dependency: Dependency = Depends(Allow(permission))
    return dependency


require = allow


def install(app: FastAPI) -> None:
    """Answer those who have to sign in first, to change their password first, or to enrol a second factor first."""
    app.add_exception_handler(SignInFirst, _to_sign_in)
    app.add_exception_handler(MustChange, _to_account)
    app.add_exception_handler(MustEnrol, _to_factor)


# ---- what routes ask --------------------------------------------------------------------------------------


def access_of(app: FastAPI) -> Access | None:
    """People, sessions and audit of the running server; None while it starts."""
    return getattr(getattr(app.state, "runtime", None), "access", None)


def people_access(request: Request) -> Access:
    """As `access_of`, for a route.

    Raises:
        Refused: 503 while there is none.
    """
    access = access_of(request.app)
    if access is None:
        raise Refused("error.unavailable", 503)
    return access


def person_of(request: Request) -> Person:
    """Who makes the request, on a route that asks for a person.

    Raises:
        SignInFirst: nobody is signed in.
    """
    person: Person | None = request.state.person
    if person is None:
        raise SignInFirst("error.sign_in")
    return person


def guests_allowed(app: FastAPI) -> bool:
    """Whether visitors without sign-in may watch: every link is simulated, or the first plant file is broken and nobody has an account."""
    runtime: Runtime | None = getattr(app.state, "runtime", None)
    if runtime is None:
        return False
    access = access_of(app)
    uncommissioned = access is not None and access.first_code.open
    return bool(runtime.simulated) or (runtime.plant is None and uncommissioned)


async def may_watch_live(websocket: WebSocket, kind: str) -> bool:
    """Whether whoever opened a socket may watch this kind of page, as of now: asked at subscribing and every 30 s."""
    access = access_of(websocket.app)
    person: Person | None = websocket.state.person
    if access is not None and person is not None:
        try:
            person = await (access.tokens if websocket.state.bearer else access.sessions).again(person)
        except StorageError as error:
            log.error(
                "session not read reason=%s", error
            )  # what it was allowed before holds until the database is back
        if person is None and not guests_allowed(websocket.app):
            return False
    return may_watch(person, kind, simulated=guests_allowed(websocket.app))


def permission_of_point(point: Point) -> str:
    """What reading a point needs: as much as the page that it is for, wherever else it is asked for.

    The system's own points are for the pages of communication and storage, but for those of the frame and of lists; parameters, read once
    after connecting, are for the page of parameters.
    """
    if point.equipment == SYSTEM:
        return "view" if point.key in IN_FRAME or point.key.partition(".")[0] in IN_LISTS else "diagnose"
    return "diagnose" if point.scan is Scan.ONCE else "view"


def may_read(request: Request, point: Point) -> bool:
    """Whether whoever asks may have the values of `point`."""
    return permitted(request.state.person, permission_of_point(point), simulated=guests_allowed(request.app))


def check_points(request: Request, names: Collection[str]) -> None:
    """Refuse values that belong to a page which whoever asks may not open; a name that nobody knows is told elsewhere.

    The history also knows a point by its lasting id, and points that the plant has no more.

    Raises:
        Refused: 403, names the first of them.
    """
    points = request.app.state.runtime.points
    strange = {*names} - points.keys()
    former = {point.id: point for point in points.values() if point.id in strange} if strange else {}
    for name in names:
        point = points.get(name) or former.get(name)
        if point is None and name.startswith(f"{SYSTEM}."):
            point = Point(name, name, SYSTEM, name.removeprefix(f"{SYSTEM}."), name)
        if point is not None and not may_read(request, point):
            raise Refused("access.point", 403, tag=name)


def shown_name(request: Request, name: str) -> str:
    """The name of a person for whoever asks: visitors without sign-in read that it was somebody, and not who."""
    if not name or request.state.person is not None:
        return name
    return str(request.app.state.view.text(request, "access.role.operator"))


def shown_words(request: Request, words: str) -> str:
    """What a person wrote (a reason, a comment) for whoever asks: it may name somebody, so visitors without sign-in read nothing of it."""
    return words if request.state.person is not None else ""


async def check_origin_and_token(request: Request) -> None:
    """Refuse a change that another site's page asks for: fetch metadata or origin, then the signed token of this session.

    Raises:
        Refused: 403, or 415 for an API body that is no JSON.
    """
    content = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if request.url.path.startswith("/api/") and content not in ("", "application/json"):
        raise Refused("access.json_only", 415)
    if request.state.bearer:
        return  # a token that a program sends on purpose cannot be borrowed by a page
    if not _from_own_page(request):
        raise Refused("access.other_site", 403)
    token = request.headers.get("x-csrf-token", "")
    if not token and content == "application/x-www-form-urlencoded":
        form = await request.form()
        values = form.getlist("csrf")
        token = values[0] if len(values) == 1 and isinstance(values[0], str) else ""
    access = access_of(request.app)
    if access is None or not access.is_form_token(token, request.state.bound):
        raise Refused("access.form_stale", 403)


def _from_own_page(request: Request) -> bool:
    """Whether a page of ours sends it: fetch metadata and origin say so, as far as they are there, else the referer does."""
    site, origin = request.headers.get("sec-fetch-site"), request.headers.get("origin")
    if site is not None:  # a form of ours says "Origin: null", since our pages tell no referer
        return site == "same-origin" and (origin in (None, "null") or is_own_origin(request.scope, origin))
    named = origin or request.headers.get("referer") or ""
    try:
        parts = urlsplit(named)
    except ValueError:
        return False
    return is_own_origin(request.scope, f"{parts.scheme}://{parts.netloc}")


async def fields(
    request: Request, required: Iterable[str], optional: Iterable[str] = (), lists: Iterable[str] = ()
) -> dict[str, str]:
    """The fields of a form by name, each once; what is not named is refused, not ignored (no rights by an extra field).

    `next` is where the form leads to afterwards: empty, or a path of this server.

    Raises:
        Refused: 422, a field is missing, there twice, a file, unknown, or not text.
    """
    form = await request.form()
    wanted, extra, many = set(required), {*optional, "csrf", "next"}, set(lists)
    found: dict[str, str] = {}
    for name, value in form.multi_items():
        if name in many and isinstance(value, str):
            continue
        if name not in wanted | extra or name in found or isinstance(value, UploadFile):
            raise Refused("access.form_field", 422, field=printable(name, 40))
        found[name] = value
    if missing := sorted(wanted - set(found)):
        raise Refused("access.form_field", 422, field=missing[0])
    if next := found.get("next"):
        found["next"] = local_path(next)
    return {name: found.get(name, "") for name in (*required, *optional, "next")}


async def field_list(request: Request, name: str) -> list[str]:
    """All values of the field `name` (check boxes)."""
    form: FormData = await request.form()
    return [value for value in form.getlist(name) if isinstance(value, str)]


# ---- addresses and cookies --------------------------------------------------------------------------------


def is_secure(scope: Scope) -> bool:
    """Whether the browser came over TLS."""
    return scope.get("scheme") in ("https", "wss")


def cookie_name(name: str, secure: bool) -> str:
    """`__Host-sid` under TLS: no other host and no unencrypted page can set it."""
    return f"__Host-{name}" if secure else name


def address_of(scope: Scope) -> str:
    """Where the request comes from; all addresses of this machine are one."""
    client = scope.get("client")
    if not client:
        return ""
    try:
        address = plain(str(client[0]))
    except ValueError:
        return printable(client[0], 64)
    return "127.0.0.1" if address.is_loopback else str(address)


def session_cookie(response: Response, request: Request, sid: str) -> None:
    """Hand the browser its session: a cookie until it is closed, out of reach of scripts and other sites."""
    secure = is_secure(request.scope)
    response.set_cookie(cookie_name(SID, secure), sid, httponly=True, samesite="strict", secure=secure, path="/")


def session_id(request: Request) -> str:
    """The id in the cookie; empty without one."""
    return request.cookies.get(cookie_name(SID, is_secure(request.scope)), "")


def half_cookie(response: Response, request: Request, ticket: str) -> None:
    """Hand the browser what stands for a right password until the code comes; empty takes it away."""
    secure = is_secure(request.scope)
    name, life = cookie_name(HALF, secure), round(HALF_LIFE) if ticket else 0
    response.set_cookie(name, ticket, max_age=life, httponly=True, samesite="strict", secure=secure, path="/")


def half_ticket(request: Request) -> str:
    """What is in that cookie; empty without one."""
    return request.cookies.get(cookie_name(HALF, is_secure(request.scope)), "")


def forget_cookies(response: Response, request: Request) -> None:
    """Take session and pre-session cookies away."""
    secure = is_secure(request.scope)
    for name in (SID, PRE, HALF):
        response.delete_cookie(cookie_name(name, secure), path="/", secure=secure, httponly=True, samesite="strict")


# ---- start-up self-check ----------------------------------------------------------------------------------


def permissions(app: FastAPI) -> dict[str, str]:
    """Route (`GET /equipment/{id}`) → permission, for every route of `app`; empty where none is declared."""
    table: dict[str, str] = {}
    for route in iter_route_contexts(app.routes):
        original = getattr(route, "starlette_route", None) or route.original_route
        declared: Iterable[Dependency] = [
            *(getattr(route, "dependencies", None) or ()),
            *(getattr(original, "dependencies", None) or ()),
        ]
        asked = [item.dependency.permission for item in declared if isinstance(item.dependency, Allow)]
        path = getattr(route, "path", None) or getattr(original, "path", "")
        methods = getattr(route, "methods", None) or getattr(original, "methods", None) or {"LIVE"}
        for method in sorted(methods):
            name = f"{method} {path}"
            table[name] = table.get(name, asked[0]) if asked else ""  # of two at one address the first is served
    return table


def check_declared(app: FastAPI) -> None:
    """Refuse to serve a route for which nobody said who may use it.

    Raises:
        ConfigurationError: names every such route.
    """
    silent = [route for route, permission in permissions(app).items() if not permission]
    if silent:
        raise ConfigurationError(
            f"{', '.join(silent)}: no permission declared, "
            f"expected dependencies=[allow(…)] with one of {', '.join(sorted(PERMISSIONS))}"
        )


# ---- details ----------------------------------------------------------------------------------------------


def _cookies(headers: Headers) -> dict[str, str]:
    return cookie_parser(headers.get("cookie", ""))


def _bearer(scope: Scope, headers: Headers) -> str | None:
    """The API token of a program; browsers' pages do not take one."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    if kind.lower() != "bearer":
        return None
    return token.strip() if scope["type"] == "websocket" or scope["path"].startswith("/api/") else None


async def _turn_away(scope: Scope, receive: Receive, send: Send, status: int, key: str) -> None:
    """Who names a token that is none is nobody, and not a guest either."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        return
    response = answer(Request(scope), status, key)
    if status == 401:
        response.headers["WWW-Authenticate"] = "Bearer"
    await response(scope, receive, send)


def _is_deed(scope: Scope, headers: Headers) -> bool:
    """Whether a person did something: a change, or a page gone to; not what a page fetches by itself."""
    if scope["type"] != "http":
        return False
    if scope["method"] not in SAFE:
        return True
    mode = headers.get("sec-fetch-mode")
    return mode == "navigate" if mode is not None else "text/html" in headers.get("accept", "")


def _with_cookie(send: Send, name: str, value: str, secure: bool) -> Send:
    """Set the pre-session cookie with the first page."""
    line = f"{name}={value}; Path=/; HttpOnly; SameSite=Strict{'; Secure' if secure else ''}"

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            if headers.get("content-type", "").startswith("text/html"):
                headers.append("set-cookie", line)
        await send(message)

    return sending


def wants_page(request: Request) -> bool:
    """Whether a browser goes to a page, as against a fragment or a program's request."""
    fragment = request.headers.get("hx-request") == "true" or request.url.path.startswith("/api/")
    return request.method in SAFE and not fragment


async def _to_sign_in(request: Request, error: Exception) -> Response:
    assert isinstance(error, SignInFirst)
    if wants_page(request):
        return RedirectResponse(f"/signin?next={quote(place_of(request), safe='/')}", 303)
    over = request.state.over
    return answer(request, 401, f"access.over.{over}" if over else error.reason)


async def _to_account(request: Request, error: Exception) -> Response:
    if wants_page(request):
        return RedirectResponse("/account", 303)
    return answer(request, 403, "access.must_change")


async def _to_factor(request: Request, error: Exception) -> Response:
    if wants_page(request):
        return RedirectResponse("/account/factor", 303)
    return answer(request, 403, "access.must_enrol")


async def _note_denied(connection: HTTPConnection, person: Person, permission: str) -> None:
    """Write a denial down, but let nobody fill the audit with them."""
    access = access_of(connection.app)
    if access is None:
        return
    route = connection.scope.get("route")
    path = getattr(route, "path", "") or connection.scope["path"]
    app_state = connection.app.state
    if not hasattr(app_state, "denials"):
        app_state.denials = {}
    noted: dict[tuple[str, ...], float] = app_state.denials
    now = app_state.runtime.clock.monotonic()
    told = _what_was_denied(app_state.runtime.plant, path, connection.scope.get("path_params", {}))
    if sum(other[0] == person.name and now - at < DENIALS_KEPT for other, at in noted.items()) >= DENIALS_APART:
        told = {}
    key = (person.name, path, *told.values())
    if now - noted.get(key, -DENIALS_KEPT) < DENIALS_KEPT:
        return
    if len(noted) > 1000:
        noted.clear()
    noted[key] = now
    await access.audit.record("access.denied", person, path, result="refused", permission=permission, **told)


def _what_was_denied(plant: Plant | None, path: str, parts: Mapping[str, str]) -> dict[str, str]:
    """The machine that a refused request was about and what was asked of it, as far as the plant has them."""
    named = next((one for one in map(parts.get, ("key", "id", "machine")) if one), "")
    item = plant.equipment.get(named) if plant else None
    if item is None:
        return {}
    command = parts.get("command") or parts.get("setpoint") or ""
    if path.endswith("/stop"):
        command = next((key for key, one in item.type.commands.items() if one.stop), "")
    known = command in item.type.commands or command in item.type.setpoints
    action = parts.get("action", "") if path.endswith(("/token/{action}", "/control/{action}")) else ""
    told = {"machine": named, "command": command if known else "", "control": action if action in CONTROL else ""}
    return {name: value for name, value in told.items() if value}
