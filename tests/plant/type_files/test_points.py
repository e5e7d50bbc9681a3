"""points.toml: a mistake is named, and parts of a word lie over it."""

from pathlib import Path

import pytest

from app.registers.codec import decode
from tests.plant.line import problem
from tests.plant.type_files.parts import POINTS, read

MISTAKES = [
    ("points", "[count]", "[product_count]", "product", "no point of points.toml"),
    ("points", "[count]", "[product_1_count]", "product_1_count", "that of a cell"),
]


@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    found = problem(tmp_path, file, old, new)
    assert found.key == key
    assert expected in found.expected


def test_parts_lie_over_their_word_and_are_only_read(tmp_path: Path) -> None:
    kind, problems = read(tmp_path)
    assert problems == []
    word, ready, state = (kind.points[key].register for key in ("word", "ready", "state"))
    assert word and ready and state
    assert (word.address, ready.address, state.address) == (10, 10, 10)
    assert (ready.shift, ready.mask, ready.writable, word.writable) == (3, 1, False, True)
    assert (state.shift, state.mask) == (0, 15)


def test_parts_have_the_order_of_their_word_and_no_value_where_it_has_none(tmp_path: Path) -> None:
    kind, problems = read(tmp_path, POINTS.replace("address = 10", 'address = 10\norder = "badc"\nnone = 0xFFFF'))
    assert problems == []
    ready, state = (kind.points[key].register for key in ("ready", "state"))
    assert ready and state
    assert (decode(ready, [0x0800]), decode(state, [0x0500])) == (1, 5)
    assert decode(ready, [0xFFFF]) is None and decode(state, [0xFFFF]) is None


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
