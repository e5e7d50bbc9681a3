"""The fault buffer of a drive behind its mailbox: present and acknowledged fault situations, active alarms, with plain words and times.

It is read when somebody asks, and from then on by itself when the drive tells a change (status word, first faults, alarm) while
somebody looks. What was read stays with its time; it is called old as soon as the drive has told something else or could not be read again.
Every drive object has a buffer of its own, the Control Unit too: the page shows that of the drive, the first one beside the Control
Unit, until another one is chosen.
"""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.errors import LinkError, PogonError, Refused
from app.links.mailbox import Missed, ParameterAccess
from app.profidrive.fault_buffer import PLACES, Columns, Message, Moment, alarms, situations
from app.profidrive.parameter_access.error_numbers import key_of
from app.profidrive.parameter_access.messages import Address, Failed, Values
from app.tags.batch import Value
from app.web import format as fmt
from app.web.commands import operation_of, wants_fragment
from app.web.drive_mailbox import CONTROL_UNIT, drive_among, kept_of, mailbox_of, objects_of, told_of
from app.web.guard import allow, fields
from app.web.operation import Operation
from app.web.pages import view_of

router = APIRouter()

NUMBERS, ALARM_NUMBERS, RUNTIME = "r0945", "r2122", "p0969"
BEFORE_AND_AFTER = ("r0944", NUMBERS, "r2121", ALARM_NUMBERS)
"""Read first and last: while they differ, the buffer moved in between."""
REST = ("r0948", "r0949", "r2109", "r2130", "r2136", "r2123", "r2124")
ALARMS = frozenset({ALARM_NUMBERS, "r2123", "r2124"})
"""Of these only the places of active alarms are read."""
TRIES = 3
TELLING = ("zsw1_fault", "zsw1_alarm", *(f"fault_{place}" for place in range(1, 9)), "alarm_number", "alarm_code")
"""Points by which a drive tells a change, as far as its type has them."""
DAY = 86_400_000

DRIVE, LAST_OBJECT = 0, 255
"""The drive object that the machine is, whatever its number; the highest number."""

Signs = tuple[Value, ...] | None
"""Values of `TELLING`; None = one of them is not known."""


class Unsteady(PogonError):
    """The buffer moved each time while it was read."""


@dataclass(frozen=True, slots=True)
class Refusal(Exception):
    """The drive does not hand out what must be there."""

    number: int | None


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The buffer at one moment."""

    time: int
    """When the drive's runtime was read, else when the last answer came [µs UTC]."""
    signs: Signs
    situations: Sequence[Sequence[Message]]
    alarms: Sequence[Message]


@dataclass(slots=True)
class Buffer:
    """What was read of one drive, and what is being read."""

    snapshot: Snapshot | None = None
    tried: Signs = None
    """What the drive told when it was asked last."""
    problem: tuple[str, Mapping[str, object]] | None = None
    """Text key and parameters of why the last reading failed."""
    task: asyncio.Task[None] | None = field(default=None, repr=False)

    @property
    def reading(self) -> bool:
        """Whether it is being read."""
        return self.task is not None and not self.task.done()


@dataclass(slots=True)
class Buffers:
    """What was read of one drive, by drive object."""

    objects: tuple[int, ...] = ()
    """Which ones it has; none = it was not asked yet."""
    found: dict[int, Buffer] = field(default_factory=dict)

    def of(self, chosen: int) -> Buffer:
        """That of a drive object; `DRIVE`, whatever its number is."""
        return self.found.setdefault(chosen, Buffer())


@dataclass(frozen=True, slots=True)
class Row:
    """One fault or alarm in words."""

    code: str
    """F07452."""
    name: str
    cause: str
    """Empty where the house does not know it."""
    remedy: str
    value: str
    received: str
    removed: str


@router.get("/equipment/{key}/fault-buffer", dependencies=[allow("view")])
async def page(request: Request, key: str) -> HTMLResponse:
    """The buffer as it was read."""
    operation = operation_of(request, key)
    machine = operation.equipment
    return view_of(request).page(
        request,
        "pages/fault_buffer.html",
        title=machine.text("fbuf.title"),
        kind=f"faceplate/{machine.id}",
        area=machine.area,
        chip=machine.id,
        up=operation.url,
        message=operation.story,
        **_drawn(request.app, operation, _chosen(request.query_params)),
    )


@router.get("/equipment/{key}/fault-buffer/rows", dependencies=[allow("view")])
async def rows(request: Request, key: str) -> HTMLResponse:
    """The lists alone, for a page that is open: read anew when the drive tells something that was not there when it was asked last."""
    operation, chosen = operation_of(request, key), _chosen(request.query_params)
    buffers, signs = _buffers(request.app, operation), _signs(operation)
    buffer = buffers.of(chosen)
    if buffer.snapshot is not None and signs is not None and signs != buffer.tried:
        _begin(operation, buffers, chosen)
    return view_of(request).fragment(request, "fragments/fault_buffer.html", **_drawn(request.app, operation, chosen))


@router.post("/equipment/{key}/fault-buffer/read", dependencies=[allow("view")])
async def read(request: Request, key: str) -> Response:
    """Read it now; nothing is added to a reading that goes on."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("object",))
    chosen = _chosen(form)
    _begin(operation, _buffers(request.app, operation), chosen)
    if not wants_fragment(request):
        return RedirectResponse(form["next"] or f"{operation.url}/fault-buffer", 303)
    await asyncio.sleep(0)  # what is refused at once is told at once
    return view_of(request).fragment(request, "fragments/fault_buffer.html", **_drawn(request.app, operation, chosen))


# ---- reading --------------------------------------------------------------------------------------------------


def _begin(operation: Operation, buffers: Buffers, chosen: int) -> None:
    buffer = buffers.of(chosen)
    if buffer.reading:
        return
    mailbox = mailbox_of(operation)
    buffer.tried = signs = _signs(operation)

    async def work() -> None:
        problem: tuple[str, Mapping[str, object]] | None = None
        try:
            buffers.objects = buffers.objects or await objects_of(operation, mailbox)
            drive = drive_among(buffers.objects) if chosen == DRIVE else chosen
            buffer.snapshot = await _snapshot(operation, mailbox, drive, signs)
        except Refusal as refusal:
            number = "–" if refusal.number is None else fmt.hexadecimal(refusal.number, 2)
            problem = key_of(refusal.number), {"number": number}
        except (LinkError, Refused) as error:
            problem = told_of(error)
        except Unsteady:
            problem = "fbuf.unsteady", {}
        buffer.problem = problem

    buffer.task = asyncio.create_task(work(), name=f"fault buffer {operation.id}")


async def _snapshot(operation: Operation, mailbox: ParameterAccess, drive: int, signs: Signs) -> Snapshot:
    """A reading that holds together.

    Raises:
        LinkError: the drive did not answer.
        Refusal: it refuses its faults.
        Unsteady: it moved each time.
    """
    before = await _columns(operation, mailbox, drive, BEFORE_AND_AFTER)
    for _ in range(TRIES):
        rest = await _columns(operation, mailbox, drive, REST)
        runtime = (await _columns(operation, mailbox, CONTROL_UNIT, (RUNTIME,)))[RUNTIME]
        time = operation.runtime.clock.micros()
        after = await _columns(operation, mailbox, drive, BEFORE_AND_AFTER)
        if after == before:
            now = int(runtime[0]) if runtime else None
            faults = Columns(after[NUMBERS], rest["r0948"], rest["r2109"], rest["r0949"], rest["r2130"], rest["r2136"])
            active = Columns(after[ALARM_NUMBERS], rest["r2123"], (), rest["r2124"])
            return Snapshot(time, signs, situations(faults, now), alarms(active, now))
        before = after
    raise Unsteady(f"{operation.id}: the fault buffer moved in each of {TRIES} readings")


async def _columns(
    operation: Operation, mailbox: ParameterAccess, drive_object: int, codes: Sequence[str]
) -> dict[str, tuple[float, ...]]:
    """Values by code; none of what the type does not list or the drive does not have, but the fault numbers must be there."""
    known = operation.equipment.equipment.type.drive_parameters
    asked = [known[code] for code in codes if code in known]
    addresses = [Address(one.number, 0, PLACES if one.code in ALARMS else one.count) for one in asked]
    found: dict[str, tuple[float, ...]] = dict.fromkeys(codes, ())
    for one, told in zip(asked, await mailbox.read(drive_object, addresses, [a.format for a in asked]), strict=True):
        if isinstance(told, Missed):
            raise told.error
        if isinstance(told, Values):
            found[one.code] = told.values
        elif one.code == NUMBERS:
            raise Refusal(told.number if isinstance(told, Failed) else None)
    return found


def _buffers(app: FastAPI, operation: Operation) -> Buffers:
    """Raises:
    HTTPException: 404, the machine has no fault buffer behind a mailbox.
    """
    if NUMBERS not in operation.equipment.equipment.type.drive_parameters:
        raise HTTPException(404)
    return kept_of(app, operation, "fault_buffers", Buffers)


def _chosen(given: Mapping[str, str]) -> int:
    """Raises:
    HTTPException: 422, that is no drive object.
    """
    text = given.get("object", "") or str(DRIVE)
    if not (text.isascii() and text.isdecimal() and int(text) <= LAST_OBJECT):
        raise HTTPException(422)
    return int(text)


def _signs(operation: Operation) -> Signs:
    points = operation.equipment.points(TELLING)
    if not all(point.state in ("good", "uncertain") for point in points):
        return None
    return tuple(point.value for point in points)


# ---- words ----------------------------------------------------------------------------------------------------


def _drawn(app: FastAPI, operation: Operation, chosen: int) -> dict[str, Any]:
    buffers, machine = _buffers(app, operation), operation.equipment
    buffer = buffers.of(chosen)
    found = buffer.snapshot
    now = operation.runtime.clock.micros()
    signs = _signs(operation)
    why = ""
    if found is not None and (buffer.problem or signs is None or signs != found.signs):
        why = machine.text("fbuf.old_failed" if buffer.problem else "fbuf.old_told" if signs else "fbuf.old_unknown")
    groups = []
    for place, messages in enumerate(found.situations if found else ()):
        if messages or place == 0:
            title = machine.text("fbuf.acknowledged", n=place) if place else machine.text("fbuf.present")
            groups.append((f"s{place}", title, [_row(operation, found, one, "F") for one in messages]))
    if found:
        active = [_row(operation, found, one, "A") for one in found.alarms]
        groups.insert(1, ("alarms", machine.text("fbuf.alarms"), active))
    return {
        "operation": operation,
        "equipment": machine,
        "groups": groups,
        "reading": buffer.reading,
        "problem": operation.words.text(*buffer.problem) if buffer.problem and not buffer.reading else "",
        "old": why,
        "chosen": chosen,
        "objects": _objects(operation, buffers, chosen),
        "read_at": fmt.moment_or_time(found.time, operation.zone, machine.lang, now) if found else "",
    }


def _objects(operation: Operation, buffers: Buffers, chosen: int) -> list[tuple[int, str, bool]]:
    """Number, name, whether it is shown, of every drive object; none while there is nothing to choose."""
    if len(buffers.objects) < 2:
        return []
    drive, text = drive_among(buffers.objects), operation.equipment.text
    found = []
    for one in buffers.objects:
        name = text("fbuf.control_unit" if one == CONTROL_UNIT else "fbuf.object", n=one)
        found.append((DRIVE if one == drive else one, name, one == (drive if chosen == DRIVE else chosen)))
    return found


def _row(operation: Operation, found: Snapshot | None, message: Message, letter: str) -> Row:
    drawn, key = operation.equipment, f"message.{message.number}"
    texts = drawn.equipment.type.texts.get(drawn.lang, {})
    name = texts.get(f"{key}.name", "").partition(" – ")
    return Row(
        f"{letter}{message.number:05d}",
        name[2] or name[0] or drawn.text("fbuf.unknown"),
        texts.get(f"{key}.cause", ""),
        texts.get(f"{key}.remedy", ""),
        "–" if message.value is None else fmt.number(message.value, fmt.shortest(message.value, 3), drawn.lang),
        _time(operation, found, message.received),
        _time(operation, found, message.removed),
    )


def _time(operation: Operation, found: Snapshot | None, moment: Moment | None) -> str:
    """Date and time where the drive's runtime leads there, else the time of the drive itself."""
    if moment is None or found is None:
        return "–"
    if moment.age is not None:
        lang, now = operation.equipment.lang, operation.runtime.clock.micros()
        return fmt.date_time(found.time - moment.age * 1000, operation.zone, lang, now)
    seconds = moment.millisecond % DAY // 1000
    clock = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return operation.equipment.text("fbuf.own", day=moment.day + moment.millisecond // DAY, time=clock)
