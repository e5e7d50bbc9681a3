"""Who gets in: all routes × all kinds of persons, forms of other sites, forged identities, sockets."""

import re
from collections.abc import Callable, Iterator, ValuesView
from copy import deepcopy
from functools import cache
from types import SimpleNamespace
from typing import cast

import pytest
from fastapi import APIRouter, FastAPI, Request
from sqlalchemy import Connection, delete, insert
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocketDisconnect

from app.access.audit.search import Filter
from app.access.roles import GUEST, PERMISSIONS, Person, permissions_of
from app.access.session_times import IDLE_AFTER
from app.access.signin import HalfIn
from app.access.tables import factor_table
from app.access.tokens import GRANTABLE
from app.clock import ManualClock
from app.errors import ConfigurationError, StorageError
from app.main import create_app
from app.plant.definitions import Point
from app.settings import Settings
from app.web.guard import allow, check_declared, check_points, permissions
from tests.virtual import house
from tests.web.people import BOSS, HOST, PASSWORD, Staff

OPEN = {
    "GET /favicon.ico",
    "GET /first",
    "GET /healthz",
    "GET /metrics",  # loopback, or a token of its own
    "GET /readyz",
    "GET /signin",
    "GET /static/{name:path}",
    "HEAD /static/{name:path}",
    "GET /live",  # says that it wants to be a socket
    "LIVE /live",  # asks at each subscription
    "POST /first",
    "POST /language",
    "POST /session/active",
    "POST /signin",
    "GET /signin/code",  # asks for the ticket that the password gave
    "POST /signin/code",
    "POST /signout",
    "POST /theme",
}
"""Every route that needs no sign-in. A new one is added here by hand, with a reason, or is not open."""
EXPECTED = {
    "GET /": "view",
    "GET /equipment/{key}": "view",
    "GET /account": "account",
    "POST /account/password": "account",
    "GET /users": "administer",
    "GET /users/review": "administer",
    "GET /users/review.csv": "administer",
    "POST /users": "administer",
    "POST /users/{key}/roles": "administer",
    "POST /users/{key}/password": "administer",
    "POST /users/{key}/factor": "administer",
    "GET /account/factor": "factor",
    "POST /account/factor/begin": "factor",
    "POST /account/factor/confirm": "factor",
    "POST /account/factor/codes": "factor",
    "POST /account/factor/remove": "factor",
    "GET /tokens": "tokens",
    "POST /tokens": "tokens",
    "GET /audit": "audit.own",
    "GET /audit.csv": "audit",
    "POST /audit/verify": "administer",
}
KINDS = [
    "nobody",
    "guest",
    "viewer",
    "operator",
    "engineer",
    "admin",
    "disabled",
    "idle operator",
    "idle engineer",
    "initial",
    "between password and code",
    "between password and code, guests allowed",
    "between password and code, idle before",
    "enrolling operator",
    "enrolling engineer",
    "enrolling admin",
]


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("guard") / "data")) as client:
        yield Staff(client)


@pytest.fixture
def live_plant(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plant has a link that is not simulated."""
    monkeypatch.setattr(type(staff.client.app.state.runtime), "simulated", property(lambda _: False))  # type: ignore[attr-defined]


# ---- every route says who --------------------------------------------------------------------------------


@cache
def routes() -> dict[str, str]:
    return permissions(create_app(Settings()))


def test_every_route_declares_a_permission_and_the_open_ones_are_these() -> None:
    table = routes()
    assert [route for route, permission in table.items() if not permission] == []
    assert {route for route, permission in table.items() if permission == "open"} == OPEN


def test_what_looks_after_people_asks_for_these_rights() -> None:
    table = routes()
    assert {route: table[route] for route in EXPECTED} == EXPECTED


def silent_route(app: FastAPI) -> None:
    app.add_api_route("/silent", lambda: {})


def silent_router(app: FastAPI) -> None:
    router = APIRouter()
    router.add_api_route("/deep/silent", lambda: {}, methods=["POST"])
    app.include_router(router)


def silent_socket(app: FastAPI) -> None:
    app.add_api_websocket_route("/silent", lambda websocket: None)


def silent_mount(app: FastAPI) -> None:
    app.mount("/silent", StaticFiles(directory="."))


@pytest.mark.parametrize("add", [silent_route, silent_router, silent_socket, silent_mount])
def test_a_route_that_says_nothing_stops_the_start(add: Callable[[FastAPI], None]) -> None:
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    app.add_api_route("/said", lambda: {}, dependencies=[allow("view")])
    check_declared(app)
    add(app)
    with pytest.raises(ConfigurationError, match=r"/silent.*no permission declared"):
        check_declared(app)


def test_an_unknown_permission_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r'"fly" is unknown'):
        allow("fly")


# ---- all routes × all kinds of persons --------------------------------------------------------------------


def rights(kind: str) -> frozenset[str]:
    """What the written table gives to this kind of person."""
    match kind.split():
        case ["nobody" | "disabled"]:
            return frozenset()
        case ["between", *_, "allowed"]:
            return GUEST
        case ["between", *_, "before"]:
            return permissions_of(["operator"]) & {"view", "account", "stop"}
        case ["between", *_]:
            return frozenset()
        case ["enrolling", role]:
            return permissions_of([role]) & {"factor", "stop"}
        case ["guest"]:
            return GUEST
        case ["idle", role]:
            return permissions_of([role]) & {"view", "account", "stop"}
        case ["initial"]:
            return frozenset({"account"})
        case _:
            return permissions_of([kind])


def come_as(staff: Staff, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    if not kind.endswith(("guest", "guests allowed")):
        monkeypatch.setattr(type(staff.client.app.state.runtime), "simulated", property(lambda _: False))  # type: ignore[attr-defined]
    if kind in ("nobody", "guest"):
        staff.have()
    elif kind == "disabled":
        staff.wait(staff.access.people.disable, BOSS, staff.add("gone", "engineer"), False)
        sid = staff.enter("gone")
        staff.wait(staff.access.people.disable, BOSS, staff.add("gone"), True)
        staff.have(sid)
    elif kind.startswith("idle"):
        staff.enter(f"idle-{kind[5:]}", kind[5:])
        let_idle(staff, monkeypatch)
    elif kind.startswith("enrolling"):
        staff.enter(f"new-{kind[10:]}", kind[10:])
        monkeypatch.setattr(staff.access.sessions, "_factor_roles", frozenset({kind[10:]}))
    elif kind.startswith("between"):
        key, old = staff.add("careful", "operator"), ""
        if kind.endswith("before"):
            staff.access.people._db.run(lambda connection: connection.execute(delete(factor_table)) and None)
            old = staff.enter("careful")
            let_idle(staff, monkeypatch)
        staff.access.people._db.run(lambda connection: put_factor(connection, key))
        half = staff.wait(staff.access.sign_in.with_password, "careful", PASSWORD, "127.0.0.1", "testclient", old)
        assert isinstance(half, HalfIn)
        staff.have(old)
        staff.client.cookies.set("half", half.ticket)
    elif kind == "initial":
        name = f"new{staff.wait(staff.access.people.count)}"
        _, initial = staff.wait(staff.access.people.add, BOSS, name, "", ["engineer"])
        staff.have(staff.wait(staff.access.sign_in.with_password, name, initial, "127.0.0.1", "testclient").sid)
    else:
        staff.enter(f"the-{kind}", kind)


def let_idle(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    """For sessions it is later, for nothing else."""
    sessions = staff.access.sessions
    clock = deepcopy(sessions._clock)
    assert isinstance(clock, ManualClock)
    clock.advance(IDLE_AFTER + 1)
    for part in (sessions, sessions._times):
        monkeypatch.setattr(part, "_clock", clock)


def put_factor(connection: Connection, person: int) -> None:
    """A second factor, were it not there."""
    values = {"person": person, "sealed": "", "since": 0, "last_step": 0}
    connection.execute(insert(factor_table).prefix_with("OR IGNORE").values(**values))


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
def test_every_route_lets_in_exactly_whom_the_table_names(
    staff: Staff, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong, comes, came = [], True, dict[str, str]()
    for route, permission in routes().items():
        method, path = route.split()
        if method == "LIVE":
            continue
        if comes:
            come_as(staff, kind, monkeypatch)
            came = dict(staff.client.cookies)
        else:
            staff.client.cookies.clear()
            staff.client.cookies.update(came)
        address = re.sub(r"\{[^}]*\}", "987654", path)  # nothing that another test may have made
        if method in ("GET", "HEAD"):
            answer = staff.client.request(method, address)
            if path == "/signin/code" and kind.startswith("between"):
                assert answer.status_code == 200
        else:
            bound = staff.client.cookies.get("sid") or "a" * 22
            if kind == "disabled" or not staff.client.cookies.get("sid"):
                staff.client.cookies.set("pre", "a" * 22)
                bound = "a" * 22
            headers = {"Origin": HOST, "X-CSRF-Token": staff.access.form_token(bound)}
            answer = staff.client.request(method, address, headers=headers)
        turned_away = answer.status_code in (401, 403) or (
            answer.status_code == 303
            and re.match(r"/signin\?next=|/account(/factor)?$", answer.headers["location"]) is not None
            and path not in ("/signin", "/signin/code", "/signout")
        )
        allowed = permission == "open" or permission in rights(kind)
        if turned_away == allowed:
            wrong.append((kind, route, permission, answer.status_code, answer.headers.get("location", "")))
        if not allowed and answer.status_code == 200:
            wrong.append((kind, route, "data"))
        comes = allowed and method not in ("GET", "HEAD")  # what was done may have been the end of this session
    assert wrong == []


def test_a_permission_of_the_table_is_asked_for_by_a_route_or_by_the_gate() -> None:
    asked = set(routes().values()) - {"open"}
    assert asked <= set(PERMISSIONS)


def test_a_page_sends_to_sign_in_and_back_a_fragment_and_the_api_say_401(staff: Staff, live_plant: None) -> None:
    staff.have()
    answer = staff.client.get("/equipment/m1?tab=2&x=a b")
    assert (answer.status_code, answer.headers["location"]) == (
        303,
        "/signin?next=/equipment/m1%3Ftab%3D2%26x%3Da%2520b",
    )
    fragment = staff.client.get("/equipment/m1", headers={"HX-Request": "true"})
    assert fragment.status_code == 401
    assert "<html" not in fragment.text


def test_a_form_that_is_sent_after_the_session_ended_leads_to_sign_in(staff: Staff) -> None:
    """A list of people is no fragment: the page that answers is all that is left."""
    staff.enter("boss", "admin")
    staff.client.cookies.clear()
    answer = staff.post("/users", {"name": "typed", "display": "Typed"})
    assert answer.status_code == 401
    assert '<a class="btn tap" href="/signin">' in answer.text


def test_a_denial_is_written_down_once_a_minute(staff: Staff) -> None:
    staff.enter("curious", "operator")
    for _ in range(5):
        assert staff.client.get("/users").status_code == 403
    lines = staff.wait(staff.access.audit.find, Filter(person="curious", kind="access.denied"))
    assert [(line.object, line.parameters) for line in lines] == [("/users", {"permission": "administer"})]


# ---- forged identities ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "headers",
    [
        {"Referer": f"{HOST}/users"},
        {"X-Forwarded-For": "127.0.0.1"},
        {"X-Forwarded-User": "ana"},
        {"X-Remote-User": "admin"},
        {"X-Original-URL": "/healthz"},
        {"X-Rewrite-URL": "/healthz"},
        {"Authorization": "Basic YWRtaW46YWRtaW4="},
        {"Authorization": "Bearer eyJhbGciOiJub25lIn0.eyJzdWIiOiJhZG1pbiJ9."},
        {"Cookie": "sid=admin; user=admin; role=admin"},
        {"Cookie": "sid=" + "A" * 43},
        {"Cookie": "__Host-sid=" + "A" * 43},
    ],
)
def test_no_header_makes_somebody_of_nobody(staff: Staff, live_plant: None, headers: dict[str, str]) -> None:
    staff.have()
    answer = staff.client.get("/users", headers=headers)
    assert (answer.status_code, answer.headers.get("location")) == (303, "/signin?next=/users")


def test_an_unknown_host_is_refused(staff: Staff) -> None:
    assert staff.client.get("/", headers={"Host": "evil.example"}).status_code == 400


def test_a_token_of_a_program_is_only_good_for_the_api(staff: Staff, live_plant: None) -> None:
    key = staff.add("maker", "engineer")
    maker = Person(key, "maker", "", frozenset({"engineer"}), permissions_of({"engineer"}), "")
    _, secret = staff.wait(staff.access.tokens.create, maker, "MES", ["view", "configure"], 7)
    staff.have()
    assert staff.client.get("/tokens", headers={"Authorization": f"Bearer {secret}"}).status_code == 303


@pytest.mark.sweep(8)
@pytest.mark.parametrize("permission", sorted(GRANTABLE))
def test_a_token_gets_in_exactly_where_its_one_permission_is_asked_for(
    staff: Staff, live_plant: None, permission: str
) -> None:
    """Whatever its maker may do; and where no program is served it is nobody, not its maker."""
    key = staff.add("toolsmith", "operator", "engineer", "admin")
    may = permissions_of({"operator", "engineer", "admin"})
    maker = Person(key, "toolsmith", "", frozenset({"operator", "engineer", "admin"}), may, "")
    _, secret = staff.wait(staff.access.tokens.create, maker, f"only {permission}", [permission], 7)
    wrong = []
    for route, asked in routes().items():
        method, path = route.split()
        if method == "LIVE" or asked == "open":
            continue
        staff.have()
        address = re.sub(r"\{[^}]*\}", "987654", path)
        answer = staff.client.request(method, address, headers={"Authorization": f"Bearer {secret}", "Origin": HOST})
        turned_away = answer.status_code in (401, 403) or (
            answer.status_code == 303 and "/signin" in answer.headers["location"]
        )
        if turned_away == (path.startswith("/api/") and asked == permission):
            wrong.append((route, asked, answer.status_code))
    assert wrong == []


# ---- forms of other sites ---------------------------------------------------------------------------------


def signed(staff: Staff) -> dict[str, str]:
    return {"csrf": staff.access.form_token(staff.client.cookies["sid"]), "session": "0" * 16}


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": HOST}, 404),
        ({"Sec-Fetch-Site": "same-origin"}, 404),
        ({"Referer": f"{HOST}/account"}, 404),
        ({}, 403),
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": HOST, "Sec-Fetch-Site": "cross-site"}, 403),
        ({"Origin": HOST, "Sec-Fetch-Site": "same-site"}, 403),
        ({"Origin": HOST, "Sec-Fetch-Site": "none"}, 403),
        ({"Origin": "http://127.0.0.1:8001"}, 403),
        ({"Referer": "http://evil.example/127.0.0.1:8000"}, 403),
    ],
)
def test_a_change_comes_from_a_page_of_ours_or_not_at_all(staff: Staff, headers: dict[str, str], status: int) -> None:
    staff.enter("ana")
    answer = staff.client.post("/account/sessions/end", data=signed(staff), headers=headers)
    assert answer.status_code == status


@pytest.mark.parametrize(
    "which", ["none", "empty", "other session", "changed", "of the pre-session", "twice", "salt only"]
)
def test_a_change_needs_the_token_of_this_very_session(staff: Staff, which: str) -> None:
    old = staff.enter("ana")
    foreign = staff.access.form_token(old)
    staff.enter("ana")
    own = signed(staff)["csrf"]
    token: str | list[str] = {
        "none": [],
        "empty": "",
        "other session": foreign,
        "changed": own[:-1] + ("a" if own[-1] != "a" else "b"),
        "of the pre-session": staff.access.form_token("a" * 22),
        "twice": [own, own],
        "salt only": "." + own.partition(".")[2],
    }[which]
    answer = staff.client.post(
        "/account/sessions/end", data={"csrf": token, "session": "0" * 16}, headers={"Origin": HOST}
    )
    assert answer.status_code == 403


def test_the_token_may_come_in_a_header_and_every_page_has_a_fresh_one(staff: Staff) -> None:
    sid = staff.enter("ana")
    headers = {"Origin": HOST, "X-CSRF-Token": staff.access.form_token(sid)}
    assert staff.client.post("/session/active", headers=headers).status_code == 200
    first, second = (re.search(r'name="csrf" value="([^"]+)"', staff.client.get("/account").text) for _ in range(2))
    assert first and second and first[1] != second[1]
    assert staff.access.is_form_token(first[1], sid)


@pytest.mark.sweep(8)
def test_nothing_changes_with_get(staff: Staff) -> None:
    staff.enter("boss1", "admin")
    for route in routes():
        method, path = route.split()
        if method == "POST" and f"GET {path}" not in routes():
            assert staff.client.get(re.sub(r"\{[^}]*\}", "1", path)).status_code in (404, 405), route


@pytest.mark.parametrize("method", ["TRACE", "PUT", "DELETE", "PATCH"])
def test_other_methods_are_not_there(staff: Staff, method: str) -> None:
    staff.enter("ana")
    assert staff.client.request(method, "/account").status_code in (404, 405)


# ---- sockets ----------------------------------------------------------------------------------------------


def hello(staff: Staff, kind: str) -> object:
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        socket.send_json({"subscribe": kind, "rev": 0})
        answer = socket.receive_json()
        return answer.get("error") or "hello" in answer


def named(staff: Staff) -> object:
    """Whom a socket of this browser names."""
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        socket.send_json({"subscribe": "overview", "rev": 0})
        return socket.receive_json().get("hello", {}).get("who")


@pytest.fixture
def unread(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From its call on the database does not say whose a session is."""

    async def fail(*_: object) -> None:
        raise StorageError("disk I/O error")

    return lambda: monkeypatch.setattr(staff.access.sessions, "find", fail)


def test_a_socket_says_who_is_signed_in_and_not_that_nobody_is_while_that_cannot_be_read(
    staff: Staff, unread: Callable[[], None]
) -> None:
    staff.have()
    assert named(staff) == ""
    staff.enter("ana")
    assert named(staff) == "ana"
    unread()
    assert named(staff) is None


def test_a_socket_does_not_refuse_for_good_while_nobody_knows_who_asks(
    staff: Staff, live_plant: None, unread: Callable[[], None]
) -> None:
    staff.enter("the-viewer", "viewer")
    unread()
    assert hello(staff, "overview") == "unavailable"


def test_a_socket_gives_each_person_the_pages_that_the_person_may_see(staff: Staff, live_plant: None) -> None:
    staff.have()
    assert hello(staff, "overview") == "not_allowed"
    staff.enter("the-viewer", "viewer")
    assert hello(staff, "overview") is True
    assert hello(staff, "parameters/m1") == "not_allowed"
    staff.enter("the-engineer", "engineer")
    assert hello(staff, "parameters/m1") is True


@pytest.mark.parametrize(
    "kind", [kind for kind in KINDS if kind.startswith(("between password and code", "enrolling"))]
)
def test_who_has_given_no_code_yet_has_no_more_on_a_socket(
    staff: Staff, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    come_as(staff, kind, monkeypatch)
    for page, needs in (("overview", "view"), ("parameters/m1", "diagnose"), ("storage", "diagnose")):
        assert hello(staff, page) == (True if needs in rights(kind) else "not_allowed")


def test_a_guest_has_a_socket_only_while_all_is_simulated(staff: Staff) -> None:
    staff.have()
    assert hello(staff, "overview") is True
    assert hello(staff, "parameters/m1") == "not_allowed"


@pytest.mark.parametrize(
    "headers", [{"Origin": "https://evil.example"}, {"Origin": HOST, "Sec-Fetch-Site": "cross-site"}]
)
def test_a_socket_of_another_site_is_refused(staff: Staff, headers: dict[str, str]) -> None:
    staff.enter("ana")
    with (
        pytest.raises(WebSocketDisconnect),
        staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers=headers),
    ):
        pass


def test_a_socket_closes_when_its_session_ends(staff: Staff) -> None:
    staff.enter("marko", "viewer")
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        socket.send_json({"subscribe": "overview", "rev": 0})
        assert "hello" in socket.receive_json()
        staff.wait(staff.access.people.disable, BOSS, staff.add("marko"), True)
        with pytest.raises(WebSocketDisconnect):
            for _ in range(100):
                socket.receive_json()


# ---- while the audit cannot be written --------------------------------------------------------------------


def test_without_audit_changes_are_refused_and_pages_go_on(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    staff.enter("boss2", "admin", "engineer", "operator")
    monkeypatch.setattr(type(staff.access.audit), "healthy", property(lambda _: False))
    answer = staff.post("/users", {"name": "eve", "own_password": PASSWORD, "roles": "admin"})
    assert answer.status_code == 503
    assert staff.client.get("/users").status_code == 200
    assert staff.post("/session/active").status_code == 200


# ---- cookies ----------------------------------------------------------------------------------------------


def test_a_browser_without_session_gets_a_pre_session_that_no_script_and_no_site_reads(staff: Staff) -> None:
    staff.have()
    cookie = staff.client.get("/signin").headers["set-cookie"]
    assert re.fullmatch(r"pre=[\w-]{22}; Path=/; HttpOnly; SameSite=Strict", cookie)


def test_static_files_and_programs_get_no_cookie(staff: Staff) -> None:
    staff.have()
    assert "set-cookie" not in staff.client.get("/favicon.ico").headers
    assert "set-cookie" not in staff.client.get("/healthz").headers


@pytest.mark.parametrize("unknown", [0, 1, 1000])
def test_names_that_nobody_knows_cost_one_look_through_the_points_however_many_they_are(unknown: int) -> None:
    """Eight thousand, as many as an address holds, beside four thousand points held the loop for half a second and more."""
    looks = 0

    class Points(dict[str, Point]):
        def values(self) -> ValuesView[Point]:
            nonlocal looks
            looks += 1
            return super().values()

    state = SimpleNamespace(runtime=SimpleNamespace(points=Points({f"m1.p{i}": point(f"m1.p{i}") for i in range(5)})))
    asked = SimpleNamespace(app=SimpleNamespace(state=state))
    check_points(cast(Request, asked), [f"nobody.{i}" for i in range(unknown)])
    assert looks <= 1


def point(name: str) -> Point:
    return Point(name, name, "m1", name.partition(".")[2], name)
