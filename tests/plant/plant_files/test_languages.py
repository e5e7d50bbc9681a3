"""Languages of a plant: each mistake names file, line, key, value and expectation."""

from pathlib import Path

import pytest

from tests.plant.design import changed, mistakes

MISTAKES = [
    ('["hr", "en", "de", "cs"]', '["hr", "fr"]', "plant.languages.1", '"fr"', "hr, en, de, cs"),
    ('["hr", "en", "de", "cs"]', '["hr", "hr"]', "plant.languages.1", '"hr"', "each language once"),
    ('["hr", "en", "de", "cs"]', "[]", "plant.languages", "[]", "at least one"),
    ('["hr", "en", "de", "cs"]', '"hr"', "plant.languages", '"hr"', "a list"),
    (
        'hr = "Ventilator 2"',
        'fr = "Ventilateur 2"',
        "equipment.m2.label.fr",
        '"Ventilateur 2"',
        "a language of the product",
    ),
    ('"Ventilator 2"', "2", "equipment.m2.label.hr", "2", "a text"),
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
