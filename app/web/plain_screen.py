"""What the screens of a machine show whose type draws none of its own: its points, sorted by what they are."""

from collections.abc import Iterator
from dataclasses import dataclass

from app.plant.definitions import Device, Kind, Point
from app.web.points import EquipmentView, PointView

CURVES = 4
"""Most curves of its small trend."""
STATE, SINCE = "state", "state_since"
"""Usual keys of the point that says its state, and of the time since then."""
DERIVED_ELSEWHERE = frozenset({"option", "min_today", "max_today"})
"""Derived points that say nothing by themselves: what the plant file says, and ends of the day of another point."""


@dataclass(frozen=True, slots=True)
class PlainScreen:
    """Its points in the order of the files of its type; cells of tables, parameters and what cannot be read are left out."""

    machine: EquipmentView

    @property
    def state(self) -> PointView | None:
        """What says its state: as `picture` has it, else the point `state`, else the first one that is said in words."""
        kind = self.machine.equipment.type
        keys = [kind.picture.state] if kind.picture else []
        keys += [STATE, *(point.key for point in self._shown() if _in_words(point))]
        return next(iter(self.machine.points(keys)), None)

    @property
    def since(self) -> PointView | None:
        """Since when it is in this state, if its type tells."""
        return next(iter(self.machine.points([SINCE])), None)

    @property
    def measured(self) -> list[PointView]:
        """What is a quantity."""
        return self.machine.points([point.key for point in self._shown() if not _in_words(point) and point.unit])

    @property
    def others(self) -> list[PointView]:
        """What is none: words, bits, counts, but for its state."""
        state = self.state
        found = [point.key for point in self._shown() if _in_words(point) or not point.unit]
        return self.machine.points([key for key in found if not state or key != state.key])

    @property
    def curves(self) -> list[PointView]:
        """Its small trend: quantities that are recorded, those with a scale first."""
        kept = {point.key for point in self._shown() if point.history and point.kind is Kind.ANALOG}
        found = [point for point in self.measured if point.key in kept]
        return sorted(found, key=lambda point: point.scale_high is None)[:CURVES]

    @property
    def on_tile(self) -> list[PointView]:
        """What its tile on the overview shows, which is told of nothing else."""
        return self.machine.points([point.key for point in self._shown() if self._told_to_tile(point.key)])

    @property
    def state_on_tile(self) -> PointView | None:
        """Its state, where its tile may show it."""
        state = self.state
        return state if state and self._told_to_tile(state.key) else None

    @property
    def since_on_tile(self) -> PointView | None:
        """Since when, likewise."""
        return self.since if self._told_to_tile(SINCE) else None

    def _told_to_tile(self, key: str) -> bool:
        return key in self.machine.equipment.type.tile

    def _shown(self) -> Iterator[Point]:
        kind = self.machine.equipment.type
        for key, point in self.machine.equipment.points.items():
            elsewhere = point.derived is not None and point.derived.kind in DERIVED_ELSEWHERE
            unread = _unread(point, kind.device, self.machine.equipment.base)
            if not (point.table or key == SINCE or key in kind.setpoints or elsewhere or unread):
                yield point


def _unread(point: Point, device: Device, base: int) -> bool:
    register = point.register
    if register is None:
        return False
    written = device.write_only if register.table == "holding" else ()
    return not register.readable or any(first <= register.address - base <= last for first, last in written)


def _in_words(point: Point) -> bool:
    return bool(point.texts) or point.kind in (Kind.ENUM, Kind.BOOL, Kind.TEXT)
