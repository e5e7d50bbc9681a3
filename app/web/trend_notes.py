"""Notes on trends: marks on the curves, listed beside them. Who is not signed in reads none: they may name somebody."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType

from fastapi import APIRouter, Request
from fastapi.responses import Response
from starlette.datastructures import QueryParams

from app.errors import Refused, StorageError
from app.historian.notes import LONGEST_NOTE, Note, Notes
from app.web import format as fmt
from app.web import typed_time
from app.web.guard import allow, fields, person_of
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.signin import zone_of
from app.web.trend_address import names_of, on_screen, read_view, seen, typed_form, typed_micros, view_asked

router = APIRouter(prefix="/trends")


JUST_NOW = 60_000_000
"""How long a chart that follows the present may have been drawn before a note of now is written [µs]."""


@dataclass(frozen=True, slots=True)
class Line:
    """A note as it is drawn."""

    number: int
    """Its sign on the curves and in the list, from 1."""
    note: Note
    time: str
    machine: str
    deletable: bool
    """By whoever looks."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """The notes of a range as they are drawn, and what a new one asks for."""

    lines: Sequence[Line]
    machines: Sequence[tuple[str, str]]
    """Id and name of those that a note may be about."""
    time: str
    """Of a new one: as it was typed when that was refused, else that of cursor A, else now when the curves are live, else the middle."""
    may_write: bool
    longest: int = LONGEST_NOTE
    problem: str = ""
    typed: str = ""
    """Text and machine as they were typed and chosen when that was refused."""
    chosen: str = ""
    elsewhere: str = ""
    """When a note was written that stands outside the range, which does not list it."""


@router.get("/notes", dependencies=[allow("account")])
async def notes(request: Request) -> Response:
    """The notes about the machines of `tags` and about all between `from` and `to`, as a fragment."""
    return await _drawn(request, on_screen(request.query_params))


@router.post("/notes", dependencies=[allow("annotate")])
async def add(request: Request) -> Response:
    """Write a note at a time, in the plant's zone when it says no other."""
    given = await fields(request, ["time", "text", "machine", "view"])

    async def work(kept: Notes) -> int:
        plant, machine = plant_of(request), given["machine"]
        if machine and machine not in plant.equipment:
            raise Refused("trend.error.note_machine", 422, machine=machine[:64])
        time = _moment(request, given["time"])
        await kept.add(person_of(request), time, machine, given["text"])
        return time

    return await _do(request, given, work)


@router.post("/notes/{number:int}/delete", dependencies=[allow("annotate")])
async def remove(request: Request, number: int) -> Response:
    """Delete one's own note; an engineer those of others, too."""
    given = await fields(request, ["view"])

    async def work(kept: Notes) -> int:
        await kept.remove(person_of(request), number)
        return 0

    return await _do(request, given, work)


async def lines_for_export(request: Request, tags: Sequence[str], begin: int, end: int) -> list[Note]:
    """The notes that belong to an export of `tags`; none when they cannot be read."""
    with suppress(StorageError):
        return list(await _notes(request).find({tag.partition(".")[0] for tag in tags}, begin, end, most=None))
    return []


def _moment(request: Request, text: str) -> int:
    """What the field for the time says [µs UTC]; who is refused reads how it is written in this field."""
    view, zone = view_of(request), zone_of(request)
    try:
        return typed_micros(text, zone)
    except Refused as error:
        now = typed_form(view.runtime(request).clock.micros(), zone)
        raise Refused(
            "trend.error.typed_time", 422, value=text[: typed_time.LONGEST], form=view.text(request, "frame.time_form"),
            example=typed_time.shown(now, language_of(request)),
        ) from error  # fmt: skip


def _notes(request: Request) -> Notes:
    runtime = view_of(request).runtime(request)
    return Notes(runtime.db, runtime.access.audit, runtime.clock)


async def _do(request: Request, given: dict[str, str], work: Callable[[Notes], Awaitable[int]]) -> Response:
    """Do `work`, which gives the time of a new note, and draw the range: a note of a moment after it belongs to it, too."""
    asked, problem, new = read_view(given["view"]), "", 0
    try:
        new = await work(_notes(request))
    except Refused as refused:
        problem = view_of(request).refusal(request, refused)
    return await _drawn(request, asked, problem, given if problem else {}, new)


async def _drawn(
    request: Request,
    asked: QueryParams,
    problem: str = "",
    typed: Mapping[str, str] = MappingProxyType({}),
    new: int = 0,
) -> Response:
    view, runtime, person = view_of(request), view_of(request).runtime(request), person_of(request)
    now, zone = runtime.clock.micros(), zone_of(request)
    begin, end = seen(asked, now, zone)
    wanted = view_asked(asked, now, zone)
    at = wanted["a"] or (now if wanted["span"] is not None else (begin + end) // 2)
    if end < new <= end + JUST_NOW:
        end = new + 1
    ids = list(dict.fromkeys(name.partition(".")[0] for name in names_of(asked)))
    plant, lang = plant_of(request), language_of(request)
    known = {key: view.machine(request, plant.equipment[key]).label for key in ids if key in plant.equipment}
    lines = [
        Line(number, one, fmt.date_time(one.time, zone, lang, now), known.get(one.machine, one.machine),
             one.may_be_deleted_by(person))
        for number, one in enumerate(await _notes(request).find(ids, begin, end), 1)
    ]  # fmt: skip
    sheet = Sheet(
        lines, list(known.items()), typed.get("time") or typed_form(at, zone), person.may("annotate"), problem=problem,
        typed=typed.get("text", ""), chosen=typed.get("machine", ""),
        elsewhere=fmt.date_time(new, zone, lang, now) if new and not begin <= new < end else "",
    )  # fmt: skip
    return view.fragment(request, "fragments/trend_notes.html", notes=sheet)
