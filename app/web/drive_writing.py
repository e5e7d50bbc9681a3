"""Writing drive parameters: a list that a person fills, its review against the drive, the write by the gate, and saving.

    chosen (list) → reviewed (read from the drive now: old → new, unit, range, text) → written (all or none, read back) → saved to ROM

Reviewing and writing go on beside the page, which looks how far they are. The list belongs to a session and a drive; what was written
and not saved since the server began belongs to the drive.
"""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from app.commands.entry import parse_number
from app.commands.gate import Question
from app.commands.lifecycle import Progress, ProgressState
from app.commands.parameter_change import (
    MOST,
    SAVES,
    ParameterChange,
    apart,
    element_name,
    held,
    saving_of,
    wrong_value,
)
from app.commands.value_set import Change, Stands
from app.errors import LinkError, PogonError, Refused
from app.links.mailbox import Missed
from app.profidrive.parameter_access.error_numbers import key_of, shown
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Failed, Values
from app.profidrive.parameter_access.parameter import DriveParameter, When
from app.profidrive.parameter_access.source import is_source, parse_source
from app.web import format as fmt
from app.web.commands import gate_of, operation_of, wants_fragment
from app.web.drive_mailbox import drive_among, has_objects, kept_of, mailbox_of, objects_of, problem_of
from app.web.drive_values import confirmed, element_of, permitted_text, value_text
from app.web.guard import address_of, allow, field_list, fields, people_access, person_of
from app.web.language import language_of
from app.web.operation import Operation
from app.web.pages import view_of

router = APIRouter()

AT_ONCE = 0.3
"""A step that is over sooner is answered with its end, not with how far it is [s]."""
MOST_LISTS = 50
"""Sessions whose lists of one drive are kept."""
LONGEST_VALUE = 40


@dataclass(frozen=True, slots=True)
class Line:
    """One element of the list, as it was reviewed."""

    key: str
    change: ParameterChange | None
    """None: it cannot be written as it is."""
    old: float | None = None
    problem: str = ""
    """Why not."""

    @property
    def same(self) -> bool:
        """Whether the drive holds that value already."""
        return self.change is not None and self.old == self.change.in_format(self.change.new)


@dataclass(slots=True)
class Draft:
    """What one session is about to write."""

    typed: dict[str, str] = field(default_factory=dict)
    """Element (`2:p1120`) → value as typed."""
    lines: Sequence[Line] = ()
    """As reviewed; empty = not reviewed."""
    problem: str = ""
    """Why it was not reviewed, written or saved."""
    task: asyncio.Task[None] | None = None
    what: str = ""
    """review, write or save, of what is or was at work."""
    done: int = 0
    ended: Progress | None = None
    """How the last write or save ended."""

    @property
    def busy(self) -> bool:
        """Whether something is at work."""
        return self.task is not None and not self.task.done()

    @property
    def changes(self) -> list[ParameterChange]:
        """What is to be written."""
        return [line.change for line in self.lines if line.change is not None and not line.same]

    def reset(self) -> None:
        """Nothing is reviewed any more."""
        self.lines, self.problem, self.ended = (), "", None


@dataclass(slots=True)
class Drive:
    """What is known of writing to one drive."""

    drafts: dict[str, Draft] = field(default_factory=dict)
    """By session."""
    unsaved: set[str] = field(default_factory=set)
    """Elements written and not saved since, as far as this server knows."""
    written: dict[tuple[int, str], int] = field(default_factory=dict)
    """(drive object, code) → when it was written last: what was read before is old [µs UTC]."""
    objects: tuple[int, ...] = ()

    def draft(self, session: str) -> Draft:
        """The list of `session`; the oldest one nobody works with goes when there are too many."""
        if session not in self.drafts and len(self.drafts) >= MOST_LISTS:
            idle = next((key for key, one in self.drafts.items() if not one.busy), None)
            if idle is not None:
                del self.drafts[idle]
        return self.drafts.setdefault(session, Draft())


def drive_of(request: Request, operation: Operation) -> Drive:
    """What is known of writing to the drive of `operation`."""
    return kept_of(request.app, operation, "drive_writing", Drive)


# ---- routes ---------------------------------------------------------------------------------------------------


@router.get("/equipment/{key}/drive-parameters/list", dependencies=[allow("configure")])
async def listed(request: Request, key: str) -> HTMLResponse:
    """The list alone, while something is at work."""
    return _drawn(request, operation_of(request, key))


@router.post("/equipment/{key}/drive-parameters/list", dependencies=[allow("configure")])
async def choose(request: Request, key: str) -> Response:
    """Put an element into the list (`add`), take one out (`remove`), keep what is typed, or empty it (`clear`)."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("add", "remove", "clear"), lists=("key", "value"))
    draft = _free_draft(request, operation)
    await _keep_typed(request, draft)
    if form["clear"]:
        draft.typed.clear()
    if form["add"]:
        element_of(operation, form["add"])  # refuses what the type does not have
        if len(draft.typed) >= MOST:
            raise Refused("why.par_count", 422, n=len(draft.typed) + 1, limit=MOST)
        draft.typed.setdefault(form["add"], "")
    draft.typed.pop(form["remove"], None)
    draft.reset()
    return _answered(request, operation, form)


@router.post("/equipment/{key}/drive-parameters/review", dependencies=[allow("configure")])
async def review(request: Request, key: str) -> Response:
    """Read what the list is about from the drive now, and judge what was typed."""
    operation = operation_of(request, key)
    form = await fields(request, (), (), lists=("key", "value"))
    draft = _free_draft(request, operation)
    await _keep_typed(request, draft)
    draft.reset()
    drive, language = drive_of(request, operation), language_of(request)

    async def work() -> None:
        draft.lines = await reviewed(operation, drive, draft, draft.typed, language)

    await at_work(operation, draft, "review", work())
    return _answered(request, operation, form)


@router.post("/equipment/{key}/drive-parameters/write", dependencies=[allow("configure")])
async def write(request: Request, key: str) -> Response:
    """Write what was reviewed, by the gate."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("id", "nonce", "reason", "password"))
    drive, draft = drive_of(request, operation), _free_draft(request, operation)
    changes = draft.changes
    if not changes:
        raise Refused("why.par_count", 422, n=0, limit=MOST)
    given = await given_of(request, form, draft, operation)
    if given is None:
        return _answered(request, operation, form)
    gate = gate_of(operation)

    async def work() -> None:
        draft.ended = ended = await gate.parameters.change(person_of(request), operation.id, changes, **given)
        now = operation.runtime.clock.micros()
        drive.written |= {(one.object, one.parameter.code): now for one in changes}
        drive.unsaved |= {
            one.key for one in ended.changes if one.stands is not Stands.OLD and not _trigger(one, changes)
        }
        if ended.state is ProgressState.CONFIRMED:
            draft.typed.clear()
        draft.lines = ()

    draft.problem, draft.ended = "", None
    await at_work(operation, draft, "write", work())
    return _answered(request, operation, form)


@router.post("/equipment/{key}/drive-parameters/save", dependencies=[allow("configure")])
async def save(request: Request, key: str) -> Response:
    """Have the drive keep its values without power."""
    operation = operation_of(request, key)
    form = await fields(request, (), ("id", "nonce", "reason", "password"))
    drive, draft = drive_of(request, operation), _free_draft(request, operation)
    given = await given_of(request, form, draft, operation)
    if given is None:
        return _answered(request, operation, form)
    gate, before = gate_of(operation), set(drive.unsaved)

    async def work() -> None:
        draft.ended = ended = await gate.parameters.save(person_of(request), operation.id, **given)
        if ended.state is ProgressState.CONFIRMED:
            drive.unsaved -= before

    draft.problem, draft.ended = "", None
    await at_work(operation, draft, "save", work())
    return _answered(request, operation, form)


@router.post("/equipment/{key}/drive-parameters/cancel", dependencies=[allow("configure")])
async def cancel(request: Request, key: str) -> Response:
    """End the review, or have the write put back what it has changed."""
    operation = operation_of(request, key)
    form = await fields(request, ())
    draft = drive_of(request, operation).draft(person_of(request).session)
    if draft.busy and draft.what == "review" and draft.task is not None:
        draft.task.cancel()
        await asyncio.wait([draft.task], timeout=AT_ONCE)
    elif draft.busy and draft.what == "write":
        gate_of(operation).parameters.cancel(operation.id)
    return _answered(request, operation, form)


# ---- at work --------------------------------------------------------------------------------------------------


def _free_draft(request: Request, operation: Operation) -> Draft:
    """The list of whoever asks.

    Raises:
        Refused: 409, it is being read or written.
    """
    draft = drive_of(request, operation).draft(person_of(request).session)
    if draft.busy:
        raise Refused("why.busy", 409, label="dpar.change")
    return draft


async def _keep_typed(request: Request, draft: Draft) -> None:
    keys, values = await field_list(request, "key"), await field_list(request, "value")
    if len(keys) != len(values):
        raise Refused("par.form", 422)
    for key, value in zip(keys, values, strict=True):
        if key in draft.typed:
            draft.typed[key] = value.strip()[:LONGEST_VALUE]


async def given_of(
    request: Request, form: Mapping[str, str], draft: Draft, operation: Operation
) -> dict[str, Any] | None:
    """What goes with an order of a person; None where the password was wrong, which the list tells."""
    given: dict[str, Any] = {
        "id": form["id"][:64],
        "nonce": form["nonce"],
        "reason": form["reason"],
        "confirmed": True,
        "address": address_of(request.scope),
        "language": language_of(request),
    }
    if form["password"]:
        try:
            await people_access(request).own.confirm(person_of(request), form["password"])
        except Refused as refusal:
            draft.problem = operation.words.refusal(refusal)
            return None
        given["proven"] = True
    return given


async def at_work(operation: Operation, draft: Draft, what: str, work: Any) -> None:
    """Do `work` beside the page; what goes wrong is told in the list."""

    async def told() -> None:
        try:
            await work
        except Question as question:
            draft.problem = operation.words.refusal(question)
        except Refused as refusal:
            draft.problem = operation.words.refusal(refusal)
        except LinkError as error:
            draft.problem = operation.words.text(*problem_of(error))
        except PogonError as error:
            draft.problem = str(error)

    draft.what, draft.done = what, 0
    draft.task = asyncio.create_task(told(), name=f"{what} {operation.id}")
    await asyncio.wait([draft.task], timeout=AT_ONCE)


async def reviewed(
    operation: Operation, drive: Drive, draft: Draft, typed: Mapping[str, str], language: str
) -> list[Line]:
    """`typed` as numbers, with what the drive holds now.

    Raises:
        LinkError, Refused: the drive does not answer.
    """
    mailbox = mailbox_of(operation)
    drive.objects = drive.objects or await objects_of(operation, mailbox)
    found: dict[str, Line] = {}
    by_object: dict[int, list[tuple[str, DriveParameter, int]]] = {}
    for key in typed:
        object, parameter, index = element_of(operation, key)
        if object not in drive.objects:  # it was chosen before anybody had asked which ones there are
            object = drive_among(drive.objects)
        by_object.setdefault(object, []).append((key, parameter, index))
    for object, members in by_object.items():
        before = draft.done

        def progress(done: int, count: int, before: int = before) -> None:
            draft.done = before + done

        addresses = [Address(one.number, index, 1 if one.count else 0) for _, one, index in members]
        formats: list[Format | None] = [one.format for _, one, _ in members]
        told = await mailbox.read(object, addresses, formats, progress)
        for (key, parameter, index), outcome in zip(members, told, strict=True):
            if isinstance(outcome, Missed):
                raise outcome.error
            old = parameter.in_unit(outcome.values[0]) if isinstance(outcome, Values) else None
            refused = _error(operation, outcome.number) if isinstance(outcome, Failed) else ""
            found[key] = _line(operation, key, object, parameter, index, old, refused, typed[key], language)
    return [found[key] for key in typed]


def _line(
    operation: Operation, key: str, object: int, parameter: DriveParameter, index: int,
    old: float | None, refused: str, text: str, language: str,
) -> Line:  # fmt: skip
    words = operation.words
    if refused or old is None:
        return Line(key, None, old, refused or words.text("dpar.not_read", {}))
    if parameter.code in SAVES:
        return Line(key, None, old, words.text("why.par_save_apart", {}))
    try:
        value = typed_value(parameter, text, language)
    except Refused as refusal:
        return Line(key, None, old, words.refusal(refusal))
    if own := apart(parameter, value):
        return Line(key, None, old, words.text(own, {}))
    wrong = wrong_value(parameter, value)
    if wrong is not None:
        return Line(key, None, old, words.text(*wrong))
    value = held(parameter, value)
    return Line(key, ParameterChange(object, parameter, value, index, seen=old), old)


def typed_value(parameter: DriveParameter, text: str, language: str) -> float:
    """What a person typed for a parameter: a number, hexadecimal with 0x, or a source.

    Raises:
        Refused: 422.
    """
    if not text:
        raise Refused("why.argument_missing", 422, label=parameter.text_key)
    if is_source(parameter.kind):
        source = parse_source(text)
        if source is None:
            raise Refused("dpar.no_source", 422, text=text)
        return float(source)
    if text.casefold().startswith("0x") and text.isascii():
        try:
            return float(int(text, 16))
        except ValueError:
            raise Refused("why.not_a_number", 422, text=text) from None
    return parse_number(text, language, parameter.unit)


# ---- words ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Drawn:
    """A line of the list, its review or its result, as drawn."""

    key: str
    name: str
    object: int
    label: str
    unit: str
    permitted: str
    typed: str
    options: Sequence[tuple[str, str]]
    warns: bool
    """Nothing confirms its range."""
    warning: str = ""
    """What writing it does besides."""
    known: bool = True
    """Whether anything is known of it but its number."""
    stopped: bool = False
    """Only at standstill."""
    old: str = ""
    new: str = ""
    problem: str = ""
    same: bool = False


def list_context(request: Request, operation: Operation) -> dict[str, Any]:
    """What the list is drawn from."""
    person = person_of(request)
    drive = drive_of(request, operation)
    draft = drive.draft(person.session)
    gate = operation.gate
    stage = gate.parameters.stage(operation.id) if gate and draft.busy else None
    ended = draft.ended
    return {
        "operation": operation,
        "equipment": operation.equipment,
        "draft": draft,
        "items": [_item(operation, key, text) for key, text in draft.typed.items()],
        "review": [_reviewed(operation, draft, line) for line in draft.lines],
        "wrong": sum(line.change is None for line in draft.lines),
        "count": len(draft.changes),
        "stage": stage,
        "results": [_result(operation, one) for one in ended.changes] if ended else [],
        "ended": operation.words.tell(ended) if ended else None,
        "good": ended is not None and ended.state in (ProgressState.CONFIRMED, ProgressState.DRY_RUN),
        "unsaved": sorted(drive.unsaved),
        "saves": saving_of(operation.equipment.equipment.type),
        "objects": has_objects(operation),
    }


def _item(operation: Operation, key: str, text: str) -> Drawn:
    object, parameter, index = element_of(operation, key)
    drawn, name = operation.equipment, element_name(parameter, index)
    options = [(str(value), f"{value} – {drawn.t(label)}") for value, label in parameter.options.items()]
    return Drawn(
        key,
        name,
        object,
        drawn.t(parameter.text_key),
        fmt.unit_symbol(parameter.unit, drawn.text) if parameter.unit else "",
        permitted_text(parameter, drawn.lang),
        text,
        options,
        not confirmed(parameter),
        drawn.t(parameter.warning) if parameter.warning else "",
        parameter.known,
        not has_objects(operation) and parameter.when is not When.ALWAYS,
    )


def _reviewed(operation: Operation, draft: Draft, line: Line) -> Drawn:
    one = _item(operation, line.key, draft.typed.get(line.key, ""))
    if line.change is not None:
        one = replace(one, object=line.change.object)
    _, parameter, _ = element_of(operation, line.key)
    old = "–" if line.old is None else value_text(operation, parameter, line.old)
    new = value_text(operation, parameter, line.change.new) if line.change else one.typed
    return replace(one, old=old, new=new, problem=line.problem, same=line.same)


def _result(operation: Operation, change: Change) -> dict[str, Any]:
    object, parameter, _ = element_of(operation, change.key)
    drawn = operation.equipment
    text = _error(operation, change.error) if change.error is not None else drawn.text(f"set.is_{change.stands}")
    return {
        "key": change.key,
        "name": change.code,
        "object": object,
        "label": drawn.t(change.label),
        "done": change.stands is Stands.NEW,
        "text": text,
        "value": "?" if change.found is None else value_text(operation, parameter, change.found),
        "unit": fmt.unit_symbol(parameter.unit, drawn.text) if parameter.unit else "",
    }


def _error(operation: Operation, number: int | None) -> str:
    said = shown(number)
    return f"{said} {operation.equipment.text(key_of(number), number=said)}"


def _trigger(change: Change, changes: Sequence[ParameterChange]) -> bool:
    return next(one.parameter.trigger for one in changes if one.key == change.key)


def _answered(request: Request, operation: Operation, form: Mapping[str, str]) -> Response:
    if not wants_fragment(request):
        return RedirectResponse(form.get("next") or f"{operation.url}/drive-parameters", 303)
    return _drawn(request, operation)


def _drawn(request: Request, operation: Operation) -> HTMLResponse:
    fresh = operation.fresh()
    return view_of(request).fragment(request, "fragments/drive_parameter_list.html", **list_context(request, fresh))
