"""What every transport keeps, over real telegrams: the table itself is the list of what is tested."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass

import pytest

from app.clock import ManualClock
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected
from app.links.contract import Block, Transport
from app.links.memory import MemoryTransport
from app.links.transports import TRANSPORTS
from app.plant.definitions import Link
from app.sim.bus import Bus, LineFaultMode
from app.sim.server import TcpServer, serve_pty
from tests.links.devices import RegisterDevice, on_bus
from tests.virtual import loop_clock, virtual
from tests.wires import serve_line

ANSWERS = 30.0
"""Patience where an answer comes [s], however busy the machine."""


class Working(RegisterDevice):
    """Also in virtual time it takes some to answer."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        if virtual():
            hold_up(0.0001)
        return super().read(function, address, count)


@dataclass
class Bench:
    transport: Transport
    device: RegisterDevice
    other: RegisterDevice


@pytest.fixture(params=list(TRANSPORTS))
async def bench(request: pytest.FixtureRequest) -> AsyncIterator[Bench]:
    device, other = Working({n: n * 3 for n in range(200)}), RegisterDevice({n: 7 for n in range(200)})
    bus = Bus({1: device, 2: other})
    server = TcpServer(bus)
    await server.start("127.0.0.1", 0)
    line = await (serve_line if virtual() else serve_pty)(bus, 115200)
    link = Link(
        "hall",
        request.param,
        host="127.0.0.1",
        tcp_port=server.address[1],
        port=line.path,
        baud=115200,
        parity="none",
        stop_bits=2,
    )
    transport: Transport = TRANSPORTS[request.param](link, on_bus(bus))
    await transport.connect()
    yield Bench(transport, device, other)
    await transport.close()
    await line.close()
    await server.close()


async def test_reads_exactly_the_words_asked_for(bench: Bench) -> None:
    for block in (Block(0, 1), Block(7, 3), Block(0, 125)):
        words = await bench.transport.read(1, block, ANSWERS)
        assert words == [3 * n for n in range(block.address, block.address + block.count)]


async def test_writes_one_word_and_several_and_checks_the_echo(bench: Bench) -> None:
    await bench.transport.write(1, 5, [0x1234], ANSWERS, 6)
    await bench.transport.write(1, 8, [1, 2, 3], ANSWERS, 16)
    assert await bench.transport.read(1, Block(5, 6), ANSWERS) == [0x1234, 18, 21, 1, 2, 3]


async def test_a_refusal_is_told_by_its_code(bench: Bench) -> None:
    with pytest.raises(DeviceException, match="illegal data address") as refused:
        await bench.transport.read(1, Block(1000, 1), ANSWERS)
    assert refused.value.code == 2
    with pytest.raises(DeviceException):
        await bench.transport.write(1, 1000, [1], ANSWERS)


async def test_silence_lasts_the_patience_and_no_longer(bench: Bench) -> None:
    for patience in (0.05, 0.15):
        began = asyncio.get_running_loop().time()
        with pytest.raises(NoAnswer):
            await bench.transport.read(9, Block(0, 1), patience)
        assert patience * 0.9 <= asyncio.get_running_loop().time() - began < patience + 0.15


async def test_a_request_that_no_telegram_can_carry_is_a_link_error(bench: Bench) -> None:
    with pytest.raises(LinkError):
        await bench.transport.read(1, Block(0, 126), ANSWERS)
    with pytest.raises(LinkError):
        await bench.transport.write(1, 0, [70000], ANSWERS)


@pytest.mark.parametrize(
    ("mode", "argument"),
    [
        (LineFaultMode.WRONG_UNIT, 0),
        (LineFaultMode.WRONG_LENGTH, 0),
        (LineFaultMode.GARBAGE, 0),
        (LineFaultMode.GARBAGE, 1),
    ],
)
async def test_a_wrong_answer_never_becomes_a_value_and_the_next_one_is_right(
    bench: Bench, mode: LineFaultMode, argument: int
) -> None:
    fault = bench.device.line_fault
    for count in (1, 3, 125):
        fault.mode, fault.argument, fault.count = mode, argument, 1
        with pytest.raises((BadAnswer, NoAnswer)):
            await bench.transport.read(1, Block(0, count), 0.15)
        assert await bench.transport.read(1, Block(1, 2), ANSWERS) == [3, 6]
    fault.mode, fault.argument, fault.count = mode, argument, 1
    with pytest.raises((BadAnswer, NoAnswer)):
        await bench.transport.write(1, 1, [9], 0.15)


async def test_a_late_answer_is_not_the_answer_to_the_next_request(bench: Bench) -> None:
    fault = bench.device.line_fault
    fault.mode, fault.delay_ms, fault.count = LineFaultMode.SLOW, 120, 1
    with pytest.raises(NoAnswer):
        await bench.transport.read(1, Block(0, 2), 0.05)
    for address in (10, 20, 30):
        words = await bench.transport.read(1, Block(address, 2), 0.5)
        assert words == [3 * address, 3 * address + 3]
        await asyncio.sleep(0.03)


async def test_a_closed_connection_refuses_at_once(bench: Bench) -> None:
    await bench.transport.close()
    await bench.transport.close()
    assert not bench.transport.connected
    began = asyncio.get_running_loop().time()
    with pytest.raises(NotConnected):
        await bench.transport.read(1, Block(0, 1), 5.0)
    with pytest.raises(NotConnected):
        await bench.transport.write(1, 0, [1], 5.0)
    assert asyncio.get_running_loop().time() - began < 0.1
    await bench.transport.connect()
    assert await bench.transport.read(1, Block(1, 1), 0.5) == [3]


async def test_a_server_that_goes_away_is_noticed_at_once_not_after_the_patience() -> None:
    device = RegisterDevice({0: 1})
    device.line_fault.mode = LineFaultMode.SILENT
    server = TcpServer(Bus({1: device}))
    await server.start("127.0.0.1", 0)
    transport = TRANSPORTS["tcp"](Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1]))
    await transport.connect()
    reading = asyncio.create_task(transport.read(1, Block(0, 1), 10.0))
    await asyncio.sleep(0.05)
    began = asyncio.get_running_loop().time()
    await server.close()
    with pytest.raises(NotConnected):
        await reading
    assert asyncio.get_running_loop().time() - began < 0.5
    with pytest.raises(NotConnected):
        await transport.connect()
    await transport.close()


@pytest.mark.sweep(8)
async def test_a_reader_that_is_ended_ends_also_when_the_answer_comes_at_that_moment(bench: Bench) -> None:
    async def read_for_ever() -> None:
        while True:
            await bench.transport.read(1, Block(0, 1), 0.5)

    for n in range(60):
        reader = asyncio.create_task(read_for_ever())
        await asyncio.sleep(0.002 + n * 0.00007)
        reader.cancel()
        done, _ = await asyncio.wait([reader], timeout=1)
        assert done


async def test_in_a_loop_that_is_slow_to_come_round_several_telegrams_are_carried_each_time() -> None:
    rounds = 0

    async def busy() -> None:
        nonlocal rounds
        while True:
            hold_up(0.02)
            rounds += 1
            await asyncio.sleep(0)

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        hold_up(0.0001)
        return bytes((3, 2, 0, unit))

    transport = MemoryTransport(Link("l", "memory"), exchange)
    await transport.connect()
    task = asyncio.create_task(busy())
    try:
        for _ in range(300):
            assert await transport.read(7, Block(0, 1), 1.0) == [7]
        carried = rounds
        assert carried < 150, "not one for each round"
        began = rounds
        end = asyncio.get_running_loop().time() + 0.3
        while asyncio.get_running_loop().time() < end:
            await transport.read(7, Block(0, 1), 1.0)
        assert rounds - began >= 5, "and the others have their turns"
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def hold_up(seconds: float) -> None:
    """Keep the loop from everybody."""
    clock = loop_clock()
    assert isinstance(clock, ManualClock)
    clock.advance(seconds)
