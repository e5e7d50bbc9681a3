"""A type speaks the languages of the plant that uses it; one mistake in it is one mistake."""

import shutil
from pathlib import Path

import pytest

from app.plant.loader import read_plant
from app.plant.plant_files import languages
from app.plant.problems import Problem
from app.plant.texts import Texts

TYPES = {
    "meter": {
        "device.toml": 'label = "type"\n[device]\n',
        "points.toml": '[power]\naddress = 1\nunit = "kW"\n',
        "texts.de.toml": 'type = "Zähler"\n[point]\npower = "Leistung"\n',
        "texts.en.toml": 'type = "Meter"\n[point]\npower = "Power"\n',
    }
}
PLANT = """
[plant]
name = "Hall"
timezone = "UTC"
languages = ["de", "en"]
[links.hall]
transport = "tcp"
host = "192.0.2.1"
[equipment.meter1]
type = "meter"
link = "hall"
unit = 1
[equipment.meter]
type = "meter"
link = "hall"
unit = 2
repeat = 2
"""
ALARM = '\n[[alarms]]\nequipment = "{id}"\nkey = "high"\nlabel = "High"\nexpression = "power > 5"\npriority = 2\n'


@pytest.fixture
def types(tmp_path: Path) -> Path:
    for name, files in TYPES.items():
        (tmp_path / "types" / name).mkdir(parents=True)
        for file, text in files.items():
            (tmp_path / "types" / name / file).write_text(text)
    return tmp_path / "types"


def problems(types: Path, plant: str = PLANT) -> list[Problem]:
    (types.parent / "plant.toml").write_text(plant)
    return read_plant(types.parent, type_folder=types)[1]


@pytest.mark.parametrize("languages", ['["de", "en"]', '["en", "de"]', '["en"]', '["de"]'])
def test_a_type_needs_the_languages_of_the_plant_only(types: Path, languages: str) -> None:
    assert problems(types, PLANT.replace('["de", "en"]', languages)) == []


@pytest.mark.parametrize("text", ["", "\n\n", "# nothing yet\n"])
def test_an_empty_file_of_another_language_is_no_mistake(types: Path, text: str) -> None:
    (types / "meter" / "texts.hr.toml").write_text(text)
    assert problems(types) == []


def test_a_language_that_the_plant_speaks_is_missed_by_name(types: Path) -> None:
    (said,) = problems(types, PLANT.replace('["de", "en"]', '["de", "en", "cs"]'))
    assert str(said) == "meter/texts.cs.toml: (file) = no such file: expected a TOML file"
    named = {problem.file for problem in problems(types, PLANT.replace('languages = ["de", "en"]\n', ""))}
    assert named == {"meter/texts.hr.toml", "meter/texts.cs.toml"}, "without a list it speaks all of ours"


def test_a_wrong_file_of_any_language_is_told(types: Path) -> None:
    (types / "meter" / "texts.hr.toml").write_text("no = = toml")
    (said,) = problems(types)
    assert said.file == "meter/texts.hr.toml"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("plant", ["demo", "own"])
def test_a_new_language_of_the_product_asks_nothing_of_who_does_not_speak_it(
    types: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plant: str
) -> None:
    shutil.copytree(languages.LOCALE, tmp_path / "locale")
    (tmp_path / "locale" / "sl").mkdir()
    (tmp_path / "locale" / "sl" / "frame.toml").write_text('[frame]\nalarms = "Alarmi"\n')
    monkeypatch.setattr(languages, "LOCALE", tmp_path / "locale")
    assert "sl" in languages.languages()
    if plant == "demo":
        assert read_plant(Path("plants/demo").resolve())[1] == []
    else:
        assert problems(types) == []
        assert {problem.file for problem in problems(types, PLANT.replace('["de", "en"]', '["de", "en", "sl"]'))} == {
            "meter/texts.sl.toml"
        }


def test_a_text_of_another_language_comes_with_its_mark(types: Path) -> None:
    (types.parent / "plant.toml").write_text(PLANT)
    plant, _ = read_plant(types.parent, type_folder=types)
    assert plant
    texts = Texts.read(plant)
    assert texts.of_type("hr", "meter", "point.power") == "[de] Leistung"


@pytest.mark.parametrize("id", ["meter1", "meter_01", "meter_02", "meter"])
@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("points.toml", "[power]\naddress = -1\n"),
        ("device.toml", 'label = "type"\n[device]\nmax_read = 1000\n'),
        ("alarms.toml", '[x]\nexpression = "power >"\npriority = 1\n'),
    ],
)
def test_a_mistake_in_a_type_is_no_second_one_in_the_alarms_of_its_machines(
    types: Path, id: str, file: str, text: str
) -> None:
    (types / "meter" / file).write_text(text)
    (said,) = problems(types, PLANT + ALARM.format(id=id))
    assert said.file == f"meter/{file}"


def test_an_alarm_of_nobody_is_a_mistake_beside_that_of_a_type(types: Path) -> None:
    (types / "meter" / "points.toml").write_text("[power]\naddress = -1\n")
    assert sorted(problem.file for problem in problems(types, PLANT + ALARM.format(id="pump"))) == [
        "meter/points.toml",
        "plant.toml",
    ]
