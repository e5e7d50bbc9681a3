"""The address of a trend: what it may say, and what that means. The address is the whole view, so it is also what a saved view keeps."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from urllib.parse import quote, urlencode
from zoneinfo import ZoneInfo

from starlette.datastructures import QueryParams

from app.clock import to_datetime
from app.errors import ConfigurationError, Refused
from app.historian.export import moment
from app.historian.saved_views import LONGEST_VIEW
from app.plant.definitions import Kind, Plant
from app.web import typed_time
from app.web.format import repeated

MOST_PENS = 8
PRESETS = ("10m", "1h", "8h", "24h", "7d")
DEFAULT_SPAN = "10m"
UNITS = {"s": 1, "m": 60, "h": 3600, "d": 86400}
SHORTEST = 1
LONGEST = 3660 * 86400
"""Of a span [s]."""
AXES = ("auto", "fit", "scale")
KNOWN = ("tags", "span", "from", "to", "off", "pen", "axis", "a", "b", "under")
"""All that an address says, in its order."""
OF_TIME = {"span", "from", "to", "a", "b"}


def names_of(asked: QueryParams) -> list[str]:
    """The tags of an address, each once."""
    named = [name.strip() for text in asked.getlist("tags") for name in text.split(",")]
    return list(dict.fromkeys(name for name in named if name))


def on_screen(query: QueryParams) -> QueryParams:
    """What a part of the page is about: the view on the screen, told whole as `view`, else what the address itself says.

    Raises:
        Refused: 422, the view is too long.
    """
    return read_view(query["view"]) if "view" in query else query


def read_view(text: str) -> QueryParams:
    """What a view says.

    Raises:
        Refused: 422, it is too long.
    """
    if len(text) > LONGEST_VIEW:
        raise Refused("trend.error.view_length", 422, most=LONGEST_VIEW)
    return QueryParams(text)


def view_asked(asked: QueryParams, now: int, zone: ZoneInfo) -> dict[str, Any]:
    """The part of time and how it is drawn: `span` [s] when live, else `from` and `to` [µs UTC]; rulers; `under`, how much earlier
    another period is that is drawn under this one [s].

    Raises:
        Refused: 422, one of them cannot be read.
    """
    out: dict[str, Any] = {
        "now": now,
        "span": None,
        "from": None,
        "to": None,
        "name": "",
        "axis": asked.get("axis", AXES[0]),
        "under": _earlier(asked.get("under", "")),
    }
    if out["axis"] not in AXES:
        raise Refused("trend.error.axis", 422, value=out["axis"][:40], expected=", ".join(AXES))
    if asked.get("from", "") or asked.get("to", ""):
        out["from"], out["to"] = range_asked(asked, now, zone)
    else:
        name = asked.get("span", "") or DEFAULT_SPAN
        found = re.fullmatch(r"(\d{1,9})([smhd])", name, re.ASCII)
        seconds = int(found[1]) * UNITS[found[2]] if found else 0
        if not SHORTEST <= seconds <= LONGEST:
            raise Refused("trend.error.span", 422, value=name[:40])
        out["span"], out["name"] = seconds, name
    for ruler in ("a", "b"):
        out[ruler] = moment_asked(asked.get(ruler, ""), zone, now) if asked.get(ruler, "") else None
    return out


def _earlier(text: str) -> float | None:
    """How much earlier the other period is [s]; None when there is none."""
    if not text:
        return None
    found = re.fullmatch(r"(\d{1,9}(?:\.\d{1,3})?)([smhd])", text, re.ASCII)
    seconds = float(found[1]) * UNITS[found[2]] if found else 0.0
    if not 0 < seconds <= LONGEST:
        raise Refused("trend.error.under", 422, value=text[:40])
    return seconds


def range_asked(asked: QueryParams, now: int, zone: ZoneInfo) -> tuple[int, int]:
    """`from` and `to` [µs UTC]; the last hour when neither is said.

    Raises:
        Refused: 422, one cannot be read, or the range is empty or too long.
    """
    begin = moment_asked(asked.get("from", "") or "-1h", zone, now)
    end = moment_asked(asked.get("to", "") or "now", zone, now)
    if end <= begin:
        raise Refused("trend.error.range", 422)
    return not_too_long(begin, end)


def not_too_long(begin: int, end: int) -> tuple[int, int]:
    """The same range [µs UTC].

    Raises:
        Refused: 422, it is longer than numbers are made of.
    """
    if end - begin > LONGEST * 1_000_000:
        raise Refused("trend.error.long", 422, days=LONGEST // 86400)
    return begin, end


def seen(asked: QueryParams, now: int, zone: ZoneInfo) -> tuple[int, int]:
    """From when to when a view shows [µs UTC].

    Raises:
        Refused: 422, a part of it cannot be read.
    """
    view = view_asked(asked, now, zone)
    return (now - view["span"] * 1_000_000, now) if view["span"] is not None else (view["from"], view["to"])


def moment_asked(text: str, zone: ZoneInfo, now: int) -> int:
    """A time as µs UTC.

    Raises:
        Refused: 422, it cannot be read, or has no room before it for another period.
    """
    try:
        return _with_room(moment(text, zone, now), zone)
    except (ConfigurationError, OverflowError) as error:
        raise Refused("trend.error.time", 422, value=text[:40]) from error


def typed_micros(text: str, zone: ZoneInfo, *, end: bool = False) -> int:
    """What a field for a time, or for the end of one, says, in the plant's zone when it names no offset (typed_time.py) [µs UTC].

    Raises:
        Refused: 422, it says no time, or one without room before it for another period.
    """
    try:
        return _with_room(typed_time.micros(text, zone, end=end), zone)
    except (ValueError, OverflowError) as error:
        raise Refused("trend.error.time", 422, value=text[:40]) from error


def _with_room(at: int, zone: ZoneInfo) -> int:
    """The same time [µs UTC], which has a date in the zone as all have that can lie under it.

    Raises:
        OverflowError: it or one of these has none: years go from 1 to 9999.
    """
    for one in (at, at - LONGEST * 1_000_000):
        to_datetime(one).astimezone(zone)
    return at


def typed_form(at: int, zone: ZoneInfo) -> str:
    """A time [µs UTC] as a field has it before anybody types; the repeated hour of autumn with its offset, so that it is read as it was."""
    moment = to_datetime(at).astimezone(zone)
    return moment.isoformat(timespec="seconds") if repeated(moment) else f"{moment:%Y-%m-%dT%H:%M:%S}"


def kept(text: str, now: int, zone: ZoneInfo) -> str:
    """A view as it is kept: only what an address says, in its order.

    Raises:
        Refused: 422, it is too long, has no pens or too many, or a part of it cannot be read.
    """
    asked = read_view(text)
    names = names_of(asked)
    if not names:
        raise Refused("trend.error.no_tags", 422)
    if len(names) > MOST_PENS:
        raise Refused("trend.error.too_many", 422, n=len(names), most=MOST_PENS)
    view_asked(asked, now, zone)
    return query_of([(key, asked[key]) for key in KNOWN if asked.get(key, "")])


def opened(query: str, usable: Callable[[str], bool], now: int, zone: ZoneInfo) -> str:
    """The view that somebody had last, to begin with: live, as long as it was, with those of its pens that can still be drawn.

    Empty when nothing of it is left.
    """
    asked = QueryParams(query)
    names = [name for name in names_of(asked) if usable(name)]
    try:
        view = view_asked(asked, now, zone)
    except Refused:
        return ""
    if not names:
        return ""
    span = view["name"] or f"{max(SHORTEST, (view['to'] - view['from']) // 1_000_000)}s"
    rest = [(key, asked[key]) for key in KNOWN if key not in OF_TIME | {"tags"} and asked.get(key, "")]
    return query_of([("tags", ",".join(names)), ("span", span), *rest])


def first_pens(plant: Plant) -> list[str]:
    """Pens for who comes the first time: how fast all drives turn; how fast machines move; or what has a normal band on the first one."""
    points = [one for item in plant.equipment.values() for one in item.points.values() if one.history]
    speeds = [one for one in points if one.opens_trends]
    for found in ([one for one in speeds if one.unit == "rpm"], speeds):
        if found:
            return [one.name for one in found[:MOST_PENS]]
    for item in plant.equipment.values():
        names = [one.name for one in item.points.values() if one.kind is Kind.ANALOG and one.normal and one.history]
        if names:
            return names[:3]
    return []


def with_pens(asked: QueryParams, names: Sequence[str]) -> str:
    """The same view with other pens, as a query."""
    here = [(key, asked[key]) for key in KNOWN if key != "tags" and asked.get(key, "")]
    return query_of(
        [
            ("tags", ",".join(names)),
            *((key, value) for key, value in here if key not in ("off", "pen") or value in names),
        ]
    )


def query_of(parts: Mapping[str, str] | Sequence[tuple[str, str]]) -> str:
    """`parts` as the query of an address, readable."""
    return urlencode(parts, safe=",:", quote_via=quote)
