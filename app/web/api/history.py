"""History for programs: columns as a screen needs them, and every stored sample."""

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field
from sqlalchemy import Connection

from app.clock import to_datetime
from app.historian import query
from app.tags import quality as q
from app.web.api.lookup import Moment, declared, range_of, runtime_of
from app.web.api.plant import origins
from app.web.errors import Wrong
from app.web.guard import allow, check_points
from app.web.history import read

if TYPE_CHECKING:
    from app.runtime import Runtime

router = APIRouter(prefix="/api/v1")

MOST_SERIES = 8


class SeriesOut(BaseModel):
    """A decimated series: columns with first, lowest, highest, last; null breaks the line.

    A column of `count` 0 has no sample of its own: it is an edge or a break.
    """

    tag: str
    unit: str
    source: str = Field(description="sample, minute or hour")
    step: float = Field(description="width of a column [s]")
    time: list[datetime]
    first: list[float | None]
    low: list[float | None]
    high: list[float | None]
    last: list[float | None]
    quality: list[int] = Field(description="worst level: 0 good, 1 uncertain, 2 bad")
    count: list[int] = Field(description="samples in the column")


class SampleOut(BaseModel):
    """One stored sample."""

    time: datetime
    value: float | str | None
    quality: str
    origin: list[str]


class RawOut(BaseModel):
    """Stored samples in order; `next` is where to go on when there are more."""

    tag: str
    unit: str
    samples: list[SampleOut]
    next: datetime | None


@router.get("/history", dependencies=[allow("view"), declared])
async def history(
    request: Request,
    tags: Annotated[str, Query(description=f"comma separated, at most {MOST_SERIES}", max_length=2000)],
    begin: Annotated[Moment, Query(alias="from")],
    end: Annotated[Moment, Query(alias="to")],
    width: Annotated[int, Query(ge=1, le=query.MAX_WIDTH, description="columns")] = 1000,
) -> list[SeriesOut]:
    """Series as a screen needs them: no spike is lost, whatever the width."""
    runtime = runtime_of(request)
    names = [name.strip() for name in tags.split(",") if name.strip()]
    if not 1 <= len(names) <= MOST_SERIES:
        raise Wrong("query.tags", tags, f"1 to {MOST_SERIES} tags, comma separated")
    check_points(request, names)
    first, last = range_of(request, begin, end)

    def work(connection: Connection) -> list[SeriesOut]:
        found = [_traced(connection, runtime, name, "query.tags") for name in names]
        return [_series(connection, one, first, last, width) for one in found]

    return await read(runtime, work, much=True)


@router.get("/history/{name}/raw", dependencies=[allow("export"), declared])
async def raw(
    request: Request,
    name: str,
    begin: Annotated[Moment, Query(alias="from")],
    end: Annotated[Moment, Query(alias="to")],
    limit: Annotated[int, Query(ge=1, le=50_000)] = 10_000,
) -> RawOut:
    """Every stored sample, a page at a time."""
    runtime = runtime_of(request)
    check_points(request, [name])
    first, last = range_of(request, begin, end)

    def work(connection: Connection) -> tuple[_Traced, list[tuple[int, float | str | None, int]]]:
        found = _traced(connection, runtime, name, "path.name")
        number = found.number
        return found, [] if number is None else query.page(connection, number, first - 1, last, limit + 1)

    found, rows = await read(runtime, work, much=True)
    return RawOut(
        tag=name,
        unit=found.unit,
        samples=[
            SampleOut(time=to_datetime(t), value=value, quality=q.name(word), origin=origins(word))
            for t, value, word in rows[:limit]
        ],
        next=to_datetime(rows[limit][0]) if len(rows) > limit else None,
    )


@dataclass(frozen=True, slots=True)
class _Traced:
    """A tag with its history."""

    name: str
    unit: str
    number: int | None
    """In the history; None: nothing was recorded of it."""


def _traced(connection: Connection, runtime: "Runtime", name: str, field: str) -> _Traced:
    """The tag `name`, also one that the plant has no more; `field` is where the request names it.

    Raises:
        Wrong: 404, neither the plant nor its history knows it.
    """
    point = runtime.points.get(name)
    known = query.find(connection, point.id if point else name)
    if point is None and known is None:
        raise Wrong(field, name, "a tag of the plant, or one that it had", 404)
    unit = point.unit if point else known.unit if known else ""
    return _Traced(name, unit, known.number if known else None)


def _series(connection: Connection, traced: _Traced, begin: int, end: int, width: int) -> SeriesOut:
    number = traced.number
    found = query.Columns() if number is None else query.columns(connection, number, begin, end, width)
    return SeriesOut(
        tag=traced.name,
        unit=traced.unit,
        source=found.source,
        step=found.step / 1e6,
        time=[to_datetime(t) for t in found.time],
        first=found.first,
        low=found.low,
        high=found.high,
        last=found.last,
        quality=found.quality,
        count=found.count,
    )
