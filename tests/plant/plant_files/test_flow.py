"""`[picture]` of a plant file: ways that material goes, and what is wrong with them."""

from pathlib import Path

import pytest

from tests.plant.transport import PLANT, loaded, one


def test_ways_become_pairs_each_once(tmp_path: Path) -> None:
    plant = loaded(tmp_path, PLANT + '\n[picture]\nflow = [["p1", "seq1"], ["p1", "seq1", "p1"]]\n')
    assert plant.flow == (("p1", "seq1"), ("seq1", "p1"))
    assert loaded(tmp_path, PLANT).flow == ()


@pytest.mark.parametrize(
    ("given", "key", "expected"),
    [
        ('flow = [["p1", "p2"]]', "picture.flow.0.1", "an equipment: one of p1, seq1"),
        ('flow = [["p1"]]', "picture.flow.0", "a list of two machines or more"),
        ('flow = ["p1"]', "picture.flow.0", "a list of two machines or more"),
        ('flow = [["p1", 5]]', "picture.flow.0.1", "an equipment"),
        ('flow = [["p1", "p1"]]', "picture.flow.0.1", "another machine"),
        ('flow = "p1"', "picture.flow", "a list of ways"),
        ("flows = []", "picture.flows", "no such key"),
    ],
)
def test_a_mistake_is_told_at_its_place(tmp_path: Path, given: str, key: str, expected: str) -> None:
    found = one(tmp_path, f"{PLANT}\n[picture]\n{given}\n")
    assert found.key == key and expected in found.expected
