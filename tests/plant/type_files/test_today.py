"""today.toml: what does not fit is told with what would."""

import shutil
from pathlib import Path

import pytest

from app.plant.problems import Problem
from app.plant.types import names, read_type
from tests.light import EQUIPMENT

LANGUAGES = ("hr", "en", "de", "cs")


def problems(tmp_path: Path, text: str) -> list[Problem]:
    shutil.copytree(EQUIPMENT / "conveyor", tmp_path / "conveyor")
    (tmp_path / "conveyor" / "today.toml").write_text(text, "utf-8")
    return read_type("conveyor", LANGUAGES, tmp_path)[1]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('[a]\nhow = "sum"\nof = "moving"\n', "time, count, energy, mean"),
        ('[a]\nhow = "time"\nof = "line_speed"\n', "a recorded point of kind bool"),
        ('[a]\nhow = "count"\nof = "moving"\n', "a recorded point of kind step that counts"),
        ('[a]\nhow = "energy"\nof = "line_speed"\n', "a recorded point in kW"),
        ('[a]\nhow = "mean"\nrecord = "run"\noutcome = "done"\n', "passage"),
        ('[a]\nhow = "mean"\nrecord = "passage"\noutcome = "sold"\n', "an outcome of passage"),
        ('[a]\nhow = "time"\nof = "moving"\n[b]\nhow = "time"\nof = "moving"\n', "`b` is the second"),
        ('[a]\nhow = "time"\nof = "moving"\nwhen = "1"\n', "no such key"),
    ],
)
def test_a_mistake_is_named_with_what_is_expected(tmp_path: Path, text: str, expected: str) -> None:
    found = problems(tmp_path, text)
    assert any(expected in str(problem) for problem in found), found


def test_every_type_tells_how_long_its_machines_ran() -> None:
    for name in names(EQUIPMENT):
        data, found = read_type(name, LANGUAGES, EQUIPMENT)
        assert not found
        assert [one.how for one in data.type.today.values()].count("time") == 1, name
