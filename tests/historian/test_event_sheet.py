"""The words of an export of events: those of the types in every language, keys for programs; codes are found by word and by key."""

import pytest

from app.historian.event_export import SHIFT
from app.historian.event_sheet import COLUMNS, coded, with_ring, worded, words
from app.plant.loader import read_plant
from app.plant.texts import Texts
from tests.conftest import ROOT

PLANT, _ = read_plant(ROOT / "plants" / "demo")
assert PLANT is not None
TEXTS = Texts.read(PLANT)
RINGS = with_ring(PLANT)


def test_machines_with_a_ring_are_those_whose_device_keeps_events() -> None:
    assert PLANT is not None
    assert {item.id for item in RINGS} == {id for id, item in PLANT.equipment.items() if item.type.events}
    assert with_ring(None) == []


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_every_event_and_every_word_of_a_snapshot_has_a_text(lang: str) -> None:
    said = words(TEXTS, PLANT, lang)
    assert list(said["headers"]) == [*COLUMNS, SHIFT]
    assert set(said["events"]) == {(item.id, code) for item in RINGS for code in item.type.events}
    assert set(said["fields"]) == {(item.id, name) for item in RINGS for name in item.type.snapshot}
    for texts in (said["headers"], said["events"], said["fields"]):
        assert all(
            text.strip() and not text.startswith(("event.", "snapshot.", "events.csv")) for text in texts.values()
        )


def test_a_program_gets_keys() -> None:
    said = words(TEXTS, PLANT, "machine")
    assert "headers" not in said and "fields" not in said
    assert said["events"] == {(item.id, code): key for item in RINGS for code, key in item.type.events.items()}


@pytest.mark.parametrize("lang", ["hr", "en", "de", "cs"])
def test_an_event_is_found_by_a_part_of_its_words_in_any_case_and_by_its_key(lang: str) -> None:
    for item in RINGS:
        for code, key in item.type.events.items():
            text = TEXTS.of_type(lang, item.type, f"event.{key}")
            assert code in worded(TEXTS, PLANT, lang, text[1:].upper())[item.id], (lang, text)
            assert code in worded(TEXTS, PLANT, lang, key)[item.id]
            assert coded(PLANT, key)[item.id] == [code]


def test_what_nobody_tells_is_no_code() -> None:
    assert coded(PLANT, "nonsense") == {}
    assert not any(worded(TEXTS, PLANT, "en", "qxqx").values())
