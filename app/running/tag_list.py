"""Every tag of a running plant: points of its machines, of the system, of the alarms; who publishes each, and when it is stale."""

from collections.abc import Iterable

from app.alarms.definitions import alarm_points
from app.historian.events import has_ring
from app.links.statistics import statistic_names
from app.plant.definitions import Plant, Point
from app.plant.system import EVENTS, SYSTEM, system_point, system_points
from app.running.derived import DERIVED
from app.tags.database import Tag

LEAST_STALE = 2.0
SCANS = 3
"""A value is stale after so many scans without it, and not before `LEAST_STALE` [s] (precedence.md)."""


def points_of(plant: Plant | None, links: Iterable[str]) -> list[Point]:
    """Every point that is a tag, of `plant` and of the system with these `links`."""
    machines = list(plant.equipment.values()) if plant else []
    statistics = [
        name for link in links for name in statistic_names(link, {item.unit for item in machines if item.link == link})
    ]
    return [
        *(point for item in machines for point in item.points.values() if _has_value(point)),
        *system_points(plant, statistics),
        *(system_point(f"{EVENTS}.{item.id}", label=EVENTS) for item in machines if has_ring(item)),
        *alarm_points(plant.equipment if plant else ()),
    ]


def tag_of(point: Point, plant: Plant | None) -> Tag:
    """The tag of `point`: its one source, and after which time it is stale [s]."""
    if point.equipment == SYSTEM or plant is None:
        return Tag(point.name, point.id, SYSTEM)
    if point.derived:
        return Tag(point.name, point.id, DERIVED)
    source = f"link.{plant.equipment[point.equipment].link}"
    return Tag(point.name, point.id, source, stale_after=stale_after(point, plant))


def stale_after(point: Point, plant: Plant) -> float:
    """After which time a value of `point` is stale [s]; 0 = never, for what is read once or on demand."""
    item = plant.equipment[point.equipment]
    link, device = plant.links[item.link], item.type.device
    match point.scan:
        case "fast":
            return max(LEAST_STALE, SCANS * (link.fast or device.fast))
        case "slow":
            return max(LEAST_STALE, SCANS * (link.slow or device.slow))
        case _:
            return 0.0


def _has_value(point: Point) -> bool:
    """False for registers that can only be written: they are no tags."""
    return point.register is None or point.register.readable
