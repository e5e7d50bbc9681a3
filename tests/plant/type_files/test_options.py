"""Options, presets and their ranges: a mistake is named."""

from pathlib import Path

import pytest

from tests.plant.line import problem

MISTAKES = [
    ("device", "length = 4000", "length = 9000", "presets.long.length", "from 100 to 5000"),
    ("device", "length = 4000", "lenght = 4000", "presets.long.lenght", "perhaps length"),
    ("device", "default = 3", "default = 2.5", "options.slots.default", "a whole number: it"),
    ("device", "default = 660", "default = 660.5\nwhole = true", "options.length.default", "a whole number: `whole`"),
    ("device", "slots = 5", "slots = 4.5", "presets.long.slots", "a whole number"),
    ("device", "default = 660", 'default = "width + 1"', "options.length.default", "width"),
    ("device", "default = 660", 'default = "100 * slots +"', "options.length.default", "expression"),
    ("device", "default = 660", 'default = "2000 * slots"', "options.length.default", "from 100 to 5000"),
    ("device", "default = 660", 'default = "660 / (slots - 3)"', "options.length.default", "from 100 to 5000"),
    ("device", "arrivals = [0, 60]", "arrivals = [60]", "options.simulation.numbers.arrivals", "[low, high]"),
]


@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    found = problem(tmp_path, file, old, new)
    assert found.key == key
    assert expected in found.expected
