"""`part_of`: bits of a word that is a point itself; and commands whose telegrams depend on what the device says."""

from pathlib import Path

import pytest

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.problems import Problem

POINTS = """
[word]
address = 10
writable = true
label = "x"
[ready]
part_of = "word"
shift = 3
kind = "bool"
label = "x"
[state]
part_of = "word"
mask = 0x0F
label = "x"
"""
COMMANDS = """
[go]
writes = [
    { point = "word", value = 1, when = "ready == 0" },
    { point = "word", value = 2, after = "ready == 1", within = 3 },
]
feedback = "state == 2"
label = "x"
"""


def read(folder: Path, points: str = POINTS, commands: str = COMMANDS) -> tuple[EquipmentType, list[Problem]]:
    kind = folder / "thing"
    kind.mkdir()
    (kind / "device.toml").write_text('label = "x"\n[device]\n')
    (kind / "points.toml").write_text(points)
    (kind / "commands.toml").write_text(commands)
    data, problems = types.read_type("thing", (), folder)
    return data.type, problems


def test_parts_lie_over_their_word_and_are_only_read(tmp_path: Path) -> None:
    kind, problems = read(tmp_path)
    assert problems == []
    word, ready, state = (kind.points[key].register for key in ("word", "ready", "state"))
    assert word and ready and state
    assert (word.address, ready.address, state.address) == (10, 10, 10)
    assert (ready.shift, ready.mask, ready.writable, word.writable) == (3, 1, False, True)
    assert (state.shift, state.mask) == (0, 15)


def test_a_telegram_says_when_it_is_written_and_after_what(tmp_path: Path) -> None:
    kind, _ = read(tmp_path)
    first, second = kind.commands["go"].writes
    assert (first.when, first.after) == ("ready == 0", "")
    assert (second.when, second.after, second.within) == ("", "ready == 1", 3.0)


@pytest.mark.parametrize(
    ("points", "key", "expected"),
    [
        (POINTS.replace('part_of = "word"', 'part_of = "wrod"', 1), "ready.part_of", "a point above"),
        (POINTS.replace('part_of = "word"\nmask', 'part_of = "ready"\nmask'), "state.part_of", "a whole u16 register"),
        (POINTS.replace("address = 10", 'address = 10\ntype = "i16"'), "ready.part_of", "a whole u16 register"),
        (POINTS.replace("address = 10", "address = 10\nreadable = false"), "ready.part_of", "that is read"),
        (POINTS.replace("shift = 3", "shift = 16"), "ready.shift", "0 to 15"),
        (POINTS.replace("shift = 3", "shift = 3\naddress = 11"), "ready.address", "no address"),
        (POINTS.replace("shift = 3", "shift = 3\nwritable = true"), "ready.writable", "no such key"),
        ('[other]\naddress = 10\nlabel = "x"\n' + POINTS, "word.address", "words that other does not use"),
    ],
)
def test_a_part_that_is_none_is_told(tmp_path: Path, points: str, key: str, expected: str) -> None:
    _, problems = read(tmp_path, points)
    assert any(problem.key == key and expected in problem.expected for problem in problems), problems


@pytest.mark.parametrize(
    ("commands", "key", "expected"),
    [
        (COMMANDS.replace('after = "ready == 1"', 'after = "raedy == 1"'), "go.writes.1.after", "it has no raedy"),
        (COMMANDS.replace('when = "ready == 0"', 'when = "ready =="'), "go.writes.0.when", ""),
        (COMMANDS.replace("within = 3", "within = 0"), "go.writes.1.within", "0.1 to 60"),
        (COMMANDS.replace('when = "ready == 0"', "within = 3"), "go.writes.0.within", "no such key"),
        (COMMANDS.replace('label = "x"', 'stop = true\nlabel = "x"'), "go.writes.0.when", "no such key"),
        (COMMANDS.replace('label = "x"', 'stop = true\nlabel = "x"'), "go.writes.1.after", "no such key"),
    ],
)
def test_a_telegram_that_cannot_wait_is_told(tmp_path: Path, commands: str, key: str, expected: str) -> None:
    _, problems = read(tmp_path, commands=commands)
    assert any(
        problem.key.replace("[", ".").replace("]", "") == key and expected in problem.expected for problem in problems
    ), problems
