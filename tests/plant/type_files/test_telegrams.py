"""What the device of a type cannot be asked or told by any telegram is a mistake of its files, not a value that never comes."""

from pathlib import Path

import pytest

from app.plant import types

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
    ("device", "read_functions = [3]", "read_functions = [1]", "device.read_functions.0", "one of 3, 4"),
    ("device", "read_functions = [3]", 'read_functions = ["3"]', "device.read_functions.0", "one of 3, 4"),
    ("device", "write_functions = [6]", "write_functions = [5]", "device.write_functions.0", "one of 6, 16"),
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
