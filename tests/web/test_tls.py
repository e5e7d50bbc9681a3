"""TLS by real sockets, on the loop that a server runs on and on Python's own: whoever greets at once, in pieces, wrongly or not at all."""

import asyncio
import socket
import ssl
from collections.abc import Callable, Coroutine
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import uvicorn
import uvloop
from fastapi import FastAPI
from fastapi.responses import PlainTextResponse

from app.web import connections
from app.web.connections import Doors, Greeter
from tests.test_cli import self_signed

pytestmark = pytest.mark.real_time

LOOPS: list[Callable[[], asyncio.AbstractEventLoop]] = [uvloop.new_event_loop, asyncio.SelectorEventLoop]
GUARD = 30.0
"""An answer has come by then on a busy machine, too [s]; nothing is measured with it."""


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return self_signed(tmp_path_factory.mktemp("tls"))


class Client:
    """A browser whose greeting goes when the test says so."""

    def __init__(self, port: int) -> None:
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        self.heard, self.said = ssl.MemoryBIO(), ssl.MemoryBIO()
        self.tls = context.wrap_bio(self.heard, self.said, server_hostname="localhost")
        self.line = socket.create_connection(("127.0.0.1", port), timeout=GUARD)

    def greeting(self) -> bytes:
        with pytest.raises(ssl.SSLWantReadError):
            self.tls.do_handshake()
        return self.said.read()

    def ask(self) -> bytes:
        """Shake hands to the end, ask for a page, and what came."""
        self._until(self.tls.do_handshake)
        self.tls.write(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        self.line.sendall(self.said.read())
        found = b""
        while b"served" not in found:
            found += self._until(partial(self.tls.read, 4096))
        return found

    def _until(self, step: Callable[[], Any]) -> Any:
        while True:
            try:
                done = step()
            except ssl.SSLWantReadError:
                self.line.sendall(self.said.read())
                came = self.line.recv(65536)
                assert came, "the server closed"
                self.heard.write(came)
            else:
                self.line.sendall(self.said.read())
                return done


def serve(
    loop: Callable[[], asyncio.AbstractEventLoop],
    certificate: tuple[Path, Path],
    story: Callable[[int, Doors], Coroutine[Any, Any, None]],
    **limits: int,
) -> None:
    """Have a server answer on `loop` while `story` (port, doors) is told on it, too: as long as that does not wait, nobody is served."""
    app, doors = FastAPI(), Doors(**limits)
    app.get("/")(lambda: PlainTextResponse("served"))
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(*certificate)

    async def run() -> None:
        config = uvicorn.Config(app, log_level="critical", lifespan="off", timeout_graceful_shutdown=1)
        config.load()
        config.http_protocol_class = partial(Greeter, doors=doors, context=context)  # type: ignore[assignment]
        server = uvicorn.Server(config)
        with socket.create_server(("127.0.0.1", 0)) as listening:
            running = asyncio.create_task(server.serve([listening]))
            while not server.started:  # noqa: ASYNC110 — uvicorn has no event for it
                await asyncio.sleep(0.01)
            await story(listening.getsockname()[1], doors)
            server.should_exit = True
            await asyncio.wait_for(running, GUARD)
        assert len(doors) == 0
        assert not server.server_state.connections

    with asyncio.Runner(loop_factory=loop) as runner:
        runner.run(run())


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("turns", range(6))
def test_a_greeting_that_is_there_when_the_connection_is_taken_is_answered(
    loop: Callable[[], asyncio.AbstractEventLoop], certificate: tuple[Path, Path], turns: int
) -> None:
    """As on a busy machine: by the time the server looks there are a connection and its first bytes. So many turns later comes the rest."""

    async def story(port: int, _doors: Doors) -> None:
        client = Client(port)
        greeting = client.greeting()
        client.line.sendall(greeting[:200] if turns else greeting)
        for _ in range(turns):
            await asyncio.sleep(0)
        client.line.sendall(greeting[200:] if turns else b"")
        assert b"200 OK" in await asyncio.to_thread(client.ask)
        client.line.close()

    serve(loop, certificate, story)


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("said", [b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"\0" * 500, b"\x16\x03\x01", b""])
def test_who_speaks_something_else_or_nothing_is_let_go_and_the_next_one_served(
    loop: Callable[[], asyncio.AbstractEventLoop],
    certificate: tuple[Path, Path],
    said: bytes,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(connections, "HEAD_TIME", 0.5)

    async def story(port: int, doors: Doors) -> None:
        strange, client = Client(port), Client(port)
        strange.line.sendall(said)
        client.line.sendall(client.greeting())
        assert b"200 OK" in await asyncio.to_thread(client.ask)
        client.line.close()
        while strange.line.fileno() >= 0:
            try:
                if not await asyncio.to_thread(strange.line.recv, 4096):
                    break  # an alert may come before the end
            except ConnectionResetError:
                break
        strange.line.close()
        while len(doors):  # noqa: ASYNC110 — nobody tells
            await asyncio.sleep(0.01)

    serve(loop, certificate, story)


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("begun", [True, False])
def test_who_is_closed_in_the_middle_of_shaking_hands_is_forgotten(
    loop: Callable[[], asyncio.AbstractEventLoop], certificate: tuple[Path, Path], begun: bool
) -> None:
    async def story(port: int, doors: Doors) -> None:
        slow = Client(port)
        slow.line.sendall(slow.greeting()[: 200 if begun else 0])
        while len(doors) < 1:  # noqa: ASYNC110 — nobody tells
            await asyncio.sleep(0.01)
        client = Client(port)
        client.line.sendall(client.greeting())
        assert b"200 OK" in await asyncio.to_thread(client.ask)
        assert doors.dropped == 1
        client.line.close()
        slow.line.close()

    serve(loop, certificate, story, per_address=1)
