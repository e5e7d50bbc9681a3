"""Expressions in the files of a type are judged when all its points are known; each mistake with its place."""

from pathlib import Path

import pytest

from app.plant.definitions import Kind, Point
from app.plant.tables import Source
from app.plant.type_files.sentences import Sentences, names_in

POINTS = {
    "speed": Point("t.speed", "t.speed", "t", "speed", "speed"),
    "state": Point("t.state", "t.state", "t", "state", "state", kind=Kind.ENUM, texts={0: "off", 1: "on", 2: "fault"}),
    "open": Point("t.open", "t.open", "t", "open", "open", kind=Kind.BOOL),
    "free": Point("t.free", "t.free", "t", "free", "free", kind=Kind.ENUM),
}


def judged(folder: Path, text: str, *, argument: bool = False) -> list[tuple[str, str, int | None]]:
    file = folder / "x.toml"
    file.write_text(f"[first]\n[go]\nfeedback = '{text}'\n")
    source = Source(file, "x.toml")
    sentences = Sentences()
    sentences.add(source.table().table("go"), "feedback", text, argument=argument)
    sentences.check(POINTS, "thing")
    return [(problem.key, problem.expected, problem.line) for problem in source.problems]


@pytest.mark.parametrize(
    "text",
    [
        "state == 1",
        "speed > 5 and state != 2",
        "abs(speed - state) < 1",
        "state in (0, 1, 2)",
        "state > 7",  # no choice is meant: it is one in the order of them
        "0 == open",
        "speed == 7 or free == 7 or state + 5 == 7",
    ],
)
def test_a_sentence_over_points_that_are_there_is_one(tmp_path: Path, text: str) -> None:
    assert judged(tmp_path, text) == []


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("stat == 1", ["names of points of thing; it has no stat"]),
        ("b > a", ["names of points of thing; it has no a", "names of points of thing; it has no b"]),
        ("state == 7", ["a choice that state has: 0, 1, 2; 7 it never is"]),
        ("state != 7", ["a choice that state has: 0, 1, 2; 7 it never is"]),
        ("speed > 1 and not 7 == state", ["a choice that state has: 0, 1, 2; 7 it never is"]),
        ("state in (1, -1)", ["a choice that state has: 0, 1, 2; -1 it never is"]),
        ("state == 0.5", ["a choice that state has: 0, 1, 2; 0.5 it never is"]),
        ("open == 2", ["a choice that open has: 0, 1; 2 it never is"]),
        ("0 < state == 7", ["a choice that state has: 0, 1, 2; 7 it never is"]),
        ("speed == argument", ["no `argument` here: nobody enters one"]),
    ],
)
def test_what_it_may_not_say_is_told_at_its_line(tmp_path: Path, text: str, told: list[str]) -> None:
    assert judged(tmp_path, text) == [("go.feedback", expected, 3) for expected in told]


def test_where_somebody_enters_an_argument_it_may_be_named(tmp_path: Path) -> None:
    assert judged(tmp_path, "speed == argument", argument=True) == []


@pytest.mark.parametrize("text", ["speed ==", "speed = 1", "import os", "speed.real > 1"])
def test_what_is_no_sentence_is_told_once_and_reads_nothing(tmp_path: Path, text: str) -> None:
    assert [key for key, _, _ in judged(tmp_path, text)] == ["go.feedback"]
    assert names_in(text) is None


def test_what_a_sentence_reads_is_known() -> None:
    assert names_in("speed > 5 and (state == 1 or speed < 2)") == {"speed", "state"}
