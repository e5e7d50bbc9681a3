"""The last start and stop of a belt as its page draws them: speed, acceleration and jerk over one time, from what the PLC recorded."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from app.blocks.ramp_record import Moment, Phase, RampState, curve, distance
from app.web.drawing import Panel, round_steps
from app.web.tables import RowView, TableView

LEFT, WIDTH = 58.0, 376.0
LANES = (("speed", 18.0, 98.0, 5), ("acceleration", 138.0, 58.0, 3), ("jerk", 218.0, 58.0, 3))
"""Key, top and height of each panel in the drawing's units, and how many lines its scale has at most."""
APART = 20.0
"""Between two numbers of a vertical scale, in the drawing's units."""
SHORTEST = 0.1
"""Time scale of a ramp that has just begun [s]."""


@dataclass(frozen=True, slots=True)
class Lane:
    """One of the three panels."""

    key: str
    panel: Panel
    steps: tuple[float, ...]
    """Values of the lines of its scale."""
    path: str


@dataclass(frozen=True)
class RampDrawing:
    """A recorded start or stop."""

    row: RowView
    speed: float
    """When it began [%]."""
    acceleration: float
    """When it began [%/s]."""
    phases: tuple[Phase, ...]

    @property
    def state(self) -> int:
        """As `RampState`."""
        return int(self.row.number("state") or 0)

    @property
    def drawable(self) -> bool:
        """Whether there is a curve: a stop without supply has none."""
        return bool(self.phases)

    @property
    def duration(self) -> float:
        """[s]"""
        return sum(phase.duration for phase in self.phases)

    @property
    def end(self) -> float:
        """Speed that it came to [%]; without supply it is 0."""
        if self.state == RampState.CUT_OFF and not self.phases:
            return 0.0
        return 0.0 if abs(last := self._moments[-1].speed) < 0.05 else last

    @property
    def peak(self) -> float:
        """Greatest acceleration, whichever sign it has [%/s]."""
        return max((moment.acceleration for moment in self._moments), key=abs)

    @property
    def jerk(self) -> float:
        """Greatest jerk, without its sign [%/s²]."""
        return max((abs(phase.jerk) for phase in self.phases), default=0.0)

    def way(self, full_speed: float) -> float:
        """How far the belt went, signed [mm]; `full_speed` at 100 % [mm/s]."""
        return distance(self.speed, self.acceleration, self.phases) * full_speed / 100

    @cached_property
    def times(self) -> tuple[float, ...]:
        """Lines of the time scale [s]."""
        steps = round_steps(0.0, self._long, 7)
        return (*(step for step in steps[:-1] if self._long - step > self._long / 12), self._long)

    @cached_property
    def lanes(self) -> tuple[Lane, ...]:
        """Speed, acceleration and jerk, one below the other."""
        values = {
            "speed": [(m.time, m.speed) for m in self._moments],
            "acceleration": [(m.time, m.acceleration) for m in self._moments],
            "jerk": list(self._jerks()),
        }
        return tuple(self._lane(key, top, height, most, values[key]) for key, top, height, most in LANES)

    def _lane(self, key: str, top: float, height: float, most: int, points: list[tuple[float, float]]) -> Lane:
        numbers = [value for _, value in points]
        steps = round_steps(min(0.0, *numbers), max(0.0, *numbers), most)
        low, high = (steps[0], steps[-1]) if len(steps) > 1 else (-1.0, 1.0)
        room = (high - low) * 0.08
        panel = Panel(LEFT, top, WIDTH, height, (0.0, self._long), (low - room, high + room))
        fixed = [panel.y(value) for value in (low, high, 0.0)]
        written = (value for value in steps if value in (low, high, 0.0) or _apart(panel.y(value), fixed))
        return Lane(key, panel, tuple(written), panel.path(points))

    def _jerks(self) -> Iterator[tuple[float, float]]:
        begun = 0.0
        yield begun, 0.0
        for duration, jerk in self.phases:
            yield begun, jerk
            begun += duration
            yield begun, jerk
        yield begun, 0.0

    @cached_property
    def _moments(self) -> list[Moment]:
        return list(curve(self.speed, self.acceleration, self.phases))

    @property
    def _long(self) -> float:
        return max(self.duration, SHORTEST)


def _apart(place: float, others: list[float]) -> bool:
    return all(abs(place - other) >= APART for other in others)


def ramp_of(table: TableView, belt: int, *, stop: bool) -> RampDrawing | None:
    """The last start or stop of `belt` (from 1); None when the PLC has recorded none, or none is known."""
    row = table.row(2 * belt if stop else 2 * belt - 1)
    if row is None:
        return None
    speed, acceleration = row.number("speed"), row.number("acceleration")
    if speed is None or acceleration is None:
        return None
    told = [(row.number(f"duration_{n}") or 0.0, row.number(f"jerk_{n}") or 0.0) for n in (1, 2, 3)]
    return RampDrawing(row, speed, acceleration, tuple(Phase(*one) for one in told if one[0] > 0))


NAMES = {"ramp_of": ramp_of}
