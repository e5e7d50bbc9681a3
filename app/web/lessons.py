"""Lessons: what there is to learn on the machines of this plant, how far one is, and for the instructor how far everybody is."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.access.audit.kinds import Kind
from app.errors import Refused
from app.plant.definitions import Equipment
from app.plant.lesson_definition import NO_FAULT, Lesson
from app.running.classroom import Classroom
from app.running.course import Course
from app.running.instruction import look, says_simulated, write
from app.sim import training
from app.web import format as fmt
from app.web.guard import address_of, allow, fields, people_access, person_of
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.signin import moment

router = APIRouter()


@router.get("/lessons", dependencies=[allow("operate")])
async def lessons(request: Request) -> Response:
    """All lessons with one's own progress; for an instructor the class, too."""
    view, room, person = view_of(request), _room(request), person_of(request)
    plant_of(request)
    rows = [_row(request, lesson, room.course(person.id, lesson.name)) for lesson in room.lessons.values()]
    title = view.text(request, "lessons.title")
    pupils = await _pupils(request) if person.may("instruct") else None
    return view.page(request, "pages/lessons.html", title=title, kind="lessons", rows=rows, pupils=pupils)


@router.get("/lessons/class", dependencies=[allow("instruct")])
async def pupils(request: Request) -> Response:
    """How far everybody is, alone."""
    return view_of(request).fragment(request, "fragments/lesson_class.html", pupils=await _pupils(request))


@router.get("/lessons/on/{machine}", dependencies=[allow("operate")])
async def strip(request: Request, machine: str) -> Response:
    """The line on the page of a machine: the step that one is at there."""
    found = _room(request).strip(person_of(request), machine)
    return view_of(request).fragment(request, "fragments/lesson_strip.html", lesson_here=found)


@router.get("/lessons/{name}", dependencies=[allow("operate")])
async def lesson(request: Request, name: str) -> Response:
    """One lesson: its steps, the one at work open."""
    return await _page(request, _lesson(request, name))


@router.get("/lessons/{name}/steps", dependencies=[allow("operate")])
async def steps(request: Request, name: str) -> Response:
    """The steps alone."""
    drawn = await _drawn(request, _lesson(request, name))
    return view_of(request).fragment(request, "fragments/lesson_steps.html", **drawn)


@router.post("/lessons/{name}/begin", dependencies=[allow("operate")])
async def begin(request: Request, name: str) -> Response:
    """Begin a lesson on a machine, or begin it again. What it had caused there before is removed first."""
    given = await fields(request, ["machine"])
    return await _do(request, name, lambda one: _begin(request, one, given["machine"]))


@router.post("/lessons/{name}/leave", dependencies=[allow("operate")])
async def leave(request: Request, name: str) -> Response:
    """Forget one's progress. What the lesson had caused is removed first."""
    await fields(request, [])
    return await _do(request, name, lambda one: _leave(request, one))


@router.post("/lessons/{name}/answer", dependencies=[allow("operate")])
async def answer(request: Request, name: str) -> Response:
    """Answer the question of a step."""
    given = await fields(request, ["step", "choice"])

    async def work(one: Lesson) -> None:
        _room(request).answer(person_of(request), one, _index(given["step"], "step"), _index(given["choice"], "choice"))

    return await _do(request, name, work)


@router.post("/lessons/{name}/hint", dependencies=[allow("operate")])
async def hint(request: Request, name: str) -> Response:
    """Show the hint of the step at work."""
    await fields(request, [])

    async def work(one: Lesson) -> None:
        _room(request).hint(person_of(request), one)

    return await _do(request, name, work)


@router.post("/lessons/{name}/cause", dependencies=[allow("operate")])
async def cause(request: Request, name: str) -> Response:
    """Cause the fault of the step at work, or remove it: on a simulated machine only, by who has control of it."""
    given = await fields(request, ["step"])

    async def work(one: Lesson) -> None:
        person, room = person_of(request), _room(request)
        course = room.course(person.id, one.name)
        step = course.at(one) if course else None
        if course is None or step is None or not step.cause or course.step != _index(given["step"], "step"):
            return  # somebody pressed twice
        await _inject(request, course.machine, one, step.cause)
        room.caused(person, one, course.step)

    return await _do(request, name, work)


@router.post("/lessons/{name}/cause-again", dependencies=[allow("operate")])
async def cause_again(request: Request, name: str) -> Response:
    """Cause the fault once more that one's lesson had caused and that is there no more; one stays at the step at work."""
    await fields(request, [])

    async def work(one: Lesson) -> None:
        course = _room(request).course(person_of(request).id, one.name)
        if course is not None and await _gone(request, one, course):
            await _inject(request, course.machine, one, course.fault(one))

    return await _do(request, name, work)


# ---- what is done -----------------------------------------------------------------------------------------


async def _do(request: Request, name: str, work: Any) -> Response:
    one = _lesson(request, name)
    try:
        await work(one)
    except Refused as refused:
        return await _page(request, one, refused)
    return RedirectResponse(f"/lessons/{quote(name)}#step", 303)


async def _begin(request: Request, lesson: Lesson, machine: str) -> None:
    await _undo(request, lesson)
    _room(request).begin(person_of(request), lesson, machine)
    await _note(request, "lesson.begun", machine, lesson.name)


async def _leave(request: Request, lesson: Lesson) -> None:
    await _undo(request, lesson)
    _room(request).leave(person_of(request), lesson)


async def _undo(request: Request, lesson: Lesson) -> None:
    """Remove the fault that one's lesson has caused; of a machine that is gone there is nothing to remove."""
    course = _room(request).course(person_of(request).id, lesson.name)
    item = plant_of(request).equipment.get(course.machine) if course else None
    if course is not None and course.caused and item is not None:
        await _write(request, item, lesson, NO_FAULT)


async def clear_up(request: Request, person: int) -> None:
    """Forget the lessons of somebody whose account is no more, and remove what stands of the faults that they had caused.

    One that cannot be removed now is told in the audit, and stands on the instructor's page.
    """
    room = _room(request)
    for course in [one for who, one in room.everybody() if who == person]:
        lesson = room.lessons[course.lesson]
        room.forget(person, lesson)
        if await _stands(request, lesson, course):
            with suppress(Refused):
                await _write(request, plant_of(request).equipment[course.machine], lesson, NO_FAULT)


async def _stands(request: Request, lesson: Lesson, course: Course) -> bool | None:
    """Whether the fault that a lesson caused last is there; None: it has caused none, or the machine does not tell."""
    item, fault = plant_of(request).equipment.get(course.machine), course.fault(lesson)
    if item is None or not fault:
        return None
    seen = await look(view_of(request).runtime(request).links[item.link], item)
    return None if seen.words is None else seen.words[training.REG_MACHINE_FAULT] == item.type.training.faults[fault]


async def _inject(request: Request, machine: str, lesson: Lesson, fault: str) -> None:
    """Cause `fault` on `machine`.

    Raises:
        Refused: 409 one has no control of it, or it is not simulated, or did not answer.
    """
    item = plant_of(request).equipment.get(machine)
    gate = view_of(request).runtime(request).gate
    if item is None or gate is None:
        raise Refused("lessons.no_machine", 409, machine=machine)
    if not gate.control.holds(person_of(request), machine):
        refused = Refused("lessons.no_control", 409, machine=machine)
        await _note(request, "lesson.cause", machine, fault, refused)
        raise refused
    await _write(request, item, lesson, fault)


async def _write(request: Request, item: Equipment, lesson: Lesson, fault: str) -> None:
    code = 0 if fault == NO_FAULT else item.type.training.faults[fault]
    refused: Refused | None = None
    try:
        link = view_of(request).runtime(request).links[item.link]
        await write(link, item, {training.REG_MACHINE_FAULT: code})
    except Refused as error:
        refused = error
    await _note(request, "lesson.cause", item.id, fault, refused)
    if refused:
        raise refused


async def _note(request: Request, kind: Kind, machine: str, new: str, refused: Refused | None = None) -> None:
    await people_access(request).audit.record(
        kind,
        person_of(request),
        machine,
        new=new,
        result="refused" if refused else "ok",
        reason=refused.reason if refused else "",
        address=address_of(request.scope),
        **(refused.params if refused else {}),
    )


def _index(text: str, field: str) -> int:
    if not text.isascii() or not text.isdigit() or len(text) > 3:
        raise Refused("access.form_field", 422, field=field)
    return int(text)


# ---- what is drawn ----------------------------------------------------------------------------------------


def _room(request: Request) -> Classroom:
    return view_of(request).runtime(request).classroom


def _lesson(request: Request, name: str) -> Lesson:
    found = _room(request).lessons.get(name)
    if found is None:
        raise HTTPException(404)
    return found


async def _page(request: Request, lesson: Lesson, refused: Refused | None = None) -> Response:
    view = view_of(request)
    return view.page(
        request,
        "pages/lesson.html",
        status=refused.status if refused else 200,
        title=view.text(request, "lessons.lesson"),
        kind="lessons",
        up="/lessons",
        error=view.refusal(request, refused) if refused else "",
        **await _drawn(request, lesson),
    )


async def _drawn(request: Request, lesson: Lesson) -> dict[str, Any]:
    person, room, view = person_of(request), _room(request), view_of(request)
    runtime = view.runtime(request)
    course = room.course(person.id, lesson.name)
    plant = plant_of(request)
    items = [plant.equipment[id] for id in room.machines(lesson)]
    on = plant.equipment.get(course.machine) if course else None
    gate = runtime.gate
    return {
        "lesson": lesson,
        "course": course,
        "step": course.at(lesson) if course else None,
        "machines": [(item.id, view.machine(request, item).label) for item in items],
        "machine": (on.id, view.machine(request, on).label) if on else None,
        "controls": bool(on and gate and gate.control.holds(person, on.id)),
        "simulated_here": bool(on and says_simulated(runtime.links[on.link], on)),
        "fault_gone": await _gone(request, lesson, course),
        "finished": moment(request, course.finished) if course and course.finished else "",
        "took": _minutes(request, course),
    }


async def _gone(request: Request, lesson: Lesson, course: Course | None) -> bool:
    """Whether a step waits for what a fault does that is there no more: the plant was started anew, or somebody else removed it.

    False of a machine that does not tell.
    """
    step = course.at(lesson) if course else None
    if course is None or step is None or step.cause:
        return False
    return await _stands(request, lesson, course) is False


def _minutes(request: Request, course: Course | None) -> str:
    if course is None:
        return ""
    until = course.finished or view_of(request).runtime(request).clock.micros()
    return fmt.number(max(0.0, until - course.begun) / 60e6, 0, language_of(request))


def _row(request: Request, lesson: Lesson, course: Course | None) -> dict[str, Any]:
    view = view_of(request)
    item = plant_of(request).equipment.get(course.machine) if course else None
    kind = plant_of(request).types[lesson.type]
    texts = view.runtime(request).texts
    return {
        "lesson": lesson,
        "course": course,
        "done": min(course.step, len(lesson.steps)) if course else 0,
        "of": len(lesson.steps),
        "machine": view.machine(request, item).label if item else "",
        "type": texts.of_type(language_of(request), kind, kind.label),
        "finished": moment(request, course.finished) if course and course.finished else "",
        "took": _minutes(request, course),
    }


async def _pupils(request: Request) -> list[Mapping[str, Any]]:
    """Everybody who is or was in a lesson, those at work first, the latest first."""
    room = _room(request)
    people = {account.id: account for account in await people_access(request).people.all()}
    found = [
        _row(request, room.lessons[course.lesson], course)
        | {"name": people[who].display or people[who].name, "since": moment(request, course.since)}
        for who, course in room.everybody()
        if who in people
    ]
    return sorted(found, key=lambda row: (bool(row["course"].finished), -row["course"].since))
