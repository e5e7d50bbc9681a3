"""Every event of every machine's ring: the list with its filter, one event with all that it says, CSV."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import urlencode

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import Connection
from starlette.exceptions import HTTPException

from app.errors import Refused
from app.historian import event_search as search
from app.historian import events as history
from app.historian.event_gaps import Gap, Place, gaps
from app.historian.event_search import GONE, EventFilter
from app.historian.event_sheet import EventExport, EventExportSettings, coded, with_ring, worded, words
from app.historian.export import FORMATS
from app.historian.record_query import definition_at
from app.plant.definitions import Equipment, EquipmentType, Plant
from app.plant.kept import Definition
from app.records.event import Event
from app.records.snapshot import BITS, decode
from app.web import format as fmt
from app.web.event_list import RANGE, fields, place, set_filters, span
from app.web.guard import address_of, allow, person_of, shown_name, shown_words
from app.web.history import Download, check_place, read, with_shift
from app.web.language import language_of
from app.web.pages import view_of
from app.web.signin import zone_of

router = APIRouter()

PAGE = 100
"""Events on a page."""
LONGEST_CODE = 5
"""Digits of a code: one word."""
GAPS_SHOWN = 20
"""Gaps of which a page tells where they are, the newest."""
MOST_COUNTED = 100_000
"""More are not counted."""
NAMES = ("equipment", "event", "since", "until", "q", "before")


@router.get("/events", dependencies=[allow("view")], name="events")
async def events(request: Request) -> Response:
    """The list of events, newest first: of all machines, or of one."""
    return await _page(request, _typed(request))


@router.get("/equipment/{id}/events", dependencies=[allow("view")])
async def of_equipment(request: Request, id: str) -> Response:
    """The list of events of one machine.

    Raises:
        HTTPException: 404, there is no such machine, and never was.
    """
    await _check_equipment(request, id)
    return await _page(request, _typed(request) | {"equipment": id})


async def _page(request: Request, typed: dict[str, str]) -> Response:
    view, runtime = view_of(request), view_of(request).runtime(request)
    tools = _tools(request, typed)  # counted before the list is read: what comes meanwhile is asked for again
    try:
        found = await _list(request, typed, wanted_of(request, typed))
    except Refused as refusal:
        if refusal.reason != RANGE:
            raise
        found = {"problem": view.refusal(request, refusal), "export_url": ""}
    item = runtime.plant.equipment.get(typed["equipment"]) if runtime.plant else None
    return view.page(
        request,
        "pages/events.html",
        status=422 if "problem" in found else 200,
        title=view.text(request, "events.title"),
        kind="events",
        area=item.area if item else "",
        up=f"/equipment/{item.id}" if item else "/",
        chip=item.id if item else "",
        **(tools | found),
    )


@router.get("/events/list", dependencies=[allow("view")])
async def rows(request: Request) -> Response:
    """The rows alone, after a change."""
    typed = _typed(request)
    found = await _list(request, typed, wanted_of(request, typed))
    return view_of(request).fragment(request, "fragments/event_rows.html", **found)


@router.get("/events/detail/{number}", dependencies=[allow("view")])
async def detail(request: Request, number: int) -> Response:
    """All that one event says.

    Raises:
        HTTPException: 404, it is not there.
    """
    runtime = view_of(request).runtime(request)
    draw = EventWords(request)

    def work(connection: Connection) -> tuple[Event, Definition] | None:
        one = search.get(connection, number) if 0 < number < 2**63 else None
        return (one, draw.definition(connection, one)) if one else None

    found = await read(runtime, work)
    if found is None:
        raise HTTPException(404)
    return view_of(request).fragment(request, "fragments/event_detail.html", detail=draw.detail(*found))


@router.get("/events/export.csv", dependencies=[allow("export")])
async def export(request: Request) -> Response:
    """What the filter lets through as CSV: `locale` (hr, en, de, cs, machine), `bom` (1), `shift` (1: with the shift of each)."""
    typed = _typed(request)
    wanted = wanted_of(request, typed)
    runtime, person, lang = view_of(request).runtime(request), person_of(request), language_of(request)
    locale = request.query_params.get("locale", "") or lang
    if locale not in FORMATS:
        raise Refused("history.locale", 422, value=locale[:40], expected=", ".join(FORMATS))
    check_place(request)
    await _check_equipment(request, typed["equipment"])
    filters = "; ".join(f"{name}={value}" for name, value in typed.items() if value and name != "before")
    plant = runtime.plant
    made = EventExport(
        EventExportSettings(
            replace(wanted, before=None),
            zone_of(request),
            locale,
            bom=request.query_params.get("bom", "") in ("1", "on"),
            **words(runtime.texts, plant, locale),
            most_rows=runtime.settings.export_rows,
            filters=filters,
            plant=runtime.texts.label(lang, plant.name) if plant else "",
            person=person.name,
            created=runtime.clock.micros(),
            simulated=runtime.simulated,
            shifts=with_shift(request),
        )
    )
    await read(runtime, made.open)
    await runtime.access.audit.record(
        "events.exported", person, typed["equipment"], address=address_of(request.scope), filters=filters
    )
    return Download(request, made)


@router.get("/events/export/size", dependencies=[allow("export")])
async def size(request: Request) -> Response:
    """How many rows an export would have, and the limit."""
    typed = _typed(request)
    wanted = wanted_of(request, typed)
    await _check_equipment(request, typed["equipment"])
    runtime = view_of(request).runtime(request)
    limit = runtime.settings.export_rows
    found = await read(
        runtime, lambda connection: search.count(connection, replace(wanted, before=None), limit or 10**9), much=True
    )
    return Response(orjson.dumps({"rows": found, "limit": limit}), media_type="application/json")


async def _check_equipment(request: Request, id: str) -> None:
    """Refuse a machine that is neither in the plant nor in the history.

    Raises:
        HTTPException: 404.
    """
    runtime = view_of(request).runtime(request)
    if (
        id
        and not (runtime.plant and id in runtime.plant.equipment)
        and not await read(runtime, lambda connection: search.known(connection, id))
    ):
        raise HTTPException(404)


# ---- the filter -------------------------------------------------------------------------------------------


def _typed(request: Request) -> dict[str, str]:
    return fields(request, NAMES, 80)


def wanted_of(request: Request, typed: Mapping[str, str]) -> EventFilter:
    """What the address asks for, as understood; `event` is a key or a code. Visitors without sign-in find nothing by names and reasons,
    which they do not read.

    Raises:
        Refused: 422, a field cannot be read or no machine has such an event, or the end is not after the beginning.
    """
    runtime = view_of(request).runtime(request)
    begin, end = span(request, typed)
    code = _code(typed["event"])
    codes = coded(runtime.plant, typed["event"]) if typed["event"] and code is None else None
    if codes is not None and not codes:
        raise Refused("access.form_field", 422, field="event")
    text = typed["q"]
    return EventFilter(
        typed["equipment"],
        begin,
        end,
        codes,
        code,
        text,
        worded(runtime.texts, runtime.plant, language_of(request), text) if text else None,
        request.state.person is not None,
        place(typed["before"]),
    )


def _code(text: str) -> int | None:
    """The code that is meant; None: it is no number."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= LONGEST_CODE else None


def _tools(request: Request, typed: dict[str, str]) -> dict[str, Any]:
    view = view_of(request)
    runtime = view.runtime(request)
    lang, person = language_of(request), request.state.person
    machines = with_ring(runtime.plant)
    shown = [item for item in machines if typed["equipment"] in ("", item.id)]
    named: dict[str, str] = {}
    for kind in {item.type.name: item.type for item in shown}.values():
        for key in kind.events.values():
            named.setdefault(key, runtime.texts.of_type(lang, kind, f"event.{key}"))
    if (code := _code(typed["event"])) is not None:
        named[typed["event"]] = view.text(request, "events.unknown", n=code)
    chosen = set_filters(typed)
    link = urlencode(chosen | {"locale": lang, "bom": "1", "shift": "1"})
    return {
        "typed": typed,
        "machine_choices": [(item.id, runtime.texts.label(lang, item.label)) for item in machines],
        "event_choices": sorted(named.items(), key=lambda one: one[1].casefold()),
        "filtered": bool(set(chosen) - {"equipment"}),
        "all_url": "/events" + (f"?{urlencode({'equipment': typed['equipment']})}" if typed["equipment"] else ""),
        "export_url": f"/events/export.csv?{link}" if person is not None and person.may("export") else "",
        "changes": [
            (name, runtime.tags.value(runtime.tags.handle(name)) or 0)
            for item in shown
            if (name := f"sys.events.{item.id}") in runtime.tags
        ],
    }


async def _list(request: Request, typed: dict[str, str], wanted: EventFilter) -> dict[str, Any]:
    runtime = view_of(request).runtime(request)
    chosen = set_filters(typed)
    draw = EventWords(request)

    def work(connection: Connection) -> tuple[list[tuple[Event, Definition]], int, int, list[Gap]]:
        lost = history.lost(connection, wanted.equipment, wanted.begin, wanted.end)
        return (
            [(one, draw.definition(connection, one)) for one in search.find(connection, wanted, PAGE + 1)],
            search.count(connection, replace(wanted, before=None), MOST_COUNTED + 1),
            lost,
            gaps(connection, wanted.equipment, wanted.begin, wanted.end, GAPS_SHOWN) if lost else [],
        )

    found, count, lost, missing = await read(runtime, work, much=bool(set(chosen) - {"equipment"}))
    last = found[PAGE - 1][0] if len(found) > PAGE else None
    return {
        "events": [draw.row(*one) for one in found[:PAGE]],
        "found": min(count, MOST_COUNTED),
        "more": count > MOST_COUNTED,
        "lost": lost,
        "unstored": runtime.events.unstored([typed["equipment"]] if typed["equipment"] else None),
        "gaps": [(one.equipment.removeprefix(GONE), draw.gap(one)) for one in missing],
        "several": not typed["equipment"],
        "older": "/events?" + urlencode(chosen | {"before": f"{last.time}-{last.id}"}) if last else "",
        "newest": "/events?" + urlencode(chosen) if typed["before"] else "",
        "list_url": "/events/list?" + urlencode({name: value for name, value in typed.items() if value}),
        "live": not typed["before"],
        "journal": _journal(runtime.plant, typed["equipment"]),
    }


def _journal(plant: Plant | None, equipment: str) -> str:
    """Where it stands what became of a machine that keeps no events; empty: it keeps some, or there is no such machine."""
    item = plant.equipment.get(equipment) if plant else None
    if item is None or history.has_ring(item):
        return ""
    return "/alarms?" + urlencode({"tab": "journal", "source": item.id})


# ---- words ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Line:
    """One event as a line of the list."""

    id: int
    equipment: str
    machine: str
    """Its name."""
    time: str
    iso: str
    text: str
    priority: int
    """Of the alarm that it raises; 0 = none."""
    source: str
    value: str
    said: tuple[tuple[str, str], ...]
    """What its snapshot says: name, value."""
    person: str
    reason: str

    @property
    def mark(self) -> str:
        """Another one when there is more to tell."""
        return f"{self.id}-{len(self.person)}-{len(self.reason)}"


class EventWords:
    """Events in the language of a request."""

    def __init__(self, request: Request) -> None:
        self.view, self.request = view_of(request), request
        self.runtime = self.view.runtime(request)
        self.lang, self.zone = language_of(request), zone_of(request)
        self.now = self.runtime.clock.micros()

    def definition(self, connection: Connection, one: Event) -> Definition:
        """What names the bits that an event is about: as it was then, whatever the plant file says today."""
        item = self.item(one.equipment)
        if item is None or not any(field.bit_of or field.bits_of for field in item.type.snapshot.values()):
            return Definition()
        return definition_at(connection, one.equipment, item.type.records, one.time)

    def row(self, one: Event, by: Definition) -> Line:
        item = self.item(one.equipment)
        raised = [alarm.priority for alarm in item.alarms if alarm.event == one.code] if item else []
        return Line(
            id=one.id,
            equipment=one.equipment.removeprefix(GONE),
            machine=self.runtime.texts.label(self.lang, item.label) if item else one.equipment.removeprefix(GONE),
            time=self.moment(one.time),
            iso=fmt.iso(one.time, self.zone),
            text=self.text(item.type if item else None, one.code),
            priority=min(raised, default=0),
            source=str(one.source) if one.source else "",
            value=self._number(one.value) if one.value else "",
            said=tuple(self._said(item.type, one, by)) if item else (),
            person=shown_name(self.request, one.person),
            reason=shown_words(self.request, one.reason),
        )

    def gap(self, one: Gap) -> str:
        """How many events are missing, and between which two that are known."""
        after, before = (self._place(place) if place else "" for place in (one.after, one.before))
        where = "between" if after and before else "after" if after else "before"
        return self.view.text(self.request, f"events.gap.{where}", n=one.count, after=after, before=before)

    def _place(self, place: Place) -> str:
        time = self.moment(place.time)
        return self.view.text(self.request, "events.gap.place", time=time, boot=place.boot, n=place.sequence)

    def detail(self, one: Event, by: Definition) -> dict[str, Any]:
        item = self.item(one.equipment)
        key = item.type.events.get(one.code, "") if item else ""
        return {
            "row": self.row(one, by),
            "code": f"{one.code} {key}".strip(),
            "source": str(one.source),
            "value": "–" if one.value is None else self._number(one.value),
            "words": " ".join(f"{word:04X}" for word in one.words),
            "boot": one.boot,
            "sequence": one.sequence,
            "request": one.request,
            "url": f"/equipment/{one.equipment}" if item else "",
        }

    def _said(self, kind: EquipmentType, one: Event, by: Definition) -> list[tuple[str, str]]:
        found = []
        for name, value in decode(kind.snapshot, one.words, one.code).items():
            field = kind.snapshot[name]
            if value is None or (value == 0 and not (field.bit_of and any(one.words))):
                continue  # words that are all 0 say nothing, not even bit 0
            part = one.source if "source" in (field.bit_of, field.bits_of) else 0
            if field.bit_of:
                shown = f"{value} {self._bit(by, part, int(value), '')}".rstrip()
            else:
                shown = self._bits(by, part, int(value)) if field.bits_of else self._number(value)
            found.append((self.runtime.texts.of_type(self.lang, kind, f"snapshot.{name}"), shown))
        return found

    def _bits(self, by: Definition, part: int, word: int) -> str:
        """A word of bits: how many are set, and the names of those that are not."""
        off = [self._bit(by, part, bit, str(bit)) for bit in range(BITS) if not word >> bit & 1]
        missing = self.view.text(self.request, "events.missing", what=" · ".join(off)) if off else ""
        return f"{BITS - len(off)}/{BITS} {missing}".rstrip()

    def _bit(self, by: Definition, part: int, bit: int, otherwise: str) -> str:
        label = by.bit(part, bit)
        return self.runtime.texts.label(self.lang, label) if label else otherwise

    def text(self, kind: EquipmentType | None, code: int) -> str:
        if kind is None or code not in kind.events:
            return self.view.text(self.request, "events.unknown", n=code)
        return self.runtime.texts.of_type(self.lang, kind, f"event.{kind.events[code]}")

    def _number(self, value: float) -> str:
        return str(value) if isinstance(value, int) else fmt.number(value, fmt.shortest(value, 3), self.lang)

    def moment(self, micros: int) -> str:
        return fmt.moment_or_time(micros, self.zone, self.lang, self.now, milliseconds=True)

    def item(self, equipment: str) -> Equipment | None:
        return self.runtime.plant.equipment.get(equipment) if self.runtime.plant else None
