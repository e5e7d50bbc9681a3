"""The original's ARCH_POSITIONER, formula by formula, with its defects: for comparison only, nothing is driven by it.

Its known defects, reproduced here and nowhere else:

| defect | what follows |
|---|---|
| the angle comes from an arc cosine: it has no sign, and near 0° and 180° its last digits are gone | below 0° it counts up again |
| 45° decides which axis leads, whatever the quarter | right from 0° to 90° only |
| the leading axis gets full speed at once, the other follows the measured speed of both | ramps and lags are path errors |
| neither axis waits for the other's brake | the first one goes alone |
| the rope's stretch is not known to it | |
| each axis stops by its own stopping distance | the end is not reached together |
| the percentage of the last scan stays when it is finished | `percent` |

What the listing shows beside that (SQR for a square root, the error of Y computed and that of X used, a missing square in (3.19, 3.20))
are transcription errors: the formulas of the text are implemented. Of the two greatest speeds the text's lower one counts, or a set speed
below it.

Source: thesis 002, ARCH_POSITIONER, (3.5) to (3.23), reference/theses-facts.md section 2.
"""

from dataclasses import dataclass
from math import acos, cos, degrees, hypot, radians, sqrt
from typing import NamedTuple

from app.blocks.arc_positioner.circle import Circle, Point

STILL = Point(0.0, 0.0)


class OriginalOutputs(NamedTuple):
    """Of one scan."""

    speed: Point
    """[mm/s], signed."""
    percent: Point
    angle: float
    """[°], never below 0."""
    finished: bool


@dataclass(slots=True)
class OriginalArc:
    """ARCH_POSITIONER as printed; `start` and `reset` are levels as there."""

    max_speed: Point
    """[mm/s]"""
    slow_down_time: Point
    """[s]"""
    circle: Circle | None = None
    end: Point = STILL
    stopped: tuple[bool, bool] = (False, False)
    finished: bool = False
    percent: Point = STILL

    def step(
        self,
        start: bool,
        reset: bool,
        position: Point,
        speed: Point,
        start_angle: float,
        end_angle: float,
        radius: float,
        set_speed: float,
        *,
        stop_switch: bool = False,
    ) -> OriginalOutputs:
        """One scan; `position` [mm] and `speed` [mm/s] as measured, lifting when the end angle is the greater one."""
        if reset or self.circle is None:
            self.circle = Circle.through(position, start_angle, radius)
            self.end = self.circle.at(end_angle)
        angle = self._angle(position)
        if not start:
            self.stopped, self.finished = (False, False), False
            return OriginalOutputs(STILL, self.percent, angle, False)
        if abs(start_angle - angle) >= abs(start_angle - end_angle) or stop_switch:
            self.finished, self.stopped = True, (True, True)
        near = [
            abs(at - end) <= v**2 / (2 * greatest / time)
            for at, end, v, greatest, time in zip(
                position, self.end, speed, self.max_speed, self.slow_down_time, strict=True
            )
        ]
        if any(speed):
            self.stopped = (self.stopped[0] or near[0], self.stopped[1] or near[1])
        x, y = self._speeds(
            position, speed, angle, min(set_speed, *self.max_speed), 1 if end_angle > start_angle else -1
        )
        out = Point(0.0 if self.stopped[0] else x, 0.0 if self.stopped[1] else y)
        if any(out):
            self.percent = Point(abs(out.x) / self.max_speed.x * 100, abs(out.y) / self.max_speed.y * 100)
        return OriginalOutputs(out, self.percent, angle, self.finished)

    def _angle(self, position: Point) -> float:
        """(3.13) to (3.17)"""
        circle = self.circle
        assert circle is not None
        length = circle.radius * hypot(position.x - circle.x, position.y - circle.y)
        if not length:
            return 0.0
        return degrees(acos(min(1.0, max(-1.0, circle.radius * (position.x - circle.x) / length))))

    def _speeds(self, position: Point, speed: Point, angle: float, greatest: float, way: int) -> Point:
        """(3.22), (3.23); `way` is +1 for lifting."""
        circle = self.circle
        assert circle is not None
        along, right = hypot(*speed), radians(angle + 90)
        if angle <= 45:
            error = sqrt(max(0.0, circle.radius**2 - (position.y - circle.y) ** 2)) + circle.x - position.x
            x = way * along * cos(right) + error * 0.5
            return Point(min(max(x, -greatest), greatest), way * greatest)
        error = sqrt(max(0.0, circle.radius**2 - (position.x - circle.x) ** 2)) + circle.y - position.y
        y = way * along * cos(radians(angle)) + error * 0.5
        return Point(-way * greatest, min(max(y, -greatest), greatest))
