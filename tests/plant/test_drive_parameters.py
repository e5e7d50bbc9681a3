"""parameters.toml is read row by row, and what cannot be is told by file, code and key."""

from pathlib import Path

import pytest

from app.plant.drive_parameters import read_parameters, text_keys
from app.plant.tables import Source
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.parameter import DriveParameter, When

GOOD = 'p1120 = { group = "ramp", type = "f32", low = 0, high = 650, default = 5, certainty = "M" }\n'
REST = 'group = "x", type = "u16", certainty = "G"'


def found(folder: Path, text: str) -> tuple[dict[str, DriveParameter], list[str]]:
    (folder / "parameters.toml").write_text(text)
    source = Source(folder / "parameters.toml", "parameters.toml")
    parameters = read_parameters(source.table())
    return parameters, [f"{problem.key}: {problem.value}, expected {problem.expected}" for problem in source.problems]


def test_a_row_is_a_parameter(tmp_path: Path) -> None:
    text = GOOD.replace(
        "default", 'unit = "s", objects = [1, 2], when = "stopped", count = 3, allowed = [0, 5], default'
    )
    parameters, problems = found(tmp_path, text + f"r0945 = {{ count = 64, {REST} }}\n")
    assert problems == []
    assert parameters["p1120"] == DriveParameter(
        1120, True, Format.FLOAT32, "ramp", (1, 2), 3, "s", 0, 650, 5, (0, 5), When.STOPPED, "M"
    )
    assert parameters["r0945"] == DriveParameter(945, False, Format.UNSIGNED16, "x", count=64)
    assert [one.elements for one in parameters.values()] == [3, 64] and parameters["r0945"].code == "r0945"
    assert list(text_keys(parameters)) == [
        "parameter.p1120", "parameter.group.ramp", "parameter.r0945", "parameter.group.x",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (GOOD + f"r1120 = {{ {REST} }}", "a number that p1120 does not have"),
        (f"x1120 = {{ {REST} }}", "p or r and a number"),
        (f"r0000 = {{ {REST} }}", "p or r and a number"),
        (f"r01120 = {{ {REST} }}", "p or r and a number"),
        (f"r99999 = {{ {REST} }}", "p or r and a number"),
        (GOOD.replace("650", "-1"), "p1120.high"),
        (GOOD.replace("= 5", "= 651"), "p1120.default: 651"),
        (GOOD.replace("f32", "i8"), "p1120.high: 650"),
        (GOOD.replace("f32", "real"), "p1120.type"),
        (GOOD.replace("default = 5,", ""), "p1120.default"),
        (GOOD.replace('"M"', '"sure"'), "p1120.certainty"),
        (GOOD.replace("low", "allowed = [651], low"), "values within low and high"),
        (GOOD.replace("low", "objects = [256], low"), "drive objects, 0 to 255"),
        (GOOD.replace("low", "objects = [], low"), "drive objects, 0 to 255"),
        (GOOD.replace("low", 'when = "never", low'), "p1120.when"),
        (GOOD.replace("low", "colour = 1, low"), "p1120.colour"),
        (f"r0945 = {{ low = 1, {REST} }}", "r0945.low"),
    ],
)
def test_what_cannot_be_is_told(tmp_path: Path, text: str, says: str) -> None:
    _, problems = found(tmp_path, text)
    assert len(problems) >= 1 and any(says in problem for problem in problems), problems
