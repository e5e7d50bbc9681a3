"""Lesson files: what is right is read, and every mistake is told with file, line, key, value and what was expected."""

import shutil
from pathlib import Path

import pytest

from app.plant.lesson_definition import Deed
from app.plant.loader import read_plant
from tests.demo_plant import plant_folder

LANGUAGES = {"hr", "en", "de", "cs"}
GOOD = """
[lesson]
type = "eura_e800"
title = "Own lesson"
about = "What one learns"

[[steps]]
title = "Start"
text = "Start it"
until = "status == 1"
hold = 2
solution = [{ command = "forward" }]

[[steps]]
title = "Ask"
text = "Why?"
choices = [{ label = "a", why = "b" }, { label = "c", right = true, why = "d" }]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = plant_folder(tmp_path / "plant", "m1")
    (made / "lessons").mkdir()
    return made


def problems(folder: Path, text: str, name: str = "own.toml") -> list[str]:
    (folder / "lessons" / name).write_text(text, "utf-8")
    plant, found = read_plant(folder)
    assert (plant is None) == bool(found)
    return [str(problem) for problem in found]


def test_a_plant_has_the_lessons_of_its_types_and_its_own(folder: Path) -> None:
    assert problems(folder, GOOD) == []
    plant, _ = read_plant(folder)
    assert plant is not None
    assert sorted(plant.lessons) == ["motor", "own"]
    first, question = plant.lessons["own"].steps
    assert (first.kind, first.hold, first.solution) == ("until", 2, (Deed("forward"),))
    assert (question.kind, question.right) == ("question", 1)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('type = "eura_e800"', 'type = "eura"', ["lesson.type", '"eura"', "eura_e800"]),
        ('about = "What one learns"\n', "", ["lesson.about", "missing"]),
        ('"status == 1"', '"statas == 1"', ["steps.0.until", "statas", "perhaps status"]),
        ('"status == 1"', '"status == 77"', ["steps.0.until", "a choice that status has: ", "77 it never is"]),
        ('"status == 1"', '"status = 1"', ["steps.0.until", "status = 1"]),
        ('"status == 1"', '"argument == 1"', ["steps.0.until", "argument"]),
        ("hold = 2", "hold = -2", ["steps.0.hold", "-2", "from 0 to 600"]),
        ("hold = 2", 'command = "forward"', ["steps.0", "until and command", "exactly one of"]),
        ('until = "status == 1"\nhold = 2', 'command = "fly"', ["steps.0.command", '"fly"', "forward"]),
        ('until = "status == 1"\nhold = 2', 'cause = "XX"', ["steps.0.cause", '"XX"', "none, OC"]),
        ('until = "status == 1"\nhold = 2', 'alarm = "fire"', ["steps.0.alarm", '"fire"', "overcurrent"]),
        ('until = "status == 1"\nhold = 2', 'hold = 2\ncommand = "forward"', ["steps.0.hold", "only beside until"]),
        ('command = "forward" }]', 'command = "forward", value = 3 }]', ["solution.0.value", "no value with forward"]),
        ('command = "forward" }]', 'command = "set_frequency" }]', ["solution.0.value", "a value with set_frequency"]),
        ("right = true, ", "", ["steps.1.choices", "0 right answers", "exactly one"]),
        ('[{ label = "a", why = "b" }, ', "[", ["steps.1.choices", "1 answers", "from 2 to 6"]),
        ('title = "Ask"', 'title = "Ask"\ncolour = 1', ["steps.1.colour", "no such key"]),
        (GOOD[GOOD.index("[[steps]]") :], "", ["steps", "none", "at least one"]),
    ],
)
def test_a_mistake_is_named_with_its_place_and_what_was_expected(
    folder: Path, old: str, new: str, told: list[str]
) -> None:
    assert old in GOOD
    found = problems(folder, GOOD.replace(old, new))
    assert found
    assert any(all(word in line for word in ["lessons/own.toml", *told]) for line in found), found


def test_a_name_is_given_once_and_well_formed(folder: Path) -> None:
    assert any("no other lesson" in line for line in problems(folder, GOOD, "motor.toml"))
    (folder / "lessons" / "motor.toml").unlink()
    assert any("small letters" in line for line in problems(folder, GOOD, "Mój.toml"))


@pytest.mark.parametrize("name", ["UP.TOML", "own.TOML", "own.Toml"])
def test_an_ending_in_capital_letters_is_told_and_no_lesson_is_missing_in_silence(folder: Path, name: str) -> None:
    (told,) = problems(folder, GOOD, name)
    assert told.startswith(f"lessons/{name}") and "small letters, digits and _ with .toml" in told


def test_the_shipped_lessons_speak_every_language() -> None:
    plant, found = read_plant(Path("plants/demo"))
    assert plant is not None, found
    assert sorted(plant.lessons) == ["conveyor", "motor", "sequence"]
    for lesson in plant.lessons.values():
        texts = [lesson.title, lesson.about]
        for step in lesson.steps:
            texts += [step.title, step.text, *([step.hint] if step.hint else [])]
            texts += [text for choice in step.choices for text in (choice.label, choice.why)]
        assert all(set(text) == LANGUAGES and all(text.values()) for text in texts), lesson.name


def test_the_lesson_of_the_manual_can_be_taken_as_it_stands_and_shows_answers_too(folder: Path) -> None:
    """How an answer is written stood nowhere."""
    page = (Path(__file__).parents[2] / "docs" / "lessons.md").read_text("utf-8")
    lesson = "\n".join(line[4:] for line in page.splitlines() if line.startswith("    ") or not line)
    assert problems(folder, lesson[lesson.index("[lesson]") :], "manual.toml") == []
    plant, _ = read_plant(folder)
    assert plant is not None
    run, trip, asked = plant.lessons["manual"].steps
    assert run.until and trip.cause == "ESP" and [one.right for one in asked.choices] == [True, False]


def test_a_lesson_that_was_changed_is_a_change_of_the_plant(folder: Path, tmp_path: Path) -> None:
    from app.plant.changes import compare

    assert problems(folder, GOOD) == []
    before, _ = read_plant(folder)
    assert problems(folder, GOOD.replace("status == 1", "status == 2")) == []
    after, _ = read_plant(folder)
    assert before is not None
    assert after is not None
    assert [change.details for change in compare(before, after)] == [("lessons: own",)]
    shutil.rmtree(tmp_path / "plant")
