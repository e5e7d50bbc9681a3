"""Alarms of a plant file."""

from pathlib import Path

import pytest

from tests.plant.design import DESIGN, loaded, mistakes


def test_a_plant_may_add_alarms_of_its_own(tmp_path: Path) -> None:
    row = """
[[alarms]]
equipment = "m2"
key = "too_slow"
expression = "status == 1 and speed < 500"
priority = 3
on_delay = 5
label = { hr = "Ventilator: prespor", en = "Fan: too slow" }
response = "Clean the filter"
"""
    plant = loaded(tmp_path, DESIGN + row)
    alarm = plant.equipment["m2"].alarms[-1]
    assert (alarm.key, alarm.priority, alarm.on_delay) == ("too_slow", 3, 5.0)
    assert plant.texts["hr"][alarm.label] == "Ventilator: prespor"
    assert plant.texts["cs"][alarm.response] == "Clean the filter"


@pytest.mark.parametrize(
    ("row", "key", "expected"),
    [
        ('equipment = "m9"', "alarms.0.equipment", "one of m2"),
        ('expression = "spede < 5"', "alarms.0.expression", "it has no spede"),
        ('expression = "speed <"', "alarms.0.expression", "position 7"),
        ('expression = "speed < argument"', "alarms.0.expression", "no `argument` here"),
        ("priority = 5", "alarms.0.priority", "from 1 to 4"),
        ('key = "overcurrent"', "alarms.0.key", "no other alarm of m2"),
        ("on_delay = -1", "alarms.0.on_delay", "from 0 to 86400"),
        ("sound = true", "alarms.0.sound", "no such key"),
        ("label = 3", "alarms.0.label", "a text"),
    ],
)
def test_a_wrong_alarm_row_is_told(tmp_path: Path, row: str, key: str, expected: str) -> None:
    rows = {"equipment": '"m2"', "key": '"slow"', "expression": '"speed < 5"', "priority": "3", "label": '"Slow"'}
    rows[row.split(" = ")[0]] = row.split(" = ", 1)[1]
    text = DESIGN + "\n[[alarms]]\n" + "\n".join(f"{name} = {value}" for name, value in rows.items())
    problems = mistakes(tmp_path, text)
    assert [(problem.key, expected in problem.expected) for problem in problems] == [(key, True)]
    assert row in text.splitlines()[(problems[0].line or 0) - 1]
