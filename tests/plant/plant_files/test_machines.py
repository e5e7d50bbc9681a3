"""Machines of a plant file: each mistake names file, line, key, value and expectation."""

from pathlib import Path

import pytest

from tests.plant.design import DESIGN, changed, loaded, mistakes

MISTAKES = [
    ('link = "press_shop"', 'link = "pres_shop"', "equipment.m2.link", '"pres_shop"', "perhaps press_shop"),
    ("unit = 1", "unit = 0", "equipment.m2.unit", "0", "from 1 to 247"),
    ("unit = 1", "unit = 248", "equipment.m2.unit", "248", "from 1 to 247"),
    ("unit = 1", "unit = 1.5", "equipment.m2.unit", "1.5", "a whole number"),
    ("unit = 1", "unit = true", "equipment.m2.unit", "true", "a whole number"),
    ("unit = 1", "", "equipment.m2.unit", "missing", "from 1 to 247"),
    ("unit = 1", "unit = 1\nrepeat = 0", "equipment.m2.repeat", "0", "from 1 to 1000"),
    ("unit = 1", "unit = 200\nrepeat = 50", "equipment.m2.repeat", "50", "at most 48"),
    ("unit = 1", 'unit = 1\nrepeat = "30"', "equipment.m2.repeat", '"30"', "a whole number"),
    ("[equipment.m2]", "[equipment.M-2]", "equipment.M-2", '"M-2"', "small letters"),
    ("[equipment.m2]", "[equipment.sys]", "equipment.sys", '"sys"', "not sys"),
    ("unit = 1", 'unit = 1\narea = "attic"', "equipment.m2.area", '"attic"', "an area of this file"),
    ("unit = 1", 'unit = 1\nwas = "Old!"', "equipment.m2.was", '"Old!"', "former id"),
    ("unit = 1", "unit = 1\npoints = { sped = {} }", "equipment.m2.points.sped", '"sped"', "perhaps speed"),
    ("unit = 1", "unit = 1\npoints.speed.normal = [9, 1]", "equipment.m2.points.speed.normal", "[9, 1]", "low <= high"),
    (
        "unit = 1",
        "unit = 1\npoints.speed.scale_low = 9\npoints.speed.scale_high = 1",
        "equipment.m2.points.speed.scale_high",
        "1",
        "scale_low < scale_high; they are 9 and 1",
    ),
    ("unit = 1", "unit = 1\npoints.speed.dead_band = -1", "equipment.m2.points.speed.dead_band", "-1", "from 0 up"),
    ("unit = 1", "unit = 1\npoints.speed.unit = 1", "equipment.m2.points.speed.unit", "1", "no such key"),
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


def test_repeat_makes_a_class_room(tmp_path: Path) -> None:
    plant = loaded(tmp_path, changed("unit = 1", "unit = 1\nrepeat = 30"))
    assert list(plant.equipment)[0::29] == ["m2_01", "m2_30"]
    assert [item.unit for item in plant.equipment.values()] == list(range(1, 31))
    assert plant.equipment["m2_07"].label["en"] == "Fan 2 7"
    assert len(plant.points) == 30 * len(plant.types["eura_e800"].points)
    numbered = loaded(tmp_path, changed('"Fan 2"', '"Fan {n} of 30"', changed("unit = 1", "unit = 1\nrepeat = 30")))
    assert numbered.equipment["m2_07"].label["en"] == "Fan 7 of 30"


def test_two_machines_cannot_share_a_unit_of_one_link(tmp_path: Path) -> None:
    second = DESIGN[DESIGN.index("[equipment") :].replace("m2]", "m3]")
    (problem,) = mistakes(tmp_path, DESIGN + second)
    assert (problem.key, problem.value) == ("equipment.m3.unit", "1")
    assert "m2 has it" in problem.expected
    assert "unit = 1" in (DESIGN + second).splitlines()[(problem.line or 0) - 1]
    assert (problem.line or 0) > DESIGN.count("\n")


def test_the_same_unit_on_two_links_is_two_machines(tmp_path: Path) -> None:
    links = '\n[links.other]\ntransport = "memory"\n'
    second = DESIGN[DESIGN.index("[equipment") :].replace("m2]", "m3]").replace('"press_shop"', '"other"')
    assert len(loaded(tmp_path, DESIGN + links + second).equipment) == 2


def test_repeat_does_not_take_the_id_of_another_machine(tmp_path: Path) -> None:
    second = DESIGN[DESIGN.index("[equipment") :].replace("m2]", "m2_02]").replace("unit = 1", "unit = 9")
    problems = mistakes(tmp_path, changed("unit = 1", "unit = 1\nrepeat = 3") + second)
    assert any(problem.value == '"m2_02"' and "ids that no other" in problem.expected for problem in problems)


TCP = DESIGN.replace('transport = "rtu"', 'transport = "tcp"').replace('port = "/dev/ttyUSB0"', 'host = "10.0.0.7"')


@pytest.mark.parametrize("unit", [0, 255])
def test_a_device_without_units_behind_it_has_unit_0_or_255_over_tcp(tmp_path: Path, unit: int) -> None:
    text = TCP.replace("unit = 1", f"unit = {unit}")
    assert loaded(tmp_path, text).equipment["m2"].unit == unit
    (problem,) = mistakes(tmp_path, text.replace(f"unit = {unit}", f"unit = {unit}\nrepeat = 2"))
    assert (problem.key, problem.value) == ("equipment.m2.repeat", "2") and "at most 1" in problem.expected


@pytest.mark.parametrize("unit", ["254", "256", "true", "255.0"])
def test_other_units_are_as_on_a_serial_line(tmp_path: Path, unit: str) -> None:
    (problem,) = mistakes(tmp_path, TCP.replace("unit = 1", f"unit = {unit}"))
    assert problem.key == "equipment.m2.unit"


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("10.0.0.7", "10.0.0.7"),
        ("plc.hall", "PLC.hall."),
        ("localhost", "127.0.0.1"),
        ("fd00::7", "FD00:0:0:0:0:0:0:7"),
    ],
)
def test_one_device_is_not_two_machines_on_two_links(tmp_path: Path, first: str, second: str) -> None:
    """Each had its own control, its own interlocks and its own people."""
    text = TCP.replace("10.0.0.7", first)
    other = text[text.index("[links") :].replace("press_shop", "other").replace("m2]", "m3]").replace(first, second)
    (problem,) = mistakes(tmp_path, text + other)
    assert (problem.key, problem.value) == ("equipment.m3.unit", "1")
    assert problem.expected.endswith(":502 has; m2 on press_shop has it")
    assert len(loaded(tmp_path, text + other.replace("unit = 1", "unit = 2")).equipment) == 2
    assert len(loaded(tmp_path, text + other.replace("writes = false", "port = 503")).equipment) == 2
