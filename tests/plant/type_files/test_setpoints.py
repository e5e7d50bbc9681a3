"""setpoints.toml: parameters that are points too, written where the device takes them."""

from pathlib import Path

import pytest

from app.plant.definitions import Scan
from tests.plant.line import machine, problem

MISTAKES = [
    ("setpoints", "low = 5", 'low = "spead - 1"', "speed.low", "it has no spead"),
    ("setpoints", "low = 5", "low = true", "speed.low", "a number or an expression"),
    ("setpoints", "high = 100", "high = [1]", "speed.high", "a number or an expression"),
    ("setpoints", 'role = "operator"', 'role = "boss"', "delay.role", "viewer, operator, engineer, admin"),
    ("setpoints", "[delay]", "[dilay]", "dilay.address", "an address, or a key of points.toml"),
    ("setpoints", "low = 5", "lowest = 5", "speed.lowest", "no such key"),
    ("setpoints", "[delay]", '[delay]\nnormal = ["0.5 * length", 9]', "delay.normal", "a number"),
]


def test_setpoints_of_the_settings_image_can_be_written(tmp_path: Path) -> None:
    points = machine(tmp_path).points
    for key in ("speed", "delay"):
        register = points[key].register
        assert register
        assert register.writable, key
    register = points["count"].register
    assert register
    assert not register.writable


@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    found = problem(tmp_path, file, old, new)
    assert found.key == key
    assert expected in found.expected


def test_a_setpoint_with_an_address_is_a_point_that_is_read_once_and_written(tmp_path: Path) -> None:
    item = machine(tmp_path)
    speed, delay = item.points["speed"], item.points["delay"]
    assert (speed.scan, speed.low, speed.high, speed.history) == (Scan.ONCE, 5.0, 100.0, False)
    assert speed.register and speed.register.address == 0x0202
    assert delay.register and delay.register.address == 0x0204, "it is that of points.toml"
    assert [item.type.setpoints[key].role for key in ("speed", "delay")] == ["engineer", "operator"]
