"""`base`: several machines behind one unit, each with its registers from its own base on, and none on those of another."""

from pathlib import Path

import pytest

from app.plant.changes import compare
from app.plant.definitions import Plant
from app.plant.loader import read_plant
from tests.plant.test_own_types import FILES, PLANT, written

DEVICE = 'label = "type"\narea = "scales"\n[device]\nread_functions = [1, 3]\nwrite_functions = [5, 6]\n'
POINTS = """
[weight]
address = 1
unit = "kg"
[bits]
address = 9
[low]
part_of = "bits"
mask = 1
[empty]
address = 1
table = "coil"
writable = true
"""
TEXTS = FILES["texts.en"] + 'point.bits = "Bits"\npoint.low = "Low"\npoint.empty = "Empty"\n'
SECOND = '[equipment.w2]\ntype = "scale"\nlink = "line"\nunit = 1\nlabel = "Scale 2"\n'


def read(folder: Path, plant: str, device: str = DEVICE) -> tuple[Plant | None, list[tuple[str, str]]]:
    plant_, problems = read_plant(written(folder, plant, device=device, points=POINTS, texts_en=TEXTS))
    return plant_, [(one.key, one.expected) for one in problems]


def test_every_address_of_a_machine_is_so_much_further(tmp_path: Path) -> None:
    plant, problems = read(tmp_path, PLANT + SECOND + "base = 100\n")
    assert plant is not None, problems
    places = {
        point.name: (point.register.table, point.register.address)
        for item in plant.equipment.values()
        for point in item.points.values()
        if point.register
    }
    assert places == {
        "w1.weight": ("holding", 1), "w1.bits": ("holding", 9), "w1.low": ("holding", 9), "w1.empty": ("coil", 1),
        "w2.weight": ("holding", 101), "w2.bits": ("holding", 109), "w2.low": ("holding", 109), "w2.empty": ("coil", 101),
    }  # fmt: skip
    assert [(item.unit, item.base) for item in plant.equipment.values()] == [(1, 0), (1, 100)]


@pytest.mark.parametrize(
    ("more", "key", "expected"),
    [
        ("", "equipment.w2.unit", "no other equipment on line has; w1 has it (with `base`"),
        ("base = 0\n", "equipment.w2.base", "w2.weight does not lie on w1.weight: both have 0x0001 of table holding"),
        ("base = 8\n", "equipment.w2.base", "w2.weight does not lie on w1.bits: both have 0x0009 of table holding"),
        ("base = 65530\n", "equipment.w2.base", "w2.bits ends at 65535 at most"),
        ("base = -1\n", "equipment.w2.base", "from 0 to 65535"),
        ("base = 65536\n", "equipment.w2.base", "from 0 to 65535"),
        ('base = "100"\n', "equipment.w2.base", "from 0 to 65535"),
    ],
)
def test_two_machines_never_have_the_same_register(tmp_path: Path, more: str, key: str, expected: str) -> None:
    _, problems = read(tmp_path, PLANT + SECOND + more)
    assert problems[0][0] == key and expected in problems[0][1], problems


def test_a_machine_that_stands_alone_may_have_a_base_too_and_a_third_one_is_looked_at_as_the_second(
    tmp_path: Path,
) -> None:
    plant, problems = read(tmp_path / "one", PLANT + "base = 7\n")
    assert plant is not None and plant.equipment["w1"].points["weight"].register is not None, problems
    assert plant.equipment["w1"].points["weight"].register.address == 8
    third = SECOND.replace("w2", "w3").replace("Scale 2", "Scale 3") + "base = 100\n"
    _, problems = read(tmp_path / "three", PLANT + SECOND + "base = 100\n" + third)
    assert [key for key, _ in problems] == ["equipment.w3.base"] and "w2.weight" in problems[0][1]


def test_a_row_repeated_with_a_step_is_many_machines_of_one_unit(tmp_path: Path) -> None:
    plant, problems = read(tmp_path / "many", PLANT + SECOND + "base = 100\nrepeat = 3\nbase_step = 20\n")
    assert plant is not None and not problems
    found = {item.id: (item.unit, item.base) for item in plant.equipment.values()}
    assert found == {"w1": (1, 0), "w2_01": (1, 100), "w2_02": (1, 120), "w2_03": (1, 140)}
    weights = [item.points["weight"].register for item in plant.equipment.values()]
    assert [register and register.address for register in weights] == [1, 101, 121, 141]
    many, problems = read(tmp_path / "most", PLANT.replace("unit = 1", "unit = 247\nrepeat = 300\nbase_step = 9"))
    assert many is not None and not problems, "units do not count up: there are enough of them"
    assert {item.unit for item in many.equipment.values()} == {247} and many.equipment["w1_300"].base == 2691


@pytest.mark.parametrize(
    ("more", "key", "expected"),
    [
        ("base_step = 20\n", "base_step", "with `repeat` only"),
        ("repeat = 3\nbase = 100\nbase_step = 0\n", "base_step", "from 1 to 65535"),
        (
            "repeat = 3\nbase = 100\nbase_step = 8\n",
            "base",
            "w2_02.weight does not lie on w2_01.bits: both have 0x006D",
        ),
        ("repeat = 3\nbase_step = 20\n", "base_step", "w2_01.weight does not lie on w1.weight"),
        ("repeat = 3\nbase = 100\nbase_step = 40000\n", "base", "w2_03.weight ends at 65535 at most"),
    ],
)
def test_a_step_is_judged_as_a_base_is_and_its_mistake_is_told_once(
    tmp_path: Path, more: str, key: str, expected: str
) -> None:
    _, problems = read(tmp_path, PLANT + SECOND + more)
    told = [text for name, text in problems if name == f"equipment.w2.{key}"]
    assert len(told) == 1 and expected in told[0], problems


def test_a_unit_is_one_device(tmp_path: Path) -> None:
    folder = written(tmp_path, PLANT, device=DEVICE, points=POINTS, texts_en=TEXTS)
    other = DEVICE.replace("[device]", "[device]\nmax_read = 9\nholes = [[30, 40]]")
    for name, device in (("other", other), ("same", other.replace("max_read = 9\n", ""))):
        written(folder, PLANT, name, device=device, points=POINTS, texts_en=TEXTS)
        second = SECOND.replace('"scale"', f'"{name}"') + "base = 100\n"
        (folder / "plant.toml").write_text(PLANT + second, "utf-8")
        found = [(one.key, one.expected) for one in read_plant(folder)[1]]
        if name == "same":
            assert found == []
        else:
            assert found[0][0] == "equipment.w2.unit" and "the `[device]` of w1" in found[0][1]


@pytest.mark.parametrize(
    ("machine", "expected"),
    [
        ('type = "sequence"\nlink = "line"\nunit = 2\nbase = 100\ndefinition = "x"\n', ""),
        ('type = "conveyor"\nlink = "line"\nunit = 2\nbase = 100\npreset = "model"\n', "what conveyor has besides registers"),
        ('type = "eura_e800"\nlink = "line"\nunit = 2\nbase = 100\n', "what eura_e800 has besides registers"),
        ('type = "eura_e800"\nlink = "line"\nunit = 2\nbase = -1\n', "what eura_e800 has besides registers"),
        ('type = "scale"\nlink = "memory"\nunit = 2\nbase = 100\n', "on a simulated link"),
        ('type = "scale"\nlink = "memory"\nunit = 2\nbase = 1\nrepeat = 2\nbase_step = 9\n', "on a simulated link"),
    ],
)  # fmt: skip
def test_what_has_fixed_addresses_has_no_base(tmp_path: Path, machine: str, expected: str) -> None:
    link = '[links.memory]\ntransport = "memory"\n'
    _, problems = read(tmp_path, PLANT + link + f"[equipment.x1]\n{machine}")
    told = [text for key, text in problems if key == "equipment.x1.base"]
    assert not expected or (len(told) == 1 and expected in told[0]), problems


def test_a_link_to_the_same_host_is_the_same_unit_still(tmp_path: Path) -> None:
    link = '[links.other]\ntransport = "tcp"\nhost = "localhost"\n'
    _, problems = read(tmp_path, PLANT + link + SECOND.replace('"line"', '"other"') + "base = 100\n")
    assert problems[0][0] == "equipment.w2.unit" and "w1 on line has it" in problems[0][1]


def test_another_base_is_another_place(tmp_path: Path) -> None:
    before, _ = read(tmp_path, PLANT + SECOND + "base = 100\n")
    (tmp_path / "plant.toml").write_text(PLANT + SECOND + "base = 200\n", "utf-8")
    after, _ = read_plant(tmp_path)
    assert before is not None and after is not None
    (change,) = compare(before, after)
    assert change.name == "w2" and "base: 100 → 200" in change.details
    assert change.effects[0].key == "elsewhere"
