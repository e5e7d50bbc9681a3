"""What a stranger sends costs no more than reading it: bodies, their kinds and sizes, cookies, queries, hosts, origins, proxies, tokens."""

import asyncio
import re
from collections.abc import Iterator
from http import cookies
from typing import Any

import pytest
from fastapi.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from app.main import create_app
from app.settings import Settings
from app.web.guard import permissions
from app.web.security import ALWAYS, LARGEST_BODY
from tests.virtual import house
from tests.web.knock import knock
from tests.web.people import HOST, Staff

FORM = "application/x-www-form-urlencoded"
ROUTES = sorted(
    (method, re.sub(r"\{[^}]*\}", "1", path))
    for method, path in (route.split() for route in permissions(create_app(Settings())))
    if method not in ("GET", "HEAD", "LIVE")
)
CHARSETS = [
    "punycode",
    "idna",
    "undefined",
    "utf-16",
    "utf-7",
    "utf-32",
    "latin-1",
    "zip",
    "hex",
    "utf-8; a=b",
    "",
    "'utf-8'",
    "é",
]


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("bodies") / "data")) as client:
        yield Staff(client)


@pytest.fixture
def client(staff: Staff) -> TestClient:
    staff.have()
    return staff.client


def endless(portion: bytes = b"a=b&" * 1024) -> Iterator[bytes]:
    while True:
        yield portion


# ---- what a body may be -----------------------------------------------------------------------------------


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "kind",
    [
        "multipart/form-data; boundary=XX",
        "multipart/form-data",
        "Multipart/Mixed; boundary=XX",
        *(f"multipart/form-data; boundary=XX; charset={one}" for one in CHARSETS),
        *(f"{FORM}; charset={one}" for one in CHARSETS),
        *(f"application/json; charset={one}" for one in CHARSETS),
        "text/plain",
        "text/plain;charset=utf-8",
        "application/octet-stream",
        "application/xml",
        f"{FORM}, multipart/form-data; boundary=XX",
        "application/json" + " " * 5000 + ";",
        ";" * 5000,
        "/",
    ],
)
def test_a_body_of_another_kind_is_refused_on_every_route_before_anybody_reads_it(
    client: TestClient, kind: str
) -> None:
    for method, path in ROUTES:
        answer = knock(client, method, path, [("Content-Type", kind)], endless())
        assert (path, answer.status, answer.taken) == (path, 415, 0)
        assert answer.headers["connection"] == "close"
        assert answer.headers.items() >= {name.lower(): value for name, value in ALWAYS.items()}.items()
        assert ("application/json" in answer.headers["content-type"]) is path.startswith("/api/")


@pytest.mark.parametrize(
    "headers",
    [
        [("Content-Type", FORM), ("Content-Type", "multipart/form-data; boundary=XX")],
        [("Content-Type", "multipart/form-data; boundary=XX"), ("Content-Type", FORM)],
        [("Content-Type", FORM), ("Content-Encoding", "gzip")],
    ],
)
def test_two_kinds_or_a_packed_body_are_refused(client: TestClient, headers: list[tuple[str, str]]) -> None:
    for method, path in ROUTES:
        answer = knock(client, method, path, headers, endless())
        assert (path, answer.status, answer.taken) == (path, 415, 0)


@pytest.mark.parametrize(
    "kind",
    [FORM, f"{FORM};charset=UTF-8", f'{FORM}; charset="utf-8"', "Application/X-WWW-Form-Urlencoded ; charset=utf8"],
)
def test_a_form_in_utf_8_is_read(staff: Staff, kind: str) -> None:
    staff.have()
    token = staff.access.form_token("a" * 22)
    body = f"csrf={token}&to=de&next=/".encode()
    answer = knock(staff.client, "POST", "/language", [("Content-Type", kind), ("Cookie", "pre=" + "a" * 22)], [body])
    assert (answer.status, answer.headers["location"]) == (303, "/")


# ---- how much ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("length", [str(LARGEST_BODY + 1), "9" * 12, "9" * 5000, "-1", "+5", "1e3", "٣", "x", ""])
def test_a_body_that_says_it_is_too_long_is_not_read_on_any_route(client: TestClient, length: str) -> None:
    if not length.isascii():
        length = length.encode().decode("latin-1")
    for method, path in ROUTES:
        answer = knock(client, method, path, [("Content-Type", FORM), ("Content-Length", length)], endless())
        assert (path, answer.status, answer.taken) == (path, 413, 0)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", [FORM, "application/json", None])
@pytest.mark.parametrize("portion", [b"%" * 4096, b"&" * 4096, b"[" * 4096, b"a=" * 2048, b"x" * 4096])
def test_a_body_that_says_nothing_of_its_length_is_read_no_further_than_the_limit(
    staff: Staff, kind: str | None, portion: bytes
) -> None:
    sid = staff.enter("ana", "admin", "engineer", "operator")
    headers = [("Content-Type", kind)] if kind else []
    for signed in ([], [("Cookie", f"sid={sid}"), ("User-Agent", "testclient")]):
        for method, path in ROUTES:
            answer = knock(staff.client, method, path, [*headers, *signed], endless(portion))
            assert answer.status in (401, 403, 404, 409, 413, 415), (path, answer.status)
            assert answer.taken <= LARGEST_BODY // len(portion) + 1


def test_a_body_that_does_not_come_is_not_waited_for(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.web.security.BODY_TIME", 0.05)
    never = asyncio.Event()
    out: list[Any] = []

    async def ask() -> None:
        async def receive() -> dict[str, Any]:
            await never.wait()
            return {"type": "http.disconnect"}

        async def send(message: dict[str, Any]) -> None:
            out.append(message)

        scope: dict[str, Any] = {
            "type": "http", "method": "POST", "path": "/language", "raw_path": b"/language", "query_string": b"", "root_path": "",
            "scheme": "http", "http_version": "1.1", "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 8000), "state": {},
            "headers": [(b"host", b"127.0.0.1:8000"), (b"origin", HOST.encode()), (b"content-type", FORM.encode())],
        }  # fmt: skip
        await client.app(scope, receive, send)

    assert client.portal is not None
    client.portal.call(ask)
    assert out[0]["status"] == 408


# ---- what a body holds ------------------------------------------------------------------------------------

BODIES = [
    b"[" * LARGEST_BODY,
    b'{"a":' * 3000,
    b'{"id":"12345678","value":' + b"9" * 16000 + b"}",
    b'{"id":"12345678","value":1' + b"0" * 4000 + b"}",
    b'{"id":"12345678","value":-1e999}',
    b'{"id":"12345678","value":NaN}',
    b'{"occurrences":[' + b",".join([b"9" * 4000] * 3) + b"]}",
    b'{"occurrences":[' + b",".join([b"1"] * 5000) + b"]}",
    b'{"occurrences":[-1,0,9223372036854775807,9223372036854775808,1e300]}',
    b'{"occurrences":[1],"comment":"\\ud800"}',
    b'{"id":"\\ud800\\udfff\\ud800..","value":1,"reason":"\\u0000"}',
    b'{"arguments":{"' + b"a" * 9000 + b'":1}}',
    b"\xff\xfe\x00",
    b"",
    b"null",
    b"%" * LARGEST_BODY,
    b"&" * LARGEST_BODY,
    b"a&" * (LARGEST_BODY // 2),
    b"+%00=%ff%fe&" * 1000,
    b"name=" + b"%C4%8D" * 2600,
    b"name=" + b"a" * 16000 + b"&password=" + b"-" * 100,
]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("body", BODIES, ids=lambda body: f"{body[:16]!r}-{len(body)}")
@pytest.mark.parametrize("kind", [FORM, "application/json"])
def test_no_body_makes_an_error_of_ours(staff: Staff, body: bytes, kind: str) -> None:
    sid = staff.enter("ana", "admin", "engineer", "operator")
    token = staff.access.form_token(sid)
    headers = [("Cookie", f"sid={sid}"), ("User-Agent", "testclient"), ("X-CSRF-Token", token), ("Content-Type", kind)]
    for method, path in ROUTES:
        for address in {path, path.replace("/1/", "/m1/", 1).replace("/1", "/forward")}:
            if address in ("/signout", "/audit/verify"):
                continue
            answer = knock(staff.client, method, address, headers, [body])
            assert answer.status < 500 or answer.status == 503, (address, answer.status, answer.body[:200])


# ---- cookies ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        'sid="' + "\\" * 30000 + '"',
        "; ".join(f'c{number}="' + "\\1" * 50 + '"' for number in range(250)),
        ";" * 30000,
        "=" * 30000,
        "sid=" + "a" * 30000,
        'pogon_lang="\\055\\056"',
        "sid=a b; sid=\x7f",
    ],
)
def test_a_cookie_that_is_not_ours_is_not_decoded(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    seen: list[str] = []
    monkeypatch.setattr(cookies, "_unquote", lambda value: seen.append(value) or value)
    assert knock(client, "GET", "/", [("Cookie", text)]).status == 200
    assert seen == []


def test_our_cookies_arrive_whatever_others_are_sent_with_them(client: TestClient) -> None:
    headers = [("Cookie", 'other="' + "\\" * 9000 + '"; pogon_lang=cs'), ("Cookie", "x=y; pogon_theme=day")]
    page = knock(client, "GET", "/", headers).body.decode()
    assert '<html lang="cs"' in page


# ---- hosts and origins ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1:80@evil", "127.0.0.1@evil", "localhost:", "localhost:80:80", "localhost:123456", "[::1", "[::1]x", "local host", "a" * 9000,
     "localhost/", "localhost#", "localhost?", "127.0.0.1:8000, evil", "[" * 9000],
)  # fmt: skip
def test_a_host_is_a_name_and_a_port_and_nothing_else(client: TestClient, host: str) -> None:
    assert knock(client, "GET", "/", [("Host", host), ("Origin", HOST)]).status == 400


@pytest.mark.parametrize(
    ("headers", "served"),
    [
        ({"Origin": HOST}, True),
        ({"Origin": "https://127.0.0.1:8000"}, False),
        ({"Origin": "https://127.0.0.1:8000", "Sec-Fetch-Site": "same-origin"}, False),
        ({"Origin": "http://evil.test", "Sec-Fetch-Site": "same-origin"}, False),
        ({"Origin": "null", "Sec-Fetch-Site": "same-origin"}, True),  # a form of a page that tells no referer
        ({"Origin": "http://127.0.0.1:8000/x"}, True),
        ({"Origin": "http://u@127.0.0.1:8000"}, False),
        ({"Origin": "", "Referer": "http://[bad"}, False),
        ({"Origin": "http://[bad"}, False),
        ({"Origin": "ws://127.0.0.1:8000"}, False),
        ({"Origin": "", "Referer": f"{HOST}/alarms"}, True),
        ({"Origin": "", "Referer": "https://127.0.0.1:8000/alarms"}, False),
    ],
)
def test_a_form_comes_from_the_same_scheme_host_and_port(staff: Staff, headers: dict[str, str], served: bool) -> None:
    staff.have()
    token = staff.access.form_token("a" * 22)
    sent = [("Content-Type", FORM), ("Cookie", "pre=" + "a" * 22), *((name, value) for name, value in headers.items())]
    answer = knock(staff.client, "POST", "/language", sent, [f"csrf={token}&to=de".encode()])
    assert answer.status == (303 if served else 403)


@pytest.mark.parametrize(
    "origin", ["https://127.0.0.1:8000", "http://127.0.0.1:8000/", "http://[bad", "ws://127.0.0.1:8000"]
)
def test_a_socket_comes_from_the_same_scheme_host_and_port(client: TestClient, origin: str) -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": origin}),
    ):
        pass


# ---- tokens of programs -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "token", ["pogon_nonsense", "eyJhbGciOiJub25lIn0.e30.", "", "pgn_" + "a" * 43, "x" * 9000, "é"]
)
def test_a_token_that_is_none_is_nobody_and_not_a_guest(client: TestClient, token: str) -> None:
    assert knock(client, "GET", "/api/v1/plant").status == 200
    answer = knock(client, "GET", "/api/v1/plant", [("Authorization", f"Bearer {token}")])
    assert (answer.status, answer.headers["www-authenticate"]) == (401, "Bearer")
    assert b"access.token_unknown" in answer.body
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(
            "ws://127.0.0.1:8000/live", headers={"Origin": HOST, "Authorization": "Bearer nonsense"}
        ),
    ):
        pass


# ---- proxies ----------------------------------------------------------------------------------------------
