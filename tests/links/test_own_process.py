"""The plant in a process of its own: what the drives do, and what the screens show, when either side dies, freezes or comes back."""

import asyncio
import os
import signal
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from app.links.contract import Block, Transport
from app.links.rtu import RtuTransport
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from app.plant.loader import read_plant
from app.sim.eura_e800.drive import FORWARD
from app.sim.eura_e800.faults import CE
from app.tags.quality import Origin, is_bad, is_good, origin
from tests.conftest import PogonServer
from tests.links.devices import Line, running, until
from tests.sim.test_simulate_process import simulating

pytestmark = pytest.mark.real_time

START = ("m1", "m2")
BAUD = 57600
WATCHDOG = 3.0
"""F905 of the second drive [s]: longer than a busy machine keeps the server from asking."""
PLANT = """
[plant]
name = {{ en = "Own process" }}
timezone = "Europe/Zagreb"
languages = ["en"]
[areas.drives]
label = {{ en = "Drives" }}
[links.hall]
transport = "{transport}"
{where}
writes = true
[equipment.m1]
type = "eura_e800"
link = "hall"
unit = 1
label = {{ en = "Fan 1" }}
simulation = {{ start = "forward", F905 = 0.0 }}
[equipment.m2]
type = "eura_e800"
link = "hall"
unit = 2
label = {{ en = "Fan 2" }}
simulation = {{ start = "forward", F905 = {watchdog} }}
"""


def plant_at(folder: Path, transport: str, where: str = "") -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "plant.toml").write_text(PLANT.format(transport=transport, where=where, watchdog=WATCHDOG))
    return folder


def where_of(said: dict[str, str]) -> tuple[str, str]:
    """Transport and lines of the plant file for what `pogon simulate` has opened."""
    if "tcp" in said:
        host, _, port = said["tcp"].rpartition(":")
        return "tcp", f'host = "{host}"\nport = {port}\nsimulated = true'
    return "rtu", f'port = "{said["rtu"].split()[0]}"\nbaud = {BAUD}\nparity = "none"\nsimulated = true'


@pytest.fixture(params=["tcp", "rtu"])
async def plant(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[tuple[Path, int]]:
    """A plant folder whose link leads to virtual drives of another process, and the number of that process."""
    opening = ["--tcp", "127.0.0.1:0"] if request.param == "tcp" else ["--pty", "--baud", str(BAUD)]
    async with simulating(str(plant_at(tmp_path / "drives", "memory")), *opening) as (process, said):
        yield plant_at(tmp_path / "plant", *where_of(said)), process.pid


def link_of(folder: Path) -> Link:
    plant, problems = read_plant(folder)
    assert plant is not None, problems
    return plant.links["hall"]


@asynccontextmanager
async def foreign_master(folder: Path) -> AsyncIterator[Transport]:
    link = link_of(folder)
    transport: Transport = TcpTransport(link) if link.transport == "tcp" else RtuTransport(link)
    await transport.connect()
    try:
        yield transport
    finally:
        await transport.close()


async def states(folder: Path) -> tuple[int, int]:
    """Status codes of m1 and m2 as anybody else reads them, without being heard for longer than that."""
    async with foreign_master(folder) as transport:
        words = [await transport.read(unit, Block(0x1005, 1), 0.5) for unit in (1, 2)]
    return words[0][0] & 0xFF, words[1][0] & 0xFF


async def ready(server: PogonServer) -> None:
    """Wait until the server says that its links are up."""

    def asked() -> bool:
        try:
            with urllib.request.urlopen(f"{server.url}/readyz", timeout=2):
                return True
        except urllib.error.HTTPError as answer:
            answer.close()
            return False

    for _ in range(100):
        if await asyncio.to_thread(asked):
            return
        await asyncio.sleep(0.1)
    raise AssertionError(f"not ready within 10 s:\n{server.log()}")


@asynccontextmanager
async def screens(folder: Path) -> AsyncIterator[Line]:
    """What a server would show, in this process."""
    plant, problems = read_plant(folder)
    assert plant is not None, problems
    async with running(list(plant.equipment.values()), link=plant.links["hall"]) as line:
        yield line


def both(line: Line, true: Callable[[int], bool]) -> Callable[[], bool]:
    return lambda: all(true(line.quality(f"{name}.frequency")) for name in START)


async def test_screens_over_a_wire_show_what_the_drives_of_another_process_do(plant: tuple[Path, int]) -> None:
    folder, _ = plant
    async with screens(folder) as line:
        await until(both(line, is_good))
        assert origin(line.quality("m1.frequency")) == Origin.SIMULATED
        assert line.value("m1.status") == line.value("m2.status") == FORWARD
        await line.link.write("m1", "command", 3)
        before = line.value("m1.frequency")
        assert isinstance(before, float)
        await until(lambda: line.value("m1.frequency") < before - 1)  # type: ignore[operator]
        assert line.value("m2.status") == FORWARD


@pytest.mark.slow
async def test_drives_that_freeze_are_bad_on_the_screen_and_come_back_by_themselves(plant: tuple[Path, int]) -> None:
    folder, number = plant
    async with screens(folder) as line:
        await until(both(line, is_good))
        os.kill(number, signal.SIGSTOP)
        assert await until(both(line, is_bad), limit=10) < 2.5
        await asyncio.sleep(3)
        os.kill(number, signal.SIGCONT)
        assert await until(both(line, is_good), limit=15) < 10
        await until(lambda: line.value("m1.status") == FORWARD)


@pytest.mark.slow
async def test_drives_of_a_process_that_dies_are_bad_and_those_of_the_next_one_are_read(tmp_path: Path) -> None:
    drives = plant_at(tmp_path / "drives", "memory")
    async with simulating(str(drives), "--tcp", "127.0.0.1:0") as (first, said):
        folder = plant_at(tmp_path / "plant", *where_of(said))
        async with screens(folder) as line:
            await until(both(line, is_good))
            first.kill()
            assert await until(both(line, is_bad), limit=5) < 1.0
            await asyncio.sleep(1.5)
            async with simulating(str(drives), "--tcp", said["tcp"]):
                assert await until(both(line, is_good), limit=10) < 6.5, "pauses grow to 5 s and no further"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
async def test_without_the_server_one_drive_runs_on_and_the_other_trips_as_its_f905_says(
    plant: tuple[Path, int], number: signal.Signals, pogon_server: Callable[..., PogonServer]
) -> None:
    folder, _ = plant
    first = await asyncio.to_thread(pogon_server, plant=folder)
    await ready(first)
    await asyncio.sleep(1.5)
    if link_of(folder).transport == "tcp":
        assert await states(folder) == (FORWARD, FORWARD), "while the server asks, both run"
    os.kill(first.process.pid, number)
    await asyncio.sleep(WATCHDOG + 2)  # one look only: whoever asks the drive is heard by it
    if number == signal.SIGKILL or link_of(folder).transport == "tcp":
        assert await states(folder) == (FORWARD, CE)
    if number == signal.SIGSTOP:
        os.kill(first.process.pid, signal.SIGCONT)
        await asyncio.sleep(2)
        if link_of(folder).transport == "tcp":
            assert await states(folder) == (FORWARD, CE), "nothing is commanded by coming back"
        first.kill()
        await asyncio.sleep(0.2)
    second = await asyncio.to_thread(pogon_server, plant=folder, data=first.data)
    await ready(second)
    await asyncio.sleep(1)
    second.kill()
    await asyncio.sleep(0.2)
    assert await states(folder) == (FORWARD, CE), "a new server reads and commands nothing"
