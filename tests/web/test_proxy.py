"""A proxy says for whom it asks; without one nobody is believed."""

from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from starlette.requests import Request

from app.main import create_app
from app.settings import Settings
from tests.virtual import house
from tests.web.conftest import Start
from tests.web.knock import knock
from tests.web.people import HOST, Staff


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("bodies") / "data")) as client:
        yield Staff(client)


@pytest.fixture
def client(staff: Staff) -> TestClient:
    staff.have()
    return staff.client


@pytest.fixture(scope="module")
def proxied(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    app = create_app(
        Settings(
            data=tmp_path_factory.mktemp("proxied") / "data", behind_proxy="10.0.0.0/24, 2001:db8::1, ::ffff:10.0.7.1"
        )
    )

    async def who(request: Request) -> Any:
        from starlette.responses import PlainTextResponse

        return PlainTextResponse(f"{request.scope['client'][0]} {request.scope['scheme']}")

    app.add_route("/who", who)
    with TestClient(app, base_url=HOST, follow_redirects=False) as client:
        yield client


@pytest.mark.parametrize(
    ("forwarded", "address"),
    [
        ([], "10.0.0.7"),
        (["203.0.113.9"], "203.0.113.9"),
        (["198.51.100.1, 203.0.113.9"], "203.0.113.9"),
        (["203.0.113.9, 10.0.0.8"], "203.0.113.9"),
        (["198.51.100.1", "203.0.113.9"], "203.0.113.9"),
        (["203.0.113.9:4711"], "203.0.113.9"),
        (["[2001:db8::9]:4711"], "2001:db8::9"),
        (["2001:db8::9"], "2001:db8::9"),
        (["<script>, 203.0.113.9"], "203.0.113.9"),
        (["10.0.0.8"], "10.0.0.8"),
        (["::ffff:203.0.113.9"], "203.0.113.9"),
        (["203.0.113.9, ::ffff:10.0.0.8"], "203.0.113.9"),
    ],
)
def test_the_proxy_says_for_whom_it_asks(proxied: TestClient, forwarded: list[str], address: str) -> None:
    headers = [("X-Forwarded-Proto", "https"), *(("X-Forwarded-For", one) for one in forwarded)]
    for peer in ("10.0.0.7", *(("::ffff:10.0.0.7", "10.0.7.1", "::ffff:10.0.7.1") if forwarded else ())):
        answer = knock(proxied, "GET", "/who", headers, peer=peer)
        assert (answer.status, answer.body.decode()) == (200, f"{address} https")


RUBBISH = [
    "<script>",
    "unknown",
    "",
    "203.0.113.9, x",
    "203.0.113.999",
    "1.2.3.4:port",
    "é",
    "," * 9000,
    "[::1",
    "[::1]x",
]


@pytest.mark.parametrize(
    "headers",
    [
        *([("X-Forwarded-For", one)] for one in RUBBISH),
        [("X-Forwarded-Proto", "ftp")],
        [("X-Forwarded-Proto", "https, http")],
        [("X-Forwarded-Proto", "https"), ("X-Forwarded-Proto", "http")],
    ],
)
def test_rubbish_of_a_proxy_is_refused(proxied: TestClient, headers: list[tuple[str, str]]) -> None:
    answer = knock(proxied, "GET", "/who", headers, peer="10.0.0.7")
    assert answer.status == 400
    assert answer.headers["content-security-policy"]


@pytest.mark.parametrize("peer", ["203.0.113.9", "10.0.1.7", "127.0.0.1", "::1", "testclient", ""])
def test_behind_a_proxy_nobody_asks_past_it(proxied: TestClient, peer: str) -> None:
    for path in ("/", "/signin", "/who", "/api/v1/plant", "/metrics", "/static/css/frame.css"):
        answer = knock(proxied, "GET", path, [("X-Forwarded-For", "198.51.100.1")], peer=peer)
        assert (path, answer.status) == (path, 403)
    assert knock(proxied, "GET", "/healthz", peer=peer).status == (200 if peer in ("127.0.0.1", "::1") else 403)


@pytest.mark.sweep(8)
def test_without_a_proxy_nobody_is_believed(start: Start) -> None:
    client = start()
    answer = knock(client, "GET", "/", [("X-Forwarded-For", "<script>"), ("X-Forwarded-Proto", "https")])
    assert answer.status == 200
    assert "strict-transport-security" not in answer.headers
