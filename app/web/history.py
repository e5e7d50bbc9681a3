"""History for pages: decimated series as JSON, CSV as a stream."""

import asyncio
import logging
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import quote
from zoneinfo import ZoneInfo

import orjson
from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import Response, StreamingResponse
from sqlalchemy import Connection
from starlette.types import Message, Receive, Scope, Send

from app.errors import ConfigurationError, Refused, StorageError
from app.historian import query
from app.historian.export import FORMATS, Export, ExportSettings, Sheet, meant, moment
from app.plant.definitions import Kind, Point
from app.web.errors import answer
from app.web.guard import address_of, allow, check_points, person_of
from app.web.language import language_of
from app.web.trend_notes import lines_for_export

if TYPE_CHECKING:
    from app.runtime import Runtime

log = logging.getLogger(__name__)

router = APIRouter(prefix="/history")

T = TypeVar("T")

MOST_SERIES = 8
"""Series in one answer."""
MOST_EXPORTS = 2
"""Exports at a time; a third is asked to come later."""
SLOWEST_PORTION = 30.0
"""An export ends when its reader does not take a thousand lines within this [s]."""
LONGEST_EXPORT = 1800.0
"""And when it has not taken all of it within this [s]: a million rows are written in a minute."""
DEFAULT_WIDTH = 1000
LITTLE = 86_400_000_000
"""Curves over more than that, all taken together, are waited for beside exports, and nobody else waits for them [µs]."""
HOUR = "-1h"


@router.get("/series", dependencies=[allow("view")])
async def series(request: Request) -> Response:
    """`tags` (comma separated, at most 8) from `from` to `to` (µs UTC, ISO 8601 or `-8h`; the last hour) as `width` columns.

    The answer: `now`, `alive` (how far the recorder has come), `from`, `to`, `width`, and `series`, each with `tag`, `unit`, `kind`,
    `decimals`, `stepped` (a value holds until the next; else a line), `source`, `step` (width of a column), and columns of equal length:
    `time` (the first, then how much later each is than the one before), `first`, `low`, `high`, `last` (each of these three only where it
    differs from `first`), `quality` (worst level 0 to 2), `count` (0: an edge or a break; both one number when it is that of all
    columns). All times are µs UTC. Draw first, low, high, last of each column and lift the pen at every null. A text has `time` and
    `texts` instead, its changes.
    """
    runtime = runtime_of(request)
    tags = _tags(request, MOST_SERIES)
    check_points(request, tags)
    begin, end = _range(request, runtime)
    width = _number(request, "width", DEFAULT_WIDTH, 1, query.MAX_WIDTH)

    def work(connection: Connection) -> dict[str, Any]:
        known = query.recorded(connection)
        missing = next((tag for tag in tags if tag not in known and tag not in runtime.points), None)
        if missing is not None:
            raise Refused("history.unknown_tag", 404, tag=missing)
        return {
            "now": runtime.clock.micros(),
            "alive": query.alive(connection),
            "from": begin,
            "to": end,
            "width": width,
            "series": [
                _series(connection, tag, known.get(tag), runtime.points.get(tag), begin, end, width) for tag in tags
            ],
        }

    return Response(
        orjson.dumps(await read(runtime, work, much=len(tags) * (end - begin) > LITTLE)),
        media_type="application/json",
        headers={"Cache-Control": "no-store"},
    )


@router.get("/export.csv", dependencies=[allow("export")])
async def export(request: Request) -> Response:
    """`tags` from `from` to `to` as a CSV file: `interval` seconds (0: raw) or `shift`, `locale` (hr, en, de, cs, machine), `bom` (1).

    By shift there is a row for each shift of the plant. It is streamed: nothing of it is kept here, and a browser that gives up ends it.
    """
    runtime, person = runtime_of(request), person_of(request)
    asked = _export_settings(request, runtime)
    made = Export(replace(asked, notes=await lines_for_export(request, asked.tags, asked.begin, asked.end)))
    try:
        await read(runtime, made.open)
    except ConfigurationError as error:
        raise Refused("history.not_recorded", 404, tags=", ".join(made.settings.tags)) from error
    check_place(request)
    settings = made.settings
    await runtime.access.audit.record(
        "history.exported",
        person,
        " ".join(settings.tags)[:120],
        address=address_of(request.scope),
        begin=settings.begin,
        end=settings.end,
        interval=settings.interval or ("shift" if settings.shifts else 0),
    )
    return Download(request, made)


@router.get("/export/size", dependencies=[allow("export")])
async def size(request: Request) -> Response:
    """How many rows an export would have, and the limit: for the dialog that asks for it."""
    runtime = runtime_of(request)
    settings = _export_settings(request, runtime)

    def work(connection: Connection) -> int:
        found = [query.find(connection, tag) for tag in settings.tags]
        if settings.shifts or settings.interval:
            return len(found) * settings.count()
        return sum(query.count(connection, one.number, settings.begin, settings.end) for one in found if one)

    rows = await read(runtime, work, much=True)
    return Response(orjson.dumps({"rows": rows, "limit": settings.most_rows}), media_type="application/json")


@router.get("/export/progress", dependencies=[allow("export")])
async def progress(request: Request) -> Response:
    """The exports of this person that are under way: `file`, `rows` so far, `part` 0 to 1."""
    person = person_of(request)
    mine = [
        {"file": one.file_name, "rows": one.rows, "part": round(one.progress, 4)}
        for one, owner in exports_of(request.app).items()
        if owner == person.id
    ]
    return Response(orjson.dumps(mine), media_type="application/json", headers={"Cache-Control": "no-store"})


async def read(runtime: "Runtime", work: Callable[[Connection], T], *, much: bool = False) -> T:
    """Ask the history; `much`: for what may take longer than others should wait.

    Raises:
        Refused: 503, it cannot be read now.
    """
    try:
        return await (runtime.history.read_long if much else runtime.history.read)(work)
    except StorageError as error:
        raise Refused("history.unavailable", 503) from error


def exports_of(app: FastAPI) -> dict[Sheet, int]:
    """Exports under way, and whose they are."""
    state = app.state
    if not hasattr(state, "exports"):
        state.exports = {}
    found: dict[Sheet, int] = state.exports
    return found


def runtime_of(request: Request) -> "Runtime":
    """The running plant."""
    runtime: Runtime = request.app.state.runtime
    return runtime


def shifts_of(runtime: "Runtime") -> Sequence[int]:
    """When the shifts of the plant begin [minutes of the local day]."""
    return runtime.plant.shifts if runtime.plant else ()


def with_shift(request: Request) -> Sequence[int]:
    """As `shifts_of`, when a list is asked for with the shift of each row (`shift=1`)."""
    return shifts_of(runtime_of(request)) if request.query_params.get("shift", "") in ("1", "on") else ()


def check_place(request: Request) -> None:
    """Refuse an export while there are enough: before anything is read for it.

    Raises:
        Refused: 503.
    """
    if len(exports_of(request.app)) >= MOST_EXPORTS:
        raise Refused("history.busy", 503, n=MOST_EXPORTS)


def attachment(name: str) -> str:
    """`Content-Disposition` of a file `name` (RFC 6266): a plain name for all, and the whole one for who can read it (RFC 8187)."""
    whole = re.sub(r'[\x00-\x1f\x7f-\x9f"*/:<>?\\|]', "_", name)[:150].lstrip(".") or "pogon.csv"
    plain = re.sub(r"[^A-Za-z0-9._-]", "_", whole)
    more = "" if plain == whole else f"; filename*=UTF-8''{quote(whole, safe='', errors='replace')}"
    return f'attachment; filename="{plain}"{more}'


class Download(StreamingResponse):
    """A sheet as a stream. It holds one of the places for exports while it is sent, and no longer, whatever ends it.

    A reader who is too slow for it gets no whole file: the connection is closed, its last line with the checksum is missing.
    """

    def __init__(self, request: Request, made: Sheet) -> None:
        super().__init__(
            made.stream(runtime_of(request).history),
            media_type="text/csv; charset=utf-8",
            headers={
                "Content-Disposition": attachment(made.file_name),
                "Cache-Control": "no-store",
                "X-Accel-Buffering": "no",
            },
        )
        self._request = request
        self._made = made

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        places = exports_of(self._request.app)
        if len(places) >= MOST_EXPORTS:  # others came while this one was written down
            busy = answer(self._request, 503, "history.busy", n=MOST_EXPORTS)
            await busy(scope, receive, send)
            return
        places[self._made] = person_of(self._request).id

        async def send_in_time(message: Message) -> None:
            async with asyncio.timeout(SLOWEST_PORTION):
                await send(message)

        try:
            async with asyncio.timeout(LONGEST_EXPORT):
                await super().__call__(scope, receive, send_in_time)
        except TimeoutError:
            places.pop(self._made, None)
            await self._broken_off()
        finally:
            places.pop(self._made, None)

    async def _broken_off(self) -> None:
        request, name = self._request, self._made.file_name
        log.warning("export ended: read too slowly file=%s rows=%d", name, self._made.rows)
        await runtime_of(request).access.audit.record(
            "history.export_ended",
            person_of(request),
            name,
            result="failed",
            address=address_of(request.scope),
            rows=self._made.rows,
        )


def _series(
    connection: Connection,
    tag: str,
    known: query.Recorded | None,
    point: Point | None,
    begin: int,
    end: int,
    width: int,
) -> dict[str, Any]:
    kind = point.kind.value if point else known.kind if known else Kind.ANALOG.value
    head: dict[str, Any] = {
        "tag": tag,
        "unit": point.unit if point else known.unit if known else "",
        "kind": kind,
        "decimals": point.decimals if point else 3,
        "stepped": kind != Kind.ANALOG,
    }
    if known is None:
        return head | _columns(query.Columns())
    if kind == Kind.TEXT:
        changes = query.texts(connection, known.number, begin, end, width)
        return head | {"time": _later([time for time, _ in changes]), "texts": [text for _, text in changes]}
    return head | _columns(query.columns(connection, known.number, begin, end, width))


def _columns(columns: query.Columns) -> dict[str, Any]:
    """As few digits as say it all: of a day in as many columns as a screen has pixels these are most of the answer."""
    found: dict[str, Any] = {
        "source": columns.source,
        "step": columns.step,
        "time": _later(columns.time),
        "first": columns.first,
    }
    for name in ("low", "high", "last"):
        values = getattr(columns, name)
        if values != columns.first:
            found[name] = values
    for name in ("quality", "count"):
        values = getattr(columns, name)
        found[name] = values[0] if values and values.count(values[0]) == len(values) else values
    return found


def _later(times: list[int]) -> list[int]:
    """The first time, then how much later each is than the one before."""
    return [*times[:1], *(after - before for before, after in pairwise(times))]


def _export_settings(request: Request, runtime: "Runtime") -> ExportSettings:
    begin, end = _range(request, runtime)
    check_points(request, _tags(request, 100))
    locale = request.query_params.get("locale", "") or language_of(request)
    if locale not in FORMATS:
        raise Refused("history.locale", 422, value=locale, expected=", ".join(FORMATS))
    plant, lang = runtime.plant, language_of(request)
    by_shift = request.query_params.get("interval", "").strip() == "shift"
    settings = ExportSettings(
        tags=_tags(request, 100),
        begin=begin,
        end=end,
        zone=_zone(runtime),
        interval=0 if by_shift else _number(request, "interval", 0, 0, 366 * 86_400),
        shifts=shifts_of(runtime) if by_shift else (),
        locale=locale,
        bom=request.query_params.get("bom", "") in ("1", "on"),
        most_rows=runtime.settings.export_rows,
        plant=runtime.texts.label(lang, plant.name) if plant else "",
        person=person_of(request).name,
        created=runtime.clock.micros(),
        simulated=runtime.simulated,
    )
    try:
        settings.check()
    except ConfigurationError as error:
        raise Refused("history.request", 422, problem=str(error)) from error
    return settings


def _tags(request: Request, most: int) -> list[str]:
    named = [tag.strip() for text in request.query_params.getlist("tags") for tag in text.split(",")]
    tags = list(dict.fromkeys(tag for tag in named if tag))
    if not 1 <= len(tags) <= most:
        raise Refused("history.tag_count", 422, n=most)
    return tags


def _range(request: Request, runtime: "Runtime") -> tuple[int, int]:
    zone, now = _zone(runtime), runtime.clock.micros()
    written = [
        request.query_params.get(name, "").strip() or default for name, default in (("from", HOUR), ("to", "now"))
    ]
    out = []
    for text in written:
        try:
            out.append(moment(text, zone, now))
        except ConfigurationError as error:
            raise Refused("history.time", 422, value=text[:40]) from error
    if out[1] <= out[0]:
        begin, end = (meant(text, micros, zone) for text, micros in zip(written, out, strict=True))
        raise Refused("history.range", 422, begin=begin, end=end)
    return out[0], out[1]


def _number(request: Request, name: str, default: int, low: int, high: int) -> int:
    text = request.query_params.get(name, "").strip()
    value: int | None = default if not text else None
    with suppress(ValueError):
        value = int(text) if text and len(text) < 12 else value
    if value is None or not low <= value <= high:
        raise Refused("history.number", 422, name=name, low=low, high=high)
    return value


def _zone(runtime: "Runtime") -> ZoneInfo:
    return ZoneInfo(runtime.plant.timezone) if runtime.plant else ZoneInfo("UTC")
