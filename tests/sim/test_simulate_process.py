"""`pogon simulate` as a process of its own, seen by a foreign master."""

import asyncio
import os
import signal
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.pdu import ExceptionResponse

pytestmark = pytest.mark.real_time
ROOT = Path(__file__).resolve().parents[2]
PLANT = """
[plant]
name = { en = "Test" }
timezone = "UTC"
languages = ["en"]
[areas.drives]
label = { en = "Drives" }
[links.hall]
transport = "memory"
[links.yard]
transport = "memory"
baud = 57600
[equipment.m1]
type = "eura_e800"
link = "hall"
unit = 1
label = { en = "One" }
[equipment.m2]
type = "eura_e800"
link = "yard"
unit = 1
label = { en = "Two" }
simulation = { start = "reverse", F905 = 0.5 }
"""


@asynccontextmanager
async def simulating(*arguments: str) -> AsyncIterator[tuple[Process, dict[str, str]]]:
    """The process once it is ready, and what it said by first word."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "app.cli", "simulate", *arguments, cwd=ROOT, stdout=PIPE, stderr=PIPE
    )
    assert process.stdout is not None
    try:
        said = {}
        async with asyncio.timeout(90):
            while (line := (await process.stdout.readline()).decode().strip()) != "ready":
                assert line, (await process.communicate())[1].decode()
                word, _, rest = line.rpartition(" ") if line.startswith("unit") else line.partition(" ")
                said[word] = rest
        yield process, said
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
        process._transport.close()  # type: ignore[attr-defined]


async def stop(process: Process, number: int) -> None:
    process.send_signal(number)
    async with asyncio.timeout(30):
        output, errors = await process.communicate()
    assert (process.returncode, output, errors) == (0, b"", b"")


async def refused(*arguments: str) -> str:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "app.cli", "simulate", *arguments, cwd=ROOT, stdout=PIPE, stderr=PIPE
    )
    async with asyncio.timeout(90):
        _, errors = await process.communicate()
    assert process.returncode == 2
    return errors.decode()


async def test_the_demo_plant_over_tcp_is_moving_and_obeys_a_foreign_master() -> None:
    async with simulating("plants/demo", "--tcp", "127.0.0.1:0") as (process, said):
        assert said["unit 1 m1"] == said["unit 2 m2"] == "eura_e800"
        host, _, port = said["tcp"].partition(":")
        client = AsyncModbusTcpClient(host, port=int(port), timeout=1, retries=0)
        assert await client.connect()
        words = (await client.read_holding_registers(0x1000, count=25, device_id=1)).registers
        assert words[0] > 1000 and words[5] & 0xFF == 1, "the first drive runs forward from the start"
        assert not (await client.write_register(0x2000, 3, device_id=1)).isError()
        await asyncio.sleep(0.5)
        slower = (await client.read_holding_registers(0x1000, count=25, device_id=1)).registers
        assert slower[0] < words[0]
        answer = await client.read_input_registers(0x1000, count=1, device_id=1)
        assert isinstance(answer, ExceptionResponse) and answer.exception_code == 1
        answer = await client.write_registers(0x2000, [1], device_id=1)
        assert isinstance(answer, ExceptionResponse) and answer.exception_code == 1
        client.close()
        await stop(process, signal.SIGTERM)


async def test_one_link_over_a_pseudo_terminal_at_its_own_speed(tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(PLANT)
    async with simulating(str(tmp_path), "--pty", "--link", "yard") as (process, said):
        path, baud, *rest = said["rtu"].split()
        assert (baud, rest) == ("57600", ["baud", "parity", "none"])
        client = AsyncModbusSerialClient(path, baudrate=57600, parity="N", timeout=1, retries=0)
        assert await client.connect()
        answer = await client.read_holding_registers(0x1000, count=25, device_id=1)
        assert answer.registers[5] & 0xFF == 2
        # a plant that stood still goes on afterwards: it gives the time up and does not jump
        os.kill(process.pid, signal.SIGSTOP)
        await asyncio.sleep(0.7)
        os.kill(process.pid, signal.SIGCONT)
        answer = await client.read_holding_registers(0x1005, count=1, device_id=1)
        assert answer.registers[0] & 0xFF == 2
        await asyncio.sleep(1.0)
        answer = await client.read_holding_registers(0x1005, count=1, device_id=1)
        assert answer.registers[0] & 0xFF == 0x1A, "nobody asked for longer than F905"
        client.close()
        await stop(process, signal.SIGINT)


async def test_what_cannot_be_simulated_ends_with_every_reason(tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(PLANT)
    told = await refused(str(tmp_path), "--tcp", "127.0.0.1:0")
    assert "unit 1 is m1 on link hall and m2 on link yard" in told and "one link of them" in told
    (tmp_path / "plant.toml").write_text(PLANT.replace('"yard"\nunit', '"cellar"\nunit').replace('"UTC"', '"Nowhere"'))
    told = await refused(str(tmp_path), "--pty")
    assert "cellar" in told and "Nowhere" in told


@pytest.mark.parametrize("address", ["5020", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:65536"])
async def test_an_address_that_is_none_is_told(address: str) -> None:
    assert f"--tcp {address}: expected HOST:PORT" in await refused("plants/demo", "--tcp", address)
