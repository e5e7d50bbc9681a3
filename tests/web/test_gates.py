"""Diverting gates of a PLC behind Modbus TCP: commanded and read back, products in their lanes, alarms; a PLC of an older map has none."""

import asyncio
import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from app.alarms.lifecycle import AlarmState
from app.blocks.product_tracking import GatePosition
from app.registers import plc_map
from app.settings import Settings
from app.sim import training
from app.sim.bus import Bus
from app.sim.conveyor.blades import GATE_FAULTS, GatePlan, Rule
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.server import serve_tcp
from tests.sim.conveyor.bench import QUICK
from tests.virtual import VirtualClient, house
from tests.web.operating import Operator, line_of, runtime_of, until
from tests.web.people import Staff

PORT = 5031
GATES = (GatePlan(270.0, Rule.ALTERNATING), GatePlan(500.0, Rule.HAND))
PLANT = f"""
[plant]
name = {{ en = "Hall" }}
timezone = "Europe/Zagreb"
languages = ["en"]

[links.line]
transport = "tcp"
host = "127.0.0.1"
port = {PORT}
simulated = true
writes = true

[equipment.c1]
type = "conveyor"
link = "line"
unit = 1
label = {{ en = "Conveyor 1" }}
"""
WITH_GATES = f"{PLANT}gates = 2\ngate_1_at = 270\ngate_2_at = 500\ngate_2_rule = 0\n"


class Hall:
    """A Pogon, the PLC that it hears over TCP, and somebody who operates it."""

    def __init__(self, client: VirtualClient, device: VirtualConveyor) -> None:
        self.client, self.device = client, device
        self.runtime = runtime_of(client)
        self.ivo = Operator(Staff(client), "ivo", ("engineer", "operator"))

    def value(self, key: str) -> Any:
        return self.runtime.tags.sample(f"c1.{key}").value

    def press(self, command: str) -> Any:
        return self.ivo.press(f"/equipment/c1/command/{command}", confirmed="1")

    def over(self) -> bool:
        """What was commanded last has come to its end."""
        assert self.runtime.gate is not None
        return until(lambda: (told := self.runtime.gate.progress("c1")) is None or told.over, 15)  # type: ignore[union-attr]

    def do(self, command: str) -> None:
        answer = self.press(command)
        assert answer.status_code == 202, line_of(answer)
        assert self.over()

    def alarms(self) -> set[str]:
        """Those whose condition is there."""
        return {one.key for one in self.runtime.alarms.list.active() if one.state is not AlarmState.RETURNED}

    def page(self, path: str = "") -> str:
        return unescape(self.ivo.get(f"/equipment/c1{path}", fragment=False).text)


@contextmanager
def hall(folder: Path, plant: str, device: VirtualConveyor) -> Iterator[Hall]:
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(plant, "utf-8")

    async def scan() -> None:
        while True:
            device.step()
            await asyncio.sleep(0.01)

    with house(Settings(plant=folder / "plant", data=folder / "data")) as client:
        server = client.run(serve_tcp(Bus({1: device}), "127.0.0.1", PORT))
        scans = client.loop.create_task(scan())
        here = Hall(client, device)
        assert until(lambda: here.value("state") is not None, 30)
        client.pass_time(3)
        yield here
        scans.cancel()
        client.run(server.close())


@pytest.mark.sweep(8)
def test_a_gate_goes_where_it_is_commanded_and_says_so_itself(tmp_path: Path) -> None:
    device = VirtualConveyor(Geometry(gates=GATES), start="automatic", arrivals=False, settings=QUICK)
    with hall(tmp_path, WITH_GATES, device) as here:
        assert here.value("configuration_differs") == 0 and here.value("device_gates") == 2
        here.ivo.take("c1")
        refused = here.press("gate_lane_1")
        assert "Gate 1 is turned by its rule" in line_of(refused), line_of(refused)
        assert device.gates.wanted == [False, False], "nothing was sent"
        here.do("gate_lane_2")
        assert until(lambda: here.value("gate_position_2") == 1, 5), "whose rule is by hand, that goes in automatic too"
        here.do("stop")
        here.do("select_manual")
        here.do("gate_lane_1")
        assert (here.value("gate_position_1"), here.value("gate_target_1")) == (1, 1)
        assert device.gates.positions == [GatePosition.LANE, GatePosition.LANE]
        here.do("gate_straight_1")
        assert here.value("gate_position_1") == 0 and device.machine.blades.open == [0.0, 1.0]
        assert 'class="c-gate straight"' in here.page() and 'class="c-gate lane"' in here.page()
        audit = here.ivo.get("/audit?object=c1", fragment=False).text
        assert audit.count("Gate 1 straight") + audit.count("gate_straight_1") >= 1
        viewer = Operator(here.ivo.staff, "vera", ("viewer",))
        assert viewer.post("/equipment/c1/command/gate_lane_1", id="1", nonce="1").status_code == 403
        assert device.gates.positions[0] is GatePosition.STRAIGHT


@pytest.mark.sweep(8)
def test_a_diverted_product_is_counted_and_its_passage_ends_so(tmp_path: Path) -> None:
    device = VirtualConveyor(Geometry(gates=GATES), start="automatic", interval=4.0, settings=QUICK)
    with hall(tmp_path, WITH_GATES, device) as here:
        assert until(lambda: here.value("diverted_1") == 1, 60)
        assert until(lambda: here.value("unloaded") == 1, 60)
        assert (here.value("misrouted_1"), here.value("lost")) == (0, 0)
        here.client.pass_time(3)
        sheet = here.ivo.get("/records/passage/export.csv?equipment=c1&locale=machine", fragment=False).text
        assert {"diverted", "unloaded"} <= set(re.findall(r"\b(diverted|unloaded)\b", sheet)), sheet
        assert "Product diverted" in here.page("/events")
        assert "gate_1" not in here.alarms() and "misrouted_1" not in here.alarms()


@pytest.mark.sweep(8)
def test_a_gate_whose_feedback_is_lost_is_told_and_holds_the_products_until_it_is_back(tmp_path: Path) -> None:
    device = VirtualConveyor(Geometry(gates=GATES), start="automatic", interval=4.0, settings=QUICK)
    with hall(tmp_path, WITH_GATES, device) as here:
        device.write(16, training.REG_MACHINE_FAULT, [GATE_FAULTS + 1])
        device.machine.blades.open[0] = 0.5
        assert until(lambda: "gate_1" in here.alarms(), 60)
        assert (here.value("gate_position_1"), here.value("gate_fault_1")) == (2, 1)
        assert until(lambda: here.value("gate_waiting_1") == 1, 30) and here.value("speed_source_1") == 6
        here.client.pass_time(10)
        assert here.value("diverted_1") == here.value("unloaded") == 0, (
            "nobody goes through a gate that stands anywhere"
        )
        assert "Gate 1: did not arrive" in here.page()
        device.write(16, training.REG_MACHINE_FAULT, [0])
        assert until(lambda: "gate_1" not in here.alarms(), 30)
        assert until(lambda: here.value("diverted_1") and here.value("unloaded"), 60)
        assert here.value("lost") == here.value("unexpected") == 0


@pytest.fixture
def before(monkeypatch: pytest.MonkeyPatch) -> None:
    """PLCs serve map 1.4."""
    monkeypatch.setattr(plc_map, "MINOR", 4)


@pytest.mark.sweep(8)
@pytest.mark.usefixtures("before")
def test_a_plc_of_map_1_4_goes_on_working_without_gates(tmp_path: Path) -> None:
    device = VirtualConveyor(start="automatic", interval=4.0, settings=QUICK)
    with hall(tmp_path, PLANT, device) as here:
        assert until(lambda: here.value("unloaded") == 1, 60)
        assert here.value("configuration_differs") == 0
        page = here.page()
        assert "c-gate" not in page and "gate_lane" not in page
        here.ivo.take("c1")
        here.do("stop")


@pytest.mark.sweep(8)
@pytest.mark.usefixtures("before")
def test_a_plc_of_map_1_4_behind_a_plant_file_with_gates_works_and_its_gates_are_not_known(tmp_path: Path) -> None:
    device = VirtualConveyor(start="automatic", interval=4.0, settings=QUICK)
    with hall(tmp_path, WITH_GATES, device) as here:
        assert until(lambda: here.value("unloaded") == 1, 60)
        assert here.value("configuration_differs") == 1, "it has none"
        assert here.value("gate_position_1") is None and not here.alarms() & {"gate_1", "gate_2"}
        page = here.page()
        assert 'class="c-gate unknown"' in page and 'class="c-gate lane"' not in page
        here.ivo.take("c1")
        here.do("stop")
        assert here.press("gate_lane_2").status_code != 202 or here.over()
        assert here.value("gate_position_2") is None
