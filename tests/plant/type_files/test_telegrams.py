"""What the device of a type cannot be asked or told by any telegram is a mistake of its files, not a value that never comes."""

from pathlib import Path

import pytest

from app.plant import types
from app.plant.definitions import Kind, Register, Type

DEVICE = 'label = "x"\n[device]\nread_functions = [3]\nwrite_functions = [6]\n'
POINTS = """
[state]
address = 1
label = "x"
[command]
address = 2
scale = 0.5
writable = true
readable = false
label = "x"
[level]
address = 4
type = "f32"
label = "x"
"""
COMMANDS = '[go]\nwrites = [{ point = "command", value = 1 }]\nfeedback = "state == 1"\nlabel = "x"\n'
SETPOINTS = "[delay]\naddress = 8\nlow = 1\nhigh = 9\ndefault = 2\nlabel = 'x'\n"
FILES = {"device": DEVICE, "points": POINTS, "commands": COMMANDS, "setpoints": SETPOINTS}
SEVERAL = "write_functions = [6, 16]\n"
F32 = 'type = "f32"\n'

MISTAKES = [
    ("device", "read_functions = [3]", "read_functions = [7]", "device.read_functions.0", "one of 1, 2, 3, 4"),
    ("device", "read_functions = [3]", 'read_functions = ["3"]', "device.read_functions.0", "one of 1, 2, 3, 4"),
    (
        "device",
        "write_functions = [6]",
        "write_functions = [23]",
        "device.write_functions.0",
        "one of 5, 6, 15, 16, 22",
    ),
    ("points", "address = 1\n", 'address = 1\ntable = "input"\n', "state.table", "function 4 in `read_functions`"),
    ("points", "address = 4", "address = 65535", "level.address", "no word is above 65535"),
    ("points", F32, f"{F32}writable = true\n", "level.writable", "function 16 in `write_functions`"),
    ("points", "address = 2\n", 'address = 2\ntable = "input"\n', "command.table", "holding"),
    ("commands", "value = 1", "value = 40000", "go.writes.0.value", "command holds: 0 to 32767.5 in steps of 0.5"),
    ("commands", "value = 1", "value = -0.5", "go.writes.0.value", "command holds: 0 to 32767.5 in steps of 0.5"),
    ("commands", "value = 1", "value = 0.2", "go.writes.0.value", "in steps of 0.5"),
    ("commands", '"state == 1"', '"command == 1"', "go.feedback", "command is only written"),
    ("setpoints", "low = 1", "low = 10", "delay.low", "low <= high"),
    ("setpoints", "default = 2", "default = 0", "delay.default", "from 1 to 9"),
]


def told(folder: Path, files: dict[str, str]) -> list[tuple[str, str]]:
    (folder / "thing").mkdir()
    for name, text in files.items():
        (folder / "thing" / f"{name}.toml").write_text(text)
    return [(one.key, one.expected) for one in types.read_type("thing", (), folder)[1]]


def test_what_telegrams_reach_is_no_mistake(tmp_path: Path) -> None:
    assert told(tmp_path, FILES) == []


@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_what_none_reaches_is_told_where_it_stands(
    tmp_path: Path, file: str, old: str, new: str, key: str, expected: str
) -> None:
    assert old in FILES[file]
    ((found, text),) = told(tmp_path, {**FILES, file: FILES[file].replace(old, new)})
    assert found == key and expected in text


def test_as_many_words_as_a_value_takes_are_written_at_once(tmp_path: Path) -> None:
    files = {
        **FILES,
        "device": DEVICE.replace("write_functions = [6]\n", SEVERAL),
        "points": POINTS.replace(F32, f"{F32}writable = true\n"),
    }
    ((key, expected),) = told(tmp_path, files)
    assert key == "level.type" and "at least 2" in expected
    (tmp_path / "more").mkdir()
    files["device"] += "max_write = 2\n"
    assert told(tmp_path / "more", files) == []


@pytest.mark.parametrize(
    ("part", "functions", "expected"),
    [
        ("mask = 3\n", "[22]", ""),
        ("shift = 4\n", "[22, 16]", ""),
        ("mask = 3\n", "[16]", ""),
        ("", "[22]", "function 6 in `write_functions`, which has 22"),
        ("mask = 3\n", "[5]", "function 6 in `write_functions`"),
        (f"mask = 3\n{F32.replace('f32', 'u32')}", "[22]", "function 16 in `write_functions`"),
    ],
)
def test_a_part_of_one_register_is_written_by_masks_where_the_device_knows_them(
    tmp_path: Path, part: str, functions: str, expected: str
) -> None:
    device = f'label = "x"\n[device]\nwrite_functions = {functions}\n'
    found = told(tmp_path, {"device": device, "points": f'[mode]\naddress = 1\nwritable = true\n{part}label = "x"\n'})
    assert [key for key, _ in found] == (["mode.writable"] if expected else []) and expected in "".join(
        t for _, t in found
    )


BITS_KNOWN = "read_functions = [1, 2, 3, 4]\nwrite_functions = [5, 6]\n"


def of_bits(folder: Path, points: str, device: str = BITS_KNOWN, **files: str) -> list[tuple[str, str]]:
    """Key and what was expected, of a type whose device knows bits."""
    texts = {"device": f'label = "x"\n[device]\n{device}', "points": points, **files}
    return told(folder, texts)


COIL = '[run]\naddress = 7\ntable = "coil"\nlabel = "x"\n'
INPUT = '[door]\naddress = 7\ntable = "discrete"\nlabel = "x"\n'


def test_coils_and_discrete_inputs_are_points_of_one_bit(tmp_path: Path) -> None:
    (tmp_path / "thing").mkdir()
    (tmp_path / "thing" / "device.toml").write_text(f'label = "x"\n[device]\n{BITS_KNOWN}max_read_bits = 64\n')
    texts = 'texts = { 0 = "x", 1 = "x" }\n'
    (tmp_path / "thing" / "points.toml").write_text(COIL + "writable = true\n" + texts + INPUT)
    (tmp_path / "thing" / "setpoints.toml").write_text('[pump]\naddress = "00100"\nlabel = "x"\n')
    data, problems = types.read_type("thing", (), tmp_path)
    assert problems == []
    run, door, pump = (data.type.points[key] for key in ("run", "door", "pump"))
    assert run.register == Register(7, Type.BIT, table="coil", writable=True) and run.kind is Kind.ENUM
    assert door.register == Register(7, Type.BIT, table="discrete") and door.kind is Kind.STEP
    assert pump.register == Register(99, Type.BIT, table="coil", writable=True)
    assert (data.type.setpoints["pump"].low, data.type.setpoints["pump"].high) == ("0", "1")
    assert data.type.device.max_read_bits == 64


@pytest.mark.parametrize(
    ("points", "key", "expected"),
    [
        *(
            (f"{COIL}{key} = {value}\n", f"run.{key}", f"no {key}: one of table coil is a single bit")
            for key, value in (
                ("type", '"u16"'), ("order", '"cdab"'), ("words", "2"), ("mask", "1"), ("shift", "1"), ("scale", "0.1"),
                ("offset", "1"), ("none", "1"),
            )
        ),
        (f"{INPUT}writable = true\n", "door.table", "coil"),
        (f'{COIL}kind = "text"\n', "run.kind", "kind text for type string"),
        (COIL + 'texts = { 2 = "x" }\n', "run.texts.2", "0 to 1"),
        (COIL + COIL.replace("run", "other"), "other.address", "an address that run does not have"),
        (COIL.replace("7", "65536"), "run.address", "from 0 to 65535"),
        (COIL.replace("7", '"40008"'), "run.table", 'holding: that is where 40008 lies'),
        (COIL.replace("7", '"00000"'), "run.address", "\"00001\" (coil)"),
        (COIL.replace("7", '"20001"'), "run.address", "\"40001\" (holding)"),
        (COIL.replace("7", '"465537"'), "run.address", "an address from 0 to 65535"),
        (COIL.replace("7", '"run"'), "run.address", "an address from 0 to 65535"),
        (COIL + '[part]\npart_of = "run"\nlabel = "x"\n', "part.part_of", "u16"),
    ],
)  # fmt: skip
def test_what_a_bit_cannot_be_is_told(tmp_path: Path, points: str, key: str, expected: str) -> None:
    found = of_bits(tmp_path, points)
    assert any(at == key and expected in text for at, text in found), found


@pytest.mark.parametrize(
    ("points", "device", "key", "expected"),
    [
        (COIL, "read_functions = [3]\n", "run.table", "function 1 in `read_functions`"),
        (INPUT, "read_functions = [1, 3]\n", "door.table", "function 2 in `read_functions`"),
        (COIL + "writable = true\n", "read_functions = [1]\n", "run.writable", "function 5 in `write_functions`"),
    ],
)
def test_bits_are_reached_by_their_own_functions(
    tmp_path: Path, points: str, device: str, key: str, expected: str
) -> None:
    ((at, text),) = of_bits(tmp_path, points, device)
    assert at == key and expected in text


def test_a_coil_is_written_with_either_function_and_holds_0_or_1(tmp_path: Path) -> None:
    go = '[go]\nwrites = [{ point = "run", value = 1 }]\nfeedback = "run == 1"\nlabel = "x"\n'
    for number, function in enumerate((5, 15)):
        (tmp_path / str(number)).mkdir()
        device = f"read_functions = [1]\nwrite_functions = [{function}]\n"
        assert of_bits(tmp_path / str(number), COIL + "writable = true\n", device, commands=go) == []
    two = go.replace("value = 1", "value = 2")
    ((key, text),) = of_bits(tmp_path, COIL + "writable = true\n", commands=two)
    assert key == "go.writes.0.value" and "run holds: 0 to 1 in steps of 1" in text


def test_numbers_of_a_manual_name_table_and_address(tmp_path: Path) -> None:
    rows = "".join(f'[p{n}]\naddress = "{n}"\nlabel = "x"\n' for n in ("40001", "30001", "10017", "00001", "465536"))
    (tmp_path / "thing").mkdir()
    (tmp_path / "thing" / "device.toml").write_text(f'label = "x"\n[device]\n{BITS_KNOWN}')
    (tmp_path / "thing" / "points.toml").write_text(rows)
    data, problems = types.read_type("thing", (), tmp_path)
    assert problems == []
    found = [(one.register.table, one.register.address) for one in data.type.points.values() if one.register]
    assert found == [("holding", 0), ("input", 0), ("discrete", 16), ("coil", 0), ("holding", 0xFFFF)]


def test_holes_are_those_of_registers_and_what_is_only_written_is_no_input(tmp_path: Path) -> None:
    device = BITS_KNOWN + "holes = [[5, 9]]\nwrite_only = [[20, 29]]\n"
    level = '[level]\naddress = 7\ntable = "input"\nlabel = "x"\n'
    ((key, text),) = of_bits(tmp_path, COIL + INPUT + level, device)
    assert key == "level.address" and "outside of `holes` 5 to 9" in text
    (tmp_path / "more").mkdir()
    assert of_bits(tmp_path / "more", level.replace("7", "25"), device) == []
