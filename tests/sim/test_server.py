"""The simulated line over real sockets and real pseudo-terminals, asked by a foreign master (pymodbus)."""

import asyncio
import contextlib
import os
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.exceptions import ModbusIOException
from pymodbus.pdu import ExceptionResponse, ModbusPDU

from app.errors import ConfigurationError
from app.plant.definitions import Link
from app.registers.crc import crc_holds
from app.registers.pdu import read_request, write_request
from app.registers.rtu import build_frame, read_time
from app.sim import server as server_module
from app.sim.bus import Answer, Bus, LineFaultMode
from app.sim.device import VirtualDevice
from app.sim.server import SerialServer, TcpServer, close_all, serve_pty, serve_serial, serve_tcp
from app.sim.training import LineFault
from tests.sim.fake_device import FakeDevice
from tests.virtual import VirtualLoop
from tests.wires import open_port, serve_line

POLL = read_request(0x1000, 25)
ANSWER = bytes((3, 50)) + b"".join((100 + n).to_bytes(2) for n in range(25))
Client = AsyncModbusTcpClient | AsyncModbusSerialClient
FAST = 115200
ANSWERS = 30.0
"""Patience where an answer comes [s], however busy the machine."""


class HearingBus(Bus):
    """Tells which units were asked. A master in the same loop that is out of patience may ask again before its line has read the first
    telegram: then the silence between the two is not on the line, and they are one."""

    def __init__(self, devices: Mapping[int, VirtualDevice]) -> None:
        super().__init__(devices)
        self._asked: dict[int, asyncio.Event] = defaultdict(asyncio.Event)

    def answer(self, unit: int, pdu: bytes) -> Answer:
        self._asked[unit].set()
        return super().answer(unit, pdu)

    async def heard_of(self, unit: int) -> None:
        """Until a whole telegram to `unit` was heard, and the silence behind it."""
        await self._asked[unit].wait()


@asynccontextmanager
async def tcp(bus: Bus | None = None, **options: int) -> AsyncIterator[TcpServer]:
    served = await serve_tcp(bus or Bus({1: FakeDevice()}), "127.0.0.1", 0, **options)
    try:
        yield served
    finally:
        await served.close()


@asynccontextmanager
async def pty(bus: Bus | None = None, baud: int = FAST) -> AsyncIterator[SerialServer]:
    served = await serve_pty(bus or Bus({1: FakeDevice()}), baud)
    try:
        yield served
    finally:
        await served.close()


@asynccontextmanager
async def serial_line(bus: Bus | None = None, baud: int = FAST) -> AsyncIterator[SerialServer]:
    served = await serve_line(bus or Bus({1: FakeDevice()}), baud)
    try:
        yield served
    finally:
        await served.close()


@asynccontextmanager
async def master(road: str, bus: Bus, patience: float = ANSWERS) -> AsyncIterator[Client]:
    async with contextlib.AsyncExitStack() as stack:
        client: Client
        if road == "tcp":
            host, port = (await stack.enter_async_context(tcp(bus))).address
            client = AsyncModbusTcpClient(host, port=port, timeout=patience, retries=0)
        else:
            path = (await stack.enter_async_context(pty(bus))).path
            client = AsyncModbusSerialClient(path, baudrate=FAST, parity="N", timeout=patience, retries=0)
        assert await client.connect()
        try:
            yield client
        finally:
            client.close()
            await asyncio.sleep(0.01)


async def until(fact: Callable[[], bool], patience: float) -> None:
    end = asyncio.get_running_loop().time() + patience
    while not fact():
        assert asyncio.get_running_loop().time() < end
        await asyncio.sleep(0.01)


@pytest.fixture(params=["tcp", "rtu"])
def road(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.real_time
async def test_a_foreign_master_reads_and_writes(road: str) -> None:
    device = FakeDevice()
    async with master(road, Bus({1: device})) as client:
        answer = await client.read_holding_registers(0x1000, count=25, device_id=1)
        assert answer.registers == list(range(100, 125))
        echo = await client.write_register(0x10D, 5000, device_id=1)
        assert not echo.isError()
        device.step()
        assert (await client.read_holding_registers(0x10D, count=1, device_id=1)).registers == [5000]
        assert not (await client.write_registers(0x110, [1, 2, 3], device_id=1)).isError()
        device.step()
        both = await client.readwrite_registers(read_address=0x110, read_count=3, write_address=0x120, values=[4])
        assert both.registers == [1, 2, 3]


REFUSED: list[tuple[int, Callable[[Client], Awaitable[ModbusPDU]]]] = [
    (1, lambda client: client.read_coils(0, count=1, device_id=1)),
    (1, lambda client: client.read_input_registers(0x1000, count=1, device_id=1)),
    (2, lambda client: client.read_holding_registers(0x5000, count=1, device_id=1)),
    (3, lambda client: client.write_register(0x10D, 65001, device_id=1)),
    (4, lambda client: client.write_register(0x1FF, 1, device_id=1)),
]


@pytest.mark.real_time
async def test_a_foreign_master_gets_each_exception(road: str) -> None:
    async with master(road, Bus({1: FakeDevice()})) as client:
        for code, ask in REFUSED:
            answer = await ask(client)
            assert isinstance(answer, ExceptionResponse)
            assert answer.exception_code == code


@pytest.mark.real_time
async def test_a_unit_that_is_not_there_is_silent_and_its_neighbour_answers(road: str) -> None:
    bus = HearingBus({1: FakeDevice()})
    async with master(road, bus, patience=0.1) as client:
        with pytest.raises(ModbusIOException):
            await client.read_holding_registers(0x1000, count=1, device_id=9)
        async with asyncio.timeout(ANSWERS):
            await bus.heard_of(9)
        client.ctx.comm_params.timeout_connect = ANSWERS
        assert (await client.read_holding_registers(0x1000, count=1, device_id=1)).registers == [100]


@pytest.mark.real_time
@pytest.mark.parametrize(
    "fault",
    [
        LineFault(LineFaultMode.CABLE_PULLED, count=1),
        LineFault(LineFaultMode.SLOW, delay_ms=150, count=1),
        LineFault(LineFaultMode.SILENT, count=1),
        LineFault(LineFaultMode.WRONG_UNIT, count=1),
        LineFault(LineFaultMode.GARBAGE, count=1),
    ],
)
async def test_a_spoiled_answer_never_passes_for_a_good_one(road: str, fault: LineFault) -> None:
    bus = HearingBus({1: FakeDevice(line_fault=replace(fault))})
    async with master(road, bus, patience=0.1) as client:
        with pytest.raises(ModbusIOException):
            await client.read_holding_registers(0x1000, count=25, device_id=1)
        async with asyncio.timeout(ANSWERS):
            await bus.heard_of(1)
        await asyncio.sleep(0.2)
        client.ctx.comm_params.timeout_connect = ANSWERS
        client.close()
        assert await client.connect()
        answer = await client.read_holding_registers(0x1000, count=25, device_id=1)
        assert answer.registers == list(range(100, 125))


@pytest.mark.real_time
async def test_a_wrong_length_and_a_chosen_exception_arrive_as_such(road: str) -> None:
    device = FakeDevice(line_fault=LineFault(LineFaultMode.WRONG_LENGTH, count=1))
    async with master(road, Bus({1: device})) as client:
        answer = await client.read_holding_registers(0x1000, count=25, device_id=1)
        assert answer.registers == list(range(100, 124)), (
            "pymodbus takes what it gets: the length is the master's to check"
        )
        device.line_fault = LineFault(LineFaultMode.EXCEPTION, argument=6, count=1)
        assert (await client.read_holding_registers(0x1000, count=25, device_id=1)).exception_code == 6
        assert (await client.read_holding_registers(0x1000, count=25, device_id=1)).registers == list(range(100, 125))


def in_virtual_time(story: Coroutine[Any, Any, None]) -> None:
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(story)


# --- TCP -------------------------------------------------------------------------------------------------------------


def framed(pdu: bytes, transaction: int = 1, unit: int = 1, protocol: int = 0) -> bytes:
    return transaction.to_bytes(2) + protocol.to_bytes(2) + (len(pdu) + 1).to_bytes(2) + bytes((unit,)) + pdu


@asynccontextmanager
async def socket_to(served: TcpServer) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    reader, writer = await asyncio.open_connection(*served.address)
    try:
        yield reader, writer
    finally:
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


async def polls(served: TcpServer) -> bool:
    async with socket_to(served) as (reader, writer):
        writer.write(framed(POLL))
        async with asyncio.timeout(1):
            return await reader.readexactly(59) == framed(ANSWER)


async def test_pipelined_requests_are_answered_in_order() -> None:
    device = FakeDevice(line_fault=LineFault(LineFaultMode.SLOW, delay_ms=50, count=1))
    async with tcp(Bus({1: device})) as served, socket_to(served) as (reader, writer):
        writer.write(b"".join(framed(read_request(0x1000 + n, 1), transaction=500 + n) for n in range(20)))
        for n in range(20):
            assert await reader.readexactly(11) == framed(bytes((3, 2, 0, 100 + n)), transaction=500 + n)


async def test_clients_that_flood_the_port_get_one_answer_a_turn_of_the_loop() -> None:
    answered = 0

    class CountingBus(Bus):
        def answer(self, unit: int, pdu: bytes) -> Answer:
            nonlocal answered
            answered += 1
            return super().answer(unit, pdu)

    async with contextlib.AsyncExitStack() as stack:
        served = await stack.enter_async_context(tcp(CountingBus({1: FakeDevice()})))
        for unit in (1, 1, 1, 99):  # what nobody answers takes its turn, too
            _, writer = await stack.enter_async_context(socket_to(served))
            writer.write(framed(POLL, unit=unit) * 300)
        most = 0
        async with asyncio.timeout(ANSWERS):
            while answered < 1200:
                before = answered
                await asyncio.sleep(0)
                most = max(most, answered - before)
        assert most == 1


async def test_a_request_in_pieces_is_one_request() -> None:
    async with tcp() as served, socket_to(served) as (reader, writer):
        for byte in framed(POLL):
            writer.write(bytes((byte,)))
            await writer.drain()
            await asyncio.sleep(0.001)
        assert await reader.readexactly(59) == framed(ANSWER)


async def test_two_clients_do_not_hear_each_other_and_a_slow_answer_holds_only_its_own() -> None:
    slow = FakeDevice(line_fault=LineFault(LineFaultMode.SLOW, delay_ms=300))
    async with tcp(Bus({1: FakeDevice(), 2: slow})) as served, socket_to(served) as (_, first):
        first.write(framed(POLL, unit=2))
        await first.drain()
        began = asyncio.get_running_loop().time()
        assert await polls(served)
        assert asyncio.get_running_loop().time() - began < 0.2
        assert served.connections >= 1


@pytest.mark.parametrize(
    "nonsense",
    [
        framed(POLL, protocol=1),
        b"\x00\x01\x00\x00\x00\x01\x01",
        b"\x00\x01\x00\x00\x00\x00\x01",
        b"\x00\x01\x00\x00\x00\xff\x01\x03",
        b"\x00\x01\x00\x00\xff\xff\x01",
        b"GET / HTTP/1.1\r\nHost: drive\r\n\r\n",
    ],
)
async def test_what_is_not_modbus_is_dropped(nonsense: bytes) -> None:
    async with tcp() as served:
        async with socket_to(served) as (reader, writer):
            writer.write(nonsense)
            async with asyncio.timeout(1):
                with contextlib.suppress(ConnectionError):
                    assert await reader.read() == b""
        assert await polls(served)


@pytest.mark.parametrize(
    "pdu",
    [
        b"\x10\x20\x00\x00\x7c\xf8" + bytes(248),  # 124 registers
        b"\x0f\x00\x00\x07\xf8\xff" + bytes(255),  # 2040 coils
        b"\x17\x10\x00\x00\x01\x20\x00\x00\x7a\xf4" + bytes(244),  # 122 registers
        b"\x17\x10\x00\x00\x01\x20\x00\x00\x7f\xff" + bytes(255),
    ],
)
async def test_more_than_a_telegram_holds_is_refused_with_03_and_the_connection_stays(pdu: bytes) -> None:
    """A master that does not count its registers got no answer, and took the line for broken."""
    async with tcp() as served, socket_to(served) as (reader, writer):
        writer.write(framed(pdu) + framed(POLL))
        async with asyncio.timeout(ANSWERS):
            assert await reader.readexactly(9) == framed(bytes((pdu[0] | 0x80, 3)))
            assert await reader.readexactly(59) == framed(ANSWER)


async def test_a_client_that_leaves_in_the_middle_harms_nobody() -> None:
    async with tcp() as served:
        for cut in range(1, 12):
            async with socket_to(served) as (_, writer):
                writer.write(framed(POLL)[:cut])
        assert await polls(served)
        await asyncio.sleep(0.05)
        assert served.connections == 0


async def test_a_client_that_takes_no_answers_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "SEND_TIMEOUT", 0.2)
    device = FakeDevice(words=dict.fromkeys(range(125), 1))
    async with tcp(Bus({1: device})) as served, socket_to(served) as (_, writer):
        writer.transport.pause_reading()  # type: ignore[attr-defined]
        writer.transport.set_write_buffer_limits(high=1 << 24)
        writer.write(framed(read_request(0, 125)) * 100_000)
        await until(lambda: not served.connections, 20)
        async with socket_to(served) as (reader, other):
            other.write(framed(read_request(0, 1)))
            assert await reader.readexactly(11) == framed(bytes((3, 2, 0, 1)))


async def test_connections_are_capped_and_the_idle_make_room(monkeypatch: pytest.MonkeyPatch) -> None:
    async with tcp(max_connections=2) as served, socket_to(served) as (r1, w1), socket_to(served) as (r2, w2):
        for reader, writer in ((r1, w1), (r2, w2)):
            writer.write(framed(POLL))
            await reader.readexactly(59)
        async with socket_to(served) as (reader, _):
            assert await reader.read() == b"", "a third is refused while both are busy"
        monkeypatch.setattr(server_module, "IDLE_GRACE", 0.0)
        w2.write(framed(POLL))
        await r2.readexactly(59)
        assert await polls(served)
        with contextlib.suppress(ConnectionError):
            assert await r1.read() == b"", "the one that was idle longest went"


async def test_a_taken_port_is_told() -> None:
    async with tcp() as served:
        with pytest.raises(ConfigurationError, match=f"tcp 127.0.0.1:{served.address[1]}: expected a free address"):
            await serve_tcp(Bus({}), *served.address)
    with pytest.raises(ConfigurationError, match="expected a free address"):
        await serve_tcp(Bus({}), "127.0.0.1", 70000)


@pytest.mark.sweep(8)
@given(st.lists(st.binary(min_size=1, max_size=40), max_size=6))
@settings(max_examples=30, deadline=None)
def test_no_bytes_on_a_socket_stop_the_server(noise: list[bytes]) -> None:
    async def story() -> None:
        async with tcp() as served:
            async with socket_to(served) as (_, writer):
                for piece in noise:
                    writer.write(piece)
                with contextlib.suppress(ConnectionError):
                    await writer.drain()
            assert await polls(served)

    in_virtual_time(story())


# --- RTU -------------------------------------------------------------------------------------------------------------


class Wire:
    """The master's end of a serial line, byte by byte."""

    def __init__(self, path: str) -> None:
        self._port = open_port(Link("hall", "rtu", port=path))
        self.fd = self._port.fileno()

    def send(self, data: bytes) -> None:
        os.write(self.fd, data)

    async def hear(self, count: int, patience: float = 1.0) -> bytes:
        """At least `count` bytes, or what there is when the time is over."""
        heard = b""
        until = asyncio.get_running_loop().time() + patience
        while len(heard) < count and asyncio.get_running_loop().time() < until:
            with contextlib.suppress(BlockingIOError):
                heard += os.read(self.fd, 4096)
            await asyncio.sleep(0.0002)
        return heard

    async def ask(self, frame: bytes, count: int, patience: float = 1.0) -> bytes:
        self.send(frame)
        return await self.hear(count, patience)

    def close(self) -> None:
        self._port.close()


@asynccontextmanager
async def wire(bus: Bus | None = None, baud: int = FAST) -> AsyncIterator[Wire]:
    async with serial_line(bus, baud) as served:
        end = Wire(served.path)
        try:
            yield end
        finally:
            end.close()


FRAME = build_frame(1, POLL)


@pytest.mark.parametrize(
    "nonsense",
    [
        b"\x00",
        FRAME[:-1],
        FRAME[:3],
        FRAME[:-1] + b"\x00",
        FRAME + b"\x01",
        FRAME + FRAME,
        b"\xff" * 5000,
        bytes(range(256)),
        build_frame(9, POLL),
        build_frame(1, b""),
    ],
)
async def test_a_damaged_telegram_gets_no_answer_and_the_next_one_does(nonsense: bytes) -> None:
    async with wire() as end:
        end.send(nonsense)
        assert await end.hear(1, 0.03) == b""
        assert await end.ask(FRAME, 55) == build_frame(1, ANSWER)


async def test_a_zero_behind_a_telegram_escapes_its_check_sum_and_is_still_no_request() -> None:
    async with wire() as end:
        assert await end.ask(FRAME + b"\x00", 5) == build_frame(1, b"\x83\x03")


@given(st.lists(st.binary(min_size=1, max_size=300), max_size=4))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_no_bytes_on_a_line_stop_the_slave(noise: list[bytes]) -> None:
    async def story() -> None:
        async with wire() as end:
            for piece in noise:
                if crc_holds(piece):
                    continue
                end.send(piece)
                await asyncio.sleep(0.004)
            await end.hear(1, 0.02)
            assert await end.ask(FRAME, 55) == build_frame(1, ANSWER)

    in_virtual_time(story())


async def time_of_a_poll(end: Wire, polls: int) -> float:
    """Time between the answers of a master that asks again at once [s]: of all the lower quarter, for other work only adds to it."""
    marks = []
    for _ in range(polls + 1):
        assert await end.ask(FRAME, 55) == build_frame(1, ANSWER)
        marks.append(asyncio.get_running_loop().time())
    return sorted(later - sooner for sooner, later in pairwise(marks))[polls // 4]


@pytest.mark.parametrize(("baud", "count"), [(9600, 7), (38400, 21)])
async def test_the_line_is_as_fast_as_its_arithmetic(baud: int, count: int) -> None:
    async with wire(baud=baud) as end:
        assert await time_of_a_poll(end, count) == pytest.approx(read_time(baud, 25), rel=0.1)


async def test_the_turnaround_comes_on_top_of_the_wire_time() -> None:
    async with wire(Bus({1: FakeDevice()}, turnaround=0.03), baud=38400) as end:
        assert await time_of_a_poll(end, 9) == pytest.approx(read_time(38400, 25) + 0.03, rel=0.1)


async def test_a_late_answer_comes_before_that_to_the_next_request() -> None:
    device = FakeDevice(line_fault=LineFault(LineFaultMode.SLOW, delay_ms=150, count=1))
    async with wire(Bus({1: device})) as end:
        end.send(build_frame(1, read_request(0x1000, 1)))
        await asyncio.sleep(0.05)
        second = build_frame(1, read_request(0x1001, 1))
        heard = await end.ask(second, 14)
        assert heard == build_frame(1, bytes((3, 2, 0, 100))) + build_frame(1, bytes((3, 2, 0, 101)))


async def test_line_faults_on_the_wire_are_what_they_say() -> None:
    device = FakeDevice(line_fault=LineFault(LineFaultMode.GARBAGE, count=1))
    async with wire(Bus({1: device})) as end:
        spoiled = await end.ask(FRAME, 55)
        assert spoiled[:-1] == build_frame(1, ANSWER)[:-1] and not crc_holds(spoiled)
        device.line_fault = LineFault(LineFaultMode.GARBAGE, argument=1, count=1)
        noise = await end.ask(FRAME, 52)
        assert len(noise) == 52 and not crc_holds(noise)
        device.line_fault = LineFault(LineFaultMode.WRONG_UNIT, count=1)
        assert await end.ask(FRAME, 55) == build_frame(2, ANSWER)
        device.line_fault = LineFault(LineFaultMode.WRONG_LENGTH, count=1)
        short = await end.ask(FRAME, 53)
        assert len(short) == 53 and crc_holds(short) and short[2] == 48
        device.line_fault = LineFault(LineFaultMode.SILENT, count=1)
        assert await end.ask(build_frame(1, write_request(0x10D, [3])), 1, 0.05) == b""
        assert device.pending == [(0x10D, 3)]


async def test_masters_come_and_go() -> None:
    async with serial_line() as served:
        for _ in range(3):
            end = Wire(served.path)
            assert await end.ask(FRAME, 55) == build_frame(1, ANSWER)
            end.close()


async def test_a_serial_device_is_served_and_found_again_after_it_went_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(server_module, "REOPEN_PAUSE", 0.05)
    adapter = tmp_path / "ttyUSB0"
    ours, theirs = os.openpty()
    os.set_blocking(ours, False)
    adapter.symlink_to(os.ttyname(theirs))
    served = await serve_serial(Bus({1: FakeDevice()}), str(adapter), FAST)
    os.close(theirs)
    try:
        end = Wire.__new__(Wire)
        end.fd = ours
        assert await end.ask(FRAME, 55) == build_frame(1, ANSWER)
        adapter.unlink()
        os.close(ours)
        await until(lambda: "serial line lost" in caplog.text, 2)
        end.fd, theirs = os.openpty()
        os.set_blocking(end.fd, False)
        adapter.symlink_to(os.ttyname(theirs))
        async with asyncio.timeout(2):
            while await end.ask(FRAME, 55, 0.1) != build_frame(1, ANSWER):
                pass
        os.close(theirs)
        os.close(end.fd)
    finally:
        await close_all([served])


async def test_a_line_that_cannot_be_opened_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="expected a serial device at 9600 baud"):
        await serve_serial(Bus({}), str(tmp_path / "ttyNone"))
    with pytest.raises(ConfigurationError, match="parity odds: expected one of none, even, odd"):
        await serve_serial(Bus({}), "/dev/null", parity="odds")
    with pytest.raises(ConfigurationError, match="baud 0"):
        await serve_serial(Bus({}), "/dev/null", 0)
