"""Rows of a type that there are as many of as an option says."""

import shutil
from pathlib import Path

import pytest

from app.errors import ConfigurationError
from app.plant import types
from app.plant.loader import read_plant
from app.plant.type_files.repeats import read_repeats, written_out

DEVICE = {
    "options": {"belts": {"default": 3, "low": 1, "high": 16}},
    "repeats": {"belt": {"to": "belts"}, "inner": {"to": "belts - 1"}, "later": {"from": "2", "to": "belts"}},
}


def written(data: dict[str, object], belts: int) -> dict[str, object]:
    return written_out(data, read_repeats(DEVICE, {"belts": belts}).numbers).data


def test_a_row_is_written_for_each_number_with_its_own_registers() -> None:
    rows = {
        "speed_{belt}": {
            "address": {"by": [[1, 100, 14], [4, 500, 12]]},
            "when": "m_{belt-1} > {belt}",
            "source": "{belt}",
        }
    }
    assert written(rows, 5) == {
        f"speed_{n}": {"address": at, "when": f"m_{n - 1} > {n}", "source": n}
        for n, at in zip(range(1, 6), (100, 114, 128, 500, 512), strict=True)
    }
    assert written(rows, 1).keys() == {"speed_1"}
    bits = written({"jam_{belt}": {"bits": [[1, 9, 14]], "mask": 1}}, 4)
    assert [(row["address"], row["shift"]) for row in bits.values()] == [(9, 14), (9, 15), (10, 0), (10, 1)]  # type: ignore[index]


def test_lists_sentences_and_tables_follow_the_number() -> None:
    data = {
        "tile": ["state", "motor_{belt}"],
        "all": "every(belt: abs(jam_{belt}) == 0)",
        "some": "a > 1 or any(inner: b_{inner} > 0)",
        "of": {"of": "belt", "by": [[1, 6, 0], [4, 8, 2]]},
        "images": [{"address": 1}, {"only": "inner", "address": 2}],
        "checks": [{"each": ["later"], "of": "{later}"}],
        "text": "{product} stays",
    }
    assert written(data, 2) == {
        "tile": ["state", "motor_1", "motor_2"],
        "all": "abs(jam_1) == 0 and abs(jam_2) == 0",
        "some": "a > 1 or (b_1 > 0)",
        "of": 6,
        "images": [{"address": 1}, {"address": 2}],
        "checks": [{"of": 2}],
        "text": "{product} stays",
    }
    one = written(data, 1)
    assert (one["some"], one["images"], one["checks"]) == ("a > 1 or (1 == 0)", [{"address": 1}], [])
    assert written(data, 5)["of"] == 10


def test_what_counts_with_no_option_is_told() -> None:
    with pytest.raises(ConfigurationError, match=r"repeats\.belt counts with tracks"):
        read_repeats({**DEVICE, "repeats": {"belt": {"to": "tracks"}}}, {})
    with pytest.raises(ConfigurationError, match="expected expressions"):
        read_repeats({**DEVICE, "repeats": {"belt": {"to": 3}}}, {})


def test_a_mistake_in_a_repeated_row_is_told_where_it_is_written(tmp_path: Path) -> None:
    for source in (types.EQUIPMENT / "conveyor").glob("*.toml"):
        text = source.read_text("utf-8")
        (tmp_path / "conveyor").mkdir(exist_ok=True)
        if source.name == "points.toml":
            assert '["beam_{sensor}"]\n' in text
            text = text.replace('["beam_{sensor}"]\n', '["beam_{sensor}"]\nscann = 1\n')
        (tmp_path / "conveyor" / source.name).write_text(text, "utf-8")
    line = (tmp_path / "conveyor" / "points.toml").read_text("utf-8").splitlines().index("scann = 1") + 1
    _, problems = types.read_type("conveyor", ["en"], tmp_path)
    assert {(one.key, one.line) for one in problems if "scann" in one.key} == {
        (f"beam_{n}.scann", line) for n in range(1, 5)
    }


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("file", "old", "new", "key", "expected"),
    [
        ("tables", "by = [[1, 6, 0], [4, 8, 2]]", 'by = "six"', "capacity.by", "[[from, first, step]"),
        ("tables", "by = [[1, 6, 0], [4, 8, 2]]", "by = [[5, 6, 0]]", "capacity.by", "the first from 3 or less"),
        ("tables", "by = [[1, 6, 0], [4, 8, 2]]", "by = [[1, 6]]", "capacity.by", "[[from, first, step]"),
        ("tables", 'capacity = { of = "belt"', 'capacity = { of = "track"', "capacity.of", "one of [repeats]: belt"),
        ("tables", 'capacity = { of = "belt"', "capacity = { of = [1]", "capacity.of", "one of [repeats]: belt"),
        ("points", "by = [[1, 0x2181, 1]]", "by = []", "address.by", "[[from, first, step]"),
        ("device", 'each = ["next"]', 'each = ["next", "last"]', "each.1", "one of [repeats]"),
        ("device", 'each = ["next"]', 'each = "later"', "each", "a list of names of [repeats]"),
        ("device", 'each = ["next"]', "each = [[1]]", "each.0", "one of [repeats]"),
        ("device", 'only = "', 'only = "x', "only", "one of [repeats]"),
        ("device", 'belt = { to = "belts" }', 'belt = { to = "belts * 1000" }', "repeats", "at most 1000"),
    ],
)
def test_a_mistake_in_how_rows_are_repeated_is_told(
    tmp_path: Path, file: str, old: str, new: str, key: str, expected: str
) -> None:
    shutil.copytree(types.EQUIPMENT / "conveyor", tmp_path / "conveyor")
    path = tmp_path / "conveyor" / f"{file}.toml"
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")
    given = {"belts": 5.0, "sensors": 6.0} if file == "points" else {}
    _, problems = types.read_type("conveyor", ["en"], tmp_path, given=given)
    assert [one for one in problems if one.key.endswith(key) and expected in one.expected], problems


HEAD = """\
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.line]
transport = "memory"
[equipment.c1]
type = "conveyor"
link = "line"
unit = 1
"""


def told(tmp_path: Path, rows: str) -> list[str]:
    (tmp_path / "plant.toml").write_text(HEAD + rows, "utf-8")
    return [str(one) for one in read_plant(tmp_path)[1]]


def test_a_machine_has_as_many_points_alarms_and_commands_as_its_plant_file_says(tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(
        HEAD + "belts = 2\nsensors = 1\nsensor_1 = 300\nline_length = 430\n"
        '[equipment.c2]\ntype = "conveyor"\nlink = "line"\nunit = 2\n',
        "utf-8",
    )
    plant, problems = read_plant(tmp_path)
    assert plant, problems
    two, three = plant.equipment["c1"], plant.equipment["c2"]
    assert {"motor_2", "area_3", "belt_1_end"} <= two.points.keys()
    assert not {"motor_3", "beam_2", "belt_2_end"} & two.points.keys()
    assert {"motor_3", "beam_4"} <= three.points.keys()
    assert {alarm.key for alarm in two.alarms} >= {"jam_2", "sensor_1"} and "jam_3" in {one.key for one in three.alarms}
    assert "jog_forward_3" not in two.type.commands and "jog_forward_3" in three.type.commands
    assert (two.type.name, plant.types["conveyor"]) == ("conveyor", three.type)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("belts = 17", "c1.belts = 17: expected a number from 1 to 16"),
        ("belts = 2.5", "c1.belts = 2.5: expected a whole number"),
        ("belts = 4\nbelt_2_share = 62.5", "c1.belt_2_share = 62.5: expected a whole number"),
        ("resolution = 1650.5", "c1.resolution = 1650.5: expected a whole number"),
        ("belts = true", "c1.belts = true: expected a number from 1 to 16"),
        ("belt_4_end = 700", "belt_4_end = 700: expected no such key"),
        ("belts = 5\nsensor_4 = 560", "sensor_4 = 560: expected a position on belt 5, between 905 and 1120 mm"),
        (
            "sensors = 5\nsensor_4 = 560\nsensor_5 = 500",
            "sensor_5 = 500: expected a position behind sensor_4, which is 560 mm",
        ),
        ("belts = 4\nbelt_2_end = 700", "belt_3_end = 675: expected a position behind belt_2_end, which is 700 mm"),
    ],
)
def test_what_cannot_be_built_is_told(tmp_path: Path, rows: str, said: str) -> None:
    found = told(tmp_path, rows + "\n")
    assert any(said in line for line in found), found
