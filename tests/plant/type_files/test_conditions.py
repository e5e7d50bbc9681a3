"""`checks.toml`: what must hold between the setpoints of a type; a mistake in it is told with its place."""

from pathlib import Path

import pytest

from app import bundled
from app.plant import expression
from app.plant.loader import read_plant
from app.plant.problems import Problem
from tests.plant.line import PLANT, write_type


def problems(folder: Path, checks: str) -> list[Problem]:
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(PLANT, "utf-8")
    types = write_type(folder)
    (types / "line" / "checks.toml").write_text(checks, "utf-8")
    return list(read_plant(folder / "plant", type_folder=types)[1])


WRONG = [
    ('[a]\nlabel = "type"\nexpression = "speed <="', "a.expression"),
    ('[a]\nlabel = "type"\nexpression = "speed <= nothing"', "a.expression"),
    ('[a]\nlabel = "type"\nexpression = "state == 1"', "a.expression"),
    ('[a]\nlabel = "type"\nexpression = "speed <= argument"', "a.expression"),
    ('[a]\nlabel = "type"\nexpression = "speed <= 50"\ncommands = ["start"]', "a.commands"),
    ('[a]\nlabel = "type"\nexpression = "speed <= 50"\nmore = 1', "a.more"),
    ('[a]\nlabel = "type"', "a.expression"),
]


@pytest.mark.parametrize(("checks", "place"), WRONG)
def test_a_mistake_is_told_with_its_place(tmp_path: Path, checks: str, place: str) -> None:
    found = problems(tmp_path, checks)
    assert [one.key for one in found if one.file.endswith("checks.toml")] == [place], found


def test_a_check_over_setpoints_is_read(tmp_path: Path) -> None:
    assert problems(tmp_path, '[a]\nlabel = "type"\nexpression = "speed <= 50"') == []


@pytest.mark.parametrize("name", ["eura_e800", "conveyor", "coil_car"])
def test_what_a_machine_begins_with_meets_its_checks(name: str) -> None:
    plant, _ = read_plant(bundled("plants/demo"))
    assert plant is not None
    kind = plant.types[name]
    begin = {key: one.default for key, one in kind.setpoints.items() if one.default is not None}
    begin = {"frequency_setpoint": 50.0, "f111": 50.0, "f112": 0.5} | begin if name == "eura_e800" else begin
    assert kind.checks
    for check in kind.checks:
        assert expression.parse(check.expression).true(begin) is True, check
