"""Lessons: each shipped one is played through by its own solution, in virtual time, as a learner does it in a browser."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import chance
from app.access.audit.search import Filter
from app.access.roles import Person
from app.plant.lesson_definition import Deed, Lesson
from app.running.classroom import Classroom
from app.running.course import Course
from tests.virtual import until
from tests.web.operating import Operator, runtime_of
from tests.web.people import BOSS, PASSWORD, Staff

LONGEST = 420.0
"""A step that is not ticked off in so long cannot be done [s]."""


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    demo.pass_time(3)
    return Staff(demo)


@pytest.fixture
def ana(staff: Staff) -> Iterator[Operator]:
    yield Operator(staff, "ana", ("operator",)).sit()
    gate = runtime_of(staff.client).gate
    assert gate is not None
    if holder := gate.control.holder("m2"):
        staff.wait(gate.control.session_ended, holder.session)


def room_of(client: TestClient) -> Classroom:
    return runtime_of(client).classroom


def course_of(client: TestClient, lesson: str) -> Course:
    ((_, found),) = [(who, one) for who, one in room_of(client).everybody() if one.lesson == lesson]
    return found


def person_of(client: TestClient, operator: Operator) -> Person:
    access = runtime_of(client).access
    found: Person | None = operator.staff.wait(access.sessions.find, operator.sid, "127.0.0.1", "testclient")
    assert found is not None
    return found


class Learner:
    """Does a lesson by its solution, and nothing that the lesson does not ask for."""

    def __init__(self, client: TestClient, operator: Operator, lesson: Lesson, machine: str) -> None:
        self.client, self.operator, self.lesson, self.machine = client, operator, lesson, machine

    def play(self) -> None:
        assert self.operator.post(f"/lessons/{self.lesson.name}/begin", False, machine=self.machine).status_code == 303
        self.operator.take(self.machine)
        for index, step in enumerate(self.lesson.steps):
            here = course_of(self.client, self.lesson.name)
            if here.step > index:
                continue  # it was so already
            where = f"{self.lesson.name}, step {index + 1}: {step.title['en']}"
            if step.choices:
                self.post("answer", step=str(index), choice=str(step.right))
            elif step.cause:
                self.post("cause", step=str(index))
            for deed in step.solution:
                self.do(deed, where)
            assert until(lambda: course_of(self.client, self.lesson.name).step > index, LONGEST, 0.5), where  # noqa: B023
        assert course_of(self.client, self.lesson.name).finished

    def post(self, what: str, **given: str) -> None:
        answer = self.operator.post(f"/lessons/{self.lesson.name}/{what}", False, **given)
        assert answer.status_code == 303, re.sub(r"\s+", " ", answer.text)[-3000:]

    def do(self, deed: Deed, where: str) -> None:
        runtime = runtime_of(self.client)
        if deed.acknowledge:
            wanted = (self.machine, deed.acknowledge)
            found: list[Any] = []

            def there() -> bool:
                found[:] = [one for one in runtime.alarms.list.active() if (one.equipment, one.key) == wanted]
                return bool(found)

            assert until(there, LONGEST, 0.5), where
            person = person_of(self.client, self.operator)
            self.operator.staff.wait(runtime.alarms.acknowledge, [found[0].occurrence], person)
            return
        gate = runtime.gate
        assert gate is not None

        def possible() -> bool:
            self.operator.get("/nonce")  # who sits at the machine is there
            return not gate.why_not(person_of(self.client, self.operator), self.machine, deed.command)

        assert until(possible, LONGEST, 1.0), where
        person = person_of(self.client, self.operator)
        nonce = gate.nonces.issue(person.session)
        self.operator.staff.wait(
            gate.ask,
            person,
            self.machine,
            deed.command,
            argument=deed.value,
            nonce=nonce,
            id=chance.token_hex(16),
            confirmed=True,
        )


ACKNOWLEDGE, RESET = 5, 8
"""The steps of the lesson on a motor that are done by an acknowledgement and by a command."""
MACHINES = {"motor": "m1", "conveyor": "c1", "sequence": "seq1"}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", MACHINES)
def test_a_shipped_lesson_can_be_completed_by_its_solution(staff: Staff, ana: Operator, name: str) -> None:
    client = staff.client
    Learner(client, ana, room_of(client).lessons[name], MACHINES[name]).play()
    page = ana.get(f"/lessons/{name}", False).text
    assert "The lesson is finished." in page
    assert page.count("le-over") == len(room_of(client).lessons[name].steps)


def test_every_shipped_lesson_is_played(staff: Staff) -> None:
    assert set(room_of(staff.client).lessons) == set(MACHINES)


def test_a_wrong_answer_is_explained_and_a_hint_is_shown_when_asked_for(staff: Staff, ana: Operator) -> None:
    client = staff.client
    motor = room_of(client).lessons["motor"]
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    assert "slows down by its ramp" not in ana.get("/lessons/motor", False).text
    assert ana.post("/lessons/motor/hint", False).status_code == 303
    assert "slows down by its ramp" in ana.get("/lessons/motor", False).text
    assert ana.post("/lessons/motor/answer", False, step="0", choice="1").status_code == 422  # nothing is asked here
    assert motor.steps[3].kind == "question"
    put_at(client, "motor", 3)
    assert ana.post("/lessons/motor/answer", False, step="3", choice="0").status_code == 303
    assert "No: the speed of an induction motor follows" in ana.get("/lessons/motor", False).text
    assert course_of(client, "motor").mistakes == 1
    assert ana.post("/lessons/motor/answer", False, step="3", choice="7").status_code == 422
    assert ana.post("/lessons/motor/answer", False, step="3", choice="1").status_code == 303
    assert course_of(client, "motor").step == 4


def test_a_fault_is_caused_only_by_who_has_control_and_goes_when_one_leaves(staff: Staff, ana: Operator) -> None:
    client = staff.client
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    put_at(client, "motor", 4)
    refused = ana.post("/lessons/motor/cause", False, step="4")
    assert refused.status_code == 409
    assert "Take control of m2 first" in refused.text
    ana.take("m2")
    assert ana.post("/lessons/motor/cause", False, step="4").status_code == 303
    assert fault_of(client) == 4
    assert course_of(client, "motor").step == 5
    assert ana.post("/lessons/motor/cause", False, step="4").status_code == 303  # pressed twice: nothing more
    assert ana.post("/lessons/motor/leave", False).status_code == 303
    assert fault_of(client) == 0
    assert not [one for _, one in room_of(client).everybody() if one.lesson == "motor"]
    lines = [line for line in staff.wait(staff.access.audit.find, Filter(), 80) if line.kind == "lesson.cause"]
    assert [(line.person, line.object, line.new, line.result) for line in lines[:3]] == [
        ("ana", "m2", "none", "ok"),
        ("ana", "m2", "OC", "ok"),
        ("ana", "m2", "OC", "refused"),
    ]


def test_a_fault_that_is_there_no_more_is_told_and_caused_again(staff: Staff, ana: Operator) -> None:
    """The server was started anew, and its simulated plant with it, or the instructor has cleared it."""
    client, told = staff.client, "is there no more"
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    put_at(client, "motor", 4)
    ana.take("m2")
    assert ana.post("/lessons/motor/cause", False, step="4").status_code == 303
    assert fault_of(client) == 4
    assert told not in ana.get("/lessons/motor/steps").text
    assert ana.post("/lessons/motor/cause-again", False).status_code == 303  # nothing to cause
    client.run(runtime_of(client).links["hall"].raw_write(2, 0xE010, [0]))
    assert fault_of(client) == 0
    at = course_of(client, "motor").step
    assert told in ana.get("/lessons/motor/steps").text
    assert ana.post("/lessons/motor/cause-again", False).status_code == 303
    assert fault_of(client) == 4
    assert course_of(client, "motor").step == at
    assert told not in ana.get("/lessons/motor/steps").text
    assert ana.post("/lessons/motor/leave", False).status_code == 303
    assert fault_of(client) == 0


@pytest.mark.sweep(8)
@pytest.mark.parametrize("other", [0, 13])
def test_the_fault_of_a_learner_goes_with_the_account_and_that_of_somebody_else_stays(staff: Staff, other: int) -> None:
    client = staff.client
    id = staff.add(name := f"pupil{other}", "operator")
    pupil = Operator(staff, name, ("operator",)).sit()
    assert pupil.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    put_at(client, "motor", 4, id)
    pupil.take("m2")
    assert pupil.post("/lessons/motor/cause", False, step="4").status_code == 303
    assert fault_of(client) == 4
    if other:
        client.run(runtime_of(client).links["hall"].raw_write(2, 0xE010, [other]))
        assert fault_of(client) == other
    staff.enter("chief", "admin", "engineer", "operator")
    assert staff.post(f"/users/{id}/delete", {"own_password": PASSWORD}).status_code in (200, 303)
    assert fault_of(client) == other
    assert id not in [who for who, _ in room_of(client).everybody()]
    client.run(runtime_of(client).links["hall"].raw_write(2, 0xE010, [0]))


def put_at(client: TestClient, lesson: str, step: int, who: int = 0) -> None:
    """As if everything before were done."""
    room = room_of(client)
    courses = [(key, one) for key, one in room._courses.items() if one.lesson == lesson and who in (0, key[0])]
    ((key, course),) = courses
    room._put(key, replace(course, step=step, since=runtime_of(client).clock.micros()))


def fault_of(client: TestClient) -> int:
    client.pass_time(0.5)
    word: int = client.run(runtime_of(client).links["hall"].raw_read(2, 0xE010, 1))[0]
    return word


def test_the_page_of_the_machine_names_the_step_and_no_other_page_does(staff: Staff, ana: Operator) -> None:
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    put_at(staff.client, "motor", 6)
    assert "Why did it trip?" in ana.get("/equipment/m2", False).text
    assert "Why did it trip?" in ana.get("/lessons/on/m2").text
    assert 'class="le-strip"' not in ana.get("/equipment/m1", False).text
    other = Operator(staff, "ivo", ("operator",)).sit()
    assert 'class="le-strip"' not in other.get("/equipment/m2", False).text
    assert ana.post("/lessons/motor/begin", False, machine="c1").status_code == 422


def test_the_instructor_sees_the_class_and_others_only_themselves(staff: Staff, ana: Operator) -> None:
    assert "/lessons/class" not in ana.get("/lessons", False).text
    assert ana.get("/lessons/class").status_code == 403
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    put_at(staff.client, "motor", 6)
    teacher = Operator(staff, "teacher", ("engineer",)).sit()
    page = teacher.get("/lessons", False).text
    assert "ana" in page
    assert "Step 7 of 11" in teacher.get("/lessons/class").text
    staff.have()
    assert staff.client.get("/lessons").status_code in (303, 401)


def reset_by(client: TestClient, operator: Operator) -> None:
    """`operator` takes m2 and resets its fault."""
    operator.take("m2")
    Learner(client, operator, room_of(client).lessons["motor"], "m2").do(Deed(command="reset"), "reset")
    client.pass_time(5)


@pytest.fixture
def call(staff: Staff) -> Iterator[Callable[[Operator, str], None]]:
    """Have somebody be called otherwise, for a test."""
    renamed: list[int] = []

    def rename(operator: Operator, display: str) -> None:
        renamed.append(person_of(staff.client, operator).id)
        staff.wait(staff.access.people.rename, BOSS, renamed[-1], display)

    yield rename
    for one in renamed:
        staff.wait(staff.access.people.rename, BOSS, one, "")


@pytest.mark.sweep(8)
def test_a_learner_who_is_called_otherwise_meanwhile_goes_on(
    staff: Staff, ana: Operator, call: Callable[[Operator, str], None]
) -> None:
    client = staff.client
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    put_at(client, "motor", RESET)
    call(ana, "Ana Horvat")
    assert person_of(client, ana).display == "Ana Horvat"
    reset_by(client, ana)
    assert course_of(client, "motor").step == RESET + 1


@pytest.mark.sweep(8)
def test_what_a_namesake_does_on_the_machine_ticks_nothing_off(
    staff: Staff, ana: Operator, call: Callable[[Operator, str], None]
) -> None:
    client = staff.client
    ivo = Operator(staff, "ivo", ("operator",)).sit()
    for one in (ana, ivo):
        call(one, "Ana")
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    put_at(client, "motor", RESET)
    reset_by(client, ivo)
    assert course_of(client, "motor").step == RESET


@pytest.mark.sweep(8)
def test_an_alarm_that_goes_as_it_is_acknowledged_ticks_its_step_off(staff: Staff, ana: Operator) -> None:
    client, alarms = staff.client, runtime_of(staff.client).alarms
    assert ana.post("/lessons/motor/begin", False, machine="m2").status_code == 303
    ana.take("m2")
    put_at(client, "motor", ACKNOWLEDGE - 1)
    assert ana.post("/lessons/motor/cause", False, step=str(ACKNOWLEDGE - 1)).status_code == 303
    client.pass_time(3)
    (found,) = [one for one in alarms.list.active() if one.id == "m2.overcurrent"]
    teacher = Operator(staff, "teacher", ("engineer", "operator")).sit()
    assert teacher.post("/instructor/m2/fault", False, code="0").status_code == 303  # the teacher removes it
    Learner(client, ana, room_of(client).lessons["motor"], "m2").do(Deed(command="reset"), "reset")
    client.pass_time(5)
    assert course_of(client, "motor").step == ACKNOWLEDGE
    staff.wait(alarms.acknowledge, [found.occurrence], person_of(client, ana))
    client.pass_time(2)
    assert alarms.find(found.occurrence) is None
    assert course_of(client, "motor").step == ACKNOWLEDGE + 1


def test_progress_outlives_the_server(staff: Staff, ana: Operator) -> None:
    client = staff.client
    client.pass_time(2)
    room, runtime = room_of(client), runtime_of(client)
    again = Classroom(runtime.db, runtime.tags, runtime.clock, runtime.alarms, lambda: runtime.plant)
    client.run(again.load())
    assert sorted(map(repr, again.everybody())) == sorted(map(repr, room.everybody()))
