"""The table below a trend: its numbers over what is seen or between the rulers, and those of another period under it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import Connection

from app.historian.statistics import Held, Numbers, statistics
from app.web import format as fmt
from app.web.guard import allow
from app.web.language import language_of
from app.web.pages import view_of
from app.web.signin import zone_of
from app.web.trend_address import not_too_long, on_screen, seen, view_asked
from app.web.trend_pens import Pen, pens_of, read_history

router = APIRouter()

COLUMNS = ("a", "b", "delta", "low", "mean", "high", "good")
NOTHING = "–"
BAD = 2
"""Quality level."""
LEAST_LACKING = 500_000
"""Less is not worth a word [µs]."""


@dataclass(frozen=True, slots=True)
class Line:
    """The numbers of a pen as they are drawn."""

    pen: Pen
    cells: dict[str, str]
    below: dict[str, str]
    """Small, under the cell: when a value first was, how much time is lacking."""
    earlier: str = ""
    """How much earlier the period is that they are of; empty: that on the screen."""


@dataclass(frozen=True, slots=True)
class Table:
    """The lines, and what the head says of the rulers."""

    lines: Sequence[Line]
    between: bool = False
    """The numbers are those between the rulers."""
    a: str = ""
    b: str = ""
    delta: str = ""


def empty(pens: Sequence[Pen]) -> Table:
    """Before the numbers have come."""
    return Table([Line(pen, dict.fromkeys(COLUMNS, NOTHING), {}) for pen in pens])


@router.get("/trends/table", dependencies=[allow("view")])
async def table(request: Request) -> Response:
    """Per pen of a view: low and high with when they first were, the mean weighted by time of what was good, the share of good time and
    the time that is lacking, and what held at the rulers; below each the numbers of the other period, when there is one."""
    runtime, lang, zone = view_of(request).runtime(request), language_of(request), zone_of(request)
    asked, now = on_screen(request.query_params), runtime.clock.micros()
    pens, wanted = await pens_of(request, asked), view_asked(asked, now, zone)
    a, b, earlier = wanted["a"], wanted["b"], round((wanted["under"] or 0) * 1_000_000)
    rulers = [at for at in (a, b) if at is not None]
    between = len(set(rulers)) == 2
    begin, end = not_too_long(min(rulers), max(rulers)) if between else seen(asked, now, zone)
    names, under = (
        [pen.point.name for pen in pens],
        rulers if between else [],
    )  # one ruler alone has no other one to be compared with

    def work(connection: Connection) -> tuple[list[Numbers], list[Numbers]]:
        before = [at - earlier for at in under]
        return (
            statistics(connection, names, begin, end, now, rulers),
            statistics(connection, names, begin - earlier, end - earlier, now, before) if earlier else [],
        )

    numbers, others = await read_history(runtime, work, much=True)
    words = _Words(lang, zone, now, partial(view_of(request).text, request))
    lines = []
    for i, pen in enumerate(pens):
        lines.append(words.line(pen, numbers[i], (a, b), dict(zip(rulers, numbers[i].held, strict=True))))
        if earlier:
            lines.append(words.line(pen, others[i], (a, b), dict(zip(under, others[i].held, strict=True)), earlier))
    delta = fmt.duration(abs(b - a) / 1e6, lang) if len(rulers) == 2 else ""
    clock_a, clock_b = ("" if at is None else fmt.clock_time(at, zone) for at in (a, b))
    drawn = Table(lines, between, clock_a, clock_b, delta)
    return view_of(request).fragment(request, "fragments/trend_table.html", table=drawn)


@dataclass(frozen=True, slots=True)
class _Words:
    """How numbers are said on this page."""

    lang: str
    zone: ZoneInfo
    now: int
    text: Callable[..., str]

    def line(
        self,
        pen: Pen,
        numbers: Numbers,
        rulers: Sequence[int | None],
        held: Mapping[int, Held | None],
        earlier: int = 0,
    ) -> Line:
        """`held`: what held at the rulers that this line has a value of."""
        known = [held.get(at) if at is not None else None for at in rulers]
        a, b = (one[0] if one and one[1] < BAD else None for one in known)
        cells = {
            name: fmt.NO_VALUE if at in held and value is None else self.value(pen, value)
            for name, at, value in zip("ab", rulers, (a, b), strict=True)
        }
        measured = not pen.point.texts
        delta = b - a if measured and isinstance(a, float) and isinstance(b, float) else None
        cells |= {
            "delta": self.value(pen, delta),
            "low": self.value(pen, numbers.low),
            "mean": self.value(pen, numbers.mean if measured else None),
            "high": self.value(pen, numbers.high),
            "good": fmt.number(numbers.good * 100, 1, self.lang),
        }
        below = {name: self.when(at) for name, at in (("low", numbers.low_at), ("high", numbers.high_at)) if at}
        if numbers.lacking > LEAST_LACKING:
            below["good"] = self.text("trend.lacking", time=fmt.duration(numbers.lacking / 1e6, self.lang))
        said = self.text("trend.earlier", time=fmt.duration(earlier / 1e6, self.lang)) if earlier else ""
        return Line(pen, cells, below, said)

    def value(self, pen: Pen, value: float | str | None) -> str:
        """A value of the pen in words or with its digits."""
        if value is None or isinstance(value, str):
            return value or NOTHING
        return pen.point.texts.get(f"{value:g}") or fmt.number(value, pen.point.decimals, self.lang)

    def when(self, at: tuple[int, int]) -> str:
        """When a value first was: to the second where a sample tells, else the minute or the hour that it was in."""
        exact = at[0] == at[1]
        begin, end = (fmt.clock_time(one, self.zone, seconds=exact) for one in at)
        day, today = (fmt.date(one, self.zone, self.lang, year=False) for one in (at[0], self.now))
        clock = begin if exact else f"{begin}–{end}"
        return clock if day == today else f"{day} {clock}"
