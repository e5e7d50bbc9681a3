"""Connections by real sockets: heads that do not end, requests that do not come, and that people who are signed in get in all the same."""

import asyncio
import contextlib
import http.client
import resource
from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import Any

import pytest
import uvicorn
from fastapi import FastAPI, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import PlainTextResponse, Response, StreamingResponse
from websockets.asyncio.client import connect
from websockets.frames import CloseCode

from app.web import connections
from app.web.connections import Connection, Doors
from tests.conftest import PogonServer, enroll, find_port
from tests.web.people import PASSWORD

GUARD = 30.0
"""An answer has come by then on a busy machine, too [s]; nothing is measured with it."""


# ---- who goes when there are too many ---------------------------------------------------------------------


class Rooms:
    """Doors with connections that only say that they were closed."""

    def __init__(self, **limits: int) -> None:
        self.doors = Doors(**limits)
        self.closed: list[str] = []
        self.places: dict[str, Any] = {}

    def come(self, name: str, address: str = "a", at: float = 0.0) -> bool:
        place = self.doors.enter(address, at, partial(self.closed.append, name))
        self.places[name] = place
        return place is not None


def test_the_one_that_waits_longest_without_a_request_goes_first() -> None:
    rooms = Rooms(per_address=3)
    for name in ("served", "slow", "new"):
        rooms.come(name)
    rooms.places["served"].used()
    rooms.come("next", at=5.0)
    assert rooms.closed == ["slow"]
    rooms.come("last", at=5.1)
    assert rooms.closed == ["slow", "new"]


def test_a_new_connection_has_time_for_its_request() -> None:
    rooms = Rooms(per_address=2)
    rooms.come("served")
    rooms.places["served"].used()
    rooms.come("operator", at=10.0)
    rooms.come("flood", at=10.1)
    assert rooms.closed == ["served"]


def test_who_is_used_goes_after_who_is_quiet() -> None:
    rooms = Rooms(per_address=3)
    for name in ("one", "two", "three"):
        rooms.come(name)
        rooms.places[name].used()
    rooms.places["one"].used()
    rooms.come("four")
    assert rooms.closed == ["two"]


def test_the_address_with_the_most_gives_way() -> None:
    rooms = Rooms(strangers=6, per_address=100)
    for number in range(4):
        rooms.come(f"attacker {number}", "attacker")
    rooms.come("guest", "guest")
    rooms.come("other", "other")
    for number in range(3):
        rooms.come(f"late {number}", f"late {number}", at=1.0 + number)
    assert rooms.closed == ["attacker 0", "attacker 1", "attacker 2"]


def test_a_client_with_a_network_of_addresses_is_one() -> None:
    rooms = Rooms(strangers=6, per_address=3)
    for number in range(5):
        rooms.come(f"attacker {number}", f"2001:db8:0:1::{number:x}")
    assert rooms.closed == ["attacker 0", "attacker 1"]
    rooms.come("guest", "2001:db8:0:2::1")
    rooms.come("mapped", "::ffff:192.0.2.7")
    rooms.come("same", "192.0.2.7")
    rooms.come("late", "192.0.2.8")
    assert rooms.closed == ["attacker 0", "attacker 1", "attacker 2"]
    for place in rooms.places.values():
        place.leave()
    assert (len(rooms.doors), rooms.doors._rows, rooms.doors._unknown) == (0, {}, 0)


def test_whoever_is_signed_in_is_no_stranger_and_stays() -> None:
    rooms = Rooms(strangers=2, per_address=2, most=4)
    rooms.come("operator")
    rooms.places["operator"].known("s1")
    rooms.come("hold")
    rooms.places["hold"].known("s1")
    for number in range(50):
        assert rooms.come(f"flood {number}", at=float(number))
    assert not {"operator", "hold"} & set(rooms.closed)
    assert len(rooms.doors) == 4


def test_one_session_has_its_share_and_counts_as_a_stranger_beyond() -> None:
    rooms = Rooms(per_address=2, per_session=2)
    for number in range(6):
        assert rooms.come(f"tab {number}")
        rooms.places[f"tab {number}"].known("s1")
    assert rooms.closed == ["tab 2", "tab 3"]


def test_who_signs_out_is_a_stranger_again() -> None:
    rooms = Rooms(per_address=1)
    rooms.come("one")
    rooms.places["one"].known("s1")
    rooms.places["one"].known("")
    rooms.come("two")
    assert rooms.closed == ["one"]


def test_when_all_places_are_taken_by_people_a_newcomer_is_closed() -> None:
    rooms = Rooms(most=2)
    for name in ("one", "two"):
        rooms.come(name)
        rooms.places[name].known(name)
    assert not rooms.come("three")
    rooms.places["one"].leave()
    assert rooms.come("four")


def test_the_books_are_right_after_any_order_of_events() -> None:
    rooms = Rooms(most=30, strangers=12, per_address=5, per_session=3)
    state = 7
    for step in range(4000):
        state = (state * 1103515245 + 12345) % 2**31
        name, deed = f"c{state // 64 % 60}", state // 8192 % 5
        place = rooms.places.get(name)
        if place is None or deed == 0:
            if place is not None:
                place.leave()
            rooms.come(name, f"a{state % 7}", at=float(step))
        elif deed == 1:
            place.leave()
        elif deed == 2:
            place.used()
        else:
            place.known(f"s{state % 4}" if deed == 3 else "")
    doors = rooms.doors
    rows = {address: len(row) for address, row in doors._rows.items()}
    assert sum(rows.values()) == doors._unknown <= 12
    assert doors._longest == max(rows.values(), default=0)
    assert {address: size for size, addresses in doors._sizes.items() for address in addresses} == rows
    assert doors._unknown + sum(doors._sessions.values()) == len(doors) <= 30
    assert max(doors._sessions.values(), default=0) <= 3


# ---- heads and bodies -------------------------------------------------------------------------------------


class Served:
    """A server of one application in this process."""

    def __init__(self, port: int, doors: Doors, seen: list[dict[str, str]]) -> None:
        self.port, self.doors, self.seen = port, doors, seen

    async def send(self, *portions: bytes, then: float | None = None) -> bytes:
        """Send it all and hear until the server closes; `then` None: go on waiting for that."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        try:
            with contextlib.suppress(ConnectionError):
                for portion in portions:
                    writer.write(portion)
                    await writer.drain()
            heard = b""
            with contextlib.suppress(ConnectionError):
                heard = await asyncio.wait_for(reader.read(), GUARD)
            return heard
        finally:
            writer.close()


@pytest.fixture
async def served() -> AsyncIterator[Served]:
    app, seen = FastAPI(), []

    @app.websocket("/live")
    async def hear(websocket: WebSocket) -> None:
        await websocket.accept()
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                await websocket.send_text(await websocket.receive_text())

    @app.api_route("/{name:path}", methods=["GET", "POST"])
    async def answer(request: Request, name: str) -> Response:
        if name == "read":
            await request.body()
        if name == "large":
            return StreamingResponse(b"x" * 65536 for _ in range(2000))
        seen.append(dict(request.headers))
        return PlainTextResponse("served")

    doors, port = Doors(), find_port()
    config = uvicorn.Config(
        app,
        port=port,
        log_level="critical",
        lifespan="off",
        http=partial(Connection, doors=doors),  # type: ignore[arg-type]
        ws="websockets-sansio",
        timeout_graceful_shutdown=1,
        timeout_keep_alive=1,
    )
    server = uvicorn.Server(config)
    running = asyncio.create_task(server.serve())
    while not server.started:  # noqa: ASYNC110 — uvicorn has no event for it
        await asyncio.sleep(0.01)
    yield Served(port, doors, seen)
    server.should_exit = True
    await asyncio.wait_for(running, GUARD)


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody is waited for."""
    for name in ("HEAD_TIME", "LONGEST_BODY"):
        monkeypatch.setattr(connections, name, 0.3)


GET = b"GET / HTTP/1.1\r\nHost: x\r\n"
CHUNKED = b"POST /read HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"


@pytest.mark.parametrize(
    ("portions", "status"),
    [
        ([GET, b"X: " + b"a" * 40_000], 431),
        ([GET, *[b"X: a\r\n"] * 200], 431),
        ([GET, *[b"X: " + b"a" * 1000 + b"\r\n"] * 40], 431),
        ([b"GET /" + b"a" * 40_000], 431),
        ([b"GET /" + b"a" * 40_000 + b" HTTP/1.1\r\nHost: x\r\n\r\n"], 431),
        ([GET + b"X: a\r\n" * 150 + b"\r\n"], 431),
        ([GET + b"X: " + b"a" * 33_000 + b"\r\n\r\n"], 431),
        ([CHUNKED, b"0\r\n", *[b"X: a\r\n"] * 200], 431),
        ([CHUNKED, b"0\r\n", b"X: " + b"a" * 200_000], 413),
        ([CHUNKED, b"1;" + b"a" * 200_000], 413),
        ([CHUNKED, *[b"1\r\na\r\n"] * 40_000], 413),
        ([GET, b"\x00\x01\r\n\r\n"], 400),
    ],
)
async def test_what_is_too_long_is_told_so_and_closed(served: Served, portions: list[bytes], status: int) -> None:
    heard = await served.send(*portions)
    assert heard.startswith(b"HTTP/1.1 %d " % status) or not heard, heard[:100]  # a reset may overtake the words
    assert await served.send(GET + b"Connection: close\r\n\r\n")


@pytest.mark.parametrize(
    "portions",
    [
        [GET],
        [b"G"],
        [b"\r\n"],
        [GET, b"X"],
        [b"POST /read HTTP/1.1\r\nHost: x\r\nContent-Length: 100\r\n\r\n", b"a"],
        [CHUNKED, b"5\r\n"],
        [CHUNKED, b"0\r\nX: y\r\n"],
    ],
)
async def test_what_does_not_come_is_not_waited_for(hasty: None, served: Served, portions: list[bytes]) -> None:
    heard = await served.send(*portions)
    assert heard.startswith(b"HTTP/1.1 408 ")
    assert heard.count(b"HTTP/1.1") == 1


async def test_bytes_that_come_one_by_one_do_not_stretch_the_time(hasty: None, served: Served) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(GET)
    started = asyncio.get_running_loop().time()
    with contextlib.suppress(ConnectionError):
        while not reader.at_eof() and asyncio.get_running_loop().time() - started < GUARD:
            writer.write(b"X: a\r\n")
            await asyncio.wait({asyncio.ensure_future(reader.read(1))}, timeout=0.05)
            if reader._buffer or reader.at_eof():  # type: ignore[attr-defined]
                break
    writer.close()
    assert asyncio.get_running_loop().time() - started < GUARD


async def test_a_body_that_nobody_reads_does_not_keep_the_connection(hasty: None, served: Served) -> None:
    heard = await served.send(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 100000\r\n\r\n", b"a" * 100)
    assert heard.startswith(b"HTTP/1.1 200 ")
    assert heard.count(b"HTTP/1.1") == 1


async def test_nobody_stays_without_a_word(hasty: None, served: Served) -> None:
    assert await served.send() == b""
    assert await served.send(GET + b"\r\n") != b""


async def test_a_trailer_is_no_header(served: Served) -> None:
    heard = await served.send(
        CHUNKED.replace(b"Host", b"Connection: close\r\nHost") + b"1\r\na\r\n0\r\nX-Forwarded-For: 1.2.3.4\r\n\r\n"
    )
    assert heard.startswith(b"HTTP/1.1 200 ")
    assert "x-forwarded-for" not in served.seen[0]


async def test_requests_in_advance_are_limited(served: Served) -> None:
    few = await served.send((GET + b"\r\n") * 3 + GET + b"Connection: close\r\n\r\n")
    assert few.count(b"HTTP/1.1 200 ") == 4
    many = await served.send((GET + b"\r\n") * 5000)
    assert many.count(b"HTTP/1.1 200 ") <= 20


async def test_a_reader_that_takes_nothing_is_let_go(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "SLOWEST_READER", 0.3)
    _reader, writer = await asyncio.open_connection("127.0.0.1", served.port, limit=1024)
    writer.write(b"GET /large HTTP/1.1\r\nHost: x\r\n\r\n")
    async with asyncio.timeout(GUARD):
        while not len(served.doors):  # noqa: ASYNC110
            await asyncio.sleep(0.01)
        while len(served.doors):  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    writer.close()


async def test_a_head_of_everyday_size_is_served(served: Served) -> None:
    head = b"".join(b"X-%d: " % number + b"a" * 250 + b"\r\n" for number in range(80))
    heard = await served.send(GET + head + b"Connection: close\r\n\r\n")
    assert heard.startswith(b"HTTP/1.1 200 ")


UPGRADE = (
    b"GET /live HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@pytest.mark.parametrize(
    ("head", "status"),
    [
        (UPGRADE.replace(b"Host: x", b"Host: x\r\nX: " + b"a" * 20_000), 431),
        (UPGRADE.replace(b"/live", b"/live?" + b"a" * 20_000), 414),
        (UPGRADE.replace(b"Host: x", b"Host: x\r\nContent-Length: 5") + b"abcde", 400),
        (UPGRADE.replace(b"GET", b"POST").replace(b"Host: x", b"Host: x\r\nContent-Length: 5") + b"abcde", 400),
    ],
)
async def test_a_wish_for_a_socket_that_cannot_be_read_is_answered_and_closed(
    served: Served, head: bytes, status: int
) -> None:
    heard = await served.send(head)
    assert heard.startswith(b"HTTP/1.1 %d " % status), heard[:100]
    assert not len(served.doors)


async def test_no_socket_is_opened_before_the_answers_that_are_due(served: Served) -> None:
    heard = await served.send(b"GET /large HTTP/1.1\r\nHost: x\r\n\r\n" + UPGRADE)
    assert b"101 Switching" not in heard
    assert (await served.send(GET + b"Connection: close\r\n\r\n")).startswith(b"HTTP/1.1 200 ")


MASK = b"\x80\x00\x00\x00\x00"
PING, PONG, PIECE, EMPTY = b"\x89" + MASK, b"\x8a" + MASK, b"\x00" + MASK, b"\x81" + MASK
"""Frames of a browser without a payload: two of control, a further piece of a message, a whole one."""


@pytest.mark.parametrize(
    "flood", [PING, PONG, EMPTY, b"\x01" + MASK + PIECE * 2000], ids=["pings", "pongs", "messages", "pieces"]
)
async def test_a_socket_that_sends_frames_without_end_is_closed(served: Served, flood: bytes) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(UPGRADE)
    await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), GUARD)
    heard = b""
    with contextlib.suppress(ConnectionError):
        for _ in range(12_000 // len(flood) + 1):
            writer.write(flood)
        await writer.drain()
        heard = await asyncio.wait_for(reader.read(), GUARD)  # ends when the server closes
    writer.close()
    assert len(heard) < 2 * (connections.FRAMES_AT_ONCE + GUARD * connections.FRAMES)
    assert await served.send(GET + b"Connection: close\r\n\r\n")


async def test_a_text_that_is_none_closes_its_socket_and_leaves_no_trace(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("ERROR", "uvicorn.error")
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(UPGRADE)
    await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), GUARD)
    writer.write(b"\x81\x82\x00\x00\x00\x00\xff\xfe")
    heard = await asyncio.wait_for(reader.read(), GUARD)
    writer.close()
    assert heard[2:4] == CloseCode.INVALID_DATA.to_bytes(2, "big")
    assert not caplog.records


async def test_a_socket_in_everyday_use_is_not_closed(served: Served) -> None:
    async with connect(f"ws://127.0.0.1:{served.port}/live") as socket:
        for number in range(40):
            await socket.send(f"{number}" * 1000)
            await (await socket.ping())
            assert await socket.recv() == f"{number}" * 1000


@pytest.mark.parametrize(
    ("target", "host"),
    [
        (b"/read", "x"),
        (b"http://evil/read", "evil"),
        (b"HTTP://evil:80/read?a=b://c", "evil:80"),
        (b"http://x@evil/read", "x@evil"),
        (b"http://evil", "evil"),
        (b"http://evil?a=b", "evil"),
        (b"/read?to=http://evil/", "x"),
    ],
)
async def test_a_first_line_with_a_host_is_for_that_host(served: Served, target: bytes, host: str) -> None:
    heard = await served.send(b"GET " + target + b" HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
    assert heard.startswith(b"HTTP/1.1 200 ")
    assert [headers["host"] for headers in served.seen] == [host]


# ---- a whole server under a flood -------------------------------------------------------------------------


class Visitor:
    """A browser at a real server, with a new connection for each request."""

    def __init__(self, server: PogonServer) -> None:
        self.server = server
        self.sid = ""

    def ask(self, method: str, path: str, body: str = "") -> http.client.HTTPResponse:
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=GUARD)
        headers = {"Cookie": f"pre={'a' * 22}; {self.sid}", "Origin": self.server.url, "User-Agent": "visitor"}
        if body:
            headers["Content-Type"] = "application/x-www-form-urlencoded"
        connection.request(method, path, body or None, headers)
        answer = connection.getresponse()
        self.text = answer.read().decode("utf-8", "replace")
        connection.close()
        return answer

    def csrf(self, path: str) -> str:
        self.ask("GET", path)
        return self.text.split('name="csrf" value="')[1].split('"')[0]

    def sign_in(self, name: str) -> None:
        token = self.csrf("/signin")
        answer = self.ask("POST", "/signin", f"csrf={token}&name={name}&password={PASSWORD.replace(' ', '+')}")
        assert answer.status == 303
        self.sid = (answer.getheader("Set-Cookie") or "").split(";")[0]


@pytest.mark.slow
@pytest.mark.real_time
async def test_a_flood_keeps_nobody_from_page_hold_and_stop(pogon_server: Callable[..., PogonServer]) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 8192), hard))
    server = pogon_server()
    enroll(server.data, {"ana": ["operator"]}, PASSWORD)
    ana = Visitor(server)
    await asyncio.to_thread(ana.sign_in, "ana")
    headers = {"Cookie": ana.sid, "User-Agent": "visitor"}
    open_: list[asyncio.StreamWriter] = []

    async def half(_: int) -> None:
        with contextlib.suppress(OSError):
            _reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
            writer.write(GET + b"X: ")
            open_.append(writer)

    async def guest(stack: contextlib.AsyncExitStack) -> bool:
        with contextlib.suppress(Exception):
            socket = await stack.enter_async_context(
                connect(f"ws://127.0.0.1:{server.port}/live", origin=server.url, proxy=None)  # type: ignore[arg-type]
            )
            await socket.send('{"subscribe": "overview", "rev": 0}')
            return True
        return False

    async with contextlib.AsyncExitStack() as stack:
        own = await stack.enter_async_context(
            connect(f"ws://127.0.0.1:{server.port}/live", origin=server.url, additional_headers=headers, proxy=None)  # type: ignore[arg-type]
        )
        await own.send('{"subscribe": "equipment/m1", "rev": 0}')
        guests = [await guest(stack) for _ in range(230)]
        assert 150 <= sum(guests) < 230  # a class room, and not more
        for begin in range(0, 1500, 100):
            await asyncio.gather(*(half(begin + one) for one in range(100)))
        for _ in range(3):
            assert (await asyncio.to_thread(ana.ask, "GET", "/equipment/m1")).status == 200
            token = ana.text.split('name="csrf" value="')[1].split('"')[0]
            stopped = await asyncio.to_thread(ana.ask, "POST", "/equipment/m1/stop", f"csrf={token}")
            assert stopped.status == 303
        for _ in range(3):  # the socket that was there before is still there, and a new one gets in
            assert await asyncio.wait_for(own.recv(), GUARD)
        second = await stack.enter_async_context(
            connect(f"ws://127.0.0.1:{server.port}/live", origin=server.url, additional_headers=headers, proxy=None)  # type: ignore[arg-type]
        )
        await second.send('{"subscribe": "equipment/m1", "rev": 0}')
        assert "hello" in str(await asyncio.wait_for(second.recv(), GUARD))
        for writer in open_:
            writer.transport.abort()
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert (await asyncio.to_thread(Visitor(server).ask, "GET", "/healthz")).status == 200
