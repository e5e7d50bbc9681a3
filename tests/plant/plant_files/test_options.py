"""Options and simulation of a machine: each mistake names file, line, key, value and expectation."""

from pathlib import Path

import pytest

from tests.plant.design import changed, mistakes

MISTAKES = [
    ("rated_current = 2.5", "rated_current = 85", "equipment.m2.rated_current", "85", "from 0.1 to 60"),
    ("rated_current = 2.5", "rated_current = nan", "equipment.m2.rated_current", "nan", "from 0.1 to 60"),
    ("rated_current", "rated_curent", "equipment.m2.rated_curent", "2.5", "perhaps rated_current"),
    (
        "unit = 1",
        'unit = 1\nsimulation = { start = "up" }',
        "equipment.m2.simulation.start",
        '"up"',
        "forward, reverse",
    ),
    ("unit = 1", "unit = 1\nsimulation = { F905 = -1 }", "equipment.m2.simulation.F905", "-1", "from 0 to 3000"),
    ("unit = 1", "unit = 1\nsimulation = { F999 = 1 }", "equipment.m2.simulation.F999", "1", "no such key"),
    *(
        (
            "unit = 1",
            f"unit = 1\npoints.frequency.{key} = {given}",
            f"equipment.m2.points.frequency.{key}",
            shown,
            expected,
        )
        for key, given, shown, expected in (
            ("normal", "[-inf, inf]", "[-inf, inf]", "two finite numbers"),
            ("normal", "[-1e308, 1e308]", "[-1e+308, 1e+308]", "two finite numbers"),
            ("normal", "[false, true]", "[false, true]", "two finite numbers"),
            ("scale_high", "1e308", "1e+308", "from -1e+100 to 1e+100"),
        )
    ),
]


@pytest.mark.parametrize(("old", "new", "key", "value", "expected"), MISTAKES)
def test_each_mistake_names_file_line_key_value_and_expectation(
    tmp_path: Path, old: str, new: str, key: str, value: str, expected: str
) -> None:
    text = changed(old, new)
    problems = mistakes(tmp_path, text)
    found = next((problem for problem in problems if problem.key == key), None)
    assert found, problems
    assert (found.file, found.value) == ("plant.toml", value)
    assert expected in found.expected
    if value != "missing":
        assert found.line
        names = key.split(".")
        assert names[1 if names[0] == "plant" else min(2, len(names) - 1)] in text.splitlines()[found.line - 1]
