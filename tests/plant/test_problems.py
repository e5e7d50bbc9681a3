"""A mistake is told with file, line, key, value and expectation."""

import pytest

from app.plant.problems import MoreProblems, Problem


@pytest.mark.parametrize(
    ("problem", "said"),
    [
        (Problem("plant.toml", "links.a.baud", "7", "9600"), "plant.toml: links.a.baud = 7: expected 9600"),
        (Problem("plant.toml", "x", "1", "2", 14), "plant.toml:14: x = 1: expected 2"),
        (MoreProblems(31, stopped=False), "and 31 more"),
        (MoreProblems(3, stopped=True), "and 3 more, and the rest of the file was not read"),
    ],
)
def test_it_reads_as_a_line(problem: Problem, said: str) -> None:
    assert str(problem) == said
