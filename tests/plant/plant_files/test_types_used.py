"""Types that machines are of: each mistake names file, line, key, value and expectation."""

from pathlib import Path

import pytest

from tests.plant.design import changed, mistakes

MISTAKES = [
    ('"eura_e800"', '"eura_e80"', "equipment.m2.type", '"eura_e80"', "perhaps eura_e800"),
    ('type = "eura_e800"', "", "equipment.m2.type", "missing", "a text"),
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
