"""What an alarm says of its event is what the type says of the snapshot words, for every type with a ring."""

import pytest

from app.alarms.event_params import NAMED, UNKNOWN, completed, of_event, untold
from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.records.snapshot import Field, Layout
from app.registers.plc_map import long_words, real
from tests.historian.rings import Event

KINDS = {name: types.read_type(name, LANGUAGES)[0].type for name in types.names()}
WITH_RING = [name for name, kind in KINDS.items() if kind.events]
LAYOUT: Layout = {"product": Field(0, "u32", 0, "products"), "second": Field(2, "u32", 0), "more": Field(4, "f32")}


def layout(name: str) -> Layout:
    return KINDS[name].snapshot


def told(*words: int) -> Event:
    return Event(9, 0, 1, source=4, snapshot=(*words, 0, 0, 0, 0, 0, 0)[:6])


def test_a_sequence_names_its_permissive_and_no_product() -> None:
    event = told(3, 1, 0x00F0, 0x0001, *long_words(real(7.25)))
    assert of_event(layout("sequence"), event, {}) == {
        "source": 4, "event": 9, "bit": 3, "together": 1, "abort_word": 0x00F0, "step_word": 1, "signal": 7.25,
    }  # fmt: skip


def test_a_conveyor_names_its_products() -> None:
    event = told(0, 7, 0, 6, *long_words(real(float("nan"))))
    assert of_event(layout("conveyor"), event, {}) == {
        "source": 4, "event": 9, "product": 7, "products": "7", "second": 6, "second_value": UNKNOWN,
        "order": UNKNOWN, "category": UNKNOWN,
    }  # fmt: skip


def test_a_machine_whose_words_say_nothing_names_source_and_event_only() -> None:
    assert of_event(layout("coil_car"), told(3, 5), {}) == {"source": 4, "event": 9}


@pytest.mark.parametrize("name", WITH_RING)
def test_an_alarm_whose_event_was_lost_has_the_same_parameters(name: str) -> None:
    of_lost = untold(layout(name))
    assert set(of_lost) == {*of_event(layout(name), told(), {}), "value"}
    assert {of_lost[key] for key in of_lost if key != "event"} == {UNKNOWN}


@pytest.mark.parametrize(
    ("before", "now", "named"),
    [
        (UNKNOWN, 7, "7"),
        ("7", 8, "7, 8"),
        ("7, 8", 7, "8, 7"),
        ("7", 0, "7"),
        (UNKNOWN, 0, UNKNOWN),
        ("1, 2, 3", 4, "1, 2, 3, 4"),
        ("1, 2, 3, 4", 5, "…, 3, 4, 5"),
        ("…, 3, 4, 5", 6, "…, 4, 5, 6"),
    ],
)
def test_values_are_listed_newest_last(before: str, now: int, named: str) -> None:
    assert of_event(LAYOUT, told(0, now), {"products": before})["products"] == named
    assert len(named.split(", ")) <= NAMED


def test_what_was_written_down_before_alarms_listed_all_values_names_one() -> None:
    assert completed(LAYOUT, {"product": 7})["products"] == 7
    assert completed(LAYOUT, {"product": 8, "products": "7, 8"})["products"] == "7, 8"
    assert completed(LAYOUT, {"link": "line"}) == {"link": "line"}
