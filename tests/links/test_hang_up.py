"""A Modbus server that closes the connection when it is asked for one of its registers, over TCP with a socket server that really does."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

import pytest

from app.errors import HungUp
from app.links.statistics import ERROR_KINDS, LinkState
from app.plant.definitions import Device, Link
from app.registers.pdu import exception_answer
from app.tags.quality import NOT_CONNECTED, is_good
from tests.links.devices import Line, row, running, until

pytestmark = pytest.mark.real_time

DEVICE = Device(timeout=0.3, fast=0.05, slow=0.2)
REGISTERS = 30


class Server:
    """Answers registers 0 to 29 with their address plus 100, but for `closes`: for those it hangs up."""

    def __init__(self, *closes: int) -> None:
        self.closes = set(closes)
        self.accepted = self.hung_up = 0
        self.port = 0
        self._tasks = set[asyncio.Task[None]]()
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        """Listen, on the port of before if there was one."""
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """As when it is switched off."""
        assert self._server is not None
        self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.accepted += 1
        task = asyncio.create_task(self._serve(reader, writer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            with suppress(asyncio.IncompleteReadError, ConnectionError):
                while head := await reader.readexactly(12):
                    first, count = int.from_bytes(head[8:10], "big"), int.from_bytes(head[10:12], "big")
                    wanted = range(first, first + count)
                    if self.closes.intersection(wanted):
                        self.hung_up += 1
                        break
                    if head[7] != 3 or wanted.stop > REGISTERS:
                        pdu = exception_answer(head[7], 2)
                    else:
                        pdu = bytes([3, 2 * count]) + b"".join((at + 100).to_bytes(2, "big") for at in wanted)
                    writer.write(head[:4] + (1 + len(pdu)).to_bytes(2, "big") + head[6:7] + pdu)
        finally:
            writer.close()
            with suppress(ConnectionError, asyncio.CancelledError):
                await writer.wait_closed()


@asynccontextmanager
async def at(server: Server, device: Device = DEVICE) -> AsyncIterator[Line]:
    await server.start()
    try:
        link = Link("hall", "tcp", host="127.0.0.1", tcp_port=server.port)
        async with running([row("m", 1, REGISTERS, device)], link=link) as line:
            yield line
    finally:
        await server.close()


def good(line: Line) -> set[int]:
    return {n for n in range(REGISTERS) if is_good(line.quality(f"m.v{n}")) and line.value(f"m.v{n}") == n + 100}


@pytest.mark.parametrize("connections", [1, 2])
@pytest.mark.parametrize("closes", [{0}, {0, 1}, {17}, {29}, {3, 4, 25}])
async def test_the_rest_of_the_machine_is_read_and_the_register_says_why(
    closes: set[int], connections: int, caplog: pytest.LogCaptureFixture
) -> None:
    server, rest = Server(*closes), set(range(REGISTERS)) - closes
    async with at(server, Device(timeout=0.3, fast=0.05, slow=0.2, connections=connections)) as line:
        await until(lambda: good(line) == rest, 20)
        assert {line.quality(f"m.v{n}") & 0xFF for n in closes} == {NOT_CONNECTED}
        assert caplog.text.count("connection closed at register") == len(closes)
        assert line.link.stations[1].refuses_by_closing  # what the alarm asks
        assert line.link.statistics.last_error == "hung_up"
        line.batches.clear()
        accepted = server.accepted
        await asyncio.sleep(5)  # it is looked at again now and then: nobody else notices
        assert good(line) == rest
        assert not [one for one in line.batches if one.handles and one.source == "link.hall" and one.quality & 3 == 2]
        assert server.accepted - accepted <= 4
        assert line.link.statistics.state is LinkState.UP


async def test_a_register_that_is_answered_after_all_is_read_again() -> None:
    server = Server(17)
    async with at(server) as line:
        await until(lambda: len(good(line)) == REGISTERS - 1, 20)
        server.closes.clear()
        await until(lambda: len(good(line)) == REGISTERS, 20)
        assert not line.link.stations[1].refuses_by_closing
        server.closes.add(5)  # and another one, later
        await until(lambda: not is_good(line.quality("m.v5")), 5)
        await until(lambda: good(line) == set(range(REGISTERS)) - {5}, 20)


async def test_a_server_that_is_switched_off_is_told_as_such(caplog: pytest.LogCaptureFixture) -> None:
    """Also after it was found to hang up: silence is not put down to its registers."""
    caplog.set_level("INFO")
    server = Server(17)
    async with at(server) as line:
        await until(lambda: len(good(line)) == REGISTERS - 1, 20)
        caplog.clear()
        for _ in range(4):
            await server.close()
            await until(lambda: not good(line), 5)
            assert line.link.statistics.state is not LinkState.UP
            await server.start()
            await until(lambda: len(good(line)) == REGISTERS - 1, 10)
        assert caplog.text.count("link down") == caplog.text.count("link up") == 4
        assert "connection closed at register" not in caplog.text


async def test_a_server_that_hangs_up_now_and_then_keeps_all_its_registers() -> None:
    """A connection that is lost at no register in particular is nobody's fault."""
    server = Server()
    async with at(server) as line:
        await until(lambda: len(good(line)) == REGISTERS, 20)
        for turn in range(8):
            server.closes = {(7 * turn) % REGISTERS}
            await until(lambda: not is_good(line.quality("m.v1")), 5)
            server.closes = set()
            await until(lambda: len(good(line)) == REGISTERS, 10)


def test_it_has_a_code_and_words_of_its_own() -> None:
    assert HungUp.kind in ERROR_KINDS
