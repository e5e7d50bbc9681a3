"""What the files of a type may say and cannot be is told with file, key, value and what was expected: never taken and then not done."""

from pathlib import Path

import pytest

from app.plant.loader import read_plant
from tests.plant.test_own_types import FILES, written
from tests.plant.type_files.test_orders import COMMANDS, DOSE, POINTS, TEXTS

WORDS = TEXTS + 'point.x = "X"\ngroup.g = "G"\n' + "".join(f'choice.x.{n} = "{n}"\n' for n in (0, 1, 2, 5, 70000))
X = "[x]\naddress = 10\n"
ONLY_WRITTEN = X + "readable = false\nwritable = true\nhistory = false\n"
SET = X + 'group = "group.g"\nlow = 0\nhigh = 5\n'
HALT = '[halt]\nwrites = [{ point = "run", value = 0 }]\nfeedback = "motor == 0"\nstop = true\nmoves = false\n'
ALARM = (
    '[a]\nlabel = "type"\nconsequence = "type"\ncause = "type"\nresponse = "type"\npriority = 2\nexpression = "x > 1"\n'
)
BLOCK = '[interlocks.i]\nlabel = "type"\nmissing = "type"\nexpression = "motor == 0"\ncommands = ["stop"]\n'


def told(folder: Path, **files: str) -> list[tuple[str, str, str]]:
    """File, key and what was expected of every mistake."""
    given = {"points": POINTS, "commands": COMMANDS, "texts_en": WORDS, **files}
    return [(one.file.rpartition("/")[2], one.key, one.expected) for one in read_plant(written(folder, **given))[1]]


def test_without_a_lie_it_is_taken(tmp_path: Path) -> None:
    assert (
        told(tmp_path, points=POINTS + X, setpoints=SET.replace("[x]", "[y]").replace("10", "11") + 'label = "type"\n')
        == []
    )


@pytest.mark.parametrize(
    ("row", "key", "expected"),
    [
        ('type = "f32"\nmask = 3\n', "mask", "no mask: f32 has no bits"),
        ('type = "f32"\nshift = 3\n', "shift", "no shift: f32 has no bits"),
        ('type = "f32"\nnone = 3\n', "none", "no none: f32 has no bits"),
        ('type = "string"\nkind = "text"\nscale = 0.1\n', "scale", "string is no number"),
        ('type = "string"\n', "kind", "kind text for type string"),
        ('kind = "text"\n', "kind", "kind text for type string"),
        ("shift = 16\n", "shift", "the 16 that u16 has"),
        ("mask = 0x1FFFF\n", "mask", "the 16 that u16 has"),
        ("mask = 3\nshift = 15\n", "mask", "the 16 that u16 has"),
        ("none = 70000\n", "none", "the 16 that u16 has"),
        ('kind = "enum"\n', "texts", "values of the enumeration with their texts"),
        ('kind = "enum"\nmask = 1\ntexts = [0, 1, 2]\n', "texts.2", "0 to 1"),
        ('kind = "enum"\ntexts = [0, 70000]\n', "texts.70000", "0 to 65535"),
        ('kind = "enum"\ntexts = [0, 1, 1]\n', "texts", "each value once"),
        ('table = "coil"\n', "table", "function 1 in `read_functions`"),
        ('table = "discrete"\n', "table", "function 2 in `read_functions`"),
        ('type = "bit"\n', "type", "one of u16"),
        ('type = "f64"\nnone = 3\n', "none", "no none: f64 has no bits"),
        ('type = "i64"\nnone = "0x1FFFFFFFFFFFFFFFF"\n', "none", "whole number from 0 to"),
        ('none = "0x8000000000000000"\n', "none", "the 16 that u16 has"),
        ("low = 5\nhigh = 1\n", "low", "low <= high"),
        ("scale_low = 5\nscale_high = 5\n", "scale_low", "scale_low < scale_high"),
        ("dead_band = -1\n", "dead_band", "from 0 up"),
        ("plausible = [5, 5]\n", "plausible", "low < high"),
        ('plausible = [0, "a"]\n', "plausible", "low < high"),
        ("plausible = [0]\n", "plausible", "low < high"),
        ("low = -1\nplausible = [0, 9]\n", "low", "from 0 to 9"),
        ("readable = false\n", "readable", "readable or writable"),
    ],
)
def test_of_a_point(tmp_path: Path, row: str, key: str, expected: str) -> None:
    found = told(tmp_path, points=POINTS + X + row)
    assert any((file, at) == ("points.toml", f"x.{key}") and expected in text for file, at, text in found), found


def test_of_a_part_of_a_word(tmp_path: Path) -> None:
    found = told(tmp_path, points=POINTS + '[x]\npart_of = "motor"\nmask = 3\nshift = 15\n')
    assert found == [("points.toml", "x.mask", "bits of the 16 that u16 has")]


@pytest.mark.parametrize(
    ("before", "after", "key", "expected"),
    [
        ("[start]", HALT + "[start]", "stop.stop", "it is halt"),
        ("stop = true", 'stop = true\nrole = "engineer"', "stop.role", "one click"),
        ("stop = true", 'stop = true\nargument = "run"', "stop.argument", "one click"),
        ("stop = true", 'stop = true\nhold = true\nrelease = [{ point = "run", value = 0 }]', "stop.hold", "one click"),
        ('"motor == 1"', '"1 == 1"', "start.feedback", "at least one point"),
        ('"motor == 1"', '"weight == argument"', "start.argument", "`feedback` use it"),
        ("value = 1", 'value = "argument"', "start.argument", "the point that is entered"),
        ('"motor == 1"', '"motor == 1"\nargument = "run"', "start.argument", "written nowhere"),
    ],
)
def test_of_a_command(tmp_path: Path, before: str, after: str, key: str, expected: str) -> None:
    found = told(tmp_path, commands=COMMANDS.replace(before, after))
    assert any((file, at) == ("commands.toml", key) and expected in text for file, at, text in found), found


@pytest.mark.parametrize(
    ("before", "after", "key", "expected"),
    [
        ("high = 5", "high = 70000", "x.high", "0 to 65535"),
        ("low = 0", "low = -5", "x.low", "0 to 65535"),
        ("high = 5", "high = 10000\nscale = 0.1", "x.high", "0 to 6553.5"),
        ("high = 5", "high = 5\noptions = [0, 1, 70000]", "x.options.70000", "0 to 5"),
        ("high = 5", "high = 5\noptions = [0, 1]\ndefault = 3", "x.default", "one of 0, 1"),
        ("high = 5", "high = 5\nreadable = false", "x.readable", "written and read back"),
        ("high = 5", "high = 5\nwritable = false", "x.writable", "written and read back"),
        ("[x]\naddress = 10\n", "[weight]\n", "weight", "written and read back"),
        ("high = 5", 'type = "string"\nkind = "text"', "x.type", "a number: x is a parameter"),
        ("high = 5", 'table = "coil"\nhigh = 5', "x.high", "x holds: 0 to 1 in steps of 1"),
    ],
)
def test_of_a_parameter(tmp_path: Path, before: str, after: str, key: str, expected: str) -> None:
    found = told(tmp_path, setpoints=SET.replace(before, after))
    assert any((file, at) == ("setpoints.toml", key) and expected in text for file, at, text in found), found


@pytest.mark.parametrize(
    ("register", "limits", "key", "expected"),
    [
        ("writable = true\nmask = 0xF\n", "high = 16\n", "x.high", "x holds: 0 to 15 in steps of 1"),
        ('writable = true\ntable = "coil"\n', "high = 9\n", "x.high", "x holds: 0 to 1 in steps of 1"),
        ("writable = true\nreadable = false\n", "high = 9\n", "x", "written and read back"),
        ('writable = true\ntype = "string"\nkind = "text"\n', "high = 9\n", "x", "a number: x is a parameter"),
        ("writable = true\n", "high = 9\noptions = [0, 12]\n", "x.options.12", "from 0 to 9"),
    ],
)
def test_of_a_parameter_that_is_a_point_already(
    tmp_path: Path, register: str, limits: str, key: str, expected: str
) -> None:
    found = told(tmp_path, points=POINTS + X + register, setpoints=f'[x]\ngroup = "group.g"\n{limits}')
    assert any((file, at) == ("setpoints.toml", key) and expected in text for file, at, text in found), found


@pytest.mark.parametrize(
    ("row", "file", "key", "expected"),
    [
        ("holes = [[1, 1]]\n", "points.toml", "weight.address", "outside of `holes` 1 to 1"),
        ("write_only = [[2, 2]]\n", "points.toml", "motor.address", "outside of `write_only` 2 to 2"),
        ("max_read = 1\n", "points.toml", "x.type", "`max_read` of at least 2"),
        ("group_read = { fast = 1 }\n", "points.toml", "x.type", "`group_read.fast` of at least 2"),
        ("fallback_read = 1\n", "points.toml", "x.type", "`fallback_read` of at least 2"),
        ("group_read = { fats = 6 }\n", "device.toml", "device.group_read.fats", "fast"),
        ("timeout = 0\n", "device.toml", "device.timeout", "from 0.01 to 60"),
        ("read_functions = [23, 3]\n", "device.toml", "device.read_functions.0", "one of 1, 2, 3, 4"),
        ("write_functions = [23, 6]\n", "device.toml", "device.write_functions.0", "one of 5, 6, 15, 16, 22"),
        ("max_read_bits = 2001\n", "device.toml", "device.max_read_bits", "from 1 to 2000"),
    ],
)
def test_of_a_device(tmp_path: Path, row: str, file: str, key: str, expected: str) -> None:
    found = told(tmp_path, device=FILES["device"] + row, points=POINTS + X + 'type = "f32"\n')
    assert any((at, where) == (file, key) and expected in text for at, where, text in found), found


def test_of_what_is_only_written_nothing_is_asked(tmp_path: Path) -> None:
    found = told(tmp_path, points=POINTS + ONLY_WRITTEN, alarms=ALARM)
    assert found == [("alarms.toml", "a.expression", "points that are read; x is only written")]


def test_a_stop_that_something_is_to_block(tmp_path: Path) -> None:
    assert told(tmp_path, interlocks=BLOCK) == [
        ("interlocks.toml", "interlocks.i.commands", "no Stop: nothing blocks it")
    ]


def test_a_file_that_nobody_reads(tmp_path: Path) -> None:
    ((file, key, expected),) = told(tmp_path, alarm=ALARM.replace("x > 1", "weight > 1"))
    assert (file, key) == ("alarm.toml", "(file)") and "(perhaps alarms.toml)" in expected


def test_a_file_whose_ending_is_in_capital_letters_is_not_read_either(tmp_path: Path) -> None:
    assert told(tmp_path) == []
    (folder,) = tmp_path.rglob("device.toml")
    (folder.parent / "ALARMS.TOML").write_text(ALARM, "utf-8")
    ((file, value),) = ((one.file, str(one.value)) for one in read_plant(tmp_path)[1])
    assert file.endswith("/ALARMS.TOML") and value == "ALARMS.TOML"


@pytest.mark.parametrize(
    ("before", "after", "key", "expected"),
    [
        ('"motor == 0"', '"weight - before.weight >= amount"', "failed", "another sentence than `done`"),
        ('"motor == 1"', '"1 == 1"', "armed", "at least one point"),
        (">= amount", ">= 5", "arguments.0.name", "one of its sentences reads"),
        ("low = 1,", "low = 60,", "arguments.0.low", "low <= high"),
        ('then = "stop"', 'then = "stop"\nstands = "motor == 0"', "suspend", "both stands and suspend"),
        (
            'armed = "motor == 1"\ndone = "weight - before.weight >= amount"\n',
            'suspend = "stop"\nresume = "start"\n',
            "done",
            "suspend",
        ),
    ],
)
def test_of_an_action(tmp_path: Path, before: str, after: str, key: str, expected: str) -> None:
    assert before in DOSE
    found = told(tmp_path, device=FILES["device"] + DOSE.replace(before, after))
    assert any(
        (file, at) == ("device.toml", f"actions.orders.dose.{key}") and expected in text for file, at, text in found
    ), found


def test_a_value_with_two_sources(tmp_path: Path) -> None:
    found = told(tmp_path, points=POINTS + X + 'derived = { kind = "condition", when = "motor == 1" }\n')
    assert found == [("points.toml", "x.derived", "either `address` or `derived`: a value has one source")]


def test_a_text_that_is_compared_with_a_number(tmp_path: Path) -> None:
    points = POINTS + X + 'type = "string"\nkind = "text"\n'
    ((file, key, expected),) = told(tmp_path, points=points, alarms=ALARM)
    assert (file, key) == ("alarms.toml", "a.expression") and "x" in expected
    assert told(tmp_path / "two", points=points, alarms=ALARM.replace("x > 1", "bad(x)")) == []


def test_a_number_that_is_written_to_a_text(tmp_path: Path) -> None:
    points = POINTS + X + 'type = "string"\nwords = 1\nkind = "text"\nwritable = true\n'
    commands = COMMANDS.replace('point = "run", value = 1', 'point = "x", value = 1')
    assert ("commands.toml", "start.writes.0.point") in [
        one[:2] for one in told(tmp_path, points=points, commands=commands)
    ]


def test_two_parameters_of_one_code(tmp_path: Path) -> None:
    setpoints = SET + 'code = "P1"\n' + SET.replace("[x]", "[y]").replace("10", "11") + 'label = "type"\ncode = "P1"\n'
    assert told(tmp_path, setpoints=setpoints) == [("setpoints.toml", "y.code", "a code that x does not have")]


def test_a_text_that_names_a_number_which_nobody_gives(tmp_path: Path) -> None:
    texts = WORDS.replace('"Not empty"', '"Not empty: {weight} kg"')
    expected = "a text without {weight}: the numbers that are given to it are none"
    device = FILES["device"] + DOSE
    assert told(tmp_path, device=device, texts_en=texts) == [("texts.en.toml", "missing.need.empty", expected)]
    given = device.replace('"weight < 5"', '"weight < 5"\nvalues = { weight = "weight" }')
    assert told(tmp_path / "two", device=given, texts_en=texts) == []


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ('low = "a"\nhigh = "a - 1"\n', "options with which x has low <= high: they make 5 and 4 of it"),
        (
            'scale_low = "a"\nscale_high = "a"\n',
            "options with which x has scale_low < scale_high: they make 5 and 5 of it",
        ),
        ('high = "1 / (a - 5)"\n', "options with which high of x is a number: 1 / (a - 5)"),
        ('normal = [7, "a"]\n', "options with which x has normal.0 <= normal.1: they make 7 and 5 of it"),
        ('normal = [1, "9 / (a - 5)"]\n', "options with which normal.1 of x is a number: 9 / (a - 5)"),
        ('normal = ["9 / (a - 5)", 8]\n', "options with which normal.0 of x is a number: 9 / (a - 5)"),
    ],
)
def test_limits_that_the_options_of_a_machine_turn_round(tmp_path: Path, row: str, expected: str) -> None:
    device = FILES["device"] + "[options.a]\ndefault = 5\nlow = 1\nhigh = 9\n"
    assert told(tmp_path, device=device, points=POINTS + X + row) == [("plant.toml", "equipment.w1", expected)]


def test_a_value_of_an_action_that_hides_a_point(tmp_path: Path) -> None:
    device = FILES["device"] + DOSE.replace('name = "amount"', 'name = "run", label = "type"').replace(
        ">= amount", ">= run"
    )
    found = told(tmp_path, device=device)
    assert found == [
        ("device.toml", "actions.orders.dose.done", "a name of one thing: run is a value of the action and a point")
    ]
