"""Shelving alarms, taking them out of service, and bringing them back: authorised, audited, answered in one line."""

from collections.abc import Callable

from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.access.audit.kinds import Kind
from app.access.roles import Person
from app.alarms.hiding import Hiding
from app.alarms.watch import Watch
from app.errors import Refused
from app.runtime import Runtime
from app.web.alarms import LONGEST_COMMENT, answered, drawing
from app.web.guard import allow, fields, person_of
from app.web.view import View

router = APIRouter()

LONGEST_PERMIT = 40


@router.post("/alarms/shelve", dependencies=[allow("shelve")])
async def shelve(request: Request) -> Response:
    """Shelve one alarm for some minutes, with a reason."""
    typed = await fields(request, ["alarm", "minutes"], ["reason", "more", "once"])
    minutes = typed["minutes"]
    if not minutes.isascii() or not minutes.isdecimal() or len(minutes) > 6:
        raise Refused("access.form_field", 422, field="minutes")
    if typed["once"] not in ("", "1"):
        raise Refused("access.form_field", 422, field="once")
    reason, once = _reason(typed), typed["once"] == "1"

    def do(hiding: Hiding, person: Person) -> Watch:
        return hiding.shelve(typed["alarm"], person, int(minutes) * 60.0, reason, once=once)

    return await _done(request, typed, "alarm.shelved", do, reason, f"{int(minutes)} min{' one-shot' if once else ''}")


@router.post("/alarms/unshelve", dependencies=[allow("shelve")])
async def unshelve(request: Request) -> Response:
    """End the shelf of one alarm."""
    typed = await fields(request, ["alarm"])
    return await _done(
        request, typed, "alarm.unshelved", lambda hiding, person: hiding.unshelve(typed["alarm"], person)
    )


@router.post("/alarms/take-out", dependencies=[allow("configure")])
async def take_out(request: Request) -> Response:
    """Take one alarm out of service, with a reason."""
    typed = await fields(request, ["alarm"], ["reason", "more", "permit"])
    reason, permit = _reason(typed), typed["permit"].strip()[:LONGEST_PERMIT]

    def do(hiding: Hiding, person: Person) -> Watch:
        return hiding.take_out(typed["alarm"], person, reason, permit)

    return await _done(request, typed, "alarm.taken_out", do, reason, permit)


@router.post("/alarms/put-back", dependencies=[allow("configure")])
async def put_back(request: Request) -> Response:
    """Put one alarm back into service."""
    typed = await fields(request, ["alarm"])
    return await _done(request, typed, "alarm.put_back", lambda hiding, person: hiding.put_back(typed["alarm"], person))


@router.post("/alarms/review", dependencies=[allow("configure")])
async def review(request: Request) -> Response:
    """Confirm that one alarm stays out of service."""
    typed = await fields(request, ["alarm"])
    return await _done(request, typed, "alarm.reviewed", lambda hiding, _person: hiding.review(typed["alarm"]))


def _reason(typed: dict[str, str]) -> str:
    return ": ".join(part for part in (typed["reason"].strip(), typed["more"].strip()) if part)[:LONGEST_COMMENT]


async def _done(
    request: Request,
    typed: dict[str, str],
    kind: Kind,
    do: Callable[[Hiding, Person], Watch],
    comment: str = "",
    new: str = "",
) -> Response:
    """Do it, write it down, and say how the alarm stands now."""
    view: View = request.app.state.view
    runtime: Runtime = view.runtime(request)
    person = person_of(request)
    watch = do(runtime.alarms.hiding, person)
    stored = await runtime.alarms.journal.settle()
    await runtime.access.audit.record(kind, person, object=watch.id, new=new, comment=comment)
    draw = drawing(request)
    shown = runtime.alarms.list.of(watch)
    text = view.text(request, f"alarm.answer.{kind.removeprefix('alarm.')}", text=draw.text(shown))
    return answered(request, text, "done", typed["next"] or "/alarms", stored=stored)
