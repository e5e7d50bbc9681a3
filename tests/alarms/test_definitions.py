"""Alarms of the system have their rows, their texts in every language, and their counts are tags."""

import pytest

from app.alarms.definitions import COUNTS, PRIORITIES, SYSTEM_ALARMS, alarm_points, frame_names
from app.plant.plant_files.languages import LANGUAGES
from app.plant.texts import Texts

TEXTS = Texts.read()


@pytest.mark.parametrize("key", SYSTEM_ALARMS)
def test_each_has_a_row_with_its_priority_and_its_texts_in_every_language(key: str) -> None:
    row = SYSTEM_ALARMS[key].row(key)
    assert row.priority in PRIORITIES and row.expression == ""
    for text in (row.label, row.consequence, row.cause, row.response):
        for language in LANGUAGES:
            assert TEXTS.has(language, text), (language, text)


def test_what_happened_once_has_no_delay() -> None:
    assert not [key for key, one in SYSTEM_ALARMS.items() if one.once and (one.on_delay or one.off_delay)]


@pytest.mark.parametrize("machines", [[], ["m1"], ["m1", "c1", "seq1"]])
def test_every_machine_and_the_system_is_counted_by_priority(machines: list[str]) -> None:
    names = [point.name for point in alarm_points(machines)]
    assert len(names) == len(set(names)) == len(COUNTS) + 4 * (len(machines) + 1)
    assert set(frame_names()) <= set(names)
    for item in (*machines, "sys"):
        assert {f"sys.alarms.by.{item}.p{one}" for one in PRIORITIES} <= set(names)
