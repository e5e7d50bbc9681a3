"""pogon probe and pogon inject from the terminal, over pseudo-terminals and sockets."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import cli
from app.links.contract import Block
from app.links.rtu import RtuTransport
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from app.sim.bus import Bus
from app.sim.server import MBAP, TcpServer, serve_pty, serve_tcp
from tests.links.devices import Gateway, RegisterDevice
from tests.links.serial_slaves import rtu
from tests.links.table_device import TableDevice
from tests.sim.test_simulate_process import simulating

pytestmark = pytest.mark.real_time


async def pogon(*arguments: str) -> tuple[int, str, str]:
    """Exit code, output, errors; in a thread of its own, as if in a process."""
    result = await asyncio.to_thread(CliRunner().invoke, cli, list(arguments))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@asynccontextmanager
async def line(baud: int = 9600) -> AsyncIterator[tuple[str, RegisterDevice]]:
    device = RegisterDevice({0x1000 + n: 1000 * n for n in range(40)})
    served = await serve_pty(Bus({3: device}), baud)
    try:
        yield served.path, device
    finally:
        await served.close()


async def test_a_unit_on_a_serial_line_is_found_and_read_and_nothing_is_written() -> None:
    async with line() as (path, device):
        told = await pogon(
            "probe",
            "--port",
            path,
            "--parity",
            "none",
            "--baud",
            "9600",
            "--unit",
            "1-4",
            "--read",
            "0x1000",
            "--count",
            "4",
        )
        assert told == (
            0,
            "9600 8N2 unit 3 answers: 0x1000 = 0x0000\n"
            "unit 3 0x1000  0x0000      0\n"
            "unit 3 0x1001  0x03e8   1000\n"
            "unit 3 0x1002  0x07d0   2000\n"
            "unit 3 0x1003  0x0bb8   3000\n",
            "",
        )
        assert device.writes == []


async def test_settings_that_a_port_does_not_take_are_passed_over() -> None:
    async with line() as (path, _):
        code, output, _ = await pogon("probe", "--port", path, "--baud", "9600", "--unit", "3")
        assert code == 0 and "unit 3 answers" in output


async def test_a_parity_that_a_port_passes_over_is_not_said_to_be_that_of_the_line() -> None:
    """A pseudo-terminal takes the first one that it is opened with, and has none: `9600 8E1` was what the engineer wrote down."""
    async with line() as (path, device):
        code, output, _ = await pogon("probe", "--port", path, "--baud", "9600", "--unit", "3")
        assert (code, output) == (0, "9600 8N2 unit 3 answers: 0x1000 = 0x0000\n")
        device.requests.clear()
        for parity in ("even", "odd"):
            code, output, errors = await pogon("probe", "--port", path, "--baud", "9600", "--parity", parity)
            assert (code, output) == (2, "") and f"{path}: does not take" in errors and f"parity {parity}" in errors
        assert device.requests == []


async def test_a_refusal_is_an_answer_and_a_refused_read_ends_with_1() -> None:
    device = RegisterDevice({0: 1})
    served = await serve_tcp(Bus({2: device}), "127.0.0.1", 0)
    host, port = served.address
    where = f"{host}:{port}"
    found = await pogon("probe", "--tcp", where, "--unit", "1,2")
    assert found == (0, f"{where} unit 2 answers: exception 02 illegal data address\n", "")
    code, output, _ = await pogon("probe", "--tcp", where, "--unit", "2", "--read", "0x2000")
    assert code == 1 and "unit 2 0x2000: exception 02 illegal data address" in output
    code, output, _ = await pogon("probe", "--tcp", where, "--unit", "2", "--read", "0")
    assert code == 0 and "unit 2 0x0000  0x0001      1" in output
    code, _, errors = await pogon("probe", "--tcp", where, "--unit", "5", "--patience", "50")
    assert code == 1 and "nothing answers" in errors
    await served.close()
    code, _, errors = await pogon("probe", "--tcp", where)
    assert code == 2 and "no connection" in errors
    assert device.writes == []


async def test_what_a_gateway_says_in_the_place_of_a_unit_is_no_answer_of_the_unit() -> None:
    """Each of the units asked for was said to answer."""
    gateway = Gateway({3: RegisterDevice({0x1000: 7})}, 11)
    gateway.unreached = {1, 2, 4}
    served = await serve_tcp(gateway, "127.0.0.1", 0)
    where = f"127.0.0.1:{served.address[1]}"
    try:
        assert await pogon("probe", "--tcp", where, "--unit", "1-4") == (
            0,
            f"{where} unit 3 answers: 0x1000 = 0x0007\n",
            "",
        )
        code, _, errors = await pogon("probe", "--tcp", where, "--unit", "1-2")
        assert (code, errors.splitlines()[-1]) == (
            1,
            f"pogon: nothing answers at {where}, units 1 to 2; "
            "a gateway is there: exception 11 gateway target failed to respond",
        )
    finally:
        await served.close()


async def test_bits_are_found_and_read_by_their_own_functions() -> None:
    device = TableDevice({"coil": {n: n % 3 == 0 for n in range(0x1001)}}, (1, 2))
    served = await serve_tcp(Bus({3: device}), "127.0.0.1", 0)
    where = f"127.0.0.1:{served.address[1]}"
    told = f"{where} unit 3 answers: 0x1000 = 0\n" + "".join(
        f"unit 3 {at:#06x}  {int(at % 3 == 0)}\n" for at in range(5, 5 + 200)
    )
    asked = ("probe", "--tcp", where, "--unit", "3", "--read", "5", "--count", "200")
    try:
        assert await pogon(*asked, "--function", "1") == (0, told, "")
        code, output, _ = await pogon(*asked, "--function", "2")
        assert code == 1 and "exception 02" in output
        assert {(request.function, request.words) for request in device.requests} == {(1, ()), (2, ())}
    finally:
        await served.close()


async def test_a_device_that_closes_the_connection_at_another_unit_is_found() -> None:
    class Strict(TcpServer):
        async def _serve_one(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
            head = await reader.readexactly(MBAP.size)
            reader._buffer[:0] = head  # type: ignore[attr-defined]
            return head[-1] == 3 and await super()._serve_one(reader, writer)

    served = Strict(Bus({3: RegisterDevice({0x1000: 7})}))
    await served.start("127.0.0.1", 0)
    where = f"127.0.0.1:{served.address[1]}"
    try:
        assert await pogon("probe", "--tcp", where, "--unit", "1-4") == (
            0,
            f"{where} unit 3 answers: 0x1000 = 0x0007\n",
            "",
        )
        code, _, errors = await pogon("probe", "--tcp", where, "--unit", "1-2")
        assert code == 2 and "connection lost" in errors
    finally:
        await served.close()


async def test_a_port_that_a_running_server_holds_is_left_alone() -> None:
    async with line() as (path, device):
        server = RtuTransport(rtu(path, 9600))
        await server.connect()
        code, _, errors = await pogon("probe", "--port", path, "--parity", "none")
        assert code == 2 and f"{path}: in use by another program" in errors
        assert device.requests == []
        await server.close()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "give --port DEVICE, or --tcp HOST:PORT"),
        (["--port", "x", "--tcp", "y:1"], "give --port DEVICE"),
        (["--port", "/dev/pogon-none", "--baud", "9600", "--parity", "none"], "no such device"),
        (["--port", "x", "--baud", "fast"], "--baud fast: expected"),
        (["--port", "x", "--parity", "mark"], "--parity mark: expected"),
        (["--port", "x", "--unit", "0"], "--unit 0: expected units from 1 to 247"),
        (["--tcp", "localhost:502", "--unit", "250-256"], "--unit 250-256: expected units from 0 to 255"),
        (["--port", "x", "--unit", "5-3"], "--unit 5-3: expected"),
        (["--port", "x", "--read", "70000"], "--read 70000: expected"),
        (["--port", "x", "--function", "6"], "--function 6: expected 1, 2, 3 or 4"),
        (["--port", "x", "--function", "4", "--count", "126"], "--count 126: expected 1 to 125 registers"),
        (["--tcp", "nowhere"], "--tcp nowhere: expected HOST:PORT"),
    ],
)
async def test_what_makes_no_sense_is_told_and_not_tried(arguments: list[str], told: str) -> None:
    code, output, errors = await pogon("probe", *arguments)
    assert (code, output) == (2, "") and told in errors


# ---- inject --------------------------------------------------------------------------------------------------


async def words(address: str, unit: int, block: Block) -> list[int]:
    host, _, port = address.rpartition(":")
    transport = TcpTransport(Link("t", "tcp", host=host, tcp_port=int(port)))
    await transport.connect()
    try:
        return await transport.read(unit, block, 0.3)
    finally:
        await transport.close()


async def test_a_simulated_drive_is_broken_and_put_right_again() -> None:
    async with simulating("plants/demo", "--tcp", "127.0.0.1:0") as (_, said):
        where = said["tcp"]
        assert await pogon("inject", "m1", "OC", "--tcp", where) == (0, "m1: OC\n", "")
        await asyncio.sleep(0.2)
        assert (await words(where, 1, Block(0x1005, 1)))[0] & 0xFF == 4
        assert (await words(where, 2, Block(0x1005, 1)))[0] & 0xFF != 4
        assert (await pogon("inject", "m1", "cable", "--tcp", where))[0] == 0
        await asyncio.sleep(0.1)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.25):
                await words(where, 1, Block(0x1005, 1))
        assert (await pogon("inject", "m1", "clear", "--tcp", where))[0] == 0
        await asyncio.sleep(0.1)
        assert await words(where, 1, Block(0x1005, 1))
        assert await words(where, 1, Block(0xE010, 5)) == [0, 0, 0, 0, 0]
        code, _, errors = await pogon("inject", "m9", "OC", "--tcp", where)
        assert code == 2 and "no equipment m9, expected one of m1, m2" in errors
        code, _, errors = await pogon("inject", "m1", "fire", "--tcp", where)
        assert code == 2 and "expected one of OC" in errors


@pytest.mark.parametrize(
    "head", [{}, {0xE000: 0, 0xE001: 1, 0xE002: 1, 0xE003: 1}, {0xE000: 0x5047, 0xE001: 0, 0xE002: 1, 0xE003: 1}]
)
async def test_a_real_drive_is_never_written_to(head: dict[int, int]) -> None:
    device = RegisterDevice(head | {0xE010: 0, 0xE011: 0})
    served = await serve_tcp(Bus({1: device}), "127.0.0.1", 0)
    code, _, errors = await pogon("inject", "m1", "cable", "--tcp", "{}:{}".format(*served.address))
    assert code == 2 and "real device, nothing was written" in errors
    assert device.writes == []
    await served.close()


async def test_a_plant_inside_the_server_is_reached_only_when_it_is_served() -> None:
    code, _, errors = await pogon("inject", "m1", "OC", "--plant", "plants/demo")
    assert code == 2 and "POGON_SERVE_MODBUS" in errors


async def test_a_drive_that_does_not_answer_is_not_written_to(tmp_path: Path) -> None:
    served = await serve_tcp(Bus({}), "127.0.0.1", 0)
    code, _, errors = await pogon("inject", "m1", "OC", "--tcp", "{}:{}".format(*served.address))
    assert code == 1 and "no answer" in errors
    await served.close()


@pytest.mark.parametrize(
    ("unit", "pdu", "told"),
    [
        (255, "03 02 00 07", "answers came with unit 255: is that its unit?"),
        (1, "03 04 00 07 00 08", "unit 1: 4 bytes, announced 4: expected 2"),
        (None, "01 03 02 00 07", "bytes came that are no Modbus TCP (01 03 02 00 07): is the port right, and"),
    ],
)
async def test_what_came_over_tcp_and_was_no_answer_is_told(unit: int | None, pdu: str, told: str) -> None:
    """All of them were `nothing answers`: a device that names one unit whatever it is asked, too."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(asyncio.IncompleteReadError):
            while head := await reader.readexactly(12):
                answer = bytes.fromhex(pdu)
                mbap = b"" if unit is None else head[:4] + (len(answer) + 1).to_bytes(2, "big") + bytes([unit])
                writer.write(mbap + answer)
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    where = f"127.0.0.1:{server.sockets[0].getsockname()[1]}"
    code, _, errors = await pogon("probe", "--tcp", where, "--unit", "1-2")
    assert code == 1
    assert errors.splitlines()[-1].startswith(f"pogon: nothing answers at {where}, units 1 to 2; {told}")
    server.close()
    await server.wait_closed()
