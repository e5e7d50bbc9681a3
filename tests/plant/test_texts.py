"""Texts come in the reader's language, or in another one that says which."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import ConfigurationError
from app.plant import texts as texts_module
from app.plant.loader import read_plant
from app.plant.texts import Texts, fill, plural_category, read_product

DEMO = Path(__file__).parents[2] / "plants" / "demo"

ROWS = {
    "en": {"rows.one": "{n} row", "rows.other": "{n} rows", "only": "English only", "who": "by {user}"},
    "hr": {"rows.one": "{n} redak", "rows.few": "{n} retka", "rows.other": "{n} redaka", "who": "upravlja: {user}"},
    "cs": {"rows.one": "{n} řádek", "rows.few": "{n} řádky", "rows.many": "{n} řádku", "rows.other": "{n} řádků"},
    "de": {"rows.one": "{n} Zeile", "rows.other": "{n} Zeilen"},
}


@pytest.mark.parametrize(
    ("lang", "n", "text"),
    [
        ("hr", 1, "1 redak"),
        ("hr", 21, "21 redak"),
        ("hr", 11, "11 redaka"),
        ("hr", 3, "3 retka"),
        ("hr", 0, "0 redaka"),
        ("cs", 1, "1 řádek"),
        ("cs", 4, "4 řádky"),
        ("cs", 22, "22 řádků"),
        ("cs", 2.5, "2.5 řádku"),
        ("de", 0, "0 Zeilen"),
        ("en", 1, "1 row"),
    ],
)
def test_a_number_chooses_the_plural_form(lang: str, n: float, text: str) -> None:
    assert Texts(ROWS).text(lang, "rows", n=n) == text


def test_a_missing_language_falls_back_with_its_mark() -> None:
    texts = Texts(ROWS)
    assert texts.text("en", "only") == "English only"
    assert texts.text("hr", "only") == "[en] English only"
    assert texts.text("xx", "who", user="Ana") == "[en] by Ana"
    assert texts.text("hr", "no.such.key") == "[no.such.key]"


def test_a_key_that_was_written_down_under_another_plant_is_told_by_its_last_part() -> None:
    plant, _ = read_plant(DEMO)
    texts = Texts(ROWS, plant)
    for kind in ("", "eura_e800", "gone", *(plant.types.values() if plant else ())):
        assert texts.of_former("en", kind, "point.no_such") == "no_such"
        assert texts.of_former("hr", kind, "who", user="Ana") == "upravlja: Ana"
    assert texts.of_former("de", "eura_e800", "command.stop") == texts.of_type("de", "eura_e800", "command.stop")


def test_the_plants_first_language_comes_before_english() -> None:
    plant, _ = read_plant(DEMO)
    assert plant
    texts = Texts(ROWS, plant)
    assert texts.text("de", "who", user="Ana") == "[hr] upravlja: Ana"
    assert texts.label("de", plant.equipment["m1"].label) == "Lüfter 1"
    assert texts.label("de", {"hr": "Peć"}) == "[hr] Peć"


def test_a_types_own_texts_come_first() -> None:
    plant, _ = read_plant(DEMO)
    assert plant
    texts = Texts(ROWS, plant)
    assert texts.of_type("de", "eura_e800", "command.reverse") == "Rückwärts"
    assert (
        texts.of_type("cs", plant.types["eura_e800"], "fault.unknown", code=77) == "Neznámý kód 77, viz příručku měniče"
    )
    assert texts.of_type("en", "eura_e800", "only") == "English only"
    assert texts.has("hr", "rows")
    assert not texts.has("hr", "only")


def test_placeholders_take_data_and_never_code() -> None:
    assert fill("{a} {b}", {"a": "{b}"}) == "{b} {b}"
    assert fill("{a.__class__}", {"a": 1}) == "{a.__class__}"
    assert fill("broken {", {"a": 1}) == "broken {"
    assert fill("50 %", {}) == "50 %"


@pytest.mark.sweep(8)
@given(st.text(), st.dictionaries(st.text(), st.integers()))
def test_no_text_fails_at_its_reader(text: str, params: dict[str, int]) -> None:
    assert isinstance(fill(text, params), str)


def test_categories_are_the_ones_of_the_languages() -> None:
    assert plural_category("cs", 1.5) == "many"
    assert plural_category("xx", 1) == "other"
    assert plural_category("hr", -1) == "one"


def test_product_files_are_joined_and_a_key_that_is_there_twice_is_told(tmp_path: Path) -> None:
    (tmp_path / "en").mkdir()
    (tmp_path / "en" / "frame.toml").write_text(
        '[nav]\nhome = "Home"\n[nav.rows]\none = "{n} row"\nother = "{n} rows"\n'
    )
    assert Texts(read_product(tmp_path)).text("en", "nav.rows", n=2) == "2 rows"
    (tmp_path / "en" / "more.toml").write_text('nav.home = "Start"\n')
    with pytest.raises(ConfigurationError, match=r"en/more\.toml: text nav\.home is there twice"):
        read_product(tmp_path)
    (tmp_path / "en" / "more.toml").write_text("nav = \n")
    with pytest.raises(ConfigurationError, match=r"en/more\.toml"):
        read_product(tmp_path)


def test_who_asks_for_names_of_the_plant_does_not_collect_the_texts_of_its_types(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plant, _ = read_plant(DEMO)
    assert plant
    gathered: list[object] = []
    gather = texts_module._by_type
    monkeypatch.setattr(texts_module, "_by_type", lambda plant: gathered.append(plant) or gather(plant))
    texts = Texts({}, plant)
    assert texts.label("en", plant.equipment["m1"].label) == "Fan 1"
    assert gathered == []
    key = next(iter(plant.types["eura_e800"].texts["en"]))
    assert [texts.text("en", f"eura_e800.{key}") for _ in range(2)] == [plant.types["eura_e800"].texts["en"][key]] * 2
    assert gathered == [plant]
