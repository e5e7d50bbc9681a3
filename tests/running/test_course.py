"""A course goes on by what is done, counts what was wrong, and comes back from the database as it was."""

import pytest

from app.plant.lesson_definition import Choice, Lesson, LessonStep
from app.running import course as courses

WORDS = {"en": "x"}
QUESTION = LessonStep(WORDS, WORDS, {}, choices=(Choice(WORDS, False, WORDS), Choice(WORDS, True, WORDS)))
LESSON = Lesson("l", "motor", WORDS, WORDS, 5, (LessonStep(WORDS, WORDS, {}, until="speed > 0"), QUESTION))


def test_a_course_ends_after_its_last_step() -> None:
    begun = courses.begin(LESSON, "m1", 10)
    asked = courses.done(begun, LESSON, 20)
    assert (asked.step, asked.since, asked.at(LESSON), asked.finished) == (1, 20, QUESTION, 0)
    over = courses.answered(asked, LESSON, 1, 30)
    assert (over.step, over.finished, over.at(LESSON), over.mistakes) == (2, 30, None, 0)


def test_a_wrong_answer_is_counted_and_stays_to_be_explained() -> None:
    asked = courses.done(courses.begin(LESSON, "m1", 10), LESSON, 20)
    twice = courses.answered(courses.answered(asked, LESSON, 0, 21), LESSON, 0, 22)
    assert (twice.step, twice.chosen, twice.mistakes, twice.wrong) == (1, 0, 2, {"1": 2})
    assert courses.answered(twice, LESSON, 1, 23).chosen == -1


@pytest.mark.parametrize(("step", "choice"), [(0, 0), (1, 2), (1, -1), (2, 0)])
def test_an_answer_that_nobody_asked_for_is_refused(step: int, choice: int) -> None:
    course = courses.begin(LESSON, "m1", 10)
    for _ in range(step):
        course = courses.done(course, LESSON, 20)
    with pytest.raises(ValueError, match=f"answer {choice}"):
        courses.answered(course, LESSON, choice, 30)


def test_what_the_database_keeps_is_the_course() -> None:
    course = courses.hinted(courses.hinted(courses.begin(LESSON, "m1", 10)))
    wrong = courses.answered(courses.done(course, LESSON, 20), LESSON, 0, 21)
    assert courses.from_state(courses.to_state(wrong)) == wrong
    assert wrong.hints == (0,)


def test_other_things_to_do_make_another_edition_and_other_words_do_not() -> None:
    def with_first(step: LessonStep) -> Lesson:
        return Lesson("l", "motor", WORDS, WORDS, 5, (step, QUESTION))

    assert with_first(LessonStep({"en": "y"}, WORDS, WORDS, until="speed > 0")).edition == LESSON.edition
    other = with_first(LessonStep(WORDS, WORDS, {}, until="speed > 1"))
    assert other.edition != LESSON.edition
    assert courses.begin(LESSON, "m1", 10).at(other) is None
