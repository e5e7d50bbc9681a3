"""Trends: the page, its picker of points, numbers between two moments, alarms on the time axis, the past of sparklines.

The address of the page is the whole view (trend_address.py): `tags` (at most 8, comma separated), either `span` (10s, 10m, 8h, 7d: up to
now, live) or `from` and `to`, the rulers `a` and `b`, the selected pen `pen`, pens that are `off`, how much earlier another period `under`
this one is, and how the value axes are scaled (`axis`). Curves come from
/history/series (app/web/history.py).
"""

import asyncio
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy import Connection

from app.alarms import journal
from app.alarms.journal import Filter
from app.alarms.lifecycle import Entry
from app.errors import Refused, StorageError
from app.historian import query
from app.historian.aggregate import Aggregate, Column, aggregate, first_time
from app.historian.store import GAP_AFTER
from app.plant.definitions import Kind, Point
from app.web import format as fmt
from app.web.alarms import drawing
from app.web.guard import allow, check_points, may_read
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.points import PointView, point_view
from app.web.signin import zone_of
from app.web.trend_address import (
    AXES,
    MOST_PENS,
    PRESETS,
    first_pens,
    names_of,
    opened,
    query_of,
    range_asked,
    view_asked,
)
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
RECORDER_SILENT = 15_000_000
"""The recorder tells that it lives more often than so [µs]."""


@dataclass(frozen=True, slots=True)
class Pen:
    """A curve as page and script know it."""

    number: int
    """1 to 8: colour, dash, marker."""
    point: PointView
    machine: str
    """Name of its machine in the language of the page."""
    on: bool

    @property
    def data(self) -> dict[str, Any]:
        """For the script."""
        point = self.point
        return {
            "tag": point.name,
            "number": self.number,
            "label": point.label,
            "machine": self.machine,
            "unit": point.unit,
            "scale": f"enum:{point.name}" if point.texts else point.unit,
            "decimals": point.decimals,
            "stepped": point.kind is not Kind.ANALOG,
            "normal": point.normal,
            "limits": point.limits,
            "low": point.scale_low,
            "high": point.scale_high,
            "texts": dict(point.texts),
            "on": self.on,
        }


@router.get("/trends", dependencies=[allow("view")])
async def trends(request: Request) -> Response:
    """The page; an address without any tag shows what one looked at last, the first time the speeds of all drives."""
    plant_of(request)
    view = view_of(request)
    if "tags" not in request.query_params and (begun := _beginning(request)):
        return RedirectResponse(f"/trends?{begun}", 303)
    pens = await _pens(request)
    query_of = request.query_params
    wanted = view_asked(request.query_params, _runtime(request).clock.micros(), zone_of(request))
    person = request.state.person
    text = partial(view.text, request)
    tags = [pen.point.name for pen in pens]
    data = {
        "pens": [pen.data for pen in pens],
        "selected": query_of.get("pen", "") if query_of.get("pen", "") in tags else (tags[0] if tags else ""),
        **wanted,
        "keeps": person is not None and person.may("views"),
        "texts": {
            key: text(f"trend.{key}")
            for key in ("ruler", "lacking", "other", "earlier", "csv_sums", "no_picture", "no_data", "unavailable", "empty_range",
                        "not_recorded", "clock_change", "quality", "points", "chart", "visible", "between", "paused")
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
        here=request.url.query,
        add=f"/trends/points?{urlencode({'tags': ','.join(tags)})}",
        zone_name=zone_of(request).key,
    )


@router.get("/trends/points", dependencies=[allow("view")])
async def points(request: Request) -> Response:
    """Points that can be drawn, by machine, those that fit the search `q`; a fragment for the picker."""
    plant, view = plant_of(request), view_of(request)
    wanted = request.query_params.get("q", "").strip().casefold()[:80]
    chosen = names_of(request.query_params)
    groups: list[tuple[str, str, list[tuple[str, str, str, bool]]]] = []
    left = MOST_FOUND
    for equipment in plant.equipment.values():
        await asyncio.sleep(0)
        machine = view.machine(request, equipment)
        found = []
        for key, point in equipment.points.items():
            if not _drawable(point) or point.name not in _runtime(request).points or not may_read(request, point):
                continue
            drawn = machine.point(key)
            haystack = f"{machine.label} {drawn.label} {point.name} {drawn.unit}".casefold()
            if all(word in haystack for word in wanted.split()):
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
        link=lambda name: f"/trends?{query_of({'tags': ','.join([*chosen, name])})}",
    )


@router.get("/trends/table", dependencies=[allow("view")])
async def table(request: Request) -> Response:
    """Per tag between `from` and `to`: low and high with when they first were (from and to, the same where a sample tells), the mean
    weighted by time of what was good, the share of good time and the time that is `lacking` [µs], and what held at both ends (the rulers).

    What the recorder did not see is lacking, also when it has stopped since; only what is still to come is not.
    """
    runtime = _runtime(request)
    names, (begin, end), now = _known(request, MOST_PENS), _range(request), runtime.clock.micros()

    def work(connection: Connection) -> list[dict[str, Any]]:
        alive = query.alive(connection)
        known = min(end, alive)
        seen = known if now - alive < RECORDER_SILENT else min(end, now)
        return [_statistics(connection, name, begin, end, known, max(0, seen - begin)) for name in names]

    return _json({"from": begin, "to": end, "rows": await _read(runtime, work)})


@router.get("/trends/marks", dependencies=[allow("view")])
async def alarm_markers(request: Request) -> Response:
    """Alarms of the machines of `tags` that came between `from` and `to`, the newest 200: time, priority, text, machine."""
    runtime = _runtime(request)
    names, (begin, end) = _known(request, MOST_PENS), _range(request)
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

    found = sorted(await runtime.db.read(work), key=lambda record: -record.time)[:MOST_MARKS]
    return _json(
        {
            "marks": [
                {
                    "time": record.time,
                    "priority": record.priority,
                    "text": draw.recorded(record),
                    "source": record.equipment,
                }
                for record in found
            ]
        }
    )


@router.get("/trends/recent", dependencies=[allow("view")])
async def recent(request: Request) -> Response:
    """The last 10 minutes of up to 200 tags for sparklines: `series` of [time µs, value or null]; one request for a whole page."""
    runtime = _runtime(request)
    names = _known(request, MOST_SPARKS)
    now = runtime.clock.micros()

    def work(connection: Connection) -> dict[str, list[tuple[int, float | None]]]:
        known = query.recorded(connection)
        return {
            name: _line(query.columns(connection, known[name].number, now - SPARK_SPAN, now, SPARK_WIDTH))
            for name in names
            if name in known
        }

    return _json({"now": now, "series": await _read(runtime, work)})


# ---- what is asked for ------------------------------------------------------------------------------------


def _runtime(request: Request) -> "Runtime":
    return view_of(request).runtime(request)


async def _read(runtime: "Runtime", work: Any) -> Any:
    """Read the history.

    Raises:
        Refused: 503, it cannot be read.
    """
    try:
        return await runtime.history.read(work)
    except StorageError as error:
        raise Refused("trend.unavailable", 503) from error


def _beginning(request: Request) -> str:
    """The query to begin with; what the address does say (a span) wins."""
    runtime, person, asked = _runtime(request), request.state.person, request.query_params
    said = [(key, value) for key, value in asked.multi_items() if key != "tags"]

    def usable(name: str) -> bool:
        point = runtime.points.get(name)
        return point is not None and _drawable(point) and may_read(request, point)

    last = last_view(request, person) if person is not None and person.may("views") and not said else ""
    if begun := opened(last, usable, runtime.clock.micros(), zone_of(request)):
        return begun
    first = first_pens(plant_of(request))
    return query_of([("tags", ",".join(first)), *said]) if first else ""


def _range(request: Request) -> tuple[int, int]:
    return range_asked(request.query_params, _runtime(request).clock.micros(), zone_of(request))


def _known(request: Request, most: int) -> list[str]:
    names = names_of(request.query_params)
    if not names:
        raise Refused("trend.error.no_tags", 422)
    if len(names) > most:
        raise Refused("trend.error.too_many", 422, n=len(names), most=most)
    check_points(request, names)
    return names


async def _pens(request: Request) -> list[Pen]:
    """The pens of the address.

    Raises:
        Refused: 422, more than 8, a tag that nobody knows, one that cannot be drawn.
    """
    view, runtime, lang = view_of(request), _runtime(request), language_of(request)
    names = names_of(request.query_params)
    if len(names) > MOST_PENS:
        raise Refused("trend.error.too_many", 422, n=len(names), most=MOST_PENS)
    check_points(request, names)
    strange = [name for name in names if name not in runtime.points]
    old: dict[str, query.Recorded | None] = {}
    if strange:
        found = await _read(runtime, lambda connection: {name: query.find(connection, name) for name in strange})
        old = dict(found)
    off = set(request.query_params.get("off", "").split(","))
    pens: list[Pen] = []
    text = partial(view.text, request)
    for name in names:
        point, machine = runtime.points.get(name), ""
        if point is None:
            recorded = old[name]
            if recorded is None:
                raise Refused("trend.error.unknown_tag", 422, tag=name[:80])
            point = Point(
                name=name, id=recorded.id, equipment="", key=name, label=name, unit=recorded.unit, decimals=2,
                kind=Kind(recorded.kind),
            )  # fmt: skip
        if not _drawable(point):
            raise Refused("trend.error.not_drawable", 422, tag=name[:80])
        equipment = runtime.plant.equipment.get(point.equipment) if runtime.plant else None
        if equipment is not None:
            drawn = view.machine(request, equipment)
            shown, machine = drawn.point(point.key), drawn.label
        else:
            label = text(point.label) if runtime.texts.has(lang, point.label) else name
            shown = point_view(point, runtime, lang, text, label=label)
        pens.append(Pen(len(pens) + 1, shown, machine, name not in off))
    return pens


def _drawable(point: Point) -> bool:
    return point.history and point.kind is not Kind.TEXT and point.unit != "time"


def _statistics(connection: Connection, name: str, begin: int, end: int, known: int, length: int) -> dict[str, Any]:
    """One row of the table: known up to `known`, and `length` of the range is past [µs]."""
    found, numbers = query.find(connection, name), Aggregate()
    row: dict[str, Any] = {"tag": name, "a": None, "b": None, "low_at": None, "high_at": None}
    if found is not None and known > begin:
        numbers = aggregate(connection, found.number, begin, known)
        extremes: tuple[tuple[Column, float | None], ...] = (("low", numbers.low), ("high", numbers.high))
        for column, value in extremes:
            if value is not None:
                row[f"{column}_at"] = first_time(connection, found.number, begin, known, value, column)
    if found is not None:
        row |= {ruler: _held(connection, found.number, at, known) for ruler, at in (("a", begin), ("b", end))}
    good = min(numbers.good, length)
    share = good / length if length else 0.0
    numbers_of = {"low": numbers.low, "high": numbers.high, "mean": numbers.mean}
    return row | numbers_of | {"good": share, "lacking": length - good}


def _held(connection: Connection, number: int, time: int, alive: int) -> list[Any] | None:
    """What held at `time`: value and quality level; None when nothing was recorded then."""
    found = query.at(connection, number, time)
    if found is None or time - found[0] > GAP_AFTER or time > alive + GAP_AFTER:
        return None
    return [found[1], found[2] & 3]


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
