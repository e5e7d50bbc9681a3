"""The ROM of virtual drives as it is kept on a disk: only what was saved, only for a drive that was commissioned like that."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from app.sim.device import Permanent
from app.sim.epos.drive import VirtualPositioningAxis
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.mailbox_stand import PARAMETERS, powered

BUILD: dict[str, Callable[[], Any]] = {
    "drive": powered,
    "running": lambda: VirtualSinamics(behind_mailbox=PARAMETERS, positioning=True, start="forward", setpoint=40),
    "axis": lambda: VirtualPositioningAxis(behind_mailbox=PARAMETERS),
    "moving": lambda: VirtualPositioningAxis(behind_mailbox=PARAMETERS, start="blocks"),
}


def saved(device: Any, **values: float) -> dict[str, Any]:
    """Its memory after these values were written and saved."""
    for code, value in values.items():
        (device._value if code in device._value else device.model._ram)[code] = (
            value if code in device._value else [value]
        )
    device.model._saving = 0.5
    for _ in range(60):
        device.model.step(device.dt)
    memory: dict[str, Any] = json.loads(json.dumps(device.memory()))
    return memory


@pytest.mark.parametrize("kind", BUILD)
def test_what_was_saved_is_there_in_the_next_run_and_what_was_not_is_not(kind: str) -> None:
    first, second = BUILD[kind](), BUILD[kind]()
    assert isinstance(first, Permanent) and first.memory() == {}
    before = first.written
    memory = saved(first, p2585=-450.0, p2507=3.0, p2525=777.0, p1226=31.0)
    assert first.written != before
    first.model._ram["p1058"] = [99.0]  # in RAM alone
    assert second.remember(memory)
    for code, value in (("p2585", -450), ("p2507", 3), ("p2525", 777), ("p1226", 31)):
        assert second.model.values(code) == [value], code
    assert second.model.values("p1058") != [99.0]
    assert second.memory() == memory  # and a third run has it from the second one
    assert second.machine.pulses is first.machine.pulses  # it runs where it is to run from the beginning
    for _ in range(50):
        second.step()


def test_a_drive_that_the_plant_file_commissions_otherwise_begins_as_that_says() -> None:
    memory = saved(powered(), p2585=-450.0)
    other = VirtualSinamics(behind_mailbox=PARAMETERS, positioning=True, parameters={"p1120": 3})
    assert not other.remember(memory) and other.model.values("p2585") == [-300] and other.memory() == {}


@pytest.mark.parametrize(
    "spoil",
    [
        lambda memory: {},
        lambda memory: {"saved": memory["saved"]},
        lambda memory: {**memory, "saved": {**memory["saved"], "p2585": [5e9]}},
        lambda memory: {**memory, "saved": {**memory["saved"], "p2585": ["x"]}},
        lambda memory: {**memory, "saved": {**memory["saved"], "p0757": [1.0]}},
        lambda memory: {**memory, "saved": {**memory["saved"], "p2585": float("nan")}},
    ],
)
def test_a_memory_that_is_none_changes_nothing(spoil: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    memory, drive = saved(powered(), p2585=-450.0), powered()
    assert not drive.remember(spoil(memory)) and drive.model.values("p2585") == [-300]


def test_a_parameter_that_this_version_does_not_know_is_left_out() -> None:
    memory = saved(powered(), p2585=-450.0)
    memory["saved"]["p9999"] = memory["commissioned"]["p9999"] = [1.0]
    drive = powered()
    assert drive.remember(memory) and drive.model.values("p2585") == [-450]


def test_the_initial_state_forgets_it() -> None:
    drive = powered()
    assert drive.remember(saved(powered(), p2585=-450.0))
    drive._to_initial_state()
    assert drive.memory() == {} and drive.model.values("p2585") == [-300]
