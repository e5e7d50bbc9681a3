"""Who is in which lesson: watches values, alarms and commands, ticks steps off, and keeps how far everybody is in `pogon.db`."""

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import JSON, Column, Connection, ForeignKey, String, Table, delete, insert, select

from app.access.roles import Person
from app.access.tables import person_table
from app.alarms.engine import AlarmEngine
from app.clock import Clock
from app.commands.lifecycle import Progress, ProgressState
from app.db import Database, pogon_tables
from app.errors import Refused, StorageError
from app.plant import expression
from app.plant.definitions import Plant
from app.plant.lesson_definition import NO_FAULT, Lesson, LessonStep
from app.plant.system import CLASS, LESSONS
from app.running import course as courses
from app.running.course import Course
from app.running.revisions import Revisions
from app.tags.database import TagDatabase
from app.tags.quality import NO_DATA

log = logging.getLogger(__name__)

LOOK_PERIOD = 0.5
"""How often the steps at work are looked at [s]."""

progress_table = Table(
    "lesson_progress",
    pogon_tables,
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), primary_key=True),
    Column("lesson", String(80), primary_key=True),
    Column("state", JSON, nullable=False),
)
"""A course (running/course.py) by person and lesson."""

Key = tuple[int, str]
"""Person and lesson."""


@dataclass(frozen=True, slots=True)
class Strip:
    """A step as the page of its machine names it."""

    machine: str
    lesson: Lesson
    step: LessonStep
    number: int
    """From 1."""


class Classroom:
    """The courses of everybody."""

    def __init__(
        self, db: Database, tags: TagDatabase, clock: Clock, alarms: AlarmEngine, plant: Callable[[], Plant | None]
    ) -> None:
        self._db, self._tags, self._clock, self._alarms, self._plant = db, tags, clock, alarms, plant
        self._revision = Revisions(tags, clock, LESSONS, block=4)
        self._courses: dict[Key, Course] = {}
        self._held: dict[Key, float] = {}
        """Since when the sentence of a step holds, monotonic [s]."""
        self._unwritten: set[Key] = set()

    # ---- what there is --------------------------------------------------------------------------------

    @property
    def lessons(self) -> Mapping[str, Lesson]:
        """Lessons of the plant by name, those that have a machine to be done on."""
        plant = self._plant()
        return plant.lessons if plant else {}

    def machines(self, lesson: Lesson) -> list[str]:
        """Machines that `lesson` may be done on."""
        plant = self._plant()
        return [item.id for item in plant.equipment.values() if item.type.name == lesson.type] if plant else []

    def course(self, person: int, lesson: str) -> Course | None:
        """How far `person` is in `lesson`; None = not begun, or begun in another edition of it."""
        found, known = self._courses.get((person, lesson)), self.lessons.get(lesson)
        return found if found is not None and known is not None and found.edition == known.edition else None

    def at_work(self, person: int, machine: str) -> Course | None:
        """The lesson that `person` is in on `machine`, the one begun last."""
        mine = [one for (who, name), _ in self._courses.items() if who == person and (one := self.course(who, name))]
        open_ = [one for one in mine if one.machine == machine and not one.finished]
        return max(open_, key=lambda one: one.begun, default=None)

    def strip(self, person: Person | None, machine: str) -> Strip | None:
        """What the page of `machine` says of the lesson that `person` is in there; None = in none."""
        mine = self.at_work(person.id, machine) if person is not None and person.may("operate") else None
        lesson = self.lessons[mine.lesson] if mine else None
        step = mine.at(lesson) if mine and lesson else None
        return Strip(machine, lesson, step, mine.step + 1) if mine and lesson and step else None

    def everybody(self) -> Iterable[tuple[int, Course]]:
        """All courses with their person."""
        return [(who, one) for (who, name) in self._courses if (one := self.course(who, name)) is not None]

    # ---- what people do -------------------------------------------------------------------------------

    def begin(self, person: Person, lesson: Lesson, machine: str) -> Course:
        """Begin `lesson` on `machine`, from its first step, whatever there was.

        Raises:
            Refused: 422, it is not for this machine.
        """
        if machine not in self.machines(lesson):
            raise Refused("lessons.no_machine", 422, machine=machine[:40])
        return self._keep(person, courses.begin(lesson, machine, self._clock.micros()))

    def answer(self, person: Person, lesson: Lesson, step: int, choice: int) -> Course:
        """Answer the question of `step`; an answer to a step that is over changes nothing.

        Raises:
            Refused: 409 the lesson was not begun; 422 no such answer.
        """
        mine = self._mine(person, lesson)
        if mine.step != step:
            return mine
        try:
            return self._keep(person, courses.answered(mine, lesson, choice, self._clock.micros()))
        except ValueError as error:
            raise Refused("access.form_field", 422, field="choice") from error

    def hint(self, person: Person, lesson: Lesson) -> Course:
        """Look at the hint of the step at work.

        Raises:
            Refused: 409, the lesson was not begun.
        """
        return self._keep(person, courses.hinted(self._mine(person, lesson)))

    def caused(self, person: Person, lesson: Lesson, step: int) -> Course:
        """The fault of `step` was caused, or removed, and read back.

        Raises:
            Refused: 409, the lesson was not begun.
        """
        mine = self._mine(person, lesson)
        at = mine.at(lesson)
        if at is None or not at.cause or mine.step != step:
            return mine
        stands = replace(mine, caused=at.cause != NO_FAULT)
        return self._keep(person, courses.done(stands, lesson, self._clock.micros()))

    def leave(self, person: Person, lesson: Lesson) -> None:
        """Forget how far `person` is in `lesson`."""
        self.forget(person.id, lesson)

    def forget(self, person: int, lesson: Lesson) -> None:
        """Forget how far somebody was, who may have no account any more."""
        key = (person, lesson.name)
        if self._courses.pop(key, None) is not None:
            self._changed(key)

    def _mine(self, person: Person, lesson: Lesson) -> Course:
        mine = self.course(person.id, lesson.name)
        if mine is None:
            raise Refused("lessons.not_begun", 409)
        return mine

    def _keep(self, person: Person, course: Course) -> Course:
        self._put((person.id, course.lesson), course)
        return course

    def _put(self, key: Key, course: Course) -> None:
        if self._courses.get(key) != course:
            self._courses[key] = course
            self._changed(key)

    def _changed(self, key: Key) -> None:
        self._held.pop(key, None)
        self._unwritten.add(key)
        self._revision.changed(CLASS)

    # ---- what is watched ------------------------------------------------------------------------------

    def tick(self) -> None:
        """Tick off what is done by now."""
        for key, lesson, course, step in self._open():
            if step.until:
                self._look(key, lesson, course, step)
            elif step.alarm and self._alarm_is(course, step):
                self._put(key, courses.done(course, lesson, self._clock.micros()))

    def ended(self, progress: Progress) -> None:
        """A command is over: confirmed, it ticks off the step of who gave it."""
        if progress.state is not ProgressState.CONFIRMED:
            return
        for key, lesson, course, step in self._open():
            mine = key[0] == progress.asker and progress.requested >= course.since
            if mine and step.command == progress.command and course.machine == progress.equipment:
                self._put(key, courses.done(course, lesson, self._clock.micros()))

    def _open(self) -> list[tuple[Key, Lesson, Course, LessonStep]]:
        lessons, found = self.lessons, []
        for key, course in self._courses.items():
            lesson = lessons.get(key[1])
            step = course.at(lesson) if lesson else None
            if lesson and step:
                found.append((key, lesson, course, step))
        return found

    def _look(self, key: Key, lesson: Lesson, course: Course, step: LessonStep) -> None:
        now = self._clock.monotonic()
        if not expression.parse(step.until).true(self._reader(course.machine), age=self._age(course.machine)):
            self._held.pop(key, None)
        elif now - self._held.setdefault(key, now) >= step.hold:
            self._put(key, courses.done(course, lesson, self._clock.micros()))

    def _reader(self, machine: str) -> expression.Look:
        def look(point: str) -> expression.Reading:
            handle = self._tags.handles.get(f"{machine}.{point}")
            return (None, NO_DATA) if handle is None else (self._tags.value(handle), self._tags.quality(handle))

        return look

    def _age(self, machine: str) -> expression.Age:
        def age(point: str) -> float | None:
            handle = self._tags.handles.get(f"{machine}.{point}")
            return None if handle is None else self._tags.age(handle)

        return age

    def _alarm_is(self, course: Course, step: LessonStep) -> bool:
        listed = self._alarms.list.active()
        found = next((one for one in listed if (one.equipment, one.key) == (course.machine, step.alarm)), None)
        if step.moment == "gone":
            return found is None
        if found is None:  # one whose cause was over went with its acknowledgement
            last = self._alarms.acknowledged(f"{course.machine}.{step.alarm}")
            return step.moment == "acknowledged" and last >= course.since
        return step.moment == "active" or not found.unacked

    # ---- what runs ------------------------------------------------------------------------------------

    async def load(self) -> None:
        """Read how far everybody was; what cannot be read begins anew."""

        def work(connection: Connection) -> list[tuple[int, str, Mapping[str, Any]]]:
            return [(row.person, row.lesson, row.state) for row in connection.execute(select(progress_table))]

        try:
            rows = await self._db.read(work)
        except StorageError as error:
            log.error("lessons not read reason=%s", error)
            return
        for person, lesson, state in rows:
            try:
                self._courses[person, lesson] = courses.from_state(state)
            except (TypeError, KeyError) as error:
                log.warning("course not understood lesson=%s reason=%s", lesson, error)

    async def run(self) -> None:
        """Look and write, for ever."""
        while True:
            await asyncio.sleep(LOOK_PERIOD)
            self.tick()
            await self.write()

    async def write(self) -> None:
        """Write what changed; a database that takes nothing is tried again."""
        keys = sorted(self._unwritten)
        if not keys:
            return
        states = {key: courses.to_state(self._courses[key]) for key in keys if key in self._courses}

        def work(connection: Connection) -> None:
            known = {row.id for row in connection.execute(select(person_table.c.id))}
            for person, lesson in keys:
                here = (progress_table.c.person == person) & (progress_table.c.lesson == lesson)
                connection.execute(delete(progress_table).where(here))
                if (person, lesson) in states and person in known:
                    row = {"person": person, "lesson": lesson, "state": states[person, lesson]}
                    connection.execute(insert(progress_table), [row])

        self._unwritten.clear()
        try:
            await self._db.write(work)
        except StorageError as error:
            self._unwritten.update(keys)
            log.error("lessons not written reason=%s", error)
