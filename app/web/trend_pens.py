"""The pens of a trend: which points the address names, and how each is drawn."""

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from fastapi import Request
from starlette.datastructures import QueryParams

from app.errors import Refused, StorageError
from app.historian import query
from app.plant.definitions import Kind, Point
from app.web.guard import check_points
from app.web.language import language_of
from app.web.pages import view_of
from app.web.points import PointView, point_view
from app.web.trend_address import MOST_PENS, names_of

if TYPE_CHECKING:
    from app.runtime import Runtime


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


async def pens_of(request: Request, asked: QueryParams) -> list[Pen]:
    """The pens that an address names.

    Raises:
        Refused: 422, more than 8, a tag that nobody knows, one that cannot be drawn.
    """
    view, runtime, lang = view_of(request), view_of(request).runtime(request), language_of(request)
    names = names_of(asked)
    if len(names) > MOST_PENS:
        raise Refused("trend.error.too_many", 422, n=len(names), most=MOST_PENS)
    check_points(request, names)
    strange = [name for name in names if name not in runtime.points]
    old: dict[str, query.Recorded | None] = {}
    if strange:
        found = await read_history(runtime, lambda connection: {name: query.find(connection, name) for name in strange})
        old = dict(found)
    off = set(asked.get("off", "").split(","))
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
        if not drawable(point):
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


def drawable(point: Point) -> bool:
    """Whether the point has a curve."""
    return point.history and point.kind is not Kind.TEXT and point.unit != "time"


async def read_history(runtime: "Runtime", work: Any, *, much: bool = False) -> Any:
    """Read the history; `much`: for what may take longer than others should wait.

    Raises:
        Refused: 503, it cannot be read.
    """
    try:
        return await (runtime.history.read_long if much else runtime.history.read)(work)
    except StorageError as error:
        raise Refused("trend.unavailable", 503) from error
