"""How well the alarms serve the operator: the figures of app/alarms/statistics.py on a page and as CSV, each with its limit."""

import asyncio
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlencode
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import Connection

from app.alarms import journal
from app.alarms.journal import Record
from app.alarms.statistics import DAY, ENOUGH, HOUR, MOST_IN_BUCKET, TOP, Figures, Measure, Run, measures
from app.alarms.statistics_query import read_figures
from app.errors import Refused
from app.plant.system import SYSTEM
from app.web import format as fmt
from app.web.alarm_view import PRIORITY_NAMES, Drawing, lasting
from app.web.alarms import area_choices, drawing, tabs
from app.web.audit import read_time
from app.web.csv_lines import cells, locale_of
from app.web.guard import allow, person_of
from app.web.language import language_of
from app.web.view import View

router = APIRouter()

SPANS = {"shift": 8 * HOUR, "day": DAY, "week": 7 * DAY, "month": 30 * DAY, "quarter": 90 * DAY}
"""Periods that end now [µs]; text `alarm.stats.span.<key>`."""
LONGEST = 366 * DAY
"""A period is no longer [µs]."""
LONGEST_WAIT = 10.0
"""For the figures that somebody else asked for [s]; then they are asked to come later."""
POSITIONS = range(1, 10)
ROWS = 10
"""Lines of each list on the page; the CSV has them all."""
WIDTH, HEIGHT = 720, 150
"""Of the drawing of the rate, in its own units."""
COLUMNS = 144
"""Most columns of that drawing."""
CSV_COLUMNS = (
    "section", "key", "text", "source", "value", "unit", "share_percent", "target", "limit", "verdict", "from_utc", "to_utc",
)  # fmt: skip
_UTC = ZoneInfo("UTC")
_NAMES = ("area", "span", "positions", "since", "until")


@dataclass(frozen=True, slots=True)
class Asked:
    """What the address asks for."""

    typed: Mapping[str, str]
    begin: int
    end: int
    positions: int
    area: str

    @property
    def query(self) -> str:
        """The same, for another address."""
        return urlencode({name: value for name, value in self.typed.items() if value})


@dataclass(frozen=True, slots=True)
class Answered:
    """The figures, and the newest record of every alarm that they name."""

    figures: Figures | None
    named: Mapping[str, Record] = field(default_factory=dict)


@router.get("/alarms/statistics", dependencies=[allow("view")])
async def statistics(request: Request) -> Response:
    """The figures of a time, each with its limit and a verdict."""
    view: View = request.app.state.view
    asked = _asked(request)
    answered = await _read(request, asked)
    draw = drawing(request)
    return view.page(
        request,
        "pages/alarm_statistics.html",
        title=view.text(request, "alarm.stats.title"),
        kind="frame",
        wanted=asked.typed,
        **tabs(request, {"area": asked.area} if asked.area else {}),
        area_choices=area_choices(request),
        span_choices=[(key, view.text(request, f"alarm.stats.span.{key}")) for key in SPANS],
        position_choices=[str(one) for one in POSITIONS],
        export_url=f"/alarms/statistics.csv?{asked.query}&locale={language_of(request)}"
        if _may_export(request)
        else "",
        stats=_shown(draw, answered.figures, answered.named) if answered.figures else None,
    )


@router.get("/alarms/statistics.csv", dependencies=[allow("export")])
async def export(request: Request) -> Response:
    """The same figures, and the whole of every list, as CSV; `locale`: hr, en, de, cs, or machine, which it is without."""
    view: View = request.app.state.view
    asked, locale = _asked(request), locale_of(request)
    answered = await _read(request, asked)
    said = "; ".join(f"{name}={value}" for name, value in asked.typed.items() if value)
    await view.runtime(request).access.audit.record("alarm.exported", person_of(request), filters=f"statistics; {said}")
    draw = drawing(request)
    found = answered.figures
    lines = [[f"# {said}"], CSV_COLUMNS, *(_lines(draw, found, answered.named) if found else ())]
    return Response(
        "\ufeff".encode() + b"".join(cells(line, locale) for line in lines),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": 'attachment; filename="alarm-statistics.csv"'},
    )


def _may_export(request: Request) -> bool:
    person = request.state.person
    return person is not None and person.may("export")


def _asked(request: Request) -> Asked:
    """What the address asks for: a span that ends now, or two times.

    Raises:
        Refused: 422, a field is there twice, is none of its choices, or the times are not in order.
    """
    query = request.query_params
    for name in _NAMES:
        if len(query.getlist(name)) > 1:
            raise Refused("access.form_field", 422, field=name)
    typed = {name: query.get(name, "").strip()[:120] for name in _NAMES}
    typed["span"], typed["positions"] = typed["span"] or "week", typed["positions"] or "1"
    areas = ["", *(key for key, _ in area_choices(request))]
    for name, choices in (("span", [*SPANS, "own"]), ("positions", [str(one) for one in POSITIONS]), ("area", areas)):
        if typed[name] not in choices:
            raise Refused("access.form_field", 422, field=name)
    now = request.app.state.view.runtime(request).clock.micros() + 1  # what came in this very moment belongs to it
    begin, end = _period(request, typed, now)
    return Asked(typed, begin, end, int(typed["positions"]), typed["area"])


def _period(request: Request, typed: dict[str, str], now: int) -> tuple[int, int]:
    if typed["span"] != "own":
        typed["since"] = typed["until"] = ""
        return now - SPANS[typed["span"]], now
    since, until = read_time(request, typed["since"], "since"), read_time(request, typed["until"], "until")
    end = min(now, until if until is not None else now)
    if since is None or not 0 < end - since <= LONGEST:
        raise Refused("alarm.stats.wrong_period", 422, n=LONGEST // DAY)
    return since, end


async def _read(request: Request, asked: Asked) -> Answered:
    def work(connection: Connection) -> Answered:
        found = read_figures(connection, asked.begin, asked.end, asked.positions, asked.area)
        return Answered(found, journal.newest(connection, _alarms(found))) if found else Answered(None)

    view: View = request.app.state.view
    place = _place(request)
    try:
        async with asyncio.timeout(LONGEST_WAIT):
            await place.acquire()
    except TimeoutError:
        raise Refused("error.unavailable", 503) from None
    try:
        return await view.runtime(request).db.read_long(work)
    finally:
        place.release()


def _place(request: Request) -> asyncio.Lock:
    """Held while the figures of somebody are counted: what other pages read of the journal goes on beside it."""
    state = request.app.state
    if not hasattr(state, "alarm_statistics"):
        state.alarm_statistics = asyncio.Lock()
    found: asyncio.Lock = state.alarm_statistics
    return found


def _alarms(found: Figures) -> set[str]:
    """Alarms whose names are asked for: those of the page, and not every one of a year."""
    frequent = [alarm for alarm, _ in found.by_alarm[:500]]
    return {*frequent, *(run.alarm for run in found.standing), *found.chattering, *found.fleeting}


# ---- the page ---------------------------------------------------------------------------------------------


def _shown(draw: Drawing, found: Figures, named: Mapping[str, Record]) -> dict[str, Any]:
    most = max(found.by_priority.values())
    return {
        "period": _between(draw, found.begin, found.end),
        "short": found.end - found.begin < ENOUGH,
        "total": found.total,
        "hidden": found.hidden,
        "measures": [_measure(draw, one) for one in measures(found)],
        "rate": _rate(draw, found),
        "top": _counted(draw, named, found.by_alarm[:TOP], found.total),
        "priorities": [
            {
                "priority": one,
                "name": draw.texts.text(draw.lang, f"alarm.priority.{PRIORITY_NAMES[one]}"),
                "count": n,
                "share": fmt.percent(100 * n / found.total, 1, draw.lang) if found.total else "–",
                "width": round(100 * n / most, 1) if most else 0,
                "asked": found.delays[one].asked,
                "acknowledged": found.delays[one].acknowledged,
                "median": _seconds(draw, found.delays[one].median),
                "ninth": _seconds(draw, found.delays[one].ninth),
            }
            for one, n in sorted(found.by_priority.items())
        ],
        "floods": [
            (
                _between(draw, one.begin, one.end),
                "" if one.goes_on else lasting((one.end - one.begin) / 1e6),
                one.alarms,
                one.peak,
            )
            for one in sorted(found.floods, key=lambda flood: -flood.alarms)[:ROWS]
        ],
        "flood_count": len(found.floods),
        "standing": [_standing(draw, named, one) for one in found.standing[:ROWS]],
        "standing_count": len(found.standing),
        "chattering": _counted(draw, named, _most(found.chattering)[:ROWS], found.total),
        "chattering_count": len(found.chattering),
        "fleeting": _counted(draw, named, _most(found.fleeting)[:ROWS], found.total),
        "fleeting_count": len(found.fleeting),
    }


def _measure(draw: Drawing, one: Measure) -> dict[str, str]:
    return {
        "name": draw.texts.text(draw.lang, f"alarm.stats.measure.{one.key}"),
        "value": "–" if one.value is None else _amount(draw, one.value, one.unit),
        "target": _amount(draw, one.target, one.unit),
        "most": _amount(draw, one.most, one.unit),
        "verdict": one.verdict,
        "words": draw.texts.text(draw.lang, f"alarm.stats.verdict.{one.verdict}"),
    }


def _amount(draw: Drawing, value: float, unit: str) -> str:
    """With as many decimals as tell it from its limit, and never a nought for something that is there."""
    decimals = 2 if value < 10 else 1
    if 0 < value < 0.005:
        return f"<{fmt.SPACE}{fmt.number(0.01, 2, draw.lang)}{unit if unit.startswith('/') else fmt.SPACE + unit}"
    text = fmt.number(value, fmt.shortest(value, decimals), draw.lang)
    return f"{text}{unit}" if unit.startswith("/") else f"{text}{fmt.SPACE}{unit}" if unit else text


def _seconds(draw: Drawing, value: float | None) -> str:
    return "–" if value is None else fmt.duration(value, draw.lang)


def _between(draw: Drawing, begin: int, end: int) -> str:
    return f"{_minute(draw, begin)} – {_minute(draw, end)}"


def _minute(draw: Drawing, micros: int) -> str:
    day = fmt.date(micros, draw.zone, draw.lang, year=False)
    return f"{day} {fmt.clock_time(micros, draw.zone, seconds=False, lang=draw.lang)}"


def _most(counts: Mapping[str, int]) -> list[tuple[str, int]]:
    return sorted(counts.items(), key=lambda one: (-one[1], one[0]))


def _name(draw: Drawing, named: Mapping[str, Record], alarm: str) -> tuple[str, str]:
    """Chip of the source and the text, in the reader's language."""
    record = named.get(alarm)
    return (record.equipment or SYSTEM, draw.recorded(record)) if record else (alarm.partition(".")[0], alarm)


def _counted(
    draw: Drawing, named: Mapping[str, Record], counts: Sequence[tuple[str, int]], total: int
) -> list[dict[str, Any]]:
    most = counts[0][1] if counts else 1
    found = []
    for alarm, n in counts:
        source, text = _name(draw, named, alarm)
        found.append(
            {
                "source": source,
                "text": text,
                "count": n,
                "share": fmt.percent(100 * n / total, 1, draw.lang) if total else "–",
                "width": round(100 * n / most, 1),
                "url": "/alarms?" + urlencode({"tab": "journal", "q": alarm, "event": "RAISED"}),
            }
        )
    return found


def _standing(draw: Drawing, named: Mapping[str, Record], run: Run) -> dict[str, Any]:
    source, text = _name(draw, named, run.alarm)
    return {
        "source": source,
        "text": text,
        "since": _minute(draw, run.begin),
        "lasted": lasting((run.end - run.begin) / 1e6),
        "goes_on": run.goes_on,
    }


def _rate(draw: Drawing, found: Figures) -> dict[str, Any]:
    """Columns of the drawing: each is the busiest ten minutes of its part of the time."""
    together = math.ceil(len(found.buckets) / COLUMNS)
    peaks = [max(found.buckets[at : at + together]) for at in range(0, len(found.buckets), together)]
    limit = MOST_IN_BUCKET * found.positions
    top = max(*peaks, limit) * 1.15 if len(peaks) > 1 else max(peaks[0], limit) * 1.15
    width = WIDTH / len(peaks)
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "columns": [
            {
                "x": round(index * width + width * 0.1, 2),
                "width": round(width * 0.8, 2),
                "y": round(HEIGHT * (1 - peak / top), 2),
                "height": round(HEIGHT * peak / top, 2),
                "over": peak > limit,
            }
            for index, peak in enumerate(peaks)
            if peak
        ],
        "floods": [
            {
                "x": round(WIDTH * (one.begin - found.begin) / (found.end - found.begin), 2),
                "width": round(max(1.0, WIDTH * (one.end - one.begin) / (found.end - found.begin)), 2),
            }
            for one in found.floods
        ],
        "limit_y": round(HEIGHT * (1 - limit / top), 2),
        "limit": limit,
        "peak": max(peaks),
        "minutes": 10 * together,
        "begin": _minute(draw, found.begin),
        "middle": _minute(draw, (found.begin + found.end) // 2),
        "end": _minute(draw, found.end),
    }


# ---- CSV --------------------------------------------------------------------------------------------------


def _lines(draw: Drawing, found: Figures, named: Mapping[str, Record]) -> Iterator[Sequence[object]]:
    begin, end = fmt.iso(found.begin, _UTC), fmt.iso(found.end, _UTC)

    def line(
        section: str, key: object, value: object, unit: str = "", share: object = "", **more: Any
    ) -> Sequence[object]:
        source, text = more.get("name", ("", ""))
        judged: Iterable[object] = more.get("judged", ("", "", ""))
        first, last = more.get("times", (begin, end))
        return [section, str(key), text, source, value, unit, share, *judged, first, last]

    yield line("total", "annunciated", found.total)
    yield line("total", "hidden", found.hidden)
    yield line("total", "positions", found.positions)
    for one in measures(found):
        value = "" if one.value is None else round(one.value, 4)
        yield line("measure", one.key, value, one.unit, judged=(one.target, one.most, one.verdict))
    for priority, n in sorted(found.by_priority.items()):
        delay = found.delays[priority]
        yield line("priority", priority, n, "", _part(n, found.total))
        yield line("acknowledged", priority, delay.acknowledged, "", _part(delay.acknowledged, delay.asked))
        yield line("acknowledge_median", priority, "" if delay.median is None else round(delay.median, 3), "s")
        yield line("acknowledge_90", priority, "" if delay.ninth is None else round(delay.ninth, 3), "s")
    lists = (("frequent", found.by_alarm), ("chattering", _most(found.chattering)), ("fleeting", _most(found.fleeting)))
    for section, counts in lists:
        for alarm, n in counts:
            yield line(section, alarm, n, "", _part(n, found.total), name=_name(draw, named, alarm))
    for run in found.standing:
        times = (fmt.iso(run.begin, _UTC), "" if run.goes_on else fmt.iso(run.end, _UTC))
        seconds = round((run.end - run.begin) / 1e6, 3)
        yield line("standing", run.alarm, seconds, "s", name=_name(draw, named, run.alarm), times=times)
    for flood in found.floods:
        times = (fmt.iso(flood.begin, _UTC), "" if flood.goes_on else fmt.iso(flood.end, _UTC))
        yield line("flood", f"peak {flood.peak}", flood.alarms, times=times)


def _part(n: int, total: int) -> object:
    return round(100 * n / total, 4) if total else ""
