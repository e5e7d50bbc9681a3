"""Records of machines: the list of a kind with its filter, one record with its events, times of parts, CSV.

What a kind is called, shows and can be asked for is said by its equipment type; nothing here knows one.
"""

from dataclasses import replace
from typing import Any
from urllib.parse import urlencode

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy import Connection
from starlette.exceptions import HTTPException

from app import bundled
from app.errors import Refused
from app.historian import record_query as query
from app.historian.export import FORMATS
from app.historian.record_export import RecordExport, RecordExportSettings, keeping, kinds, names, words
from app.historian.record_query import ANY, RecordFilter
from app.plant.record_kinds import OPEN_CHOICE, former_addresses
from app.plant.types import EQUIPMENT
from app.records.kind import Filter, RecordKind
from app.web import record_detail, record_last, record_rows, record_times
from app.web.event_list import RANGE, amount, fields, place, set_filters, span
from app.web.guard import address_of, allow, person_of
from app.web.history import Download, check_place, read, with_shift
from app.web.language import language_of
from app.web.pages import view_of
from app.web.record_words import RecordWords
from app.web.signin import zone_of

router = APIRouter()

PAGE = 50
"""Records on a page."""
MOST_COUNTED = 100_000
"""More are not counted."""
NAMES = ("equipment", "outcome", "since", "until", "view", "before")
"""What the address may say beside the filters of the kind."""
TIMES = "steps"
"""`view`: times of parts in place of the list."""
LAST = "last"
"""`view`: the newest `record_last.COUNT` beside one another."""
LONGEST = 120
LARGEST = 1e7
"""Numbers of a filter are below."""


@router.get("/records", dependencies=[allow("view")])
async def first(request: Request) -> Response:
    """The list of the first kind that there is.

    Raises:
        HTTPException: 404, no machine has records.
    """
    for name in kinds(view_of(request).runtime(request).plant):
        return RedirectResponse(f"/records/{name}", 303)
    raise HTTPException(404)


@router.get("/records/{kind}", dependencies=[allow("view")])
async def page(request: Request, kind: str) -> Response:
    """The list of the records of a kind, newest first: of all machines, or of one; or the times of their parts."""
    of = kind_of(request, kind)
    typed = _typed(request, of)
    view, runtime = view_of(request), view_of(request).runtime(request)
    draw = RecordWords(request, of)
    tools = await _tools(request, of, typed)  # counted before the list is read: what comes meanwhile is asked for again
    try:
        found = await _main(request, of, typed, wanted_of(request, of, typed))
    except Refused as refusal:
        if refusal.reason != RANGE:
            raise
        found = {"problem": view.refusal(request, refusal), "export_url": ""}
    item = runtime.plant.equipment.get(typed["equipment"]) if runtime.plant else None
    return view.page(
        request,
        "pages/records.html",
        status=422 if "problem" in found else 200,
        title=draw.text("title"),
        kind=f"records/{of.name}",
        area=item.area if item else "",
        up=f"/equipment/{item.id}" if item else "/",
        chip=item.id if item else "",
        **(tools | found),
    )


@router.get("/records/{kind}/list", dependencies=[allow("view")])
async def rows(request: Request, kind: str) -> Response:
    """The rows, or the times, alone, after a change."""
    of = kind_of(request, kind)
    typed = _typed(request, of)
    wanted = wanted_of(request, of, typed)
    template = {TIMES: "record_times", LAST: "record_last"}.get(typed["view"], "record_rows")
    return view_of(request).fragment(request, f"fragments/{template}.html", **await _main(request, of, typed, wanted))


@router.get("/records/{kind}/detail/{number}", dependencies=[allow("view")])
async def detail(request: Request, kind: str, number: int) -> Response:
    """Everything of one record.

    Raises:
        HTTPException: 404, it is not there.
    """
    of = kind_of(request, kind)
    runtime = view_of(request).runtime(request)
    draw = RecordWords(request, of)

    def work(connection: Connection) -> dict[str, Any] | None:
        one = query.get(connection, of, number) if 0 < number < 2**63 else None
        if one is None:
            return None
        others = kinds(runtime.plant)
        overlapping = {
            field.name: query.overlapping(connection, others[field.overlapping], one)
            for field in of.fields.values()
            if field.overlapping in others
        }
        beside = [each for found in overlapping.values() for each in found]
        return {
            "one": one,
            "events": query.events(connection, [one.id])[one.id],
            "overlapping": overlapping,
            "asked": query.people(connection, [one.id, *(each.id for each in beside)]),
            "known": query.definitions(connection, [one.definition, *(each.definition for each in beside)]),
        }

    found = await read(runtime, work)
    if found is None:
        raise HTTPException(404)
    return view_of(request).fragment(
        request, _template(request, of), detail=record_detail.detail(draw, **found), kind_text=draw.text
    )


@router.get("/records/{kind}/export.csv", dependencies=[allow("export")])
async def export(request: Request, kind: str) -> Response:
    """What the filter lets through as CSV: `locale` (hr, en, de, cs, machine), `bom` (1), `shift` (1: with the shift of each)."""
    of = kind_of(request, kind)
    typed = _typed(request, of)
    wanted = wanted_of(request, of, typed)
    runtime, person, lang = view_of(request).runtime(request), person_of(request), language_of(request)
    locale = request.query_params.get("locale", "") or lang
    if locale not in FORMATS:
        raise Refused("history.locale", 422, value=locale[:40], expected=", ".join(FORMATS))
    check_place(request)
    await _check_equipment(request, of, typed["equipment"])
    filters = "; ".join(f"{name}={value}" for name, value in set_filters(typed).items() if name != "view")
    plant = runtime.plant
    settings = RecordExportSettings(
        replace(wanted, before=None),
        zone_of(request),
        locale,
        kind=of,
        bom=request.query_params.get("bom", "") in ("1", "on"),
        **words(runtime.texts, plant, of, locale),
        most_rows=runtime.settings.export_rows,
        filters=filters,
        plant=runtime.texts.label(lang, plant.name) if plant else "",
        person=person.name,
        created=runtime.clock.micros(),
        simulated=runtime.simulated,
        shifts=with_shift(request),
    )
    made = RecordExport(replace(settings, names=names(plant, of, typed["equipment"], settings.label)))
    await read(runtime, made.open)
    await runtime.access.audit.record(
        "records.exported",
        person,
        typed["equipment"],
        address=address_of(request.scope),
        record=of.name,
        filters=filters,
    )
    return Download(request, made)


@router.get("/records/{kind}/export/size", dependencies=[allow("export")])
async def size(request: Request, kind: str) -> Response:
    """How many rows an export would have, and the limit."""
    of = kind_of(request, kind)
    typed = _typed(request, of)
    wanted = replace(wanted_of(request, of, typed), before=None)
    await _check_equipment(request, of, typed["equipment"])
    runtime = view_of(request).runtime(request)
    limit = runtime.settings.export_rows
    found = await read(runtime, lambda connection: query.count(connection, of, wanted, limit or 10**9), much=True)
    return Response(orjson.dumps({"rows": found, "limit": limit}), media_type="application/json")


def _moved(address: str, kind: str) -> None:
    """An address from before there were records leads to where they are now."""

    async def moved(request: Request) -> Response:
        rest = request.url.path.removeprefix(f"/{address}")
        query = f"?{request.url.query}" if request.url.query else ""
        return RedirectResponse(f"/records/{kind}{rest}{query}", 308)

    # no detail: numbers of records are other ones
    for path in ("", "/list", "/export.csv", "/export/size"):
        right = "export" if path.startswith("/export") else "view"
        router.add_api_route(f"/{address}{path}", moved, methods=["GET"], dependencies=[allow(right)])


for _address, _kind in former_addresses(EQUIPMENT).items():
    _moved(_address, _kind)


def kind_of(request: Request, name: str) -> RecordKind:
    """The kind of this name.

    Raises:
        HTTPException: 404, no machine of the plant has such records.
    """
    found = kinds(view_of(request).runtime(request).plant).get(name)
    if found is None:
        raise HTTPException(404)
    return found


def _template(request: Request, kind: RecordKind) -> str:
    """The detail of a kind that brings its own, else that of all."""
    for item in keeping(view_of(request).runtime(request).plant, kind.name):
        own = f"screens/{item.type.name}/record_{kind.name}.html"
        if (bundled("templates") / own).is_file():
            return own
    return "fragments/record_detail.html"


async def _check_equipment(request: Request, kind: RecordKind, id: str) -> None:
    """Refuse to export of a machine that is neither in the plant nor in the history.

    Raises:
        HTTPException: 404.
    """
    runtime = view_of(request).runtime(request)
    if id and not (runtime.plant and id in runtime.plant.equipment):
        known = await read(runtime, lambda connection: query.find(connection, kind, RecordFilter(equipment=id), 1))
        if not known:
            raise HTTPException(404)


# ---- the filter -------------------------------------------------------------------------------------------


def _typed(request: Request, kind: RecordKind) -> dict[str, str]:
    return fields(request, (*NAMES, *kind.filters), LONGEST)


def wanted_of(request: Request, kind: RecordKind, typed: dict[str, str]) -> RecordFilter:
    """What the address asks for, as understood.

    Raises:
        Refused: 422, a field is none of its choices or cannot be read, or the end is not after the beginning.
    """
    for name, choices in (("outcome", kind.outcomes), ("view", (TIMES, LAST) if kind.complete else ())):
        if typed.get(name, "") not in ("", *choices):
            raise Refused("access.form_field", 422, field=name)
    given = {
        name: asked
        for name, one in kind.filters.items()
        if typed[name] and (asked := _asked(one, typed[name])) is not None
    }
    before = place(typed["before"])
    begin, end = span(request, typed)
    newest = record_last.COUNT if typed.get("view") == LAST else None
    return RecordFilter(typed["equipment"], begin, end, typed["outcome"], given, before, newest)


def _asked(one: Filter, text: str) -> float | str | None:
    match one.how:
        case "above":
            return amount(text, one.name, LARGEST)
        case "is":
            return _whole(text.removeprefix("#"), one.name)
        case "any":
            if text not in ("1", ANY):
                raise Refused("access.form_field", 422, field=one.name)
            return ANY
        case "alarm":
            return text if text == ANY else str(_whole(text, one.name))
    return text


def _whole(text: str, field: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= 10 and int(text) < 2**32):
        raise Refused("access.form_field", 422, field=field)
    return int(text)


def _url(kind: RecordKind, chosen: dict[str, str], path: str = "") -> str:
    return f"/records/{kind.name}{path}" + (f"?{urlencode(chosen)}" if chosen else "")


async def _tools(request: Request, kind: RecordKind, typed: dict[str, str]) -> dict[str, Any]:
    draw, view = RecordWords(request, kind), view_of(request)
    runtime, lang, person = draw.runtime, draw.lang, request.state.person
    machines = keeping(runtime.plant, kind.name)
    shown = [item for item in machines if typed["equipment"] in ("", item.id)]
    choosing = [one.name for one in kind.filters.values() if one.how == "choice"]

    def work(connection: Connection) -> dict[str, str]:
        found = [one for item in shown for one in query.choices(connection, kind, item.id)] if choosing else []
        return record_rows.key_choices(draw, found, query.definitions(connection, [one.definition for one in found]))

    keys = await read(runtime, work)
    chosen = set_filters(typed)
    listed = {name: value for name, value in chosen.items() if name != "view"}
    exported = chosen if typed["view"] == LAST else listed
    kept = {name: typed[name] for name in ("equipment", "view") if typed[name]}
    may_export = person is not None and person.may("export")
    others = kinds(runtime.plant)
    return {
        "typed": typed,
        "kind_text": draw.text,
        "address": f"/records/{kind.name}",
        "kinds": [
            (_url(one, {}), RecordWords(request, one).text("title"), name == kind.name) for name, one in others.items()
        ],
        "machine_choices": [(item.id, runtime.texts.label(lang, item.label)) for item in machines],
        "outcome_choices": [(one, draw.text(f"outcome.{one}")) for one in kind.outcomes],
        "filters": [_control(draw, one, typed[one.name], keys) for one in kind.filters.values()],
        "filtered": bool(set(chosen) - {"equipment", "view"}),
        "all_url": _url(kind, kept),
        "views": [
            (_url(kind, listed), view.text(request, "records.list"), not typed["view"]),
            (_url(kind, listed | {"view": TIMES}), view.text(request, "records.times"), typed["view"] == TIMES),
            (
                _url(kind, listed | {"view": LAST}),
                view.text(request, "records.last", n=record_last.COUNT),
                typed["view"] == LAST,
            ),
        ]
        if kind.complete
        else [],
        "export_url": _url(kind, exported | {"locale": lang, "bom": "1", "shift": "1"}, "/export.csv")
        if may_export
        else "",
        "changes": [
            (name, runtime.tags.value(runtime.tags.handle(name)) or 0)
            for item in shown
            if (name := f"sys.events.{item.id}") in runtime.tags
        ],
    }


def _control(draw: RecordWords, one: Filter, typed: str, keys: dict[str, str]) -> dict[str, Any]:
    """A field of the filter: its choices, or none where one types."""
    choices: dict[str, str] = {ANY: draw.text(f"any.{one.name}")} if one.how in OPEN_CHOICE else {}
    if one.how == "alarm":
        choices |= record_rows.alarm_choices(draw)
    if one.how == "choice":
        choices |= keys
    if choices and typed:
        typed = ANY if one.how == "any" else typed
        choices.setdefault(typed, typed)
    return {
        "name": one.name,
        "label": draw.text(f"filter.{one.name}"),
        "choices": list(choices.items()),
        "typed": typed,
        "search": one.how == "is",
        "mode": "numeric" if one.how == "is" else "decimal",
    }


async def _main(request: Request, kind: RecordKind, typed: dict[str, str], wanted: RecordFilter) -> dict[str, Any]:
    """The list, or the times of parts, as the address asks."""
    draw, runtime = RecordWords(request, kind), view_of(request).runtime(request)
    machines = [item.id for item in keeping(runtime.plant, kind.name)]
    ids = [wanted.equipment] if wanted.equipment else machines
    whole, chosen = replace(wanted, before=None), set_filters(typed)
    common = {
        "kind_text": draw.text,
        "list_url": _url(kind, {name: value for name, value in typed.items() if value}, "/list"),
        "detail_url": f"/records/{kind.name}/detail/",
        "live": not typed["before"],
        "several": not typed["equipment"],
        "unstored": runtime.events.unstored(ids),
    }
    if typed["view"] == TIMES:

        def times(connection: Connection) -> list[dict[str, Any]]:
            found = []
            for id in ids:
                only = replace(whole, equipment=id)
                newest = query.find(connection, kind, RecordFilter(equipment=id), 1)
                known = query.definitions(connection, [one.definition for one in newest])
                parts = query.part_times(connection, kind, only)
                found.append(
                    record_times.times(
                        draw, id, parts, *query.times(connection, kind, only, kind.complete), *known.values()
                    )
                )
            return found

        return common | {"machines": await read(runtime, times, much=True)}

    if typed["view"] == LAST:

        def last(connection: Connection) -> dict[str, Any]:
            found = query.find(connection, kind, whole, record_last.COUNT)
            asked = query.people(connection, [one.id for one in found])
            known = query.definitions(connection, [one.definition for one in found if one.definition])
            return record_last.table(draw, found, known, asked, query.parts(connection, [one.id for one in found]))

        return common | await read(runtime, last, much=True)

    def work(connection: Connection) -> dict[str, Any]:
        found = query.find(connection, kind, wanted, PAGE + 1)
        count = query.count(connection, kind, whole, MOST_COUNTED + 1)
        asked = query.people(connection, [one.id for one in found])
        known = query.definitions(connection, [one.definition for one in found if one.definition])
        last = found[PAGE - 1] if len(found) > PAGE else None
        return {
            "columns": record_rows.columns(draw),
            "rows": [record_rows.row(draw, one, known, asked[one.id]) for one in found[:PAGE]],
            "found": min(count, MOST_COUNTED),
            "more": count > MOST_COUNTED,
            "lost": sum(query.lost(connection, id, wanted.begin, wanted.end) for id in ids),
            "older": _url(kind, chosen | {"before": f"{last.begun}-{last.id}"}) if last else "",
            "newest": _url(kind, chosen) if typed["before"] else "",
        }

    return common | await read(runtime, work, much=bool(set(chosen) - {"equipment"}))
