"""What a plant file says of classes of alarms: read with what it leaves as usual, and refused by name."""

from pathlib import Path

import pytest

from app.plant.alarm_class import HOUR, AlarmClass, usual
from app.plant.definitions import Plant
from app.plant.loader import read_plant

PLANT = """
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.hall]
transport = "memory"
[equipment.m1]
type = "eura_e800"
link = "hall"
unit = 1
rated_current = 2.5
{classes}
"""


def read(tmp_path: Path, classes: str) -> tuple[Plant | None, list[str]]:
    (tmp_path / "plant.toml").write_text(PLANT.format(classes=classes))
    plant, problems = read_plant(tmp_path)
    return plant, [str(one) for one in problems]


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("", {}),
        ("[alarm_classes.drive]\nlongest = 90", {"drive": AlarmClass(1.5 * HOUR)}),
        ("[alarm_classes.comm]\nreason = false", {"comm": AlarmClass(4 * HOUR, reason=False)}),
        ("[alarm_classes.system]\nshelving = false", {"system": AlarmClass(0.0)}),
        ("[alarm_classes.command]\nout_of_service = false", {"command": AlarmClass(0.0, out_of_service=False)}),
    ],
)
def test_what_is_not_said_stays_as_usual(tmp_path: Path, written: str, expected: dict[str, AlarmClass]) -> None:
    plant, problems = read(tmp_path, written)
    assert plant is not None and not problems
    assert plant.alarm_classes == expected
    assert usual("drive").longest == 12 * HOUR and not usual("command").longest


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("[alarm_classes.drives]\nlongest = 60", ("alarm_classes.drives", "a class of alarms: ", "drive")),
        ("[alarm_classes.drive]\nlongest = 0", ("alarm_classes.drive.longest", "1 to 1440")),
        ("[alarm_classes.drive]\nlongest = 2000", ("alarm_classes.drive.longest", "2000", "1 to 1440")),
        ('[alarm_classes.drive]\nreason = "no"', ("alarm_classes.drive.reason", "true or false")),
        ("[alarm_classes.command]\nshelving = true", ("alarm_classes.command.shelving", "never shelved")),
        ("[alarm_classes.drive]\nshelving = false\nlongest = 60", ("alarm_classes.drive.longest", "shelving = false")),
        ("[alarm_classes.drive]\nmost = 60", ("alarm_classes.drive.most",)),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, written: str, told: tuple[str, ...]) -> None:
    plant, problems = read(tmp_path, written)
    assert plant is None and len(problems) == 1
    assert all(part in problems[0] for part in told), problems
