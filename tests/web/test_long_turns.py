"""Nothing that anybody sends keeps the loop: what one turn of it does is bounded, whatever the route and whoever asks."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from starlette.websockets import WebSocketDisconnect

from app.main import create_app
from app.settings import Settings
from app.web.guard import permissions
from app.web.security import LARGEST_BODY
from tests.virtual import house
from tests.web.people import HOST, Staff
from tests.web.work import Work, counted

MOST = 150_000
"""Calls in one turn. A bare loop does some ten million in a second on the slowest machine that counts: 15 ms."""
LONG = 24_000
"""What fits into the head of a request, which ends at 32 kB, when it is written with per cent signs for the rest [bytes]."""
PAGES = 1.5
"""How many times more than an honest request of the same route a hostile one may cost, beside `MOST`."""
FIELDS = (
    "names", "prefix", "after", "tags", "from", "to", "width", "limit", "pens", "person", "object", "kind", "since", "until",
    "before", "q", "search", "text", "equipment", "area", "page", "next", "lang", "group", "state", "priority", "product",
    "outcome", "definition", "sort", "zone", "digest", "id", "occurrence", "begin", "end", "span", "cursor",
)  # fmt: skip
HOSTILE = {
    "commas": ",",
    "names": "m1.speed,",
    "strangers": "a,",
    "points": "m1.speed ",
    "brackets": "[",
    "braces": '{"a":',
    "digits": "9",
    "nested": "(a+)+",
    "dots": "../",
    "letters": "č",
    "spaces": " ",
    "signs": "<&\"'>",
    "nulls": "\0",
    "percent": "%25",
    "lines": "\r\n",
    "dates": "9999-12-31T23:59:59.999999+23:59 ",
}
GETS = sorted(
    re.sub(r"\{[^}]*\}", "1", path).replace("/equipment/1", "/equipment/m1").replace("/static/1", "/static/app.css")
    for method, path in (route.split() for route in permissions(create_app(Settings())))
    if method == "GET"
)
POSTS = sorted(
    re.sub(r"\{[^}]*\}", "1", path).replace("/equipment/1", "/equipment/m1")
    for method, path in (route.split() for route in permissions(create_app(Settings())))
    if method == "POST"
)


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("turns") / "data")) as client:
        client.pass_time(3)
        yield Staff(client)


@pytest.fixture
def work() -> Iterator[Work]:
    with counted() as work:
        yield work


def long(piece: str, size: int = LONG) -> str:
    return (piece * (size // len(piece.encode()) + 1)).encode()[:size].decode("utf-8", "ignore")


def sit(staff: Staff, who: str) -> None:
    if who:
        staff.enter(who, "admin", "engineer", "operator")
    else:
        staff.have()


@pytest.mark.parametrize("who", ["", "ada"])
@pytest.mark.parametrize("kind", HOSTILE)
def test_a_query_costs_no_long_turn(staff: Staff, work: Work, kind: str, who: str) -> None:
    sit(staff, who)
    over = {}
    for path in GETS:
        for query in (
            {name: long(HOSTILE[kind], LONG // len(FIELDS)) for name in FIELDS},
            {"names": long(HOSTILE[kind])},
            {"tags": long(HOSTILE[kind])},
            {long(HOSTILE[kind], 20): long(HOSTILE[kind])},
        ):
            work.most = 0
            staff.client.get(path, params=query)
            if work.most > MOST:
                over[path] = max(work.most, over.get(path, 0))
    assert not over, over


@pytest.mark.parametrize("who", ["", "ada"])
@pytest.mark.parametrize("kind", HOSTILE)
def test_a_form_costs_no_long_turn(staff: Staff, work: Work, kind: str, who: str) -> None:
    sit(staff, who)
    size = min(LARGEST_BODY, 250_000) if who else 15_000
    over = {}
    for path in POSTS:
        for form in (
            {name: long(HOSTILE[kind], size // 12) for name in ("name", "password", "next", "reason", "argument", "comment")},
            {f"{name}{n}": "1" for n in range(size // 12) for name in ("a",)},
        ):
            work.most = 0
            answer = staff.post(path, form)
            if answer.status_code in (303, 401) and who:
                sit(staff, who)
            if work.most > MOST:
                over[path] = max(work.most, over.get(path, 0))
    assert not over, over


@pytest.mark.parametrize("kind", HOSTILE)
def test_heads_cost_no_long_turn(staff: Staff, work: Work, kind: str) -> None:
    sit(staff, "ada")
    value = long(HOSTILE[kind].strip("\0\r\n") or "x", 8000).encode("latin-1", "ignore")
    heads = ("Cookie", "Accept-Language", "Authorization", "User-Agent", "Origin", "Referer", "X-Forwarded-For", "Forwarded", "Range", "If-None-Match")
    over = {}
    for path in ("/", "/api/v1/tags", "/static/app.css", "/alarms", "/live", "/signin"):
        work.most = 0
        staff.client.get(path, headers=[*((name.encode(), value) for name in heads[:3]), *((f"X-{n}".encode(), b"1") for n in range(500))])  # type: ignore[arg-type]
        for name in heads:
            staff.client.get(path, headers={name.encode(): value})  # type: ignore[dict-item]
        if work.most > MOST:
            over[path] = work.most
    assert not over, over


def messages() -> Iterator[Any]:
    for piece in HOSTILE.values():
        yield {"subscribe": long(piece, 3000)}
        yield {"subscribe": "tags/" + long(piece, 3000)}
        yield {"hold": {"equipment": long(piece, 1000), "lease": long(piece, 1000), "counter": 10**300}}
    yield "[" * 4000
    yield '{"a":' * 800
    yield "9" * 4000


def test_a_message_on_the_socket_costs_no_long_turn(staff: Staff, work: Work) -> None:
    sit(staff, "ada")
    over = []
    for message in messages():
        work.most = 0
        with staff.client.websocket_connect("/live", headers={"Origin": HOST}) as socket:
            if isinstance(message, str):
                socket.send_text(message)
            else:
                socket.send_json(message)
            try:
                socket.receive_text()
            except (WebSocketDisconnect, KeyError):
                pass
        if work.most > MOST:
            over.append((work.most, str(message)[:80]))
    assert not over, over
