"""A plant folder is read whole, or every mistake in it is told with file, line, key, value and what was expected."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import cli
from app.plant.definitions import Kind, Plant, Scan
from app.plant.loader import read_plant
from app.plant.problems import Problem

DEMO = Path(__file__).parents[2] / "plants" / "demo"

DESIGN = """
[plant]
name = "Press shop"
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]

[links.press_shop]
transport = "rtu"            # memory | tcp | rtu
port = "/dev/ttyUSB0"
baud = 9600
parity = "even"
writes = false               # a live link sends commands only when this says so

[equipment.m2]
type = "eura_e800"
link = "press_shop"
unit = 1
label = { hr = "Ventilator 2", en = "Fan 2", de = "Lüfter 2", cs = "Ventilátor 2" }
rated_current = 2.5
"""


def write(folder: Path, text: str | bytes) -> Path:
    (folder / "plant.toml").write_bytes(text.encode() if isinstance(text, str) else text)
    return folder


def loaded(folder: Path, text: str) -> Plant:
    plant, problems = read_plant(write(folder, text))
    assert problems == []
    assert plant is not None
    return plant


def mistakes(folder: Path, text: str | bytes) -> list[Problem]:
    plant, problems = read_plant(write(folder, text))
    assert plant is None
    assert problems
    return problems


def changed(old: str, new: str, text: str = DESIGN) -> str:
    assert old in text
    return text.replace(old, new, 1)


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


def test_the_demo_plant_has_two_fans_a_conveyor_a_coil_car_its_sequence_and_no_problems() -> None:
    plant, problems = read_plant(DEMO)
    assert problems == []
    assert plant is not None
    assert list(plant.equipment) == ["m1", "m2", "c1", "cc1", "seq1"]
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


def test_repeat_makes_a_class_room(tmp_path: Path) -> None:
    plant = loaded(tmp_path, changed("unit = 1", "unit = 1\nrepeat = 30"))
    assert list(plant.equipment)[0::29] == ["m2_01", "m2_30"]
    assert [item.unit for item in plant.equipment.values()] == list(range(1, 31))
    assert plant.equipment["m2_07"].label["en"] == "Fan 2 7"
    assert len(plant.points) == 30 * len(plant.types["eura_e800"].points)
    numbered = loaded(tmp_path, changed('"Fan 2"', '"Fan {n} of 30"', changed("unit = 1", "unit = 1\nrepeat = 30")))
    assert numbered.equipment["m2_07"].label["en"] == "Fan 7 of 30"


def test_history_survives_a_rename_of_a_machine_and_of_a_point(tmp_path: Path) -> None:
    plant = loaded(tmp_path, DESIGN + 'was = "fan"\n[equipment.m2.points.current]\nwas = "old.amps"\nnormal = [1, 2]\n')
    assert plant.points["m2.speed"].id == "fan.speed"
    assert plant.points["m2.current"].id == "old.amps"
    assert plant.points["m2.current"].normal == (1, 2)
    assert plant.points["m2.current"].equipment == "m2"


def test_one_history_cannot_have_two_heirs(tmp_path: Path) -> None:
    second = DESIGN[DESIGN.index("[equipment") :].replace("m2]", "m3]").replace("unit = 1", "unit = 2") + 'was = "m2"\n'
    (problem,) = mistakes(tmp_path, DESIGN + second)
    assert (problem.key, problem.value) == ("equipment.m3.was", '"m2"')
    assert "no other equipment has or had" in problem.expected


def test_signs_that_a_terminal_would_obey_are_shown_as_numbers(tmp_path: Path) -> None:
    (problem,) = mistakes(tmp_path, "\x1b[2J\0")
    assert problem.value == r"\x1b[2J\x00"


def test_a_plant_may_add_alarms_of_its_own(tmp_path: Path) -> None:
    row = """
[[alarms]]
equipment = "m2"
key = "too_slow"
expression = "status == 1 and speed < 500"
priority = 3
on_delay = 5
label = { hr = "Ventilator: prespor", en = "Fan: too slow" }
response = "Clean the filter"
"""
    plant = loaded(tmp_path, DESIGN + row)
    alarm = plant.equipment["m2"].alarms[-1]
    assert (alarm.key, alarm.priority, alarm.on_delay) == ("too_slow", 3, 5.0)
    assert plant.texts["hr"][alarm.label] == "Ventilator: prespor"
    assert plant.texts["cs"][alarm.response] == "Clean the filter"


def test_areas_are_named_by_the_plant(tmp_path: Path) -> None:
    text = changed("unit = 1", 'unit = 1\narea = "north"') + '\n[areas.north]\nlabel = { en = "North hall" }\n'
    plant = loaded(tmp_path, text)
    assert plant.equipment["m2"].area == "north"
    assert dict(plant.areas) == {"north": {"en": "North hall"}}


def test_tcp_port_is_a_number_and_stop_bits_follow_parity(tmp_path: Path) -> None:
    tcp = changed(
        '"rtu"            # memory | tcp | rtu\nport = "/dev/ttyUSB0"', '"tcp"\nhost = "10.0.0.7"\nport = 1502'
    )
    link = loaded(tmp_path, tcp).links["press_shop"]
    assert (link.host, link.tcp_port) == ("10.0.0.7", 1502)
    assert loaded(tmp_path, changed('"even"', '"none"')).links["press_shop"].stop_bits == 2


MISTAKES = [
    ("[plant]", "[plants]", "plant", "missing", "name, timezone, languages"),
    ('name = "Press shop"', "", "plant.name", "missing", "a text"),
    ('name = "Press shop"', 'name = ""', "plant.name", '""', "a text"),
    ('"Europe/Zagreb"', '"Europe/Zagrb"', "plant.timezone", '"Europe/Zagrb"', "Europe/Zagreb"),
    ('"Europe/Zagreb"', "7", "plant.timezone", "7", "a text"),
    ('"Europe/Zagreb"', '"../../etc/passwd"', "plant.timezone", '"../../etc/passwd"', "a time zone"),
    ('["hr", "en", "de", "cs"]', '["hr", "fr"]', "plant.languages.1", '"fr"', "hr, en, de, cs"),
    ('["hr", "en", "de", "cs"]', '["hr", "hr"]', "plant.languages.1", '"hr"', "each language once"),
    ('["hr", "en", "de", "cs"]', "[]", "plant.languages", "[]", "at least one"),
    ('["hr", "en", "de", "cs"]', '"hr"', "plant.languages", '"hr"', "a list"),
    ('timezone = "', 'colour = 1\ntimezone = "', "plant.colour", "1", "no such key"),
    ('"rtu"', '"rtv"', "links.press_shop.transport", '"rtv"', "one of memory, tcp, rtu"),
    ('transport = "rtu"', "", "links.press_shop.transport", "missing", "a text"),
    ('port = "/dev/ttyUSB0"', "", "links.press_shop.port", "missing", "/dev/ttyUSB0"),
    ('"rtu"', '"tcp"', "links.press_shop.port", '"/dev/ttyUSB0"', "a whole number from 1 to 65535"),
    ("9600", "9601", "links.press_shop.baud", "9601", "9600"),
    ("9600", '"9600"', "links.press_shop.baud", '"9600"', "9600"),
    ("9600", "true", "links.press_shop.baud", "True", "9600"),
    ('"even"', '"evil"', "links.press_shop.parity", '"evil"', "none, even, odd"),
    ('"even"', '["even"]', "links.press_shop.parity", "['even']", "none, even, odd"),
    ("writes = false", 'writes = "no"', "links.press_shop.writes", '"no"', "true or false"),
    ("writes = false", "wirtes = false", "links.press_shop.wirtes", "False", "perhaps writes"),
    ("writes = false", "fast = 0", "links.press_shop.fast", "0", "from 0.01 to 3600"),
    ("writes = false", "stop_bits = 3", "links.press_shop.stop_bits", "3", "from 1 to 2"),
    ("[links.press_shop]", "[links.Press-Shop]", "links.Press-Shop", '"Press-Shop"', "small letters"),
    ('"eura_e800"', '"eura_e80"', "equipment.m2.type", '"eura_e80"', "perhaps eura_e800"),
    ('type = "eura_e800"', "", "equipment.m2.type", "missing", "a text"),
    ('link = "press_shop"', 'link = "pres_shop"', "equipment.m2.link", '"pres_shop"', "perhaps press_shop"),
    ("unit = 1", "unit = 0", "equipment.m2.unit", "0", "from 1 to 247"),
    ("unit = 1", "unit = 248", "equipment.m2.unit", "248", "from 1 to 247"),
    ("unit = 1", "unit = 1.5", "equipment.m2.unit", "1.5", "a whole number"),
    ("unit = 1", "unit = true", "equipment.m2.unit", "True", "a whole number"),
    ("unit = 1", "", "equipment.m2.unit", "missing", "from 1 to 247"),
    ("unit = 1", "unit = 1\nrepeat = 0", "equipment.m2.repeat", "0", "from 1 to 1000"),
    ("unit = 1", "unit = 200\nrepeat = 50", "equipment.m2.repeat", "50", "at most 48"),
    ("unit = 1", 'unit = 1\nrepeat = "30"', "equipment.m2.repeat", '"30"', "a whole number"),
    ("[equipment.m2]", "[equipment.M-2]", "equipment.M-2", '"M-2"', "small letters"),
    ("[equipment.m2]", "[equipment.sys]", "equipment.sys", '"sys"', "not sys"),
    (
        'hr = "Ventilator 2"',
        'fr = "Ventilateur 2"',
        "equipment.m2.label.fr",
        '"Ventilateur 2"',
        "a language of the product",
    ),
    ('"Ventilator 2"', "2", "equipment.m2.label.hr", "2", "a text"),
    ("rated_current = 2.5", "rated_current = 45", "equipment.m2.rated_current", "45", "from 0.1 to 4.5"),
    ("rated_current = 2.5", "rated_current = nan", "equipment.m2.rated_current", "nan", "from 0.1 to 4.5"),
    ("rated_current", "rated_curent", "equipment.m2.rated_curent", "2.5", "perhaps rated_current"),
    ("unit = 1", 'unit = 1\narea = "attic"', "equipment.m2.area", '"attic"', "an area of this file"),
    ("unit = 1", 'unit = 1\nwas = "Old!"', "equipment.m2.was", '"Old!"', "former id"),
    (
        "unit = 1",
        'unit = 1\nsimulation = { start = "up" }',
        "equipment.m2.simulation.start",
        '"up"',
        "forward, reverse",
    ),
    ("unit = 1", "unit = 1\nsimulation = { F905 = -1 }", "equipment.m2.simulation.F905", "-1", "from 0 to 3000"),
    ("unit = 1", "unit = 1\nsimulation = { F999 = 1 }", "equipment.m2.simulation.F999", "1", "no such key"),
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


def test_all_mistakes_come_at_once(tmp_path: Path) -> None:
    text = DESIGN
    picked = [row for row in MISTAKES if row[2] in ("plant.timezone", "links.press_shop.parity", "equipment.m2.unit")]
    for old, new, *_ in {row[2]: row for row in reversed(picked)}.values():
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


@pytest.mark.parametrize(
    ("row", "key", "expected"),
    [
        ('equipment = "m9"', "alarms.0.equipment", "one of m2"),
        ('expression = "spede < 5"', "alarms.0.expression", "it has no spede"),
        ('expression = "speed <"', "alarms.0.expression", "position 7"),
        ('expression = "speed < argument"', "alarms.0.expression", "no `argument` here"),
        ("priority = 5", "alarms.0.priority", "from 1 to 4"),
        ('key = "overcurrent"', "alarms.0.key", "no other alarm of m2"),
        ("on_delay = -1", "alarms.0.on_delay", "from 0 to 86400"),
        ("sound = true", "alarms.0.sound", "no such key"),
        ("label = 3", "alarms.0.label", "a text"),
    ],
)
def test_a_wrong_alarm_row_is_told(tmp_path: Path, row: str, key: str, expected: str) -> None:
    rows = {"equipment": '"m2"', "key": '"slow"', "expression": '"speed < 5"', "priority": "3", "label": '"Slow"'}
    rows[row.split(" = ")[0]] = row.split(" = ", 1)[1]
    text = DESIGN + "\n[[alarms]]\n" + "\n".join(f"{name} = {value}" for name, value in rows.items())
    problems = mistakes(tmp_path, text)
    assert [(problem.key, expected in problem.expected) for problem in problems] == [(key, True)]
    assert row in text.splitlines()[(problems[0].line or 0) - 1]


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
