"""Branches, loops and safe steps as a sequence file says them: what they mean, and everything wrong is named with what was expected."""

from pathlib import Path

import pytest

from app.blocks.sequence import Branch, Chart, Loop
from app.plant.loader import read_plant
from app.plant.sequences import canonical
from tests.running.test_sequence_machines import DRIVE, LINKS, SEQUENCE, file, step

STEPS = [step(key) for key in ("a", "b", "c", "d", "e", "f")]
WAY = '[[branches]]\nafter = "a"\ntake = "all"\npaths = ["b", "c"]\nthen = "e"\n'
LOOP = '[[loops]]\nfrom = "c"\nto = "d"\ntimes = 3\n'
COUNT = '[[recipe]]\nkey = "count"\nlabel = "Count"\ndecimals = 0\nminimum = 1\nmaximum = 9\ndefault = 4\n'
GIVEN = LOOP.replace("3", '"recipe.count"')
SAFE = 'abort_to = "f"\n'


def read(folder: Path, more: str, head: str = "", steps: list[str] = STEPS) -> tuple[Chart | None, list[str], str]:
    (folder / "sequences").mkdir(parents=True)
    (folder / "plant.toml").write_text(LINKS + DRIVE + SEQUENCE, "utf-8")
    (folder / "sequences" / "work.toml").write_text(file(*steps, more, head=head), "utf-8")
    plant, problems = read_plant(folder)
    found = plant.equipment["seq1"].sequence if plant else None
    told = [f"{one.key} = {one.value}: {one.expected}" for one in problems]
    return (found.chart if found else None), told, canonical(found) if found else ""


def test_a_file_says_which_step_follows_which(tmp_path: Path) -> None:
    chart, problems, program = read(tmp_path / "hall", WAY + LOOP, SAFE)
    assert problems == []
    assert chart == Chart((Branch(1, (2, 3), 5, together=True),), (Loop(3, 4, 3),), safe=6)
    assert program.endswith("branch 1 all 2,3 then 5\nloop 3 4 3\nabort_to 6\n"), "part of the check sum"


def test_a_value_of_the_run_says_how_often_a_loop_is_passed(tmp_path: Path) -> None:
    chart, problems, program = read(tmp_path / "hall", COUNT + GIVEN)
    assert problems == [] and chart == Chart(loops=(Loop(3, 4, 4, "count"),))
    assert "loop 3 4 recipe.count\n" in program, "whatever its default is"
    assert chart is not None and chart.counted({"count": 7.0}).loops == (Loop(3, 4, 7, "count"),)


def test_a_file_without_has_the_check_sum_that_it_had(tmp_path: Path) -> None:
    assert "branch" not in read(tmp_path / "hall", "")[2]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("more", "head", "told"),
    [
        (WAY.replace('"all"', '"both"'), "", "one of first, all"),
        (WAY.replace('after = "a"', 'after = "z"'), "", "one of a, b, c, d, e, f"),
        (WAY.replace('["b", "c"]', '["b"]'), "", "the first steps of at least two paths"),
        (WAY.replace('["b", "c"]', '["c", "d"]'), "", "the step behind a, where the first path begins"),
        (WAY.replace('["b", "c"]', '["b", "d", "c"]'), "", "each path once, in the order of the steps"),
        (WAY.replace('["b", "c"]', '["b", "x"]'), "", "a step of this file"),
        (WAY.replace('then = "e"', 'then = "c"'), "", "a step behind the last path, which begins with c"),
        (WAY + WAY, "", "a step after which nothing else divides"),
        (
            WAY + WAY.replace('after = "a"', 'after = "d"').replace('["b", "c"]', '["e", "f"]').replace('"e"\n', '"f"\n'),
            "",
            "a step behind the last path",
        ),
        (
            WAY.replace('then = "e"', 'then = "d"') + WAY.replace('after = "a"', 'after = "c"')
            .replace('["b", "c"]', '["d", "e"]').replace('then = "e"', 'then = "f"'),
            "",
            "a branch within one path of the branch after a, or one that does not touch its paths",
        ),
        (WAY + LOOP.replace('from = "c"', 'from = "b"'), "", "a step in the same path as b"),
        (LOOP.replace('to = "d"', 'to = "b"'), "", "c or a step behind it"),
        (LOOP.replace("times = 3", "times = 1"), "", "from 2"),
        (COUNT + GIVEN.replace("recipe.count", "recipe.counts"), "", "a number, or one of recipe.count (perhaps recipe.count)"),
        (GIVEN, "", "a number, or a value of [[recipe]], which has none"),
        (COUNT + LOOP.replace("3", '"count"'), "", "a whole number"),
        (COUNT.replace("decimals = 0\n", "") + GIVEN, "", "in whole numbers, with decimals = 0; its decimals are 1"),
        (COUNT.replace("maximum = 9", "maximum = 9.5") + GIVEN, "", "its range is 1 to 9.5"),
        (COUNT.replace("default = 4", "default = 4.5") + GIVEN, "", "default 4.5"),
        (COUNT.replace("minimum = 1", "minimum = 0") + GIVEN, "", "a value of a run from 1 to 10000; its range is 0 to 9"),
        (COUNT.replace("maximum = 9", "maximum = 10001") + GIVEN, "", "its range is 1 to 10001"),
        (LOOP + LOOP.replace('from = "c"', 'from = "b"'), "", "each with an end of its own"),
        (LOOP + LOOP.replace('from = "c"', 'from = "d"').replace('to = "d"', 'to = "e"'), "", "a loop within another one"),
        (WAY, 'abort_to = "c"\n', "a step outside of the branch or loop at a"),
        (LOOP, 'abort_to = "d"\n', "a step outside of the branch or loop at c"),
        ("", 'abort_to = "a"\n', "a step behind the first one"),
        ("", 'abort_to = "y"\n', "one of a, b, c, d, e, f"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told(tmp_path: Path, more: str, head: str, told: str) -> None:
    problems = read(tmp_path / "hall", more, head)[1]
    assert problems and any(told in one for one in problems), problems


def test_paths_side_by_side_command_different_machines(tmp_path: Path) -> None:
    steps = [step(key, "d1.stop") if key in ("b", "d") else step(key) for key in ("a", "b", "c", "d", "e", "f")]
    problems = read(tmp_path / "both", WAY, steps=steps)[1]
    assert len(problems) == 1 and "d1 is in two of them" in problems[0]
    assert read(tmp_path / "one", WAY.replace('"all"', '"first"'), steps=steps)[1] == []
