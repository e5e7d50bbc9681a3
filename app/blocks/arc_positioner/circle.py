"""The circle of the lift: X is the trolley's axis, Y the hoist's, angles from X, counted towards Y."""

from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, radians, sin
from typing import NamedTuple, Self


class Point(NamedTuple):
    """Position, or speed, of both axes."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Circle:
    """Centre and radius [mm]."""

    x: float
    y: float
    radius: float

    @classmethod
    def through(cls, point: Point, angle: float, radius: float) -> Self:
        """The circle of `radius` [mm] on which `point` lies at `angle` [°].

        Source: thesis 002, (3.7), (3.8).
        """
        return cls(point.x - radius * cos(radians(angle)), point.y - radius * sin(radians(angle)), radius)

    def at(self, angle: float) -> Point:
        """Point at `angle` [°]."""
        return Point(self.x + self.radius * cos(radians(angle)), self.y + self.radius * sin(radians(angle)))

    def angle(self, point: Point, near: float = 0.0) -> float:
        """Angle of `point` [°], of all its turns the one nearest to `near`; exact everywhere, unlike an arc cosine."""
        angle = degrees(atan2(point.y - self.y, point.x - self.x))
        return angle + 360.0 * round((near - angle) / 360.0)

    def radial_error(self, point: Point) -> float:
        """Way of `point` from the circle [mm], outwards positive."""
        return hypot(point.x - self.x, point.y - self.y) - self.radius
