"""tables.toml: a mistake is named."""

from pathlib import Path

import pytest

from tests.plant.line import problem

MISTAKES = [
    ("tables", "row = 16", "row = 130", "product.row", "from 5 to 121"),
    ("tables", "address = 0x0800", "address = 0xF800", "product.address", "250 rows of 16 words"),
    ("tables", 'capacity = "slots"', 'capacity = "slot"', "product.capacity", "perhaps slots"),
    ("tables", 'capacity = "slots"', 'capacity = "simulation"', "product.capacity", "one of length, slots"),
    ("tables", 'capacity = "slots"', "capacity = 0", "product.capacity", "from 1 to"),
    ("tables", "offset = 3", "offset = 2", "product.columns.state.offset", "its generation"),
    ("tables", "offset = 3", "offset = 15", "product.columns.state.offset", "its generation"),
    ("tables", "offset = 3", "offset = 5", "product.columns.head.offset", "state does not use"),
    ("tables", "offset = 3", "offset = 16", "product.columns.state.offset", "from 0 to 15"),
    ("tables", "offset = 3", "", "product.columns.state.offset", "a whole number"),
    ("tables", 'type = "u32"', "", "product.columns.id", "a row begins with it"),
    ("tables", "columns.id]", "columns.number]", "product.columns.id", "a row begins with it"),
    ("tables", "columns.state]", "columns.State]", "product.columns.State", "small letters"),
    ("tables", 'unit = "mm"', 'units = "mm"', "product.columns.head.units", "no such key"),
    ("tables", 'high = "length"', 'high = "lenght"', "product.columns.head.high", "options of line"),
]


@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    found = problem(tmp_path, file, old, new)
    assert found.key == key
    assert expected in found.expected
