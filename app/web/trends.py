"""Trends: the page, its picker of points, alarms on the time axis, the past of sparklines.

The address of the page is the whole view (trend_address.py): `tags` (at most 8, comma separated), either `span` (10s, 10m, 8h, 7d: up to
now, live) or `from` and `to`, the rulers `a` and `b`, the selected pen `pen`, pens that are `off`, how much earlier another period `under`
this one is, and how the value axes are scaled (`axis`). Curves come from
/history/series (app/web/history.py).
"""

import asyncio
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy import Connection
from starlette.datastructures import QueryParams

from app.alarms import journal
from app.alarms.journal import Filter
from app.alarms.lifecycle import Entry
from app.errors import Refused
from app.historian import query
from app.web import format as fmt
from app.web.alarms import drawing
from app.web.guard import allow, check_points, may_read
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.palette import folded
from app.web.signin import zone_of
from app.web.trend_address import (
    AXES,
    MOST_PENS,
    PRESETS,
    first_pens,
    names_of,
    on_screen,
    opened,
    query_of,
    seen,
    view_asked,
    with_pens,
)
from app.web.trend_pens import drawable, pens_of, read_history
from app.web.trend_table import empty
from app.web.trend_views import last_view, views_of

if TYPE_CHECKING:
    from app.runtime import Runtime

router = APIRouter()

MOST_SPARKS = 200
"""Sparklines of one page."""
SPARK_SPAN = 600_000_000
"""What a sparkline shows [µs]."""
SPARK_WIDTH = 120
MOST_FOUND = 80
"""Points that the picker lists; more ask for a narrower search."""
MOST_MARKS = 200


@dataclass(frozen=True, slots=True)
class Mark:
    """An alarm on the axis of time."""

    time: int
    priority: int
    when: str
    source: str
    """Its machine."""
    text: str


@router.get("/trends", dependencies=[allow("view")])
async def trends(request: Request) -> Response:
    """The page; an address without any tag shows what one looked at last, the first time the speeds of all drives."""
    plant_of(request)
    view = view_of(request)
    if "tags" not in request.query_params and (begun := _beginning(request)):
        return RedirectResponse(f"/trends?{begun}", 303)
    pens = await pens_of(request, request.query_params)
    query_of = request.query_params
    wanted = view_asked(request.query_params, _runtime(request).clock.micros(), zone_of(request))
    person = request.state.person
    text = partial(view.text, request)
    tags = [pen.point.name for pen in pens]
    data = {
        "pens": [pen.data for pen in pens],
        "selected": query_of.get("pen", "") if query_of.get("pen", "") in tags else (tags[0] if tags else ""),
        **wanted,
        "texts": {
            key: text(f"trend.{key}")
            for key in ("other", "no_picture", "no_data", "unavailable", "empty_range", "not_recorded", "clock_change", "quality",
                        "points", "chart", "paused")
        },
    }  # fmt: skip
    return view.page(
        request,
        "pages/trends.html",
        title=text("trend.title"),
        kind=f"tags/{','.join(tags)}",
        pens=pens,
        most=MOST_PENS,
        presets=[(name, _span_label(name)) for name in PRESETS],
        span=wanted["name"],
        axes=[(name, text(f"trend.axis.{name}")) for name in AXES],
        axis=wanted["axis"],
        trend=orjson.dumps(data).decode(),
        may_export=person is not None and person.may("export"),
        views=await views_of(request) if person is not None and person.may("views") else None,
        asked=request.url.query,
        table=empty(pens),
        zone_name=zone_of(request).key,
    )


@router.get("/trends/points", dependencies=[allow("view")])
async def points(request: Request) -> Response:
    """Points that can be drawn, by machine, those that fit the search `q`; a fragment for the picker."""
    plant, view, person = plant_of(request), view_of(request), request.state.person
    wanted = folded(request.query_params.get("q", "").strip()[:80]).split()
    asked = on_screen(request.query_params)
    chosen = names_of(asked)
    groups: list[tuple[str, str, list[tuple[str, str, str, bool]]]] = []
    left = MOST_FOUND
    for equipment in plant.equipment.values():
        await asyncio.sleep(0)
        machine = view.machine(request, equipment)
        found = []
        for key, point in equipment.points.items():
            if not drawable(point) or point.name not in _runtime(request).points or not may_read(request, point):
                continue
            drawn = machine.point(key)
            haystack = folded(f"{machine.label} {drawn.label} {point.name} {drawn.unit}")
            if all(word in haystack for word in wanted):
                found.append((point.name, drawn.label, drawn.unit, point.name in chosen))
        if found and left > 0:
            groups.append((machine.label, equipment.id, found[:left]))
        left -= len(found)
    return view.fragment(
        request,
        "fragments/trend_points.html",
        groups=groups,
        more=max(0, -left),
        full=len(chosen) >= MOST_PENS,
        most=MOST_PENS,
        engineer=person is not None and person.may("configure"),
    )


@router.get("/trends/pens", dependencies=[allow("view")])
async def other_pens(request: Request) -> Response:
    """The view on the screen `with` one more pen, or `without` one of its pens."""
    query = request.query_params
    asked, new = on_screen(query), query.get("with")
    names = [*(name for name in names_of(asked) if name != query.get("without")), *([new] if new else [])]
    return RedirectResponse(f"/trends?{with_pens(asked, names)}", 303)


@router.get("/trends/marks", dependencies=[allow("view")])
async def alarm_markers(request: Request) -> Response:
    """Alarms of the machines of a view that came within it, the newest 200; as a fragment, in words and with where they are drawn."""
    runtime, zone, lang = _runtime(request), zone_of(request), language_of(request)
    asked, now = on_screen(request.query_params), runtime.clock.micros()
    names, (begin, end) = _known(request, asked, MOST_PENS), seen(asked, now, zone)
    draw = drawing(request)
    machines = {name.split(".")[0] for name in names}

    def work(connection: Connection) -> list[journal.Record]:
        return [
            record
            for machine in sorted(machines)
            for record in journal.find(
                connection, Filter(equipment=machine, event=str(Entry.RAISED), since=begin, until=end), MOST_MARKS
            )
        ]

    found = sorted(await runtime.db.read_long(work), key=lambda record: -record.time)[:MOST_MARKS]
    marks = [
        Mark(one.time, one.priority, fmt.date_time(one.time, zone, lang, now), one.equipment, draw.recorded(one))
        for one in found
    ]
    return view_of(request).fragment(request, "fragments/trend_marks.html", marks=marks)


@router.get("/trends/recent", dependencies=[allow("view")])
async def recent(request: Request) -> Response:
    """The last 10 minutes of up to 200 tags for sparklines: `series` of [time µs, value or null]; one request for a whole page."""
    runtime = _runtime(request)
    names = _known(request, request.query_params, MOST_SPARKS)
    now = runtime.clock.micros()

    def work(connection: Connection) -> dict[str, list[tuple[int, float | None]]]:
        known = query.recorded(connection)
        return {
            name: _line(query.columns(connection, known[name].number, now - SPARK_SPAN, now, SPARK_WIDTH))
            for name in names
            if name in known
        }

    return _json({"now": now, "series": await read_history(runtime, work)})


# ---- what is asked for ------------------------------------------------------------------------------------


def _runtime(request: Request) -> "Runtime":
    return view_of(request).runtime(request)


def _beginning(request: Request) -> str:
    """The query to begin with; what the address does say (a span) wins."""
    runtime, person, asked = _runtime(request), request.state.person, request.query_params
    said = [(key, value) for key, value in asked.multi_items() if key != "tags"]

    def usable(name: str) -> bool:
        point = runtime.points.get(name)
        return point is not None and drawable(point) and may_read(request, point)

    last = last_view(request, person) if person is not None and person.may("views") and not said else ""
    if begun := opened(last, usable, runtime.clock.micros(), zone_of(request)):
        return begun
    first = first_pens(plant_of(request))
    return query_of([("tags", ",".join(first)), *said]) if first else ""


def _known(request: Request, asked: QueryParams, most: int) -> list[str]:
    names = names_of(asked)
    if not names:
        raise Refused("trend.error.no_tags", 422)
    if len(names) > most:
        raise Refused("trend.error.too_many", 422, n=len(names), most=most)
    check_points(request, names)
    return names


def _line(columns: query.Columns) -> list[tuple[int, float | None]]:
    """Columns as one line: first, lowest, highest, last; None where the pen is lifted."""
    out: list[tuple[int, float | None]] = []
    for time, first, low, high, last in zip(
        columns.time, columns.first, columns.low, columns.high, columns.last, strict=True
    ):
        run = [first] if low == high == first == last else [first, low, high, last]
        out += [(time, value) for value in run]
    return out


def _span_label(name: str) -> str:
    return f"{name[:-1]}{fmt.SPACE}{'min' if name[-1] == 'm' else name[-1]}"


def _json(content: object) -> Response:
    return Response(orjson.dumps(content), media_type="application/json", headers={"Cache-Control": "no-store"})
