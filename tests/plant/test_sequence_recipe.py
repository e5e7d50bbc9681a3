"""Values of a run as a sequence file says them: what they mean, and everything wrong is named with what was expected."""

from pathlib import Path

import pytest

from app.plant.definitions import Equipment
from app.plant.loader import read_plant
from app.plant.sequences import canonical
from tests.running.test_sequence_machines import LINKS, SEQUENCE, file, step

DRIVE = '[equipment.m1]\ntype = "eura_e800"\nlink = "all"\nunit = 1\n'
VALUE = '[[recipe]]\nkey = "hold"\nlabel = "Hold"\nunit = "s"\nminimum = 2\nmaximum = 20\ndefault = 5\n'
STEP = "minimum = 0.1\nmaximum = 900\n"
ORDER = '[[steps.orders]]\nmachine = "m1"\naction = "run_forward"\nvalues = { frequency = "recipe.hold" }\n'


CHILD = '[equipment.seq2]\ntype = "sequence"\nlink = "all"\nunit = 22\ndefinition = "child"\n'
OTHER = (
    VALUE.replace("hold", "wait")
    + "decimals = 1\n"
    + VALUE.replace("hold", "count").replace("= 2\n", "= 1\n", 1)
    + "decimals = 0\n"
)


def calls(folder: Path, values: str, own: str = VALUE, action: str = "run") -> tuple[Equipment | None, list[str]]:
    """A plant whose sequence starts another one with `values`."""
    (folder / "sequences").mkdir(parents=True)
    (folder / "plant.toml").write_text(LINKS + DRIVE + SEQUENCE + CHILD, "utf-8")
    work = file(step("a", f"seq2.{action}({values})"), own)
    (folder / "sequences" / "work.toml").write_text(work, "utf-8")
    (folder / "sequences" / "child.toml").write_text(file(step("a"), OTHER), "utf-8")
    plant, problems = read_plant(folder)
    told = [f"{one.file} {one.key} = {one.value.strip(chr(34))}: {one.expected}" for one in problems]
    return plant.equipment["seq1"] if plant else None, told


def read(folder: Path, more: str, first: str = "") -> tuple[Equipment | None, list[str]]:
    (folder / "sequences").mkdir(parents=True)
    (folder / "plant.toml").write_text(LINKS + DRIVE + SEQUENCE, "utf-8")
    text = file(step("a"), step("b"), more).replace(STEP, f"{first}\n", 1) if first else file(step("a"), more)
    (folder / "sequences" / "work.toml").write_text(text, "utf-8")
    plant, problems = read_plant(folder)
    told = [f"{one.key} = {one.value.strip(chr(34))}: {one.expected}" for one in problems]
    return plant.equipment["seq1"] if plant else None, told


def test_start_takes_them_within_their_limits_under_their_own_names(tmp_path: Path) -> None:
    item, problems = read(tmp_path / "hall", VALUE)
    assert problems == [] and item is not None and item.sequence is not None
    (argument,) = item.type.commands["start"].arguments
    assert (argument.name, float(argument.low), float(argument.high), argument.unit) == ("hold", 2.0, 20.0, "s")
    assert item.points["recipe_1"].unit == "s" and item.points["recipe_1"].label == argument.label
    assert "recipe hold 2 20\n" in canonical(item.sequence), "part of the check sum"


def test_a_file_without_has_the_check_sum_and_the_start_that_it_had(tmp_path: Path) -> None:
    item, problems = read(tmp_path / "hall", "")
    assert problems == [] and item is not None and item.sequence is not None
    assert item.type.commands["start"].arguments == () and "recipe" not in canonical(item.sequence)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (VALUE.replace("maximum = 20", "maximum = 2"), "recipe.0.maximum = 2: more than the minimum, which is 2"),
        (VALUE.replace("default = 5", "default = 21"), "recipe.0.default = 21: a number from 2 to 20"),
        (VALUE + VALUE, "recipe.1.key = hold: a key that no other value of a run has"),
        (
            VALUE.replace('"hold"', '"step"'),
            "recipe.0.key = step: a key that is no word of the grammar and none of step",
        ),
        ("".join(VALUE.replace('"hold"', f'"h{n}"') for n in range(5)), "recipe.4.key = h4: at most 4 values of a run"),
    ],
)
def test_what_cannot_be_is_named(tmp_path: Path, more: str, told: str) -> None:
    item, problems = read(tmp_path / "hall", more)
    assert item is None and any(one.startswith(told) for one in problems), problems


@pytest.mark.parametrize(
    ("line", "instead"),
    [
        ("maximum = 20\n", ""),
        ("maximum = 20\n", 'maximum = "x"\n'),
        ("default = 5\n", ""),
        ("default = 5\n", "default = true\n"),
    ],
)
def test_what_is_missing_or_no_number_is_one_mistake(tmp_path: Path, line: str, instead: str) -> None:
    _, problems = read(tmp_path / "hall", VALUE.replace(line, instead))
    (told,) = problems
    assert told.endswith(": a number") and "None" not in told


@pytest.mark.parametrize(
    ("times", "told"),
    [
        ('minimum = "recipe.hold"\nmaximum = 60', ""),
        ('minimum = "recipe.hold"\nmaximum = 10', "at least the minimum, which is 20 s at most"),
        ('maximum = "recipe.hold"', ""),
        ('minimum = "recipe.hole"\nmaximum = 60', "a number, or one of recipe.hold"),
        ('maximum = 60\n[steps.permissives.3]\nkey = "x"\nlabel = "x"\nwhen = "m1.frequency < recipe.hold"', ""),
        (
            'maximum = 60\n[steps.permissives.3]\nkey = "x"\nlabel = "x"\nwhen = "m1.frequency < recipe.hole"',
            "recipe.hole is none",
        ),
        ("maximum = 60\n" + ORDER, ""),
        ("maximum = 60\n" + ORDER.replace("hold", "no"), "a number, or one of recipe.hold"),
    ],
)
def test_they_stand_for_times_values_of_orders_and_in_conditions(tmp_path: Path, times: str, told: str) -> None:
    item, problems = read(tmp_path / "hall", VALUE, times)
    assert (item is None) is bool(told) and (not told or any(told in one for one in problems)), problems


def test_an_order_is_checked_at_both_ends_of_the_range(tmp_path: Path) -> None:
    _, problems = read(tmp_path / "hall", VALUE.replace("maximum = 20", "maximum = 5000"), "maximum = 60\n" + ORDER)
    assert any("values.frequency = 5000" in one for one in problems), problems


def test_a_step_gives_another_sequence_some_of_its_values_or_none(tmp_path: Path) -> None:
    item, problems = calls(tmp_path / "some", 'wait = "recipe.hold", count = 3')
    assert problems == [] and item is not None and item.sequence is not None
    assert "order seq2.run(wait = recipe.hold, count = 3)\n" in canonical(item.sequence), "part of the check sum"
    for n, (values, action) in enumerate([("wait = 2.5", "run"), ("", "run"), ("count = 20", "start")]):
        assert calls(tmp_path / str(n), values, action=action)[1] == []


@pytest.mark.parametrize(
    ("values", "own", "told"),
    [
        ("wait = 21", "", "steps.0.orders.0.values.wait = 21.0: a number from 2 to 20 for seq2"),
        ("wait = 2.25", "", "values.wait = 2.25: a number with at most 1 decimals, as seq2 takes it"),
        ("count = 2.5", "", "values.count = 2.5: a number in whole numbers, as seq2 takes it"),
        ("hold = 3", "", "values.hold = 3.0: a value of run: one of wait, count"),
        ('wait = "recipe.wait"', "", "a number, or a value of [[recipe]], which has none"),
        ('count = "recipe.hold"', VALUE, "in whole numbers, as seq2 takes it; hold has decimals = 1"),
        ('wait = "recipe.hold"', VALUE.replace("maximum = 20", "maximum = 25"), "values.wait = 25.0: a number from 2 to 20 for seq2"),
        ('wait = "recipe.hold"', VALUE.replace("minimum = 2", "minimum = 1"), "values.wait = 1.0: a number from 2 to 20 for seq2"),
        ('wait = "recipe.hold"', VALUE.replace('"s"', '"Hz"'), "recipe.hold: a value of a run in s, as seq2 takes it; hold is in Hz"),
        ('wait = "recipe.hold"', VALUE.replace('unit = "s"\n', ""), "a value of a run in s, as seq2 takes it; hold is without a unit"),
    ],
)  # fmt: skip
def test_what_another_sequence_does_not_take_is_named(tmp_path: Path, values: str, own: str, told: str) -> None:
    item, problems = calls(tmp_path / "hall", values, own)
    assert item is None and len(problems) == 1 and told in problems[0], problems
    assert problems[0].startswith("sequences/work.toml"), "where it is given, not where it is taken"


def test_an_order_that_starts_nothing_gives_no_values(tmp_path: Path) -> None:
    assert any("a value of suspend" in one for one in calls(tmp_path / "hall", "wait = 3", action="suspend")[1])
