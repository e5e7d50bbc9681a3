"""The socket of a page, by a real client of a real server: who may open it, what it says, and that nobody harms the others."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import orjson
import pytest
import uvicorn
from fastapi import FastAPI
from starlette.websockets import WebSocket
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from app.clock import SystemClock
from app.live.frames import Live
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from app.web.guard import Gatekeeper
from app.web.socket import Allowance, Sockets, router, sockets_of
from tests.conftest import find_port


@dataclass
class Hall:
    """A runtime with three tags and no plant behind them."""

    tags: TagDatabase = field(default_factory=lambda: TagDatabase(SystemClock()))
    simulated: bool = True
    plant: object = "a plant"
    points: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.clock = SystemClock()
        self.settings = SimpleNamespace(hosts=frozenset({"127.0.0.1", "localhost", "[::1]"}))
        self.tags.configure([Tag(f"m1.{key}", key, "hall") for key in ("speed", "current", "status")])
        self.live = Live(self.tags, self.clock, 0.02)

    def publish(self, **values: float) -> None:
        now = self.clock.micros()
        self.tags.publish(
            Batch("hall", 0, now, now, [self.tags.handle(f"m1.{key}") for key in values], list(values.values()))
        )


def page_of_m1(kind: str, plant: object, known: object) -> list[str]:
    """The only page there is."""
    if kind != "equipment/m1":
        raise KeyError(kind)
    return ["m1.speed", "m1.current"]


@dataclass
class Served:
    port: int
    hall: Hall
    app: FastAPI

    @property
    def sockets(self) -> Sockets:
        return sockets_of(self.app)

    def open(self, *, origin: str | None = "own", host: str = "", **more: Any) -> Any:
        named = f"http://127.0.0.1:{self.port}" if origin == "own" else origin
        headers = {"Host": host} if host else {}
        return connect(f"ws://127.0.0.1:{self.port}/live", origin=named, additional_headers=headers, proxy=None, **more)  # type: ignore[arg-type]


@pytest.fixture
async def served(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Served]:
    monkeypatch.setattr("app.web.socket.page_tags", page_of_m1)
    app = FastAPI()
    app.include_router(router)
    app.add_middleware(Gatekeeper)
    hall = Hall()
    app.state.runtime = hall
    port = find_port()
    server = uvicorn.Server(
        uvicorn.Config(
            app, port=port, log_level="error", ws_max_size=65536, timeout_graceful_shutdown=2, lifespan="off"
        )
    )
    running = asyncio.create_task(server.serve())
    beat = asyncio.create_task(hall.live.beat())
    while not server.started:  # noqa: ASYNC110 — uvicorn has no event for it
        await asyncio.sleep(0.01)
    yield Served(port, hall, app)
    server.should_exit = True
    await asyncio.wait_for(running, 10)
    beat.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await beat


async def hear(socket: ClientConnection) -> dict[str, Any]:
    return orjson.loads(await asyncio.wait_for(socket.recv(), 15))  # type: ignore[no-any-return]


async def say(socket: ClientConnection, message: object) -> None:
    await socket.send(message if isinstance(message, str) else orjson.dumps(message).decode())


async def ask(socket: ClientConnection, kind: str = "equipment/m1") -> dict[str, Any]:
    await say(socket, {"subscribe": kind, "rev": 1})
    return (await hear(socket))["hello"]  # type: ignore[no-any-return]


async def until(truth: Callable[[], bool], seconds: float = 3) -> None:
    async with asyncio.timeout(seconds):
        while not truth():  # noqa: ASYNC110
            await asyncio.sleep(0.01)


async def test_a_subscription_is_answered_with_handles_then_a_full_frame_then_changes(served: Served) -> None:
    served.hall.publish(speed=1180)
    async with served.open() as socket:
        hello = await ask(socket)
        assert hello["rev"] == 1
        assert hello["handles"] == {"m1.speed": 0, "m1.current": 1}
        first = await hear(socket)
        assert first["full"] is True
        assert [value[:2] for value in first["v"]] == [[0, 1180], [1, None]]
        served.hall.publish(current=2.1, status=1)
        second = await hear(socket)
        assert [value[:2] for value in second["v"]] == [[1, 2.1]]
        assert second["n"] == first["n"] + 1


async def test_a_snapshot_is_full(served: Served) -> None:
    async with served.open() as socket:
        await ask(socket)
        await hear(socket)
        await say(socket, {"snapshot": True})
        assert (await hear(socket))["full"] is True


async def test_a_second_subscription_replaces_the_first(served: Served) -> None:
    async with served.open() as socket:
        await ask(socket)
        await hear(socket)
        await say(socket, {"subscribe": "equipment/m1", "rev": 1})
        answers = [await hear(socket)]
        while "hello" not in answers[-1]:
            answers.append(await hear(socket))
        assert (await hear(socket))["full"] is True
        assert served.hall.live.watchers == 1


async def test_a_frame_comes_every_second_although_nothing_changes(served: Served) -> None:
    async with served.open() as socket:
        await ask(socket)
        await hear(socket)
        assert [(await hear(socket))["v"], (await hear(socket))["v"]] == [[], []]


@pytest.mark.parametrize(
    ("message", "error", "code"),
    [
        ("{not json", "bad_message", 1008),
        ("[]", "bad_message", 1008),
        ({"write": 1}, "bad_message", 1008),
        ({"subscribe": 7}, "bad_message", 1008),
        ({"subscribe": "equipment/m9", "rev": 1}, "unknown_kind", 1008),
        ({"subscribe": "x" * 5000, "rev": 1}, "too_large", 1009),
    ],
)
async def test_what_is_no_message_of_ours_is_answered_with_its_name_and_closed(
    served: Served, message: object, error: str, code: int
) -> None:
    async with served.open() as socket:
        await say(socket, message)
        assert await hear(socket) == {"error": error}
        with pytest.raises(ConnectionClosed) as closed:
            await hear(socket)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == code


async def test_bytes_are_no_message(served: Served) -> None:
    async with served.open() as socket:
        await socket.send(b"\x00\x01")
        assert await hear(socket) == {"error": "bad_message"}


async def test_a_frame_above_64_kb_is_refused_by_the_server(served: Served) -> None:
    async with served.open() as socket:
        with pytest.raises(ConnectionClosed):
            await say(socket, "x" * 70_000)
            await hear(socket)


@pytest.mark.parametrize(
    "wrong",
    [
        {"origin": None},
        {"origin": "http://evil.example"},
        {"origin": "http://127.0.0.1:1"},
        {"origin": "null"},
        {"origin": "http://rebound.example", "host": "rebound.example"},
    ],
    ids=["no origin", "other site", "other port", "null", "rebound name"],
)
async def test_only_a_page_of_this_server_may_open_a_socket(served: Served, wrong: dict[str, Any]) -> None:
    with pytest.raises(InvalidStatus) as refused:
        async with served.open(**wrong):
            pass
    assert refused.value.response.status_code in (400, 403)
    assert len(served.sockets) == 0


async def test_a_socket_of_another_site_is_refused_even_with_a_forged_origin(served: Served) -> None:
    with pytest.raises(InvalidStatus):
        async with connect(
            f"ws://127.0.0.1:{served.port}/live",
            origin=f"http://127.0.0.1:{served.port}",  # type: ignore[arg-type]
            additional_headers={"Sec-Fetch-Site": "cross-site"},
            proxy=None,
        ):
            pass


async def test_why_no_socket_comes_about_is_logged_once_a_minute(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    """A proxy that keeps the name for itself: the pages come, and stay without values."""
    for _ in range(3):
        with pytest.raises(InvalidStatus):
            async with served.open(origin="https://hall.example"):
                pass
    (told,) = [message for message in caplog.messages if message.startswith("socket refused")]
    assert f"scheme=ws host='127.0.0.1:{served.port}' origin='https://hall.example'" in told
    assert told.endswith("a proxy has to pass Host and X-Forwarded-Proto on (docs/operations.md)")


async def test_a_socket_whose_upgrade_was_lost_on_the_road_is_told_so(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(3):
        reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
        writer.write(f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\nConnection: close\r\n\r\n".encode())
        answer = (await asyncio.wait_for(reader.read(), 15)).decode()
        writer.close()
        assert answer.startswith("HTTP/1.1 426 Upgrade Required\r\n")
        assert answer.endswith("has to pass Upgrade and Connection on (docs/operations.md)\n")
    assert sum(message.startswith("socket refused scheme=http ") for message in caplog.messages) == 1


async def test_who_may_not_watch_is_told_so(served: Served) -> None:
    served.hall.simulated = False
    async with served.open() as socket:
        await say(socket, {"subscribe": "equipment/m1", "rev": 1})
        assert await hear(socket) == {"error": "not_allowed"}


async def test_a_right_that_ends_closes_the_socket_at_the_next_check(served: Served) -> None:
    served.sockets.recheck = 0.2
    async with served.open() as socket:
        await ask(socket)
        served.hall.simulated = False
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                await hear(socket)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1008
    await until(lambda: served.hall.live.watchers == 0)


async def test_one_address_has_its_share_of_sockets_and_gets_a_place_back(served: Served) -> None:
    served.sockets.per_address = 3
    async with contextlib.AsyncExitStack() as stack:
        first = await stack.enter_async_context(served.open())
        for _ in range(2):
            await stack.enter_async_context(served.open())
        with pytest.raises(InvalidStatus):
            await stack.enter_async_context(served.open())
        await first.close()
        await until(lambda: len(served.sockets) == 2)
        await stack.enter_async_context(served.open())


async def test_the_server_has_its_share_of_sockets(served: Served) -> None:
    served.sockets.most = 2
    async with served.open(), served.open():
        with pytest.raises(InvalidStatus):
            async with served.open():
                pass


async def test_a_closed_tab_is_forgotten(served: Served) -> None:
    async with served.open() as socket:
        await ask(socket)
        assert served.hall.live.watchers == 1
    await until(lambda: served.hall.live.watchers == 0 and len(served.sockets) == 0)


async def test_a_browser_that_reads_nothing_harms_nobody(served: Served) -> None:
    async with served.open(max_queue=1) as slow, served.open() as fast:
        await say(slow, {"subscribe": "equipment/m1", "rev": 1})
        slow.transport.pause_reading()
        await ask(fast)
        await hear(fast)
        for number in range(100):
            served.hall.publish(speed=float(number))
            frame = await hear(fast)
            while not frame["v"]:
                frame = await hear(fast)
            assert frame["v"][0][1] == float(number)
        slow.transport.resume_reading()


async def test_all_sockets_close_when_the_server_ends(served: Served) -> None:
    async with served.open() as socket:
        await ask(socket)
        await served.sockets.close()
        with pytest.raises(ConnectionClosed):
            while True:
                await hear(socket)


async def test_nobody_keeps_a_socket_open_without_a_word(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.web.socket.FIRST_WORD", 0.1)
    async with served.open() as socket:
        assert await hear(socket) == {"error": "bad_message"}


async def test_a_browser_that_takes_too_long_is_not_told_that_it_said_nonsense(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    send = WebSocket.send

    async def slow(self: WebSocket, message: Any) -> None:
        if '"hello"' in message.get("text", ""):
            await asyncio.Event().wait()
        await send(self, message)

    monkeypatch.setattr(WebSocket, "send", slow)
    monkeypatch.setattr("app.web.socket.SLOWEST_SEND", 0.1)
    async with served.open() as socket:
        await say(socket, {"subscribe": "equipment/m1", "rev": 1})
        with pytest.raises(ConnectionClosed) as closed:
            await hear(socket)
    assert closed.value.rcvd is not None and closed.value.rcvd.code == 1013


async def test_a_guard_of_ones_own_decides(served: Served) -> None:
    asked: list[str] = []

    def guard(answer: bool) -> Callable[[Any, str], Awaitable[bool]]:
        async def decide(_: Any, kind: str) -> bool:
            asked.append(kind)
            return answer

        return decide

    served.sockets.may_watch = guard(True)
    async with served.open() as socket:
        await ask(socket)
    served.sockets.may_watch = guard(False)
    async with served.open() as socket:
        await say(socket, {"subscribe": "equipment/m1", "rev": 1})
        assert await hear(socket) == {"error": "not_allowed"}
    assert asked == ["equipment/m1", "equipment/m1"]


class Tab:
    """A socket of somebody, as far as it is counted."""


async def test_who_is_signed_in_takes_the_place_of_the_guest_who_came_first(served: Served) -> None:
    sockets = served.sockets
    sockets.most = 3
    async with served.open() as first, served.open() as second, served.open():
        assert not sockets.enter(Tab(), "127.0.0.1")  # type: ignore[arg-type]
        one, two = Tab(), Tab()
        for mine in (one, two):
            assert sockets.enter(mine, "127.0.0.1", "session")  # type: ignore[arg-type]
        for gone in (first, second):
            with pytest.raises(ConnectionClosed) as closed:
                await hear(gone)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1013
        assert len(sockets) == 3
        for mine in (one, two):
            sockets.leave(mine)  # type: ignore[arg-type]


def test_a_session_has_its_tabs_and_a_class_room_its_guests() -> None:
    sockets = Sockets()
    ours = [Tab() for _ in range(31)]
    assert [sockets.enter(one, "a", "s1") for one in ours] == [True] * 30 + [False]  # type: ignore[arg-type]
    guests = [sockets.enter(object(), "a") for _ in range(250)]  # type: ignore[arg-type]
    assert sum(guests) == 200
    assert sum(sockets.enter(object(), f"b{n}") for n in range(250)) == 100  # type: ignore[arg-type]
    assert sockets.enter(object(), "a", "s2")  # type: ignore[arg-type]


def test_a_guest_with_a_network_of_addresses_is_one() -> None:
    sockets = Sockets(per_address=3)
    ours = [Tab() for _ in range(5)]
    entered = [sockets.enter(one, f"2001:db8:0:1::{n}") for n, one in enumerate(ours)]  # type: ignore[arg-type]
    assert entered == [True] * 3 + [False] * 2
    assert sockets.enter(Tab(), "2001:db8:0:2::1")  # type: ignore[arg-type]
    sockets.leave(ours[1])  # type: ignore[arg-type]
    assert sockets.enter(ours[4], "2001:db8:0:1::4")  # type: ignore[arg-type]


async def test_who_sends_too_much_is_closed_and_nobody_else(served: Served) -> None:
    async with served.open() as loud, served.open() as quiet:
        await ask(quiet)
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(1500):
                await say(loud, {"subscribe": "equipment/m1", "rev": 1})
            while True:
                await hear(loud)
        assert closed.value.rcvd is None or closed.value.rcvd.code == 1013
        assert (await hear(quiet))["full"] is True


def test_ten_a_second_and_a_handful_at_once_are_taken() -> None:
    allowance = Allowance(0.0)
    assert [allowance.take(0.0) for _ in range(31)] == [True] * 30 + [False]
    assert all(allowance.take(1.0 + step * 0.15) for step in range(1000))  # a button that is held
    assert sum(allowance.take(200.0 + step * 0.01) for step in range(1000)) == pytest.approx(130, abs=2)
