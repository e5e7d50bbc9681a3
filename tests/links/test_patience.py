"""Silence is the device's, never ours: a process that was held up finds what was answered meanwhile."""

import asyncio
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import pytest
import uvloop

from app.errors import NoAnswer
from app.links.contract import Block
from app.links.memory import MemoryTransport
from app.links.patience import more
from app.links.rtu import RtuTransport
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from app.sim.bus import Bus, LineFaultMode
from app.sim.server import TcpServer, serve_pty
from tests.links.devices import RegisterDevice
from tests.links.serial_slaves import rtu

PATIENCE, HELD_UP = 0.25, 0.4
KINDS = ("memory", "tcp", "rtu")
LOOPS = (asyncio.new_event_loop, uvloop.new_event_loop)


class Hindering(RegisterDevice):
    """Asked for something, it holds up the loop that it shares with who asked."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        asyncio.get_running_loop().call_soon(time.sleep, HELD_UP)
        return super().read(function, address, count)


@asynccontextmanager
async def opened(
    kind: str, device: RegisterDevice, delay: float = 0.0
) -> AsyncIterator[MemoryTransport | TcpTransport | RtuTransport]:
    """A link of that kind to `device`; over memory it answers after `delay` [s]."""

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        await asyncio.sleep(delay)
        return None if device.line_fault.mode is LineFaultMode.SILENT else bytes((3, 2, 0, 7))

    bus = Bus({1: device})
    close: Callable[[], Awaitable[None]] | None = None
    transport: MemoryTransport | TcpTransport | RtuTransport
    if kind == "memory":
        transport = MemoryTransport(Link("hall", "memory"), exchange)
    elif kind == "tcp":
        server = TcpServer(bus)
        await server.start("127.0.0.1", 0)
        transport, close = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1])), server.close
    else:
        line = await serve_pty(bus, 115200)
        transport, close = RtuTransport(rtu(line.path)), line.close
    try:
        await transport.connect()
        yield transport
    finally:
        await transport.close()
        if close is not None:
            await close()


def heard(what: socket.socket) -> None:
    what.recv(1)
    time.sleep(HELD_UP)


@pytest.mark.real_time
@pytest.mark.parametrize("new_loop", LOOPS)
@pytest.mark.parametrize("delay", [0.0, 0.05])
@pytest.mark.parametrize("kind", KINDS)
def test_a_loop_that_was_held_up_finds_the_answer_that_was_due_meanwhile(
    kind: str, delay: float, new_loop: Callable[[], asyncio.AbstractEventLoop]
) -> None:
    async def held_up() -> list[int]:
        """What comes in between: another task, and something that is heard."""
        async with opened(kind, Hindering({0: 7}), delay) as transport:
            loop = asyncio.get_running_loop()
            here, there = socket.socketpair()
            with here, there:
                loop.add_reader(here, heard, here)
                there.send(b".")
                if kind == "memory":
                    loop.call_soon(time.sleep, HELD_UP)
                try:
                    return await transport.read(1, Block(0, 1), PATIENCE)
                finally:
                    loop.remove_reader(here)

    with asyncio.Runner(loop_factory=new_loop) as runner:
        assert runner.run(held_up()) == [7]


@pytest.mark.real_time
@pytest.mark.parametrize("new_loop", LOOPS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_silent_device_is_silent_for_a_loop_that_was_held_up_too(
    kind: str, new_loop: Callable[[], asyncio.AbstractEventLoop]
) -> None:
    async def held_up() -> None:
        device = RegisterDevice(dict.fromkeys(range(16), 7))
        device.line_fault.mode = LineFaultMode.SILENT
        async with opened(kind, device) as transport:
            asking = asyncio.create_task(transport.read(1, Block(0, 1), PATIENCE))
            asyncio.get_running_loop().call_later(0.01, time.sleep, HELD_UP)
            with pytest.raises(NoAnswer, match=f"no answer.* in {PATIENCE} s"):
                await asking
            device.line_fault.mode = LineFaultMode.NONE
            assert await transport.read(1, Block(0, 1), 5.0) == [7]

    with asyncio.Runner(loop_factory=new_loop) as runner:
        runner.run(held_up())


@pytest.mark.real_time
@pytest.mark.parametrize("new_loop", LOOPS)
@pytest.mark.parametrize("kind", KINDS)
def test_who_is_ended_meanwhile_ends(kind: str, new_loop: Callable[[], asyncio.AbstractEventLoop]) -> None:
    async def held_up() -> None:
        device = RegisterDevice(dict.fromkeys(range(16), 7))
        device.line_fault.mode = LineFaultMode.SILENT
        async with opened(kind, device) as transport:
            asking = asyncio.create_task(transport.read(1, Block(0, 1), 3600.0))
            await asyncio.sleep(0.05)
            asking.cancel()
            with pytest.raises(asyncio.CancelledError):
                await asking

    with asyncio.Runner(loop_factory=new_loop) as runner:
        runner.run(held_up())


async def test_what_the_loop_was_late_is_given_once_and_never_more_than_the_time_out() -> None:
    now = asyncio.get_running_loop().time()
    assert [more(now + after, 1.0) for after in (0.5, 0.0, -0.4, -60.0)] == pytest.approx([0.0, 0.0, 0.4, 1.0])
