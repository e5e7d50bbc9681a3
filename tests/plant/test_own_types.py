"""A plant folder may bring types of its own, `equipment/<type>/`: read as ours are, never run as Python, never from outside of it."""

from pathlib import Path

import pytest

from app.plant.changes import compare
from app.plant.loader import read_plant
from app.plant.problems import Problem

PLANT = """
[plant]
name = "Waterworks"
timezone = "Europe/Zagreb"
languages = ["hr", "en"]
[links.line]
transport = "tcp"
host = "127.0.0.1"
[equipment.w1]
type = "scale"
link = "line"
unit = 1
label = "Scale 1"
"""
FILES = {
    "device": 'label = "type"\narea = "scales"\n[device]\n',
    "points": '[weight]\naddress = 1\nunit = "kg"\n',
    "texts.en": 'type = "Scale"\narea = "Scales"\npoint.weight = "Weight"\n',
}


def written(folder: Path, plant: str = PLANT, name: str = "scale", **files: str) -> Path:
    kind = folder / "equipment" / name
    kind.mkdir(parents=True)
    for file, text in {**FILES, **{key.replace("_", "."): text for key, text in files.items()}}.items():
        (kind / f"{file}.toml").write_text(text, "utf-8")
    (folder / "plant.toml").write_text(plant, "utf-8")
    return folder


def problems(folder: Path) -> list[Problem]:
    return read_plant(folder)[1]


def test_a_plant_brings_a_type_and_what_it_lacks_in_a_language_comes_in_another(tmp_path: Path) -> None:
    plant, found = read_plant(written(tmp_path))
    assert plant, found
    assert plant.equipment["w1"].points["weight"].unit == "kg"
    assert plant.areas["scales"]["en"] == "Scales"
    assert plant.types["scale"].texts["en"]["type"] == "Scale" and plant.types["scale"].texts["hr"] == {}


def test_a_mistake_is_told_with_the_place_of_the_file(tmp_path: Path) -> None:
    (found,) = problems(written(tmp_path, points='[weight]\naddress = 1\nunits = "kg"\n'))
    assert (found.file, found.line, found.key) == ("equipment/scale/points.toml", 3, "weight.units")


def test_a_text_that_no_language_has_is_a_mistake(tmp_path: Path) -> None:
    (found,) = problems(written(tmp_path, points="[weight]\naddress = 1\n[tare]\naddress = 2\n"))
    assert (found.file, found.key, found.value) == ("equipment/scale/texts.hr.toml", "point.tare", "missing")


@pytest.mark.parametrize("text", ["true", '["Weight"]', "2026-11-27", "[{ a = 1 }]"])
def test_what_is_no_text_is_not_drawn_as_one(tmp_path: Path, text: str) -> None:
    words = FILES["texts.en"].replace('"Weight"', text)
    (found,) = problems(written(tmp_path, **{"texts.en": words}))
    assert (found.file, found.line, found.key) == ("equipment/scale/texts.en.toml", 3, "point.weight")
    assert found.expected == "a text"


def test_a_number_is_a_text_and_a_blank_one_is_a_warning(tmp_path: Path) -> None:
    words = FILES["texts.en"].replace('"Weight"', "10").replace('"Scales"', '" "')
    plant, found = read_plant(written(tmp_path, **{"texts.en": words}))
    assert plant, found
    assert plant.types["scale"].texts["en"]["point.weight"] == "10"
    assert [(one.key, one.file) for one in plant.doubts] == [("area", "equipment/scale/texts.en.toml")]


def test_a_type_of_ours_is_not_replaced(tmp_path: Path) -> None:
    found = problems(written(tmp_path, PLANT.replace('"scale"', '"conveyor"'), name="conveyor"))
    assert [(one.file, one.value, one.expected) for one in found] == [
        ("equipment/conveyor", "conveyor", "a name that no type of Pogon has")
    ]


def test_its_python_is_not_run(tmp_path: Path) -> None:
    folder = written(tmp_path, records="")
    (folder / "equipment/scale/records.py").write_text("raise SystemExit\n", "utf-8")
    (folder / "equipment/scale/__init__.py").write_text("raise SystemExit\n", "utf-8")
    (folder / "equipment/scale/records.toml").write_text("[weighing]\n", "utf-8")
    found = problems(folder)
    assert found and {one.file for one in found} == {"equipment/scale/records.toml"}


def test_no_link_leads_out_of_the_folder(tmp_path: Path) -> None:
    folder = written(tmp_path / "plant")
    points = folder / "equipment/scale/points.toml"
    points.rename(tmp_path / "points.toml")
    points.symlink_to(tmp_path / "points.toml")
    assert [one.file for one in problems(folder)] == ["equipment/scale/points.toml"]


def test_one_may_be_of_the_kin_of_a_type_of_ours(tmp_path: Path) -> None:
    plant, found = read_plant(written(tmp_path, device=f'kin = "sinamics"\n{FILES["device"]}'))
    assert plant, found
    assert plant.types["scale"].kin == "sinamics" and plant.types["scale"].drive_parameters


@pytest.mark.parametrize("name", ["Scale", "my-scale", "1scale", "scale.old"])
def test_what_is_no_name_of_a_type_is_none(tmp_path: Path, name: str) -> None:
    found, folder = problems(written(tmp_path, PLANT.replace('"scale"', f'"{name}"'), name=name))
    assert (folder.file, folder.value) == (f"equipment/{name}", name)
    assert (found.key, found.value) == ("equipment.w1.type", f'"{name}"')


def test_a_change_of_it_is_a_change_of_the_plant(tmp_path: Path) -> None:
    before, _ = read_plant(written(tmp_path))
    (tmp_path / "equipment/scale/points.toml").write_text('[weight]\naddress = 7\nunit = "kg"\n', "utf-8")
    after, _ = read_plant(tmp_path)
    assert before and after
    assert compare(before, before) == []
    assert ("type", "changed", "scale") in [(one.what, one.kind, one.name) for one in compare(before, after)]


@pytest.mark.parametrize("file", ["device", "points", "commands", "texts.en"])
def test_a_file_that_is_no_toml_is_told_alone_and_not_what_the_others_miss_of_it(tmp_path: Path, file: str) -> None:
    files = FILES | {
        "device": 'label = "type"\narea = "scales"\ntile = ["weight"]\n[device]\n[options.most]\ndefault = 5\n',
        "points": '[weight]\naddress = 1\nunit = "kg"\nhigh = "most"\n[tare]\naddress = 2\nwritable = true\n',
        "commands": '[zero]\nwrites = [{ point = "tare", value = 1 }]\nfeedback = "weight == 0"\n',
        "alarms": '[heavy]\nexpression = "weight > 4"\nvalue = "weight"\npriority = 3\n',
    }
    lines = files[file].splitlines(keepends=True)
    (found,) = problems(written(tmp_path, **files | {file: "".join([*lines, lines[-1]])}))
    assert (found.file, found.line, found.key) == (f"equipment/scale/{file}.toml", len(lines) + 1, "(file)")


def test_a_file_that_is_no_toml_hides_no_file_that_nobody_reads(tmp_path: Path) -> None:
    found = problems(written(tmp_path, points="[weight]\n[weight]\n", alarm="[heavy]\n"))
    assert [(one.file, one.key) for one in found] == [
        ("equipment/scale/alarm.toml", "(file)"),
        ("equipment/scale/points.toml", "(file)"),
    ]


@pytest.mark.parametrize("name", ["DEVICE.TOML", "device.Toml", ""])
def test_a_type_without_its_first_file_is_wrong_and_not_unknown(tmp_path: Path, name: str) -> None:
    folder = written(tmp_path)
    device = folder / "equipment" / "scale" / "device.toml"
    device.rename(device.with_name(name)) if name else device.unlink()
    told = [(one.file, one.key) for one in problems(folder)]
    place = "equipment/scale/"
    assert told == [(place + file, "(file)") for file in ([name] if name else []) + ["device.toml"]]


@pytest.mark.parametrize("texts", ["[]", "{}"])
@pytest.mark.parametrize("kind", ["", 'kind = "enum"\n'])
def test_an_enumeration_without_a_single_value_is_a_mistake(tmp_path: Path, kind: str, texts: str) -> None:
    (found,) = problems(written(tmp_path, points=f"[weight]\naddress = 1\n{kind}texts = {texts}\n"))
    assert (found.file, found.key, found.value) == ("equipment/scale/points.toml", "weight.texts", texts)
    assert found.expected.startswith("the values of the enumeration with their texts")


LESSON = """
[lesson]
type = "scale"
title = "Weigh"
about = "Weigh it."
[[steps]]
title = "Load"
text = "Put something on it."
until = "weight > 1"
"""


def test_a_mistake_of_a_type_is_told_and_none_of_a_lesson_about_it(tmp_path: Path) -> None:
    (tmp_path / "lessons").mkdir()
    (tmp_path / "lessons" / "weigh.toml").write_text(LESSON, "utf-8")
    (found,) = problems(written(tmp_path, points='[weight]\naddress = 1\nunits = "kg"\n'))
    assert (found.file, found.key) == ("equipment/scale/points.toml", "weight.units")


def test_a_lesson_about_a_type_that_no_machine_of_the_plant_has_is_a_mistake(tmp_path: Path) -> None:
    (tmp_path / "lessons").mkdir()
    (tmp_path / "lessons" / "weigh.toml").write_text(LESSON.replace('"scale"', '"meter"'), "utf-8")
    (found,) = problems(written(tmp_path))
    assert (found.file, found.line, found.key) == ("lessons/weigh.toml", 3, "lesson.type")
    assert str(found).endswith("expected one of scale"), found
