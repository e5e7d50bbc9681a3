"""How far somebody is in a lesson: pure, a course and what happened in, the next course out."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from app.plant.lesson_definition import Lesson, LessonStep

RIGHT, WRONG = "right", "wrong"


@dataclass(frozen=True, slots=True)
class Course:
    """One person's way through one lesson. Times are µs UTC."""

    lesson: str
    edition: str
    machine: str
    begun: int
    step: int = 0
    """Index of the step at work; as many as there are steps = finished."""
    since: int = 0
    """Since when this step is at work."""
    finished: int = 0
    """0 = not yet."""
    wrong: Mapping[str, int] = field(default_factory=dict)
    """Index of a step → wrong answers given there."""
    hints: tuple[int, ...] = ()
    """Steps whose hint was looked at."""
    chosen: int = -1
    """Answer given last in the step at work; -1 = none."""
    caused: bool = False
    """True while a fault that the lesson caused stands."""

    def at(self, lesson: Lesson) -> LessonStep | None:
        """The step at work; None when it is finished, or of another edition of the lesson."""
        here = not self.finished and self.edition == lesson.edition and self.step < len(lesson.steps)
        return lesson.steps[self.step] if here else None

    def fault(self, lesson: Lesson) -> str:
        """The fault that `lesson` caused last and has not removed; empty: none."""
        return next((one.cause for one in reversed(lesson.steps[: self.step]) if one.cause), "") if self.caused else ""

    @property
    def mistakes(self) -> int:
        """Wrong answers given."""
        return sum(self.wrong.values())


def begin(lesson: Lesson, machine: str, now: int) -> Course:
    """The first step of `lesson` on `machine`."""
    return Course(lesson.name, lesson.edition, machine, now, since=now)


def done(course: Course, lesson: Lesson, now: int) -> Course:
    """The step at work is done: on to the next one."""
    step = course.step + 1
    over = now if step >= len(lesson.steps) else 0
    return replace(course, step=step, since=now, finished=over, chosen=-1)


def answered(course: Course, lesson: Lesson, choice: int, now: int) -> Course:
    """What becomes of an answer to the question at work: the right one goes on, a wrong one is counted and stays to be explained.

    Raises:
        ValueError: no question is asked, or it has no such answer.
    """
    step = course.at(lesson)
    if step is None or not 0 <= choice < len(step.choices):
        raise ValueError(f"lesson {course.lesson} step {course.step + 1}: answer {choice}")
    if step.choices[choice].right:
        return done(course, lesson, now)
    key = str(course.step)
    return replace(course, chosen=choice, wrong={**course.wrong, key: course.wrong.get(key, 0) + 1})


def hinted(course: Course) -> Course:
    """The hint of the step at work was looked at."""
    return course if course.step in course.hints else replace(course, hints=(*course.hints, course.step))


def to_state(course: Course) -> dict[str, Any]:
    """For the database."""
    return asdict(course)


def from_state(state: Mapping[str, Any]) -> Course:
    """What `to_state` gave.

    Raises:
        TypeError, KeyError: it is something else.
    """
    return Course(**{**state, "hints": tuple(state["hints"])})
