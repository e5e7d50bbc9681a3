"""The alarm list, its journal, acknowledging, and the fragments that every page fetches when the alarms change."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any
from urllib.parse import urlencode
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response, StreamingResponse
from sqlalchemy import Connection

from app.access.kept import ALARM_FILTER
from app.access.roles import Person
from app.alarms import journal
from app.alarms.engine import AlarmEngine
from app.alarms.journal import DAY, Filter, Record
from app.alarms.lifecycle import Entry
from app.alarms.shelf import OPERATORS
from app.alarms.watch import Answer, ListedAlarm
from app.errors import Refused
from app.historian.calendar import Shifts
from app.historian.event_export import shift_cell
from app.plant.system import SYSTEM
from app.web import format as fmt
from app.web import language
from app.web.alarm_view import PRIORITY_NAMES, STATE_NAMES, SYMBOL_OF, Drawing, Row, bars, lasting
from app.web.audit import read_time
from app.web.csv_lines import cells, locale_of
from app.web.guard import access_of, allow, field_list, fields, person_of, shown_name, shown_words
from app.web.history import with_shift
from app.web.view import View, area_label

router = APIRouter()

PAGE = 500
"""Rows that a list draws; more ask for a narrower filter, or for the next page."""
JOURNAL_PAGE = 100
CSV_PAGE = 1000
LONGEST_COMMENT = 200
TABS = ("active", "unack", "hidden", "journal")
FIELDS = ("tab", "area", "priority", "q", "event", "state", "source", "since", "until")
"""Of the filter."""
SPANS = (15, 60, 240, 720)
"""For how long somebody can shelve an alarm [min]."""
REASONS = ("maintenance", "sensor", "nuisance", "test")
"""Reasons that a list offers; text `alarm.reason.<key>`."""
MOST_AT_ONCE = 500
"""Acknowledgements in one request: no more can be on a screen."""
SECOND_PRESS = 3_000_000
"""For so long after one's own acknowledgement another press is the same one [µs]."""
_UTC = ZoneInfo("UTC")
CSV_LIST = (
    "came_utc", "came_local", "state", "priority", "source", "area", "text", "value", "limit", "duration_s", "count", "acked_by",
    "acked_at",
)  # fmt: skip
CSV_JOURNAL = (
    "seq", "time", "local_time", "event", "detail", "alarm", "occurrence", "source", "area", "class", "priority", "before",
    "after", "text", "value", "limit", "unit", "quality", "person", "address", "comment",
)  # fmt: skip


def _view(request: Request) -> View:
    view: View = request.app.state.view
    return view


def _engine(request: Request) -> AlarmEngine:
    return _view(request).runtime(request).alarms


def drawing(request: Request) -> Drawing:
    """Alarms in the language of `request`."""
    runtime = _view(request).runtime(request)
    return Drawing(runtime, runtime.texts, language.language_of(request), partial(shown_name, request))


def _may(request: Request, permission: str) -> bool:
    person: Person | None = request.state.person
    return person is not None and person.may(permission)


# ---- the list ---------------------------------------------------------------------------------------------


@router.get("/alarms", dependencies=[allow("view")])
async def alarms(request: Request) -> Response:
    """The active list, what waits for an acknowledgement, or the journal."""
    wanted = _wanted(request)
    context = await _journal(request, wanted) if wanted["tab"] == "journal" else _list(request, wanted)
    view = _view(request)
    return view.page(
        request,
        "pages/alarms.html",
        title=view.text(request, "alarm.list"),
        kind="frame",
        **_tools(request, wanted),
        **context,
    )


@router.get("/alarms/list", dependencies=[allow("view")])
async def rows(request: Request) -> Response:
    """The rows alone, after a change."""
    wanted = _wanted(request)
    return _view(request).fragment(
        request, "fragments/alarm_rows.html", **_tools(request, wanted), **_list(request, wanted)
    )


@router.get("/alarms/detail/{occurrence}", dependencies=[allow("view")])
async def detail(request: Request, occurrence: int) -> Response:
    """Cause, consequence, response and earlier occurrences of one alarm that stands; 404 with the word that it is over."""
    one = _engine(request).find(occurrence)
    if one is None:
        return _view(request).fragment(request, "fragments/alarm_detail.html", status=404, detail=None, over=True)
    return _view(request).fragment(
        request,
        "fragments/alarm_detail.html",
        detail=await _detail(request, one),
        may_acknowledge=_may(request, "acknowledge"),
        may_shelve=_may(request, "shelve"),
        may_configure=_may(request, "configure"),
    )


def _wanted(request: Request) -> dict[str, str]:
    """What the address asks for.

    Raises:
        Refused: 422, a field is there twice or is none of its choices.
    """
    query = request.query_params
    names = (*FIELDS, "page", "before")
    for name in names:
        if len(query.getlist(name)) > 1:
            raise Refused("access.form_field", 422, field=name)
    found = checked({name: query.get(name, "").strip()[:120] for name in names})
    for name in ("page", "before"):
        if found[name] and (not found[name].isascii() or not found[name].isdecimal() or len(found[name]) > 15):
            raise Refused("access.form_field", 422, field=name)
    return found


def checked(found: dict[str, str]) -> dict[str, str]:
    """`found`, the fields of a filter, when each is one of its choices.

    Raises:
        Refused: 422, one is not.
    """
    found["tab"] = found["tab"] or "active"
    for name, choices in (
        ("tab", TABS),
        ("priority", ("", "1", "2", "3", "4")),
        ("event", ("", *(str(entry) for entry in Entry))),
        ("state", ("", *STATE_NAMES.values())),
    ):
        if found[name] not in choices:
            raise Refused("access.form_field", 422, field=name)
    return found


def _tools(request: Request, wanted: dict[str, str]) -> dict[str, Any]:
    text = _view(request).text
    narrowed = {name: wanted[name] for name in ("area", "priority", "q") if wanted[name]}
    asked = {name: value for name, value in wanted.items() if value and name not in ("page", "before")}
    file = urlencode(asked | {"shift": "1", "locale": language.language_of(request)})
    return {
        "wanted": wanted,
        "kept_filters": kept_filters(request),
        **tabs(request, narrowed),
        "area_choices": area_choices(request),
        "priority_choices": [(str(one), text(request, f"alarm.priority.{name}")) for one, name in PRIORITY_NAMES.items()],
        "export_url": f"/alarms.csv?{file}" if _may(request, "export") else "",
        "may_acknowledge": _may(request, "acknowledge"),
        "may_shelve": _may(request, "shelve"),
        "may_configure": _may(request, "configure"),
    }  # fmt: skip


def kept_filters(request: Request) -> list[tuple[str, str]] | None:
    """Name and address of each filter that whoever looks has kept; None for whoever keeps nothing."""
    person, access = request.state.person, access_of(request.app)
    if person is None or access is None or not person.may("account"):
        return None
    kept = access.kept.of(person.id, ALARM_FILTER)
    return [(name, f"/alarms?{urlencode(wanted)}") for name, wanted in sorted(kept.items())]


def tabs(request: Request, narrowed: Mapping[str, str]) -> dict[str, Any]:
    """The tabs of everything about alarms, each with its count and its address; `narrowed` is the filter that they keep."""
    text, counts = _view(request).text, _engine(request).counts.values()
    known = _view(request).runtime(request).plant is not None  # of machines that nobody watches 0 would be a claim
    counted = {"active": "total", "unack": "unack", "hidden": "hidden"} if known else {}
    return {
        "tabs": [
            (tab, text(request, f"alarm.tab.{tab}"), counted.get(tab, ""), counts[counted[tab]] if tab in counted else "")
            for tab in (*TABS, "statistics")
        ],
        "tab_url": {
            **{tab: "/alarms?" + urlencode({"tab": tab, **narrowed}) for tab in TABS},
            "statistics": "/alarms/statistics" + (f"?{urlencode({'area': narrowed['area']})}" if narrowed.get("area") else ""),
        },
    }  # fmt: skip


def area_choices(request: Request) -> list[tuple[str, str]]:
    """The areas of the plant and the system, with their names."""
    view = _view(request)
    plant, texts, lang = view.runtime(request).plant, view.runtime(request).texts, language.language_of(request)
    keys = list(dict.fromkeys(item.area for item in plant.equipment.values())) if plant else []
    labels = [(key, area_label(texts, plant, lang, key)) for key in keys]
    return [*labels, (SYSTEM, view.text(request, "alarm.system.name"))]


def _chosen(request: Request, wanted: dict[str, str]) -> tuple[list[tuple[ListedAlarm, Row]], list[ListedAlarm]]:
    """What the filter lets through, and what it hides."""
    draw = drawing(request)
    shown: list[tuple[ListedAlarm, Row]] = []
    hidden: list[ListedAlarm] = []
    words = wanted["q"].casefold().split()
    standing = _engine(request).list
    for one in standing.hidden() if wanted["tab"] == "hidden" else standing.active():
        if wanted["tab"] == "unack" and not one.unacked:
            continue
        fits = (not wanted["area"] or (one.area if one.equipment else SYSTEM) == wanted["area"]) and (
            not wanted["priority"] or one.priority <= int(wanted["priority"])
        )
        row = draw.row(one) if fits else None
        if row is None:
            hidden.append(one)
            continue
        written = f"{row.text} {row.source} {draw.label_of(one.equipment)} {row.id}".casefold()
        if all(word in written for word in words):
            shown.append((one, row))
        else:
            hidden.append(one)
    return shown, hidden


def _list(request: Request, wanted: dict[str, str]) -> dict[str, Any]:
    shown, hidden = _chosen(request, wanted)
    page = min(int(wanted["page"] or 0), max(0, len(shown) - 1) // PAGE)  # there may be fewer than there were
    query = {name: value for name, value in wanted.items() if value and name != "page"}
    engine = _engine(request)
    return {
        "rows": [row for _, row in shown[page * PAGE : (page + 1) * PAGE]],
        "found": len(shown),
        "page": page,
        "page_size": PAGE,
        "next_page": "/alarms?" + urlencode(query | {"page": page + 1}) if len(shown) > (page + 1) * PAGE else "",
        "previous_page": "/alarms?" + urlencode(query | {"page": page - 1}) if page else "",
        "filtered": bool(wanted["area"] or wanted["priority"] or wanted["q"]),
        "hidden_count": len(hidden),
        "hidden_unack": sum(one.unacked for one in hidden),
        "all_url": "/alarms?" + urlencode({"tab": wanted["tab"]}),
        "list_url": "/alarms/list?" + urlencode(query | {"page": page}),
        "list_revision": engine.list.revision,
        "list_news": engine.annunciations.count,
        "unknown": _view(request).runtime(request).plant is None,
    }


async def _detail(request: Request, one: ListedAlarm) -> dict[str, Any]:
    draw = drawing(request)
    runtime = _view(request).runtime(request)

    def work(connection: Connection) -> tuple[list[journal.Past], list[int]]:
        since = draw.now - 30 * DAY
        return journal.occurrences(connection, one.id), journal.annunciations(connection, since, one.id)

    past, times = await runtime.db.read_long(work)
    response = draw.optional(one, one.response)
    return {
        "row": draw.row(one),
        "label": draw.label_of(one.equipment),
        "cause": draw.optional(one, one.cause),
        "consequence": draw.optional(one, one.consequence),
        "steps": draw.steps(response),
        "put_aside": draw.put_aside(one),
        **_choices(request, one),
        "month": bars(times, draw.now, DAY, 30),
        "month_count": len(times),
        "first_day": fmt.date(draw.now - 29 * DAY, draw.zone, draw.lang, year=False),
        "past": [
            (
                draw.moment(old.raised),
                lasting((old.returned - old.raised) / 1e6) if old.returned else "–",
                shown_name(request, old.acked_by),
            )
            for old in past
            if old.occurrence != one.occurrence
        ][:9],
    }


def _choices(request: Request, one: ListedAlarm) -> dict[str, Any]:
    """For how long, and why, whoever asks may shelve `one`; no spans where they may not."""
    allowed = _engine(request).hiding.allowed(one.alarm_class)
    most = allowed.longest
    if one.priority not in OPERATORS and not _may(request, "configure"):
        most = 0.0
    return {
        "spans": [
            (minutes, _span(request, minutes))
            for minutes in sorted({*SPANS, int(most / 60)} - {0})
            if minutes * 60 <= most
        ],
        "may_take_out": allowed.out_of_service,
        "reasons": ([] if allowed.reason else [""])
        + [_view(request).text(request, f"alarm.reason.{key}") for key in REASONS],
    }


def _span(request: Request, minutes: int) -> str:
    key, number = ("minutes", minutes) if minutes % 60 else ("hours", minutes // 60)
    return _view(request).text(request, f"alarm.shelve_{key}", n=number)


# ---- acknowledging ----------------------------------------------------------------------------------------


@router.post("/alarms/acknowledge", dependencies=[allow("acknowledge")])
async def acknowledge(request: Request) -> Response:
    """Acknowledge exactly the occurrences that are named: what somebody has seen."""
    typed = await fields(request, [], ["comment"], lists=["occurrence"])
    numbers = await field_list(request, "occurrence")
    if (
        not numbers
        or len(numbers) > MOST_AT_ONCE
        or not all(one.isascii() and one.isdecimal() and len(one) < 16 for one in numbers)
    ):
        raise Refused("access.form_field", 422, field="occurrence")
    person = person_of(request)
    answers = await _engine(request).acknowledge(
        [int(one) for one in numbers], person, typed["comment"][:LONGEST_COMMENT]
    )
    access = _view(request).runtime(request).access
    for answer in answers:
        if answer.outcome == "done":
            await access.audit.record(
                "alarm.acknowledged",
                person,
                object=answer.alarm,
                new=answer.occurrence,
                comment=typed["comment"][:LONGEST_COMMENT],
            )
    return answered(
        request,
        _told(request, answers),
        "done" if any(one.outcome == "done" or _twice(request, one) for one in answers) else "info",
        typed["next"],
        stored=all(one.stored for one in answers),
    )


@router.post("/alarms/reset", dependencies=[allow("acknowledge")])
async def reset(request: Request) -> Response:
    """Release a latched alarm."""
    typed = await fields(request, ["occurrence"])
    if not typed["occurrence"].isdecimal() or len(typed["occurrence"]) > 15:
        raise Refused("access.form_field", 422, field="occurrence")
    person, engine = person_of(request), _engine(request)
    one = engine.find(int(typed["occurrence"]))
    stored = await engine.reset(int(typed["occurrence"]), person)
    access = _view(request).runtime(request).access
    await access.audit.record("alarm.reset", person, object=one.id if one else "", new=typed["occurrence"])
    return answered(request, _view(request).text(request, "alarm.answer.reset"), "done", typed["next"], stored=stored)


def _twice(request: Request, answer: Answer) -> bool:
    """Whether the same person has just acknowledged it: a second press of the same button is no news."""
    person, clock = person_of(request), _view(request).runtime(request).clock
    own = answer.outcome == "already" and answer.by == (person.display or person.name)
    return own and clock.micros() - answer.at < SECOND_PRESS


def _told(request: Request, answers: list[Answer]) -> str:
    """What became of it, in one line."""
    view = _view(request)
    done = [one for one in answers if one.outcome == "done"]
    if done and len(done) == len(answers):
        return view.text(request, "alarm.answer.done", n=len(done))
    if len(answers) == 1 and _twice(request, answers[0]):
        return view.text(request, "alarm.answer.done", n=1)
    if len(answers) == 1:
        (one,) = answers
        draw = drawing(request)
        return view.text(request, f"alarm.answer.{one.outcome}", by=one.by, time=draw.moment(one.at) if one.at else "")
    return view.text(request, "alarm.answer.some", done=len(done), others=len(answers) - len(done))


def answered(request: Request, text: str, kind: str, next: str, *, stored: bool) -> Response:
    """The outcome: a line for the script, or back to where the form stood. What is not `stored` yet is no success without a word."""
    if not stored:
        text, kind = _view(request).text(request, "alarm.answer.unstored", text=text), "error"
    if request.headers.get("hx-request") == "true":
        return _view(request).fragment(request, "fragments/alarm_answer.html", text=text, kind=kind)
    return RedirectResponse(language.local_path(next or "/alarms"), 303)


# ---- on every page ----------------------------------------------------------------------------------------


@router.get("/alarms/banner", dependencies=[allow("view")])
async def banner(request: Request) -> Response:
    """The inside of the banner; the same for all who may do the same, so it is drawn once a change and a day."""
    view, engine = _view(request), _engine(request)
    may = _may(request, "acknowledge")
    lang = language.language_of(request)
    cache: dict[tuple[str, bool], tuple[tuple[int, str], Any, bytes]] = request.app.state.__dict__.setdefault(
        "_alarm_banners", {}
    )
    known = cache.get((lang, may))
    runtime = view.runtime(request)
    draw = drawing(request)
    state = (engine.list.revision, fmt.date(draw.now, draw.zone, draw.lang))  # what is of another day says which
    if known is None or known[0] != state or known[1] is not runtime.texts:
        content = draw.banner(may_view=True, may_acknowledge=may)
        body = await view.markup(request, "fragments/banner_inside.html", alarms=content)
        known = cache[(lang, may)] = (state, runtime.texts, body)
    return Response(known[2], media_type="text/html; charset=utf-8")


@router.get("/alarms/summary", dependencies=[allow("view")])
async def summary(request: Request, area: str = "") -> Response:
    """Alarms by area, the last three, the last 24 hours; or those of one area."""
    return _view(request).fragment(request, "fragments/alarm_summary.html", summary=drawing(request).summary(area))


# ---- the journal ------------------------------------------------------------------------------------------


async def _journal(request: Request, wanted: dict[str, str]) -> dict[str, Any]:
    runtime = _view(request).runtime(request)
    filter = _filter(request, wanted)
    found = await runtime.db.read_long(lambda connection: journal.find(connection, filter, JOURNAL_PAGE + 1))
    count = await runtime.db.read_long(lambda connection: journal.count(connection, replace(filter, before=None)))
    query = {name: value for name, value in wanted.items() if value and name not in ("before", "page")}
    draw, text = drawing(request), _view(request).text
    plant = runtime.plant
    return {
        "records": [_line(request, draw, record) for record in found[:JOURNAL_PAGE]],
        "found": count,
        "older": "/alarms?" + urlencode(query | {"before": found[JOURNAL_PAGE - 1].seq})
        if len(found) > JOURNAL_PAGE
        else "",
        "newest": "/alarms?" + urlencode(query) if wanted["before"] else "",
        "event_choices": [(str(entry), text(request, f"alarm.event.{entry}")) for entry in Entry],
        "state_choices": [(name, text(request, f"alarm.state.{name}")) for name in STATE_NAMES.values()],
        "source_choices": [
            *((item.id, draw.label_of(item.id)) for item in (plant.equipment.values() if plant else ())),
            (SYSTEM, text(request, "alarm.system.name")),
        ],
        "filtered": any(
            wanted[name] for name in ("area", "priority", "q", "event", "state", "source", "since", "until")
        ),
        "all_url": "/alarms?tab=journal",
    }


def _filter(request: Request, wanted: dict[str, str]) -> Filter:
    draw = drawing(request)
    words = wanted["q"].casefold()
    fitting = (
        [
            id
            for id, type, key, params in _engine(request).labels()
            if words in draw.filled(type, key, params).casefold()
        ]
        if words
        else None
    )
    return Filter(
        equipment=wanted["source"],
        area=wanted["area"],
        event=wanted["event"],
        state=next((str(state) for state, name in STATE_NAMES.items() if name == wanted["state"]), ""),
        priority=int(wanted["priority"] or 0),
        text=wanted["q"],
        since=read_time(request, wanted["since"], "since"),
        until=read_time(request, wanted["until"], "until"),
        before=int(wanted["before"]) if wanted["before"] else None,
        alarms=fitting[:1000] if fitting else None,
    )


def _line(request: Request, draw: Drawing, record: Record) -> dict[str, Any]:
    text = _view(request).text
    alarm = draw.runtime.alarms.definition(record.alarm)
    names = {str(state): name for state, name in STATE_NAMES.items()}
    return {
        "seq": record.seq,
        "time": fmt.date_time(record.time, draw.zone, draw.lang, draw.now, milliseconds=True),
        "iso": fmt.iso(record.time, draw.zone),
        "event": text(request, f"alarm.event.{record.event}"),
        "detail": record.detail if record.event in ("LIMIT_CHANGED", "PRIO_CHANGED") else "",
        "source": record.equipment or SYSTEM,
        "priority": record.priority,
        "priority_text": text(request, "alarm.priority." + PRIORITY_NAMES[record.priority]),
        "symbol": SYMBOL_OF[record.after],
        "text": draw.recorded(record),
        "before": text(request, f"alarm.state.{names[record.before]}"),
        "after": text(request, f"alarm.state.{names[record.after]}"),
        "value": draw.value(record.equipment, alarm.value if alarm else "", record.value, record.limit),
        "person": shown_name(request, record.person),
        "comment": shown_words(request, record.comment),
        "silent": record.silent,
    }


@router.get("/alarms.csv", dependencies=[allow("export")])
async def export(request: Request) -> Response:
    """The list or the journal as the filter shows it, with the filter in the first line.

    `shift` (1): of the journal with shifts; `locale`: hr, en, de, cs, or machine, which it is without.
    """
    wanted, locale = _wanted(request), locale_of(request)
    person = person_of(request)
    shown = "; ".join(f"{name}={value}" for name, value in wanted.items() if value and name not in ("page", "before"))
    await _view(request).runtime(request).access.audit.record("alarm.exported", person, filters=shown)
    pieces = (_csv_journal if wanted["tab"] == "journal" else _csv_list)(request, wanted, shown, locale)
    first = await anext(pieces)  # what cannot be read is told before a file begins

    async def whole() -> AsyncIterator[bytes]:
        yield first
        async for piece in pieces:
            yield piece

    return StreamingResponse(
        whole(),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="alarms-{wanted["tab"]}.csv"'},
    )


async def _csv_list(request: Request, wanted: dict[str, str], shown: str, locale: str) -> AsyncIterator[bytes]:
    draw = drawing(request)
    yield "\ufeff".encode() + cells([f"# {shown}"], locale) + cells(CSV_LIST, locale)
    rows, _ = _chosen(request, wanted)
    for index, (one, row) in enumerate(rows):
        end = draw.now if one.life.active else one.returned or draw.now
        yield cells(
            [
                fmt.iso(one.first_true, _UTC), row.iso, STATE_NAMES[one.state], one.priority, row.source, one.area,
                row.text, _plain(one.value), _plain(one.limit), _seconds(one.first_true, end), one.count,
                one.acked_by, fmt.iso(one.acked_at, _UTC) if one.acked_at else "",
            ],
            locale,
        )  # fmt: skip
        if index % 200 == 0:
            await asyncio.sleep(0)


async def _csv_journal(request: Request, wanted: dict[str, str], shown: str, locale: str) -> AsyncIterator[bytes]:
    draw, runtime = drawing(request), _view(request).runtime(request)
    filter = _filter(request, wanted | {"before": ""})

    def read(filter: Filter) -> list[Record]:
        return runtime.db.run(lambda connection: journal.find(connection, filter, CSV_PAGE))

    found = await asyncio.to_thread(read, filter)
    begins = with_shift(request)
    shifts = Shifts(begins, draw.zone) if begins else None
    columns = (*CSV_JOURNAL, "shift") if shifts else CSV_JOURNAL
    yield "\ufeff".encode() + cells([f"# {shown}"], locale) + cells(columns, locale)
    while found:
        for r in found:
            yield cells(
                [
                    r.seq, fmt.iso(r.time, _UTC), fmt.iso(r.time, draw.zone), r.event, r.detail, r.alarm, r.occurrence,
                    r.equipment or SYSTEM, r.area, r.alarm_class, r.priority, r.before, r.after, draw.recorded(r),
                    _plain(r.value), _plain(r.limit), r.unit, r.quality, r.person, r.address, r.comment,
                    *([shift_cell(shifts, r.time, draw.zone)] if shifts else []),
                ],
                locale,
            )  # fmt: skip
        filter = replace(filter, before=found[-1].seq)
        found = await asyncio.to_thread(read, filter)


def _seconds(begin: int, end: int) -> float | str:
    """How long it was [s]; empty where the clock was set back between, as nobody knows then."""
    return round((end - begin) / 1e6, 3) if begin <= end else ""


def _plain(value: float | None) -> float | str:
    return "" if value is None else value
