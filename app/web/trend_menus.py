"""Menus over a trend, drawn when they are opened: its own range, another period under it, what can be taken along.

What is chosen goes back as the event `trend` of the page (HX-Trigger): `from` and `to`, `under` and rulers [µs], and the curves follow.
"""

from typing import Any
from urllib.parse import urlencode

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.errors import Refused
from app.historian.calendar import days_before
from app.web import format as fmt
from app.web.guard import allow
from app.web.language import language_of
from app.web.pages import view_of
from app.web.signin import zone_of
from app.web.trend_address import LONGEST, names_of, on_screen, seen, typed_form, typed_micros, view_asked

router = APIRouter(prefix="/trends")

DAY = 86_400_000_000
DAYS = {"24h": 1, "7d": 7}
"""How many days earlier the other period may begin, by the clock on the wall."""
SUMS_OF = 1_000_000_000
"""An export of sums has at least 1 s and at most about a thousand lines: this many times less than what is seen [µs of the range per s]."""


@router.get("/range", dependencies=[allow("view")])
async def own_range(request: Request) -> Response:
    """The form for a range, or the range that was typed in it."""
    begin, end = _seen(request)
    typed = {key: request.query_params.get(key) for key in ("from", "to")}
    if None in typed.values():
        zone = zone_of(request)
        written = {"from": typed_form(begin, zone), "to": typed_form(end, zone)}
        return view_of(request).fragment(request, "fragments/trend_range.html", typed=written, wrong=False)
    try:
        begin, end = (typed_micros(text or "", zone_of(request), end=key == "to") for key, text in typed.items())
    except Refused:
        begin = end = 0
    if begin >= end:
        return view_of(request).fragment(request, "fragments/trend_range.html", typed=typed, wrong=True)
    return _chosen({"from": begin, "to": end})


@router.get("/compare", dependencies=[allow("view")])
async def compare(request: Request) -> Response:
    """The menu of periods that can lie under this one, or the one that was chosen: `under`, or its own `begin`."""
    runtime, zone, query = view_of(request).runtime(request), zone_of(request), request.query_params
    begin, end = _seen(request)
    wanted = view_asked(on_screen(query), runtime.clock.micros(), zone)
    now_under = round((wanted["under"] or 0) * 1_000_000)
    lengths = {"none": 0, "span": end - begin}
    lengths |= {name: begin - days_before(begin, days, zone) for name, days in DAYS.items()}
    rulers = sorted({at for at in (wanted["a"], wanted["b"]) if at is not None})
    typed, wrong = query.get("begin"), False
    if query.get("under") in lengths:
        return _chosen({"under": lengths[query["under"]]})
    if query.get("under") == "rulers" and len(rulers) == 2:
        half = (end - begin) // 2
        earlier, later = rulers
        return _chosen({"under": later - earlier, "a": later, "b": None, "from": later - half, "to": later + half})
    if typed is not None:
        try:
            earlier = begin - typed_micros(typed, zone)
        except Refused:
            earlier = 0
        if 0 < earlier <= LONGEST * 1_000_000:
            return _chosen({"under": earlier})
        wrong = True
    return view_of(request).fragment(
        request,
        "fragments/trend_compare.html",
        chosen=next((name for name, length in lengths.items() if length == now_under), ""),
        names=tuple(lengths),
        may_rulers=len(rulers) == 2,
        begin=typed_form(begin - (now_under or DAY), zone) if typed is None else typed,
        wrong=wrong,
    )


@router.get("/export", dependencies=[allow("export")])
async def export(request: Request) -> Response:
    """What can be taken along of what is seen now as a table; pictures the page makes by itself."""
    begin, end = _seen(request)
    every = max(1, -(-(end - begin) // SUMS_OF))
    names = names_of(on_screen(request.query_params))
    lang = language_of(request)
    query = urlencode({"tags": ",".join(names), "from": begin, "to": end, "locale": lang, "bom": 1}, safe=",")
    return view_of(request).fragment(
        request,
        "fragments/trend_export.html",
        href=f"/history/export.csv?{query}",
        every=every,
        sums=fmt.duration(every, lang),
    )


def _seen(request: Request) -> tuple[int, int]:
    return seen(on_screen(request.query_params), view_of(request).runtime(request).clock.micros(), zone_of(request))


def _chosen(detail: dict[str, Any]) -> Response:
    return Response(status_code=204, headers={"HX-Trigger": orjson.dumps({"trend": detail}).decode()})
