"""The audit on screen and as CSV: who did what, where, from what to what, and whether the chain holds."""

import re
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any
from urllib.parse import urlencode
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response, StreamingResponse

from app.access.audit.line import Record
from app.access.audit.search import Filter
from app.access.roles import PERMISSIONS, ROLES, Person
from app.access.roles import SYSTEM as NOBODY
from app.clock import to_datetime
from app.commands import parameter_change, value_set
from app.commands.open_sets import values_of
from app.errors import Refused
from app.plant.system import SYSTEM
from app.web import audit_words, language, page_names, typed_time
from app.web import format as fmt
from app.web.csv_lines import cells, locale_of, number_in
from app.web.guard import allow, fields, people_access, person_of
from app.web.signin import moment, view_of, zone_of

router = APIRouter()

PAGE = 50
"""Lines on a page."""
CSV_PAGE = 500
_UTC = ZoneInfo("UTC")
SETS = {
    value_set.KEY: value_set.LABEL,
    parameter_change.KEY: parameter_change.LABEL,
    parameter_change.SAVE: parameter_change.SAVE_LABEL,
    parameter_change.ENCODER: parameter_change.ENCODER_LABEL,
}
"""What is written as one has no command of its type: key → text."""
BAD = frozenset({"refused", "failed", "unconfirmed", "unknown", "lost"})
"""What a line ended with that is marked."""
COLUMNS = ("seq", "time", "kind", "person", "address", "object", "old", "new", "result", "reason", "text")
WRITTEN: dict[str, Callable[[str], Any]] = {"old": number_in, "new": number_in}
"""How a column is written for a spreadsheet, when not as the text that it is; programs get that."""


@router.get("/audit", dependencies=[allow("audit.own")])
async def audit(request: Request) -> Response:
    """Lines, newest first; an operator sees only their own."""
    view, access, person = view_of(request), people_access(request), person_of(request)
    wanted, typed = _filter(request, person)
    lines = await access.audit.find(wanted, PAGE + 1)
    older = lines[PAGE - 1].seq if len(lines) > PAGE else None
    query = {name: value for name, value in typed.items() if value}
    verdict = access.audit.verdict
    return view.page(
        request,
        "pages/audit.html",
        title=view.text(request, "audit.title"),
        kind="frame",
        rows=[_row(request, line) for line in lines[:PAGE]],
        typed=typed,
        kinds=[(kind, _kind(request, kind)) for kind in _groups(await access.audit.kinds())],
        older=f"/audit?{urlencode(query | {'before': older})}" if older else "",
        newest=f"/audit?{urlencode(query)}" if wanted.before else "",
        export=f"/audit.csv?{urlencode(query | {'locale': language.language_of(request)})}"
        if person.may("audit")
        else "",
        whole=person.may("audit"),
        may_verify=person.may("administer"),
        healthy=access.audit.healthy,
        verdict=verdict,
        why=view.text(request, f"audit.why.{verdict.why}") if verdict and not verdict.ok else "",
        count=await access.audit.count(),
        filtered=bool(query),
    )


@router.post("/audit/verify", dependencies=[allow("administer")])
async def verify(request: Request) -> Response:
    """Verify the chain now."""
    await fields(request, [])
    await people_access(request).audit.check(person_of(request))
    return RedirectResponse("/audit", 303)


@router.get("/audit.csv", dependencies=[allow("audit")])
async def export(request: Request) -> Response:
    """The lines that the filter lets through, oldest last, as CSV with UTC and local time.

    `locale`: hr, en, de, cs, or machine, which it is without.
    """
    person, access, locale = person_of(request), people_access(request), locale_of(request)
    wanted, typed = _filter(request, person)
    filters = "&".join(f"{name}={value}" for name, value in typed.items() if value)
    await access.audit.find(wanted, 1)  # what cannot be read is told before a file begins
    await access.audit.record("audit.exported", person, filters=filters)
    return StreamingResponse(
        _csv(request, wanted, locale),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": 'attachment; filename="audit.csv"'},
    )


async def _csv(request: Request, wanted: Filter, locale: str) -> AsyncIterator[bytes]:
    access = people_access(request)
    yield "\ufeff".encode()
    yield cells([*COLUMNS[:2], "local_time", *COLUMNS[2:]], locale)
    zone, written = zone_of(request), WRITTEN if locale != "machine" else {}
    while lines := await access.audit.find(wanted, CSV_PAGE):
        for line in lines:
            told = [written.get(name, str)(getattr(line, name)) for name in COLUMNS[2:-1]]
            times = fmt.iso(line.time, _UTC), fmt.iso(line.time, zone)
            yield cells([line.seq, *times, *told, _text(request, line)], locale)
        wanted = Filter(wanted.person, wanted.object, wanted.kind, wanted.since, wanted.until, lines[-1].seq)


def _filter(request: Request, person: Person) -> tuple[Filter, dict[str, str]]:
    """The filter in the address, and what was typed; an operator's is always their own name.

    Raises:
        Refused: 422, a time or a number cannot be read, or a field is there twice.
    """
    query = request.query_params
    names = ("person", "object", "kind", "since", "until")
    for name in (*names, "before"):
        if len(query.getlist(name)) > 1:
            raise Refused("access.form_field", 422, field=name)
    typed = {name: query.get(name, "").strip()[:120] for name in names}
    if not person.may("audit"):
        typed["person"] = ""
    before = query.get("before", "")
    if before and not re.fullmatch(r"[0-9]{1,18}", before):
        raise Refused("access.form_field", 422, field="before")
    wanted = Filter(
        person=_stored(request, typed["person"]) if person.may("audit") else person.name,
        object=typed["object"],
        kind=typed["kind"],
        since=read_time(request, typed["since"], "since"),
        until=read_time(request, typed["until"], "until"),
        before=int(before) if before else None,
    )
    return wanted, typed


def read_time(request: Request, text: str, field: str) -> int | None:
    """What a field for a time says (typed_time.py), in the plant's zone; `until` is an end.

    Raises:
        Refused: 422, it is none, or cannot be written in UTC and in the plant's zone.
    """
    if not text:
        return None
    zone = zone_of(request)
    try:
        return typed_time.micros(text, zone, end=field == "until")
    except (ValueError, OverflowError) as error:
        view = view_of(request)
        now = to_datetime(view.runtime(request).clock.micros()).astimezone(zone)
        example = f"{typed_time.written_day(now, language.language_of(request))} {now:%H:%M}"
        told = text[: typed_time.LONGEST]
        raise Refused(
            "frame.time_wrong", 422, text=told, form=view.text(request, "frame.time_form"), example=example
        ) from error


def _row(request: Request, line: Record) -> dict[str, Any]:
    zone = zone_of(request)
    old, new = audit_words.told(request, line)
    if line.kind == "plant.reloaded":
        object = view_of(request).text(request, "plant.files")
    elif line.kind == "access.denied":
        object = _page(request, line)
    else:
        object = _object(request, line.object)
    return {
        "line": line,
        "person": _person(request, line.person),
        "time": moment(request, line.time),
        "iso": fmt.iso(line.time, zone),
        "text": _text(request, line, object),
        "object": object,
        "result": (result := _result(request, line)),
        "reason": "" if (reason := _reason(request, line)) == result else reason,
        "why": line.parameters.get("why", ""),
        "bad": line.result in BAD,
        "old": old,
        "new": new,
    }


def _person(request: Request, name: str) -> str:
    """Who did it: a person by name; the server itself, or somebody at its terminal, in words with a space, which no name has."""
    who, _, user = name.partition(":")
    if who == "terminal" and user:
        return view_of(request).text(request, "audit.by.terminal", user=user)
    return view_of(request).text(request, "audit.by.system") if name == NOBODY.name else name


def _stored(request: Request, typed: str) -> str:
    """The name under which lines of whom somebody `typed` are stored: what `_person` says is understood, and what is stored too."""
    view, said = view_of(request), typed.casefold()
    before, after = view.text(request, "audit.by.terminal", user="\n").casefold().split("\n")
    if said == view.text(request, "audit.by.system").casefold():
        return NOBODY.name
    if len(said) > len(before) + len(after) and said.startswith(before) and said.endswith(after):
        return f"terminal:{typed[len(before) : len(typed) - len(after)]}"
    return typed


def _page(request: Request, line: Record) -> str:
    """What was refused, by the name in the reader's language: the command or setpoint, what was asked about control, else the page; with
    the machine's when it is of one."""
    told = line.parameters
    name = told.get("machine", "")
    machine = _object(request, name)
    if (command := told.get("command")) and (named := _object(request, f"{name}.{command}")) != machine:
        return named
    key = f"control.{told['control']}" if "control" in told else page_names.name_of(line.object)
    return ": ".join(filter(None, (machine, view_of(request).text(request, key) if key else "")))


def _object(request: Request, object: str) -> str:
    """What a line is about, by its name in the reader's language; empty when nothing of the plant is called so now."""
    view = view_of(request)
    runtime, lang = view.runtime(request), language.language_of(request)
    if object == "simulation":
        return view.text(request, "instructor.speed")
    if " " in object and all("." in one for one in object.split()):
        return ", ".join(filter(None, (_object(request, one) for one in object.split())))
    name, _, key = object.partition(".")
    if name == SYSTEM:
        return _blank(_known(request, f"alarm.system.{key.partition('.')[0]}.label", ""))
    item = runtime.plant.equipment.get(name) if runtime.plant else None
    if item is None:
        return ""
    machine = runtime.texts.label(lang, item.label)
    part = next((alarm.label for alarm in item.alarms if alarm.key == key), "")
    if key in item.type.commands:
        part = item.type.commands[key].label
    elif key in item.points:
        part = item.points[key].label
    elif key in SETS:
        part = SETS[key]
    told = _blank(runtime.texts.of_type(lang, item.type, part)) if part else ""
    return f"{machine}: {told}" if told else machine


def _blank(text: str) -> str:
    """A text whose placeholders nobody fills."""
    return re.sub(r"\{\w+\}", "…", text)


def _text(request: Request, line: Record, object: str = "") -> str:
    return _known(
        request,
        f"audit.kind.{line.kind}",
        line.kind,
        **{"object": object or line.object, "old": line.old, "new": line.new, "person": _person(request, line.person)}
        | dict(line.parameters),
    )


def _result(request: Request, line: Record) -> str:
    """What became of it: of a command its state, of the control of a machine what was done with it."""
    family = {"control": "control", "command": "fb"}.get(line.kind, "audit.result")
    return _known(request, f"{family}.{line.result}", _known(request, f"audit.result.{line.result}", line.result))


def _written(request: Request, params: Mapping[str, str]) -> dict[str, object]:
    """`params` of a reason as the language writes them: the audit keeps its numbers as texts."""
    numbers = dict[str, object]()
    for name in params.keys() & (fmt.VALUES | {"seconds", "limit", "age"}):
        with suppress(ValueError):
            numbers[name] = float(params[name])
    return fmt.parameters({**params, **numbers}, language.language_of(request), partial(view_of(request).text, request))


def _amount(request: Request, value: str) -> str:
    """A number that the text of a condition names, as the screen wrote it."""
    number = audit_words.number_of(value)
    return value if number is None else fmt.number(number, fmt.shortest(number, 1), language.language_of(request))


def _reason(request: Request, line: Record) -> str:
    """Why it came to this end, filled with what the gate wrote down as `reason_…`; labels are text keys of the machine's type."""
    params = dict(line.parameters)
    of_reason = {name.removeprefix("reason_"): value for name, value in params.items() if name.startswith("reason_")}
    params |= {name: str(value) for name, value in _written(request, of_reason).items()}
    runtime = view_of(request).runtime(request)
    item = runtime.plant.equipment.get(line.object.partition(".")[0]) if runtime.plant else None
    if params.get("label"):
        numbers = {name: _amount(request, value) for name, value in of_reason.items() if name != "label"}
        kind = item.type if item else ""
        params["label"] = runtime.texts.of_former(language.language_of(request), kind, params["label"], **numbers)
    if values := values_of(line.parameters):
        params["values"] = ", ".join(
            f"{key} = {'?' if now is None else f'{now:g}'} ({_known(request, f'set.{stands}', stands)})"
            for key, _, _, now, stands in values
        )
        cause = params.get("cause", "")
        params["because"] = _known(request, cause, cause, **params).rstrip(".")
    if "cause" in params and "because" not in params:
        params["because"] = _known(request, params["cause"], params["cause"])
    if line.kind == "access.denied":
        roles = [
            _known(request, f"access.role.{role}", role)
            for role in ROLES
            if role in PERMISSIONS.get(params.get("permission", ""), ())
        ]
        return _known(request, "audit.needs", "", roles=" / ".join(roles)) if roles else ""
    code = params.setdefault("code", "?")  # older lines do not have it
    params["meaning"] = _known(request, fmt.exception_key(int(code) if code.isdecimal() else 0), "")
    told = _known(request, line.reason, line.reason, **params) if line.reason else ""
    return f"{told} (×{params['count']})" if told and line.kind == "command" and "count" in params else told


def _known(request: Request, key: str, otherwise: str, /, **params: str) -> str:
    """The text `key` in the reader's language, or what was written down when we have no words for it."""
    runtime, lang = view_of(request).runtime(request), language.language_of(request)
    return runtime.texts.text(lang, key, **params) if runtime.texts.has(lang, key) else otherwise


def _kind(request: Request, kind: str) -> str:
    return _known(request, f"audit.group.{kind}", kind)


def _groups(kinds: list[str]) -> list[str]:
    return sorted({kind.partition(".")[0] for kind in kinds})
