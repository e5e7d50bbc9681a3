"""`[actions.orders]`: what a sequence may have a machine do, with one that ends by a command of its own; also of a type of a plant."""

from pathlib import Path

import pytest

from app.plant.loader import read_plant
from app.plant.problems import Problem
from tests.plant.test_own_types import FILES, written

POINTS = FILES["points"] + "[motor]\naddress = 2\n[run]\naddress = 3\nwritable = true\n"
COMMANDS = (
    '[start]\nwrites = [{ point = "run", value = 1 }]\nfeedback = "motor == 1"\n'
    '[stop]\nwrites = [{ point = "run", value = 0 }]\nfeedback = "motor == 0"\nstop = true\nmoves = false\n'
)
TEXTS = (
    FILES["texts.en"] + 'point.motor = "Motor"\npoint.run = "Run"\ncommand.start = "Start"\ncommand.stop = "Stop"\n'
    'argument.amount = "Amount"\norder.dose = "Dose"\nneed.empty = "Empty"\nmissing.need.empty = "Not empty"\n'
)
DOSE = """
[actions.orders.dose]
label = "order.dose"
arguments = [{ name = "amount", type = "u32", unit = "kg", low = 1, high = 50 }]
commands = [{ command = "start" }]
armed = "motor == 1"
done = "weight - before.weight >= amount"
failed = "motor == 0"
then = "stop"
[actions.orders.dose.needs.empty]
expression = "weight < 5"
"""


def found(folder: Path, orders: str = DOSE, texts: str = TEXTS) -> list[Problem]:
    files = {"device": FILES["device"] + orders, "points": POINTS, "commands": COMMANDS, "texts_en": texts}
    return read_plant(written(folder, **files))[1]


def test_a_type_of_a_plant_has_one_that_ends_with_a_stop_of_its_own(tmp_path: Path) -> None:
    assert found(tmp_path) == []
    plant = read_plant(tmp_path)[0]
    assert plant is not None
    action = plant.equipment["w1"].type.orders["dose"]
    assert (action.then, action.armed, action.values, action.adjusts) == ("stop", "motor == 1", ("amount",), False)
    assert [one.key for one in action.needs] == ["empty"]


@pytest.mark.parametrize(
    ("before", "after", "key", "expected"),
    [
        ('then = "stop"', 'then = "halt"', "dose.then", "one of start, stop"),
        ('done = "weight - before.weight >= amount"\nfailed = "motor == 0"\n', "", "dose.done", "then"),
        ("before.weight", "before.mass", "dose.done", "it has no before.mass"),
        ("before.weight", "after.weight", "dose.done", "it has no after.weight"),
        (">= amount", ">= much", "dose.done", "it has no much"),
        ("low = 1, ", "", "dose.arguments.0.low", "a number"),
        ("high = 50", 'high = "weight"', "dose.arguments.0.high", "a number"),
        ('"amount", type', '"abs", type', "dose.arguments.0.name", "no word of the grammar"),
        ('"weight < 5"', '"weight < amount"', "dose.needs.empty.expression", "it has no amount"),
        ('"weight < 5"', '"weight < argument"', "dose.needs.empty.expression", ""),
        ('"weight < 5"', '"weight < 5"\ncommands = ["start"]', "dose.needs.empty.commands", ""),
    ],
)
def test_a_mistake_in_it_is_told_at_its_place(tmp_path: Path, before: str, after: str, key: str, expected: str) -> None:
    assert before in DOSE
    told = found(tmp_path, DOSE.replace(before, after))
    assert any(
        one.file == "equipment/scale/device.toml" and one.key == f"actions.orders.{key}" and expected in one.expected
        for one in told
    ), told


@pytest.mark.parametrize("text", ["order.dose", "argument.amount", "need.empty", "missing.need.empty"])
def test_a_text_that_no_language_has_is_named(tmp_path: Path, text: str) -> None:
    (one,) = found(
        tmp_path, texts="".join(line for line in TEXTS.splitlines(keepends=True) if not line.startswith(text))
    )
    assert (one.key, one.value) == (text, "missing")
