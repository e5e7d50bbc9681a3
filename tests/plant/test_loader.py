"""A plant folder is read whole, or every mistake in it is told with file, line, key, value and what was expected."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import cli
from app.plant.definitions import Kind, Scan
from app.plant.loader import read_plant
from tests.plant.design import DESIGN, changed, loaded, mistakes, write

DEMO = Path(__file__).parents[2] / "plants" / "demo"


def test_the_lines_of_the_design_page_are_enough(tmp_path: Path) -> None:
    plant = loaded(tmp_path, DESIGN)
    motor, link = plant.equipment["m2"], plant.links["press_shop"]
    assert plant.name["de"] == "Press shop"
    assert (plant.timezone, list(plant.languages)) == ("Europe/Zagreb", ["hr", "en", "de", "cs"])
    assert (link.transport, link.port, link.baud, link.parity, link.stop_bits) == (
        "rtu",
        "/dev/ttyUSB0",
        9600,
        "even",
        1,
    )
    assert (link.writes, link.may_write, link.simulated, link.believe_simulated) == (False, False, False, False)
    assert (motor.unit, motor.label["cs"], motor.options["rated_current"]) == (1, "Ventilátor 2", 2.5)
    assert plant.points["m2.current"].normal == (0.75, 2.4)
    assert (motor.area, plant.areas["drives"]["hr"]) == ("drives", "Pogoni")


def test_the_demo_plant_has_two_fans_a_conveyor_a_coil_car_its_sequence_a_crane_and_no_problems() -> None:
    plant, problems = read_plant(DEMO)
    assert problems == []
    assert plant is not None
    assert list(plant.equipment) == ["m1", "m2", "c1", "cc1", "seq1", "cr1", "a1"]
    assert all(link.simulated for link in plant.links.values())
    assert (plant.equipment["seq1"].machine, plant.equipment["seq1"].tables["step"]) == ("cc1", 8)
    assert plant.equipment["m1"].options["simulation"] == {"start": "forward", "F113": 40.0, "F905": 0.0}
    assert plant.equipment["m2"].options["simulation"] == {}


def test_a_point_is_named_after_its_equipment(tmp_path: Path) -> None:
    plant = loaded(tmp_path, DESIGN)
    speed = plant.points["m2.speed"]
    assert (speed.name, speed.id, speed.equipment, speed.key) == ("m2.speed", "m2.speed", "m2", "speed")
    assert (speed.scale_low, speed.scale_high) == (-1500, 1500)
    setpoint = plant.points["m2.frequency_setpoint"]
    assert (setpoint.kind, setpoint.scan) == (Kind.STEP, Scan.SLOW)
    assert plant.points["m2.f200"].kind is Kind.ENUM


def test_history_survives_a_rename_of_a_machine_and_of_a_point(tmp_path: Path) -> None:
    plant = loaded(tmp_path, DESIGN + 'was = "fan"\n[equipment.m2.points.current]\nwas = "old.amps"\nnormal = [1, 2]\n')
    assert plant.points["m2.speed"].id == "fan.speed"
    assert plant.points["m2.current"].id == "old.amps"
    assert plant.points["m2.current"].normal == (1, 2)
    assert plant.points["m2.current"].equipment == "m2"


LIMITS = DESIGN + "[equipment.m2.points.current]\n"


def test_a_plant_moves_the_limits_of_a_value_and_says_why(tmp_path: Path) -> None:
    point = loaded(tmp_path, LIMITS + 'high = 31\nreason = "A starter of another make beside it."\n').points[
        "m2.current"
    ]
    assert (point.low, point.high, point.reason) == (0, 31, "A starter of another make beside it.")


@pytest.mark.parametrize(
    ("lines", "key", "expected"),
    [
        ("high = 31", "points.current.reason", "why `high` differs here"),
        ('high = 31\nreason = " "', "points.current.reason", "why `high` differs here"),
        ('reason = "no limits"', "points.current.reason", "neither `low` nor `high`"),
        ('low = 5\nhigh = 4\nreason = "wrong"', "points.current.high", "low < high; they are 5 and 4"),
        ('high = -1\nreason = "wrong"', "points.current.high", "low < high; they are 0 and -1"),
        ('high = "31"\nreason = "a text"', "points.current.high", "a number"),
    ],
)
def test_limits_without_sense_or_reason_are_refused(tmp_path: Path, lines: str, key: str, expected: str) -> None:
    (problem,) = mistakes(tmp_path, LIMITS + lines + "\n")
    assert problem.key == f"equipment.m2.{key}" and expected in problem.expected


def test_limits_of_a_setpoint_are_those_of_its_device(tmp_path: Path) -> None:
    text = DESIGN + '[equipment.m2.points.frequency_setpoint]\nhigh = 60\nreason = "quick"\n'
    (problem,) = mistakes(tmp_path, text)
    assert "those of its device" in problem.expected


def test_one_history_cannot_have_two_heirs(tmp_path: Path) -> None:
    second = DESIGN[DESIGN.index("[equipment") :].replace("m2]", "m3]").replace("unit = 1", "unit = 2") + 'was = "m2"\n'
    (problem,) = mistakes(tmp_path, DESIGN + second)
    assert (problem.key, problem.value) == ("equipment.m3.was", '"m2"')
    assert "no other equipment has or had" in problem.expected


def test_signs_that_a_terminal_would_obey_are_shown_as_numbers(tmp_path: Path) -> None:
    (problem,) = mistakes(tmp_path, "\x1b[2J\0")
    assert problem.value == r"\x1b[2J\x00"


def test_areas_are_named_by_the_plant(tmp_path: Path) -> None:
    text = changed("unit = 1", 'unit = 1\narea = "north"') + '\n[areas.north]\nlabel = { en = "North hall" }\n'
    plant = loaded(tmp_path, text)
    assert plant.equipment["m2"].area == "north"
    assert dict(plant.areas) == {"north": {"en": "North hall"}}


MISTAKES = [
    ("[plant]", "[plants]", "plant", "missing", "name, timezone, languages"),
    ('name = "Press shop"', "", "plant.name", "missing", "a text"),
    ('name = "Press shop"', 'name = ""', "plant.name", '""', "a text"),
    ('"Europe/Zagreb"', '"Europe/Zagrb"', "plant.timezone", '"Europe/Zagrb"', "Europe/Zagreb"),
    ('"Europe/Zagreb"', "7", "plant.timezone", "7", "a text"),
    ('"Europe/Zagreb"', '"../../etc/passwd"', "plant.timezone", '"../../etc/passwd"', "a time zone"),
    ('timezone = "', 'colour = 1\ntimezone = "', "plant.colour", "1", "no such key"),
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


def test_all_mistakes_come_at_once(tmp_path: Path) -> None:
    text = DESIGN
    for old, new in (('"Europe/Zagreb"', '"Europe/Zagrb"'), ('"even"', '"evil"'), ("unit = 1", "unit = 0")):
        text = changed(old, new, text)
    text = changed("rated_current", "rated_curent", changed("9600", "9601", text))
    keys = {problem.key for problem in mistakes(tmp_path, text)}
    assert keys == {
        "plant.timezone",
        "links.press_shop.parity",
        "links.press_shop.baud",
        "equipment.m2.unit",
        "equipment.m2.rated_curent",
    }


@pytest.mark.parametrize(
    ("content", "value", "expected", "line"),
    [
        (b"", "an empty file", "TOML", None),
        (b"  \n\n", "an empty file", "TOML", None),
        (b"[plant\nname = 1", "[plant", "TOML (", 1),
        (b'[plant]\nname = "x"\nname = "y"\n', 'name = "y"', "TOML (", 3),
        (b'[plant]\nname = "\xff"\n', "byte 0xff", "UTF-8", 2),
        (b"PK\x03\x04\x00\x00", "PK", "TOML (", 1),
        (b"a = " + b"[" * 20000, "", "", None),
    ],
)
def test_what_is_no_toml_is_told_and_never_raises(
    tmp_path: Path, content: bytes, value: str, expected: str, line: int | None
) -> None:
    problem = mistakes(tmp_path, content)[0]
    assert value in problem.value
    assert expected in problem.expected
    assert line is None or problem.line == line


def test_a_plant_without_file_or_folder_is_told(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        plant, problems = read_plant(folder)
        assert plant is None
        assert str(problems[0]) == "plant.toml: (file) = no such file: expected a TOML file"
    (tmp_path / "plant.toml").mkdir()
    assert read_plant(tmp_path)[0] is None
    assert read_plant(tmp_path / "plant.toml" / "x" / "\0")[0] is None


def test_an_empty_plant_lacks_links_and_equipment(tmp_path: Path) -> None:
    keys = {problem.key for problem in mistakes(tmp_path, DESIGN[: DESIGN.index("[links")])}
    assert keys == {"links", "equipment"}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", ["plant", "links", "equipment", "areas", "alarms", "links.press_shop", "equipment.m2"])
@pytest.mark.parametrize("value", ["1", '"x"', "[]", "[1]", "true"])
def test_anything_in_place_of_a_table_is_told_and_never_raises(tmp_path: Path, name: str, value: str) -> None:
    table = re.compile(rf"^\[{re.escape(name)}(\.\w+)?\]\n(.+\n)*", re.M)
    text = f"{name} = {value}\n" + table.sub("", DESIGN)
    plant, problems = read_plant(write(tmp_path, text))
    assert (plant is None) == bool(problems)
    if name not in ("areas", "alarms") or value != "[]":
        assert problems


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    assert loaded(tmp_path, "\ufeff" + DESIGN).equipment


def test_the_command_line_says_what_is_wrong_or_that_nothing_is(tmp_path: Path) -> None:
    fine = CliRunner().invoke(cli, ["check", "--no-tests", str(DEMO)])
    assert fine.exit_code == 0
    assert "no problems" in fine.output
    wrong = CliRunner().invoke(cli, ["check", str(write(tmp_path, changed("9600", "9601")))])
    assert wrong.exit_code == 2
    assert "plant.toml:10: links.press_shop.baud = 9601: expected one of 1200" in wrong.output
