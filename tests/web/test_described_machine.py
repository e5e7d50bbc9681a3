"""Machines whose types describe them (`simulation.toml`): seen, commanded and broken over every carrier, as ours are."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.plant.loader import read_plant
from app.settings import Settings
from app.sim.plant import SimPlant
from app.sim.server import SerialServer, TcpServer, serve_tcp
from app.tags.quality import is_bad
from tests.own_types import write_own
from tests.virtual import VirtualClient, house, loop_clock
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import Staff
from tests.wires import SerialLine, sim_server

CARRIERS = ("memory", "tcp", "rtu")
PORT = 1502
FIRST = ("v1.closed", "e1.state", "w1.weight", "w2.weight", "w3.weight", "p1.state_3", "l1.flow")
"""A point of every machine."""


class Elsewhere:
    """The machines of a plant in a process of their own, as it were: behind a port or a serial line."""

    def __init__(self, folder: Path, line: SerialLine | None) -> None:
        plant, problems = read_plant(folder)
        assert plant, problems
        self._plant, self._line = plant, line

    async def open(self) -> None:
        machines = SimPlant(self._plant, loop_clock())
        self._running = asyncio.create_task(machines.run())
        self._server: TcpServer | SerialServer
        if self._line is None:
            self._server = await serve_tcp(machines.merged(), "127.0.0.1", PORT)
            return
        opened = sim_server._Line(self._line.ours.fileno(), self._line.close)
        self._server = SerialServer(machines.merged(), lambda: opened, self._line.path, 115200, paced=True)
        await self._server.start()

    async def close(self) -> None:
        self._running.cancel()
        await self._server.close()


@pytest.fixture(params=CARRIERS)
def client(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[VirtualClient]:
    """A browser at the plant of five types, over a carrier."""
    line = SerialLine() if request.param == "rtu" else None
    folder = write_own(tmp_path / "plant", request.param, line.path if line else PORT)
    with house(Settings(plant=folder, data=tmp_path / "data")) as browser:
        elsewhere = Elsewhere(folder, line) if request.param != "memory" else None
        if elsewhere:
            browser.run(elsewhere.open())
        assert runtime_of(browser).problems == []
        assert until(lambda: all(value(browser, one) is not None for one in FIRST), 30)
        yield browser
        if elsewhere:
            browser.run(elsewhere.close())


def value(client: VirtualClient, name: str) -> object:
    return runtime_of(client).tags.sample(name).value


@pytest.mark.sweep(8)
def test_commands_are_confirmed_by_what_the_machine_says(client: VirtualClient) -> None:
    ana = Operator(Staff(client), "ana", ("engineer", "operator"))
    assert until(lambda: value(client, "v1.closed") == 1, 10)
    assert (value(client, "v1.opened"), value(client, "v1.position")) == (0, 0)
    for machine, command, point, wanted in (
        ("v1", "open", "v1.opened", 1),
        ("e1", "on", "e1.state", 1),
        ("p1", "start_3", "p1.state_3", 2),
        ("w2", "zero", "w2.zeroed", 1),
        ("w2", "damp", "w2.damping", 9),
    ):
        ana.take(machine)
        ana.press(f"/equipment/{machine}/command/{command}")
        assert until(lambda point=point, wanted=wanted: value(client, point) == wanted, 10), point  # type: ignore[misc]
        client.pass_time(1)
        assert "Done" in words(ana.get(f"/equipment/{machine}/commands").text), machine
    assert value(client, "w2.turns") == 5, "the other bits of the register are the machine's"
    assert (value(client, "w1.damping"), value(client, "w3.damping")) == (2, 2)
    assert value(client, "w1.zeroed") == value(client, "w3.zeroed") == 0, (
        "of its own unit's machines only one was zeroed"
    )
    assert "Done" in line_of(ana.post("/equipment/e1/stop")) or until(lambda: value(client, "e1.state") == 0, 5)


@pytest.mark.sweep(8)
def test_values_move_as_the_file_says(client: VirtualClient) -> None:
    assert until(lambda: value(client, "l1.flow") == 3, 10)
    assert value(client, "l1.temperature") == -12.5
    assert value(client, "w1.name") == "W-1"
    assert until(lambda: value(client, "w3.weight") == 12.5 and value(client, "w3.stable") == 1, 10)
    before = value(client, "e1.life")
    client.pass_time(2)
    assert value(client, "e1.life") != before
    assert value(client, "e1.energy") == 12000


@pytest.mark.sweep(8)
def test_an_instructor_breaks_its_line_and_causes_its_fault(client: VirtualClient) -> None:
    ana = Operator(Staff(client), "ana", ("engineer", "operator"))
    ana.take("e1")
    ana.press("/equipment/e1/command/on")
    assert until(lambda: value(client, "e1.state") == 1, 5)
    page = ana.get("/instructor/e1", fragment=False)
    assert page.status_code == 200 and "Fuse" in page.text
    assert ana.post("/instructor/e1/fault", fragment=False, code="7").status_code == 303
    assert until(lambda: value(client, "e1.state") == 0, 5)
    ana.press("/equipment/e1/command/on")
    assert until(
        lambda: "The device refused (exception 4): device failure" in words(ana.get("/equipment/e1/commands").text), 5
    )
    # one unit is one device: the line of w2 is that of w1, and of no other unit
    told = {"mode": "1", "delay": "0", "argument": "0", "count": "0"}
    assert ana.post("/instructor/w2/line", fragment=False, **told).status_code == 303
    assert until(lambda: is_bad(runtime_of(client).tags.sample("w1.weight").quality), 10)
    assert not is_bad(runtime_of(client).tags.sample("e1.power").quality)
    assert ana.post("/instructor/w1/reset", fragment=False).status_code == 303
    assert until(lambda: value(client, "w1.weight") == 12.5, 30)


def test_what_a_type_has_not_is_not_offered_to_the_instructor(tmp_path: Path) -> None:
    folder = write_own(tmp_path / "plant")
    with house(Settings(plant=folder, data=tmp_path / "data")) as browser:
        ana = Operator(Staff(browser), "ana", ("engineer", "operator"))
        assert until(lambda: value(browser, "l1.flow") is not None)
        page = ana.get("/instructor/l1", fragment=False).text
        assert "/instructor/l1/line" in page and "/instructor/l1/reset" in page
        assert "/instructor/l1/fault" not in page and "/instructor/l1/world" not in page
        assert ana.post("/instructor/l1/world", fragment=False).status_code == 404
        assert "/instructor/e1/fault" in ana.get("/instructor/e1", fragment=False).text
