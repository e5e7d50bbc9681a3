"""commands.toml: a mistake is named."""

from pathlib import Path

import pytest

from tests.plant.line import problem
from tests.plant.type_files.parts import COMMANDS, read

MISTAKES = [
    ("commands", "code = 1", "code = 70000", "start.code", "from 1 to 65535"),
    ("commands", 'feedback = "state == 1"', 'feedback = "stat == 1"', "start.feedback", "it has no stat"),
    ("commands", 'feedback = "state == 1"', 'feedback = "count == argument"', "start.feedback", "no `argument` here"),
    ("commands", "code = 1", "code = 1\nwrites = [{ point = 'speed', value = 1 }]", "start.writes", "nothing where"),
    ("commands", "code = 1", "code = 1\nrelease = [{ point = 'speed', value = 1 }]", "start.release", "nothing where"),
    ("commands", "code = 1", "code = 1\nargument = 'speed'", "start.argument", "`arguments` where"),
    ("commands", "code = 1", "code = 1\nhold = true", "start.hold", "`hold_bits`"),
    ("commands", "hold = true", "", "jog.hold", "hold = true"),
    ("commands", "hold = true", "hold = true\nneeds_reason = true", "jog.needs_reason", "nobody has the time"),
    ("commands", "hold_bits = 1", "hold_bits = 1\narguments = [{ name = 'a' }]", "jog.arguments", "a `code`"),
    ("commands", 'feedback = "moving == 1"', "", "jog.feedback", "a text"),
    ("commands", "stop = true", "stop = true\narguments = [{ name = 'a' }]", "stop.arguments", "none for a Stop"),
    ("commands", 'type = "u32"', 'type = "u16"', "edit.arguments.0.type", "one of f32, u32, i32"),
    ("commands", 'type = "u32"', 'type = "u32", decimals = 1', "edit.arguments.0.decimals", "0 for u32"),
    ("commands", "low = 1", "low = [1]", "edit.arguments.0.low", "a number or an expression"),
    ("commands", "low = 1", "lowest = 1", "edit.arguments.0.lowest", "no such key"),
    ("commands", 'high = "length"', 'high = "width"', "edit.arguments.1.high", "it has no width"),
    ("commands", 'name = "head"', 'name = "product"', "edit.arguments.1.name", "no other argument"),
    ("commands", 'name = "head"', 'name = "age"', "edit.arguments.1.name", "no word of the grammar"),
    ("commands", 'name = "head"', 'name = "Head"', "edit.arguments.1.name", "small letters"),
]


@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    found = problem(tmp_path, file, old, new)
    assert found.key == key
    assert expected in found.expected


def test_a_telegram_says_when_it_is_written_and_after_what(tmp_path: Path) -> None:
    kind, _ = read(tmp_path)
    first, second = kind.commands["go"].writes
    assert (first.when, first.after) == ("ready == 0", "")
    assert (second.when, second.after, second.within) == ("", "ready == 1", 3.0)


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
