"""What became of each product: the list of passages with its filter, the steps of one, CSV."""

from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import urlencode

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import Connection
from starlette.exceptions import HTTPException

from app.errors import Refused
from app.historian import passage_query as query
from app.historian.export import FORMATS
from app.historian.passage_export import PassageExport, PassageWish, sensors, tracking, words
from app.historian.passage_query import ANY_ALARM, OUTCOMES, Passage, Step, Wanted
from app.historian.passages import Code, Outcome
from app.plant.definitions import Equipment
from app.web import format as fmt
from app.web.event_list import RANGE, amount, fields, place, set_filters, span
from app.web.guard import address_of, allow, person_of, shown_name, shown_words
from app.web.history import Download, check_place, read
from app.web.language import language_of
from app.web.pages import view_of
from app.web.signin import zone_of

router = APIRouter()

PAGE = 50
"""Passages on a page."""
MOST_COUNTED = 100_000
"""More are not counted."""
NAMES = ("equipment", "product", "outcome", "since", "until", "correction", "alarm", "before")
MILLIMETRES = frozenset(
    (
        Code.IDENTIFIED,
        Code.HEAD,
        Code.TAIL,
        Code.TOLERANCE,
        Code.LOST,
        14,
        Code.WITHDRAWN,
        Code.GAP_STOP,
        Code.GAP_CLEAR,
    )
)
SIGNED = frozenset((Code.HEAD, Code.TAIL, Code.TOLERANCE))
"""Events whose value is a correction."""
SECONDS = frozenset((Code.UNLOADED, Code.LEFT_BACKWARDS))
AT_SENSOR = frozenset((Code.ARRIVED, Code.HEAD, Code.TAIL, Code.TOLERANCE, Code.LOST, Code.UNEXPECTED))


@router.get("/products", dependencies=[allow("view")], name="products")
async def products(request: Request) -> Response:
    """The list of passages, newest first: of all machines, or of one."""
    typed = _typed(request)
    view, runtime = view_of(request), view_of(request).runtime(request)
    try:
        found = await _list(request, typed, _wanted(request, typed))
    except Refused as refusal:
        if refusal.reason != RANGE:
            raise
        found = {"problem": view.text(request, RANGE), "export_url": ""}
    item = runtime.plant.equipment.get(typed["equipment"]) if runtime.plant else None
    return view.page(
        request,
        "pages/products.html",
        status=422 if "problem" in found else 200,
        title=view.text(request, "products.title"),
        kind="products",
        area=item.area if item else "",
        up=f"/equipment/{item.id}" if item else "/",
        chip=item.id if item else "",
        **(_tools(request, typed) | found),
    )


@router.get("/products/list", dependencies=[allow("view")])
async def rows(request: Request) -> Response:
    """The rows alone, after a change."""
    typed = _typed(request)
    wanted = _wanted(request, typed)
    return view_of(request).fragment(request, "fragments/product_rows.html", **await _list(request, typed, wanted))


@router.get("/products/detail/{number}", dependencies=[allow("view")])
async def detail(request: Request, number: int) -> Response:
    """All steps of one passage.

    Raises:
        HTTPException: 404, it is not there.
    """
    runtime = view_of(request).runtime(request)

    def work(connection: Connection) -> tuple[Passage | None, list[Step]]:
        one = query.get(connection, number) if 0 < number < 2**63 else None
        return one, query.steps(connection, [number])[number] if one else []

    one, steps = await read(runtime, work)
    if one is None:
        raise HTTPException(404)
    return view_of(request).fragment(
        request, "fragments/product_detail.html", detail=_Words(request).detail(one, steps)
    )


@router.get("/products/export.csv", dependencies=[allow("export")])
async def export(request: Request) -> Response:
    """What the filter lets through as CSV: `locale` (hr, en, de, cs, machine), `bom` (1)."""
    typed = _typed(request)
    wanted = _wanted(request, typed)
    runtime, person, lang = view_of(request).runtime(request), person_of(request), language_of(request)
    locale = request.query_params.get("locale", "") or lang
    if locale not in FORMATS:
        raise Refused("history.locale", 422, value=locale[:40], expected=", ".join(FORMATS))
    check_place(request)
    await _check_equipment(request, typed["equipment"])
    filters = "; ".join(f"{name}={value}" for name, value in typed.items() if value and name != "before")
    plant = runtime.plant
    made = PassageExport(
        PassageWish(
            replace(wanted, before=None),
            zone_of(request),
            locale,
            bom=request.query_params.get("bom", "") in ("1", "on"),
            sensors=sensors(plant, typed["equipment"]),
            **words(runtime.texts, plant, locale),
            most_rows=runtime.settings.export_rows,
            filters=filters,
            plant=runtime.texts.label(lang, plant.name) if plant else "",
            person=person.name,
            created=runtime.clock.micros(),
            simulated=runtime.simulated,
        )
    )
    await read(runtime, made.open)
    await runtime.access.audit.record(
        "products.exported", person, typed["equipment"], address=address_of(request.scope), filters=filters
    )
    return Download(request, made)


@router.get("/products/export/size", dependencies=[allow("export")])
async def size(request: Request) -> Response:
    """How many rows an export would have, and the limit."""
    typed = _typed(request)
    wanted = _wanted(request, typed)
    await _check_equipment(request, typed["equipment"])
    runtime = view_of(request).runtime(request)
    limit = runtime.settings.export_rows
    found = await read(
        runtime, lambda connection: query.count(connection, replace(wanted, before=None), limit or 10**9)
    )
    return Response(orjson.dumps({"rows": found, "limit": limit}), media_type="application/json")


async def _check_equipment(request: Request, id: str) -> None:
    """Refuse to export of a machine that is neither in the plant nor in the history.

    Raises:
        HTTPException: 404.
    """
    runtime = view_of(request).runtime(request)
    if (
        id
        and not (runtime.plant and id in runtime.plant.equipment)
        and not await read(runtime, lambda connection: query.find(connection, Wanted(equipment=id), 1))
    ):
        raise HTTPException(404)


# ---- the filter -------------------------------------------------------------------------------------------


def _typed(request: Request) -> dict[str, str]:
    return fields(request, NAMES, 80)


def _wanted(request: Request, typed: dict[str, str]) -> Wanted:
    """What the address asks for, as understood.

    Raises:
        Refused: 422, a field is none of its choices or cannot be read, or the end is not after the beginning.
    """
    if typed["outcome"] not in ("", *OUTCOMES):
        raise Refused("access.form_field", 422, field="outcome")
    product = _whole(typed["product"].removeprefix("#"), "product", 2**32)
    if typed["alarm"] != ANY_ALARM:
        _whole(typed["alarm"], "alarm", 2**16)
    correction, before = amount(typed["correction"], "correction", 1e6), place(typed["before"])
    begin, end = span(request, typed)
    return Wanted(typed["equipment"], begin, end, product, typed["outcome"], correction, typed["alarm"], before)


def _whole(text: str, field: str, limit: int) -> int | None:
    if not text:
        return None
    if not (text.isascii() and text.isdecimal() and len(text) <= 10 and int(text) < limit):
        raise Refused("access.form_field", 422, field=field)
    return int(text)


def _tools(request: Request, typed: dict[str, str]) -> dict[str, Any]:
    view = view_of(request)
    runtime = view.runtime(request)
    machines = tracking(runtime.plant)
    lang, person = language_of(request), request.state.person
    codes: dict[int, str] = {}
    for item in machines:
        if typed["equipment"] in ("", item.id):
            codes |= {
                alarm.event: runtime.texts.of_type(lang, item.type, _event_key(item, alarm.event))
                for alarm in item.alarms
                if alarm.event and _of_product(alarm.event)
            }
    chosen = set_filters(typed)
    link = urlencode(chosen | {"locale": lang, "bom": "1"})
    return {
        "typed": typed,
        "machine_choices": [(item.id, runtime.texts.label(lang, item.label)) for item in machines],
        "outcome_choices": [(one, view.text(request, f"products.outcome.{one}")) for one in OUTCOMES],
        "alarm_choices": [
            (ANY_ALARM, view.text(request, "products.any_alarm")),
            *((str(c), t) for c, t in codes.items()),
        ],
        "filtered": bool(set(chosen) - {"equipment"}),
        "all_url": "/products" + (f"?{urlencode({'equipment': typed['equipment']})}" if typed["equipment"] else ""),
        "export_url": f"/products/export.csv?{link}" if person is not None and person.may("export") else "",
        "changes": [
            (name, runtime.tags.value(runtime.tags.handle(name)) or 0)
            for item in machines
            if typed["equipment"] in ("", item.id) and (name := f"sys.products.{item.id}") in runtime.tags
        ],
    }


def _of_product(code: int) -> bool:
    """Whether an event is about a product: of the rest none gets into a passage."""
    return code < 20 or code in (Code.GAP_STOP, Code.GAP_CLEAR)


async def _list(request: Request, typed: dict[str, str], wanted: Wanted) -> dict[str, Any]:
    runtime = view_of(request).runtime(request)
    chosen = set_filters(typed)
    machines = [wanted.equipment] if wanted.equipment else [item.id for item in tracking(runtime.plant)]

    def work(connection: Connection) -> tuple[list[Passage], int, int]:
        return (
            query.find(connection, wanted, PAGE + 1),
            query.count(connection, replace(wanted, before=None), MOST_COUNTED + 1),
            sum(query.lost(connection, id, wanted.begin, wanted.end) for id in machines),
        )

    found, count, lost = await read(runtime, work)
    draw = _Words(request)
    last = found[PAGE - 1] if len(found) > PAGE else None
    return {
        "passages": [draw.row(one) for one in found[:PAGE]],
        "found": min(count, MOST_COUNTED),
        "more": count > MOST_COUNTED,
        "lost": lost,
        "several": not typed["equipment"],
        "older": "/products?" + urlencode(chosen | {"before": f"{last.entered}-{last.id}"}) if last else "",
        "newest": "/products?" + urlencode(chosen) if typed["before"] else "",
        "list_url": "/products/list?" + urlencode({name: value for name, value in typed.items() if value}),
        "live": not typed["before"],
    }


# ---- words ------------------------------------------------------------------------------------------------


def _event_key(item: Equipment, code: int) -> str:
    return f"event.{item.type.events.get(code, str(code))}"


@dataclass(frozen=True, slots=True)
class Line:
    """One passage as a line of the list."""

    id: int
    product: str
    equipment: str
    machine: str
    """Its name."""
    entered: str
    iso: str
    seen: bool
    """Whether its entry was seen."""
    length: str
    corrections: int
    greatest: str
    alarms: str
    priority: int
    """Of the most important alarm; 0 = none."""
    outcome: str
    """Key of the outcome."""
    outcome_text: str
    duration: str
    missed: int
    mark: str
    """Another one when there is more to tell in its detail."""


class _Words:
    """Passages in the language of a request."""

    def __init__(self, request: Request) -> None:
        self.view, self.request = view_of(request), request
        self.runtime = self.view.runtime(request)
        self.lang, self.zone = language_of(request), zone_of(request)
        self.now = self.runtime.clock.micros()

    def row(self, one: Passage) -> Line:
        item = self._item(one.equipment)
        priorities = {alarm.event: alarm.priority for alarm in item.alarms if alarm.event} if item else {}
        return Line(
            id=one.id,
            product=f"#{one.product}",
            equipment=one.equipment,
            machine=self.runtime.texts.label(self.lang, item.label) if item else one.equipment,
            entered=self.moment(one.entered),
            iso=fmt.iso(one.entered, self.zone),
            seen=one.entry > 0,
            length="–" if one.length is None else fmt.quantity(one.length, 1, "mm", self.lang),
            corrections=one.corrections,
            greatest="–" if one.greatest is None else fmt.quantity(one.greatest, 1, "mm", self.lang),
            alarms=", ".join(self.event(item, code) for code in one.alarms),
            priority=min((priorities.get(code, 4) for code in one.alarms), default=0),
            outcome=one.outcome,
            outcome_text=self.view.text(self.request, f"products.outcome.{one.outcome}"),
            duration="" if one.duration is None else fmt.duration(one.duration, self.lang),
            missed=one.missed,
            mark=f"{one.outcome}-{one.corrections}-{one.codes}-{one.length}-{one.missed}",
        )

    def detail(self, one: Passage, steps: list[Step]) -> dict[str, Any]:
        item = self._item(one.equipment)
        return {
            "row": self.row(one),
            "ended": "" if one.ended is None else self.moment(one.ended),
            "boot": one.boot,
            "steps": [self._step(item, one, step) for step in steps],
            "url": f"/equipment/{one.equipment}" if item else "",
            "open": one.outcome == Outcome.OPEN,
        }

    def _step(self, item: Equipment | None, one: Passage, step: Step) -> dict[str, Any]:
        alarms = {alarm.event: alarm.priority for alarm in item.alarms if alarm.event} if item else {}
        return {
            "time": fmt.clock_time(step.time, self.zone, milliseconds=True, lang=self.lang),
            "iso": fmt.iso(step.time, self.zone),
            "after": fmt.duration(max(0, step.time - one.entered) / 1e6, self.lang) if step.time > one.entered else "",
            "text": self.event(item, step.code),
            "sensor": f"S{step.source}" if step.code in AT_SENSOR and step.source else "",
            "value": self._value(step),
            "other": f"#{step.second}" if step.second else "",
            "priority": alarms.get(step.code, 0),
            "person": shown_name(self.request, step.person),
            "reason": shown_words(self.request, step.reason),
        }

    def _value(self, step: Step) -> str:
        if step.value is None or step.code not in MILLIMETRES | SECONDS:
            return ""
        if step.code in SECONDS:
            return fmt.duration(step.value, self.lang)
        sign = "+" if step.code in SIGNED and step.value > 0 else ""
        return sign + fmt.quantity(step.value, 2 if step.code in SIGNED else 1, "mm", self.lang)

    def event(self, item: Equipment | None, code: int) -> str:
        if item is None or code not in item.type.events:
            return self.view.text(self.request, "products.event", n=code)
        return self.runtime.texts.of_type(self.lang, item.type, _event_key(item, code))

    def moment(self, micros: int) -> str:
        if fmt.date(micros, self.zone, self.lang) == fmt.date(self.now, self.zone, self.lang):
            return fmt.clock_time(micros, self.zone, milliseconds=True, lang=self.lang)
        return fmt.date_time(micros, self.zone, self.lang, self.now)

    def _item(self, equipment: str) -> Equipment | None:
        return self.runtime.plant.equipment.get(equipment) if self.runtime.plant else None
