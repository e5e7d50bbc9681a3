"""What every answer carries, whatever it is, and what is refused before anything looks at it."""

from collections.abc import Iterator

import pytest
from fastapi import FastAPI, Form
from fastapi.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from app.web.guard import allow
from app.web.security import ALWAYS, LARGEST_BODY, POLICY
from tests.web.conftest import HOST, Start, send


def breakable(app: FastAPI) -> None:
    """Routes that fail in every way."""

    @app.get("/explode", dependencies=[allow("open")])
    @app.get("/api/explode", dependencies=[allow("open")])
    async def explode() -> None:
        raise RuntimeError("the secret of the database")

    @app.post("/echo", dependencies=[allow("open")])
    async def echo(text: str = Form()) -> str:
        return text[:10]

    @app.websocket("/talk", dependencies=[allow("open")])
    async def talk(websocket: WebSocket) -> None:
        await websocket.accept()
        await websocket.close()


@pytest.fixture
def broken(start: Start) -> TestClient:
    return start(extend=breakable)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/", 200),
        ("GET", "/static/css/frame.css", 200),
        ("GET", "/static/none.css", 404),
        ("GET", "/nowhere", 404),
        ("POST", "/", 405),
        ("POST", "/language", 403),
        ("GET", "/users", 303),
        ("GET", "/live", 426),
        ("GET", "/explode", 500),
        ("GET", "/api/explode", 500),
        ("GET", "/api/nowhere", 404),
    ],
)
def test_every_answer_has_the_headers(broken: TestClient, method: str, path: str, status: int) -> None:
    answer = broken.request(method, path, headers={"Origin": HOST})
    assert answer.status_code == status
    for name, value in ALWAYS.items():
        assert answer.headers[name] == value
    assert answer.headers["content-security-policy"] == POLICY
    assert "server" not in answer.headers
    assert "strict-transport-security" not in answer.headers
    if not path.startswith("/static/css"):
        assert answer.headers["cache-control"] == "no-store"


def test_only_tls_promises_tls(broken: TestClient) -> None:
    assert (
        broken.get("https://127.0.0.1:8000/").headers["strict-transport-security"]
        == "max-age=31536000; includeSubDomains"
    )


@pytest.mark.parametrize(
    "host", ["evil.test", "127.0.0.1.evil.test", "", "localhost@evil.test", "[::1", "127.0.0.1, evil.test"]
)
def test_an_unknown_host_is_refused(client: TestClient, host: str) -> None:
    answer = client.get("/", headers={"Host": host})
    assert answer.status_code == 400
    assert answer.headers["content-security-policy"] == POLICY
    assert answer.headers["content-type"].startswith("text/plain")


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8000", "127.0.0.1:1", "[::1]:8000"])
def test_our_own_names_are_served_on_every_port(client: TestClient, host: str) -> None:
    assert client.get("/", headers={"Host": host}).status_code == 200


def test_an_allowed_host_is_served(start: Start) -> None:
    client = start(allowed_hosts="hmi.plant.test, other.test")
    assert client.get("/", headers={"Host": "HMI.plant.test"}).status_code == 200


@pytest.mark.sweep(8)
def test_a_body_that_says_it_is_too_long_is_not_read(broken: TestClient) -> None:
    assert broken.post("/echo", content=b"x" * (LARGEST_BODY + 1)).status_code == 413
    assert send(broken, "/echo", {"text": "x" * (LARGEST_BODY - 200)}).status_code == 200


def test_a_body_that_does_not_say_how_long_it_is_is_counted(broken: TestClient) -> None:
    def endless() -> Iterator[bytes]:
        yield b"text="
        for _ in range(20):
            yield b"x" * 100_000

    answer = broken.post(
        "/echo",
        content=endless(),
        headers={"Content-Type": "application/x-www-form-urlencoded", "Origin": HOST},
    )
    assert answer.status_code == 413
    assert answer.headers["content-security-policy"] == POLICY


@pytest.mark.sweep(8)
def test_an_error_of_ours_tells_the_log_and_gives_the_person_a_number(
    broken: TestClient, caplog: pytest.LogCaptureFixture
) -> None:
    client = broken
    page = client.get("/explode", headers={"Accept-Language": "de"}).text
    line = client.get("/explode", headers={"Accept-Language": "cs", "HX-Request": "true"}).text
    json = client.get("/api/explode").json()
    assert "Interner Fehler" in page and "<header" in page
    assert "Vnitřní chyba" in line and "<header" not in line
    assert json["error"] == "error.internal"
    references = [record.args[0] for record in caplog.records if record.name == "app.web.security" and record.args]
    for reference, answer in zip(references, (page, line, str(json)), strict=True):
        assert str(reference) in answer
        assert "secret" not in answer


def test_a_socket_opened_by_another_site_is_refused(broken: TestClient) -> None:
    client = broken
    for headers in (
        {"Origin": "https://evil.test"},
        {"Origin": "http://127.0.0.1:9999"},
        {"Origin": "null"},
        {"Host": "evil.test"},
    ):
        with pytest.raises(WebSocketDisconnect) as refusal, client.websocket_connect("/talk", headers=headers):
            pass
        assert refusal.value.code == 1008
    with client.websocket_connect("ws://127.0.0.1:8000/talk", headers={"Origin": "http://127.0.0.1:8000"}):
        pass


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("proxy", "believed"), [("127.0.0.1", True), ("10.0.0.7, 127.0.0.1", True), ("10.0.0.7", False), ("", False)]
)
def test_only_the_named_proxy_is_believed(start: Start, proxy: str, believed: bool) -> None:
    answer = start(behind_proxy=proxy).get("/", headers={"X-Forwarded-Proto": "https"})
    assert ("strict-transport-security" in answer.headers) is believed


@pytest.mark.parametrize("query", ["a&" * 500, "&" * 15_000, "a=1&b=2&" * 400])
def test_a_query_of_very_many_fields_is_not_taken_apart(client: TestClient, query: str) -> None:
    assert client.get(f"/healthz?{query}").status_code == 400
    assert client.get("/healthz?" + "a=1&" * 400).status_code == 200


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "path",
    ["/", "/healthz", "/api/v1/plant", "/users", "/nowhere", "/explode", "/static/css/frame.css", "/static/none.css"],
)
def test_head_is_answered_as_get_without_its_body(broken: TestClient, path: str) -> None:
    whole, head = broken.get(path, follow_redirects=False), broken.head(path, follow_redirects=False)
    assert (head.status_code, head.content) == (whole.status_code, b"")
    passing = {"content-length", "set-cookie", "etag", "last-modified", "allow"}
    assert set(head.headers) - passing == set(whole.headers) - passing
    assert head.headers.get("content-type") == whole.headers.get("content-type")


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", ["/alarms.csv", "/audit.csv", "/history/export.csv", "/events/export.csv"])
def test_an_export_is_not_read_whole_for_its_head(broken: TestClient, path: str) -> None:
    assert broken.head(path).status_code == 405
