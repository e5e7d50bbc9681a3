"""Hold-to-run by a PLC: its end is confirmed while the mode that permits it stays."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

from app import bundled
from app.settings import Settings
from tests.virtual import house, pass_time, until
from tests.web.operating import Operator, runtime_of
from tests.web.people import Staff


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("jogs")


@pytest.fixture(scope="module", params=["demo", "crane"])
def operator(request: pytest.FixtureRequest, folder: Path) -> Iterator[Operator]:
    settings = Settings(plant=bundled(f"plants/{request.param}"), data=folder / request.param)
    with house(settings) as browser:
        ana = Operator(Staff(browser), "ana", ("operator",))
        ana.sit()
        pass_time(3)
        yield ana


def hold(operator: Operator, machine: str, command: str, seconds: float) -> None:
    """Hold a button, then let go of it."""
    staff = operator.staff
    lease = operator.press(f"/equipment/{machine}/hold/{command}").json()["lease"]
    operator.sit()
    headers = {"origin": "http://127.0.0.1:8000"}
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers=headers) as socket:
        socket.send_json({"subscribe": "frame", "rev": 0})
        for counter in range(1, int(seconds / 0.15)):
            socket.send_json({"hold": {"equipment": machine, "lease": lease, "counter": counter}})
            while "hold" not in socket.receive_json():
                pass
            staff.wait(asyncio.sleep, 0.15)
        assert operator.post(f"/equipment/{machine}/release", lease=lease, cause="released").status_code == 204


@pytest.mark.sweep(20)
def test_the_end_of_every_jog_is_confirmed(operator: Operator) -> None:
    runtime = runtime_of(operator.staff.client)
    gate, plant = runtime.gate, runtime.plant
    assert gate is not None and plant is not None
    tried = 0
    for machine, item in plant.equipment.items():
        jogs = [key for key, command in item.type.commands.items() if command.hold and command.hold_bits]
        if not jogs or "select_manual" not in item.type.commands:
            continue
        operator.take(machine)
        assert operator.post(f"/equipment/{machine}/stop", id="stop").status_code in (200, 202)
        assert until(lambda machine=machine: (told := gate.progress(machine)) is None or told.over, 30)
        for jog in jogs[:2]:
            operator.press(f"/equipment/{machine}/command/select_manual", confirmed="1")
            assert until(lambda machine=machine: (told := gate.progress(machine)) is None or told.over, 30)
            if operator.press(f"/equipment/{machine}/hold/{jog}").status_code != 200:
                continue  # something is in the way of this one
            pass_time(3)
            hold(operator, machine, jog, 3)
            assert until(lambda machine=machine: (told := gate.progress(machine)) is not None and told.over, 30)
            told = gate.progress(machine)
            assert told is not None and told.reason == "hold.cause.released", (machine, jog, told.state, told.reason)
            tried += 1
    assert tried >= 2
