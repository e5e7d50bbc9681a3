"""Shifts of a plant: when they begin, and what is refused by name."""

from pathlib import Path

import pytest

from app.plant.loader import read_plant
from app.plant.plant_files.shifts import USUAL

PLANT = """
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
{shifts}
[links.hall]
transport = "memory"
[equipment.m1]
type = "eura_e800"
link = "hall"
unit = 1
rated_current = 2.5
"""


def read(tmp_path: Path, shifts: str) -> tuple[object, list[str]]:
    (tmp_path / "plant.toml").write_text(PLANT.format(shifts=shifts))
    plant, problems = read_plant(tmp_path)
    return plant.shifts if plant else None, [str(one) for one in problems]


@pytest.mark.parametrize(
    ("written", "shifts"),
    [
        ("", USUAL),
        ('shifts = ["06:00", "14:00", "22:00"]', (360, 840, 1320)),
        ('shifts = ["07:30", "19:30"]', (450, 1170)),
        ('shifts = ["00:00"]', (0,)),
    ],
)
def test_shifts_begin_when_the_file_says(tmp_path: Path, written: str, shifts: tuple[int, ...]) -> None:
    found, problems = read(tmp_path, written)
    assert not problems
    assert found == shifts


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ('shifts = ["6:00"]', ("6:00", "a time of the day such as")),
        ('shifts = ["24:00", "12:00"]', ("24:00", "a time of the day such as")),
        ("shifts = [6, 14]", ("6", "a time of the day such as")),
        ('shifts = ["06:00", "06:00"]', ("06:00", "each time once")),
        ("shifts = []", ("0", "1 to 12 times of the day")),
        ('shifts = "06:00"', ("06:00", "times of the day such as")),
    ],
)
def test_what_is_no_time_of_the_day_is_named(tmp_path: Path, written: str, told: tuple[str, str]) -> None:
    _, problems = read(tmp_path, written)
    assert any("shifts" in one and all(words in one for words in told) for one in problems), problems
