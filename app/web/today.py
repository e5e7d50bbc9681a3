"""Today's figures: what each machine did since midnight of the plant, on the overview and on the page of an area.

They are read beside the loop, once for all who look within some seconds, and say where they don't know. A page waits for them only so
long as nobody notices; then it is drawn without them and fetches them.
"""

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from zoneinfo import ZoneInfo

from fastapi import FastAPI, Request

from app.alarms.stops import Stops, read_stops
from app.clock import local_day
from app.errors import StorageError
from app.historian.today import Amount, Day, Span, read_day
from app.plant.definitions import Equipment, Plant
from app.plant.today import How
from app.web import format as fmt
from app.web.alarms import drawing
from app.web.language import language_of
from app.web.pages import plant_of, view_of

if TYPE_CHECKING:
    from app.runtime import Runtime

FRESH = 20.0
"""So long what was read is good enough for the next who asks [s]."""
PATIENCE = 0.3
"""So long a page that shows more than these figures waits for them [s]."""
NOTHING = "–"


@dataclass(frozen=True, slots=True)
class Today:
    """What was read."""

    day: Day
    stops: dict[str, Stops]
    complete: bool = True
    """Whether the history could be read."""


@dataclass(slots=True)
class _Kept:
    """The last that was read, and of which plant."""

    plant: Plant | None = None
    begin: int = 0
    """Of the day [µs UTC]."""
    asked: float = 0.0
    """When it was asked for [s]."""
    reading: "asyncio.Future[Today] | None" = None
    former: "asyncio.Future[Today] | None" = None
    """Of the same day: good enough for a page that does not wait."""


def told(machines: Iterable[Equipment]) -> list[Equipment]:
    """Those of `machines` that have figures."""
    return [item for item in machines if item.type.today]


async def drawn(
    request: Request, machines: Sequence[Equipment], patience: float | None = None
) -> dict[str, Any] | None:
    """The figures of `machines` in the language of the page; what was read before where nothing newer is read within `patience` [s].

    None: none of them has any, or nothing was read.
    """
    if not (wanted := told(machines)):
        return None
    plant, runtime = plant_of(request), view_of(request).runtime(request)
    reading, former = _reading(request.app, runtime, plant)
    await asyncio.wait([reading], timeout=patience)
    found = reading if reading.done() else former
    return _Words(request, plant, found.result()).table(wanted) if found is not None else None


def _reading(
    app: FastAPI, runtime: "Runtime", plant: Plant
) -> "tuple[asyncio.Future[Today], asyncio.Future[Today] | None]":
    """What was read or is being read, and what was before; whoever comes meanwhile gets the same."""
    if not hasattr(app.state, "today"):
        app.state.today = _Kept()
    kept: _Kept = app.state.today
    begin, end = local_day(runtime.clock.micros(), ZoneInfo(plant.timezone))
    now = runtime.clock.monotonic()
    same = kept.plant is plant and kept.begin == begin
    if kept.reading is None or not same or (kept.reading.done() and now - kept.asked >= FRESH):
        kept.former = kept.reading if same else None
        kept.plant, kept.begin, kept.asked = plant, begin, now
        kept.reading = asyncio.ensure_future(_read(runtime, plant, begin, end))
    return kept.reading, kept.former


async def _read(runtime: "Runtime", plant: Plant, begin: int, end: int) -> Today:
    until = max(begin + 1, min(runtime.clock.micros(), end))
    machines = list(plant.equipment.values())
    try:
        day = await runtime.history.read_long(lambda connection: read_day(connection, machines, begin, until))
        stops = await runtime.db.read_long(lambda connection: read_stops(connection, begin, until))
    except StorageError:
        return Today(Day(begin, until), {}, complete=False)
    return Today(day, stops)


class _Words:
    """Figures as a person reads them."""

    def __init__(self, request: Request, plant: Plant, today: Today) -> None:
        self.view = view_of(request)
        self.request = request
        self.texts = self.view.runtime(request).texts
        self.lang = language_of(request)
        self.zone = ZoneInfo(plant.timezone)
        self.today = today
        self.alarms = drawing(request)

    def table(self, machines: Iterable[Equipment]) -> dict[str, Any]:
        """One line for each machine."""
        rows = [self._row(item) for item in machines]
        day = self.today.day
        return {
            "rows": rows,
            "complete": self.today.complete,
            "since": fmt.clock_time(day.begin, self.zone, seconds=False),
            "off": self._unknown(day.off),
            "has": {name: any(row[name] for row in rows) for name in ("counts", "mean", "energy")},
        }

    def _row(self, item: Equipment) -> dict[str, Any]:
        day = self.today.day
        found = day.amounts.get(item.id, {})
        noted = bool(day.off or day.unknown.get(item.id) or not self.today.complete)
        """Whether the line or the heading says what is missing: then no figure repeats it."""
        said: dict[How, list[tuple[str, str]]] = {how: [] for how in How}
        for figure in item.type.today.values():
            label = self.texts.of_type(self.lang, item.type, f"today.{figure.name}") if figure.how is How.COUNT else ""
            text = self._amount(figure.how, found.get(figure.name, Amount(None, whole=False)), noted=noted)
            said[figure.how].append((label, text))
        stops = self.today.stops.get(item.id)
        return {
            "id": item.id,
            "label": self.texts.label(self.lang, item.label),
            "time": _only(said[How.TIME]),
            "counts": said[How.COUNT],
            "mean": _only(said[How.MEAN]),
            "energy": _only(said[How.ENERGY]),
            "stops": fmt.number(stops.count if stops else 0, 0, self.lang) if self.today.complete else NOTHING,
            "first_out": self.alarms.recorded(stops.first_out) if stops else "",
            "first_at": fmt.clock_time(stops.first_out.time, self.zone, seconds=False) if stops else "",
            "first_url": f"/alarms?tab=journal&source={item.id}",
            "unknown": self._unknown(day.unknown.get(item.id, ())),
        }

    def _amount(self, how: How, one: Amount, *, noted: bool) -> str:
        if one.value is None:
            return NOTHING
        match how:
            case How.TIME:
                text = hours(one.value)
            case How.ENERGY:
                decimals = 2 if abs(one.value) < 10 else 1 if abs(one.value) < 100 else 0
                text = fmt.quantity(one.value, decimals, "kWh", self.lang)
            case How.MEAN:
                text = fmt.duration(one.value, self.lang)
            case How.COUNT:
                text = fmt.number(one.value, 0, self.lang)
        return text if one.whole or noted else f"≥{fmt.SPACE}{text}"

    def _unknown(self, spans: Sequence[Span]) -> str:
        """When nothing was known, in words; empty: all was."""
        if not spans:
            return ""
        day = self.today.day
        begin, end = (fmt.clock_time(moment, self.zone, seconds=False) for moment in spans[-1])
        if len(spans) > 1:
            total = fmt.duration(sum(last - first for first, last in spans) / 1e6, self.lang)
            return self._text("total", total=total, begin=begin, end=end)
        from_midnight, to_now = spans[0][0] <= day.begin, spans[0][1] >= day.end - 1_000_000
        key = {(True, True): "all", (True, False): "until", (False, True): "since"}.get(
            (from_midnight, to_now), "between"
        )
        return self._text(key, begin=begin, end=end)

    def _text(self, key: str, **params: object) -> str:
        return self.view.text(self.request, f"today.unknown.{key}", **params)


def _only(said: Sequence[tuple[str, str]]) -> str:
    return said[0][1] if said else ""


def hours(seconds: float) -> str:
    """A time of a day, to the minute: `5 h 12 min`, `12 min`."""
    hour, minute = divmod(int(seconds / 60 + 0.5), 60)
    return f"{hour}{fmt.SPACE}h {minute:02d}{fmt.SPACE}min" if hour else f"{minute}{fmt.SPACE}min"
