"""The points of the system itself are tags like any other, and every one has its label in every language."""

from pathlib import Path

import pytest

from app.plant.definitions import Kind
from app.plant.plant_files.languages import LANGUAGES
from app.plant.system import FRAME, HISTORY, STATISTICS, system_point, system_points
from app.plant.texts import Texts

TEXTS = Texts.read()


def test_each_point_is_named_after_its_key_and_only_measures_have_a_history() -> None:
    for point in system_points(None, ["sys.link.hall.polls", "sys.link.hall.unit1.state"]):
        assert point.name == point.id == f"sys.{point.key}" and point.equipment == "sys"
        assert point.history is (point.kind is Kind.ANALOG)


@pytest.mark.parametrize("last", [*STATISTICS, "retries"])
def test_what_a_link_measures_has_its_unit_and_the_rest_counts(last: str) -> None:
    (point,) = (one for one in system_points(None, [f"sys.link.hall.{last}"]) if one.name.startswith("sys.link."))
    kind, unit, decimals, dead_band = STATISTICS.get(last, (Kind.STEP, "", 0, 0.0))
    assert (point.kind, point.unit, point.decimals, point.dead_band) == (kind, unit, decimals, dead_band)
    assert point.label == f"sys.link.{last}"


@pytest.mark.parametrize("language", LANGUAGES)
def test_labels_are_known_in_every_language(language: str) -> None:
    for key, *_ in (*FRAME, *HISTORY):
        label = system_point(key).label
        assert TEXTS.has(language, label), (language, label)


def test_no_key_is_there_twice() -> None:
    names = [point.name for point in system_points(None)]
    assert len(names) == len(set(names)) and Path("app/plant/system.py").is_file()
