"""An instructor pauses the simulated plant or has it run faster: everybody is told, nothing is called a fault, and times stay real."""

import asyncio
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.access.audit.search import Filter
from app.links.plc import PlcUnit
from app.sim.plc import VirtualPlc
from app.tags.quality import is_good
from tests.web.conftest import Start
from tests.web.operating import Operator, line_of, runtime_of, words
from tests.web.people import Staff

PLCS = ("c1", "cc1", "seq1", "cr1")


@pytest.fixture(scope="module")
def people(demo: TestClient) -> Staff:
    return Staff(demo)


@pytest.fixture
def staff(client: TestClient, people: Staff) -> Iterator[Staff]:
    people.enter("ivana", "engineer", "operator")
    client.cookies.set("pogon_lang", "en")
    yield people
    sim = runtime_of(client).sim
    assert sim is not None
    sim.set_speed(1)
    people.wait(asyncio.sleep, 2.0)


def active(client: TestClient) -> set[tuple[str, str]]:
    return {(one.equipment, one.key) for one in runtime_of(client).alarms.list.active()}


def good(client: TestClient, name: str) -> bool:
    tags = runtime_of(client).tags
    return is_good(tags.quality(tags.handle(name)))


def value(client: TestClient, name: str) -> Any:
    tags = runtime_of(client).tags
    return tags.value(tags.handle(name))


def tripped(client: TestClient) -> int:
    drive = runtime_of(client).sim.devices["m2"]  # type: ignore[union-attr]
    return int(drive.fault)  # type: ignore[attr-defined]


async def astray(client: TestClient) -> int:
    """By how much the time of an event that a PLC would have now is wrong [µs], the worst of all."""
    runtime, worst = runtime_of(client), 0
    for id in PLCS:
        item = runtime.plant.equipment[id]  # type: ignore[union-attr]
        unit = runtime.links[item.link].stations[item.unit].service(PlcUnit)
        device = runtime.sim.devices[id]  # type: ignore[union-attr]
        assert unit is not None and isinstance(device, VirtualPlc)
        worst = max(worst, abs(unit.clock.utc(device.time) - runtime.clock.micros()))
    return worst


@pytest.mark.sweep(8)
def test_a_pause_is_told_as_a_pause_and_not_as_a_fault(staff: Staff) -> None:
    client, runtime = staff.client, runtime_of(staff.client)
    assert runtime.sim is not None
    staff.wait(asyncio.sleep, 3.0)
    before = active(client)
    assert staff.post("/simulation/speed", {"speed": "0"}).headers["location"] == "/instructor?done=speed"
    steps = runtime.sim.steps
    staff.wait(asyncio.sleep, 8.0)
    assert runtime.sim.steps == steps
    assert not {found for found in active(client) - before if found[1] in ("program_halted", "link_down")}
    assert not [id for id in PLCS if runtime.links[runtime.plant.equipment[id].link].halted(id)]  # type: ignore[union-attr]
    assert good(client, "c1.state") and good(client, "m1.speed"), "what the paused plant shows is what it is"
    assert runtime.tags.age(runtime.tags.handle("m1.speed")) < 2.0, "it is still read"
    assert "SIMULATION PAUSED" in client.get("/equipment/m1").text
    assert "SIMULATION PAUSED" in client.get("/simulation").text
    assert staff.post("/simulation/speed", {"speed": "1"}).status_code == 303
    staff.wait(asyncio.sleep, 3.0)
    assert runtime.sim.steps > steps + 250
    assert not {found for found in active(client) - before if found[1] in ("program_halted", "link_down")}
    assert "PAUSED" not in client.get("/equipment/m1").text
    assert tripped(client) == 0, "its watchdog did not count the pause"


@pytest.mark.sweep(8)
def test_commands_to_a_paused_machine_are_refused_with_that_reason(staff: Staff) -> None:
    operator = Operator(staff, "marko", ("operator",))
    operator.take("m1")
    staff.enter("ivana", "engineer", "operator")
    staff.post("/simulation/speed", {"speed": "0"})
    answer = operator.press("/equipment/m1/command/forward")
    assert answer.status_code == 409 and "The simulation is paused" in line_of(answer)
    assert "The simulation is paused" in words(operator.get("/equipment/m1").text)
    staff.enter("ivana", "engineer", "operator")
    staff.client.cookies.set("pogon_lang", "en")
    fault = staff.post("/instructor/m1/fault", {"code": "13"})
    assert fault.status_code == 409 and "The simulation is paused" in fault.text


@pytest.mark.sweep(8)
def test_a_faster_plant_keeps_its_links_and_the_times_of_the_server(staff: Staff) -> None:
    client, runtime = staff.client, runtime_of(staff.client)
    assert runtime.sim is not None
    staff.post("/simulation/speed", {"speed": "10"})
    steps = runtime.sim.steps
    staff.wait(asyncio.sleep, 12.0)
    assert runtime.sim.steps - steps == pytest.approx(12_000, rel=0.05)
    assert tripped(client) == 0, "1 s without a telegram is 1 s of the server's"
    assert (value(client, "sys.sim_speed"), value(client, "sys.sim_pace")) == (10, 10.0)
    page = words(client.get("/").text)
    assert "SIMULATION 10×" in page
    assert staff.wait(astray, client) < 200_000
    staff.post("/simulation/speed", {"speed": "0"})
    staff.wait(asyncio.sleep, 5.0)
    assert staff.wait(astray, client) < 200_000
    staff.post("/simulation/speed", {"speed": "1"})
    staff.wait(asyncio.sleep, 0.05)
    assert staff.wait(astray, client) < 200_000, "what happens right after a pause is not told as before it"


@pytest.mark.sweep(8)
def test_who_may_and_what_is_noted(staff: Staff) -> None:
    assert staff.post("/simulation/speed", {"speed": "3"}).status_code == 422
    assert (
        staff.post("/simulation/speed", {"speed": "5", "back": "m1"}).headers["location"] == "/instructor/m1?done=speed"
    )
    first, second = [
        line for line in staff.wait(staff.access.audit.find, Filter(), 50) if line.kind == "instructor.speed"
    ][:2]
    assert (first.person, first.object, first.old, first.new, first.result) == ("ivana", "simulation", "1", "5", "ok")
    assert (second.new, second.result, second.reason) == ("3", "refused", "instructor.wrong_speed")
    for role in ("operator", "viewer"):
        staff.enter(f"one-{role}", role)
        assert staff.post("/simulation/speed", {"speed": "0"}).status_code == 403
    assert runtime_of(staff.client).sim.speed == 5  # type: ignore[union-attr]


def test_live_links_are_offered_no_speed(start: Start, tmp_path: Path) -> None:
    folder = tmp_path / "plant"
    shutil.copytree(bundled("plants/demo"), folder)
    text = (folder / "plant.toml").read_text("utf-8").replace('"memory"', '"tcp"\nhost = "192.0.2.1"')
    (folder / "plant.toml").write_text(text, "utf-8")
    staff = Staff(start(folder))
    staff.enter("ivana", "engineer")
    staff.client.cookies.set("pogon_lang", "en")
    page = staff.client.get("/instructor").text
    assert 'name="speed"' not in page and "sys.sim_speed" not in page
    refused = staff.post("/simulation/speed", {"speed": "0"})
    assert refused.status_code == 409 and "simulates no machine" in refused.text
