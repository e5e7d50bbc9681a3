"""The TCP transport beside its contract."""

import asyncio
import errno
import socket
import struct
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace

import pytest
import uvloop

from app.errors import NoAnswer, NotConnected
from app.links.contract import Block
from app.links.tcp import TcpTransport
from app.plant.definitions import Device, Link
from app.sim.bus import Answer, Bus
from app.sim.server import TcpServer
from app.tags.quality import is_good
from tests.conftest import find_port
from tests.links.devices import RegisterDevice, row, running, until

pytestmark = pytest.mark.real_time


async def test_a_connection_that_is_refused_while_its_task_ends_lets_it_end() -> None:
    transport = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=find_port()), None)

    async def connecting() -> None:
        while True:
            with suppress(NotConnected):
                await transport.connect()
            await asyncio.sleep(0)

    for turns in range(120):
        task = asyncio.create_task(connecting())
        for _ in range(turns):
            await asyncio.sleep(0)
        task.cancel()
        done, _ = await asyncio.wait({task}, timeout=1)
        ended = bool(done)
        while not task.done():
            task.cancel()
            await asyncio.wait({task}, timeout=0.05)
        assert ended, f"the task went on after it was cancelled at turn {turns}"


class _Door:
    """A gateway in a thread of its own: while it is shut, it takes every connection and closes it at once."""

    def __init__(self, port: int) -> None:
        self.shut = True
        self._behind = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._slamming = threading.Lock()
        self._held: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """No more connections."""
        self.slam()
        self._listener.close()

    def slam(self) -> None:
        """Shut it, and cut whatever goes through."""
        with self._slamming:
            self.shut = True
            for one in self._held:
                # a reset, as a PLC sends it
                one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                with suppress(OSError):
                    one.shutdown(socket.SHUT_RDWR)
                one.close()
            self._held.clear()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                with self._slamming:  # or what is half open when it slams goes through for ever
                    if self.shut:
                        near.close()
                        continue
                    far = socket.create_connection(("127.0.0.1", self._behind))
                    self._held += [near, far]
                threading.Thread(target=self._carry, args=(near, far), daemon=True).start()
                threading.Thread(target=self._carry, args=(far, near), daemon=True).start()

    @staticmethod
    def _carry(source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(4096):
                sink.sendall(data)


@pytest.mark.parametrize("copies", [1, 3, 40])
async def test_long_answers_that_come_together_are_told_apart(copies: int) -> None:
    """Of a gateway that sends each answer again right before the next one: pymodbus forgets what is longer than 264 bytes."""
    answer, ended = b"", asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal answer
        with suppress(asyncio.IncompleteReadError):
            while head := await reader.readexactly(12):
                before, count = answer, int.from_bytes(head[10:12], "big")
                words = b"".join((int.from_bytes(head[8:10], "big") + one).to_bytes(2, "big") for one in range(count))
                answer = head[:4] + (3 + len(words)).to_bytes(2, "big") + head[6:8] + bytes([len(words)]) + words
                writer.write(before * copies + answer)
        writer.close()
        await writer.wait_closed()
        ended.set()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    transport = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=server.sockets[0].getsockname()[1]), None)
    await transport.connect()
    try:
        for address in range(0, 500, 100):
            words = await transport.read(1, Block(address, 125), 2.0)
            assert words == [*range(address, address + 125)]
    finally:
        await transport.close()
        await ended.wait()
        server.close()


def test_a_connection_that_is_closed_while_it_is_opened_is_not_connected() -> None:
    async def story() -> set[str]:
        door = _Door(find_port())
        transport = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=door.port), None)
        seen = set[str]()
        for turn in range(200):
            try:
                await transport.connect()
                for _ in range(turn % 5):
                    await asyncio.sleep(0)
                await transport.read(1, Block(0, 10), 0.5)
            except Exception as error:
                seen.add(type(error).__name__)
        await transport.close()
        door.close()
        return seen

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # the loop of the server
        assert runner.run(story()) == {"NotConnected"}


def test_a_link_whose_connections_were_all_closed_while_they_were_opened_comes_back() -> None:
    async def story() -> None:
        server = TcpServer(Bus({1: RegisterDevice({0: 7})}))
        await server.start("127.0.0.1", 0)
        door = _Door(server.address[1])
        door.shut = False
        item = row("m1", 1, 1, Device(timeout=0.5, fast=0.05, connections=4))
        try:
            async with running([item], link=Link("hall", "tcp", host="127.0.0.1", tcp_port=door.port)) as line:
                await until(lambda: line.value("m1.v0") == 7)
                for _ in range(6):
                    door.slam()
                    await until(lambda: not is_good(line.quality("m1.v0")))
                    await asyncio.sleep(0.3)
                    door.shut = False
                    await until(lambda: is_good(line.quality("m1.v0")), 10)
        finally:
            door.close()
            await server.close()

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(story())


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused"), "refused; is its Modbus server on"),
        (OSError(errno.EHOSTUNREACH, "No route to host"), "nobody at this address; is it switched on"),
        (OSError(errno.ENETUNREACH, "Network is unreachable"), "no way to this address"),
        (socket.gaierror(socket.EAI_NONAME, "Name or service not known"), "nobody knows this name"),
        (OSError("Multiple exceptions: one, two"), "Multiple exceptions: one, two"),
        (None, "no answer in 1.2 s"),
    ],
)
async def test_a_connection_that_is_not_to_be_had_says_why(
    monkeypatch: pytest.MonkeyPatch, error: OSError | None, told: str
) -> None:
    """A switched-off device, a wrong port, a wrong name and a cable that is out all said `no connection`."""

    async def refuse(*_: object, **__: object) -> None:
        await asyncio.sleep(0.0 if error else 60.0)
        assert error is not None
        raise error

    known = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("192.0.2.7", 0))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: known)
    monkeypatch.setattr(asyncio.get_running_loop(), "create_connection", refuse)
    with pytest.raises(NotConnected) as failed:
        await TcpTransport(Link("hall", "tcp", host="plc.hall", tcp_port=502)).connect()
    assert str(failed.value).startswith(f"plc.hall:502: no connection, {told}")
    assert "None" not in str(failed.value)


@pytest.mark.parametrize("named", [0, 255])
async def test_a_device_that_answers_with_another_unit_is_not_read_and_its_unit_is_told(named: int) -> None:
    """It was silent to whoever looked for the reason."""

    class Constant(Bus):
        def answer(self, unit: int, pdu: bytes) -> Answer:
            return replace(super().answer(unit, pdu), unit=named)

    server = TcpServer(Constant({1: RegisterDevice({0: 7})}))
    await server.start("127.0.0.1", 0)
    transport = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1]))
    await transport.connect()
    with pytest.raises(NoAnswer, match=rf"no answer in 0.1 s; answers came with unit {named}: is that its unit\?$"):
        await transport.read(1, Block(0, 1), 0.1)
    with pytest.raises(NoAnswer, match=r"no answer in 0.1 s$"):
        await transport.read(2, Block(0, 1), 0.1)
    await transport.close()
    await server.close()


@asynccontextmanager
async def _asking(answer: Callable[[bytes], bytes]) -> AsyncIterator[TcpTransport]:
    """A transport that asks somebody who says `answer` to the first twelve bytes of each request."""
    connections = set[asyncio.Task[None]]()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(asyncio.IncompleteReadError):
            while head := await reader.readexactly(12):
                writer.write(answer(head))
        writer.close()
        await writer.wait_closed()

    def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connections.add(asyncio.create_task(serve(reader, writer)))

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    transport = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=server.sockets[0].getsockname()[1]))
    await transport.connect()
    try:
        yield transport
    finally:
        await transport.close()
        await asyncio.gather(*connections)
        server.close()


async def test_an_answer_to_a_former_connection_is_not_that_to_the_next_request() -> None:
    """Of a gateway that keeps what its device answered until somebody is there: each connection had begun at transaction 1."""
    owed = b""

    def answer(head: bytes) -> bytes:
        nonlocal owed
        said, owed = owed, head[:4] + b"\0\5" + head[6:8] + b"\2" + head[8:10]
        return said

    async with _asking(answer) as transport:
        for address in range(5):
            with pytest.raises(NoAnswer):
                await transport.read(1, Block(address, 1), 0.05)
            await transport.connect()


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (b"SSH-2.0-OpenSSH_9.2\r\n", "53 53 48 2d 32 2e 30 2d"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "48 54 54 50 2f 31 2e 31"),
        (bytes.fromhex("01 03 02 00 07 f9 86"), "01 03 02 00 07 f9 86"),
        (bytes.fromhex("00 01 00 00 ff ff 01 03 02 00 07"), "00 01 00 00 ff ff 01 03"),
    ],
    ids=["ssh", "http", "rtu", "length"],
)
async def test_what_is_no_modbus_tcp_is_told_as_such(said: bytes, told: str) -> None:
    """A wrong port, and a gateway that hands a serial line through as it is, were silent to whoever looked for the reason."""
    right = False
    hint = rf"no answer in 0.1 s; bytes came that are no Modbus TCP \({told}\): is the port right"

    def answer(head: bytes) -> bytes:
        return head[:4] + b"\0\5" + head[6:8] + b"\2\0\7" if right else said

    async with _asking(answer) as transport:
        for _ in range(2):
            with pytest.raises(NoAnswer, match=hint):
                await transport.read(1, Block(0, 1), 0.1)
        right = True
        assert await transport.read(1, Block(0, 1), 5.0) == [7]
