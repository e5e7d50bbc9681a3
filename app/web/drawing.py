"""Geometry of what moves: where a value stands on an indicator or a dial. Pure numbers, no markup.

The same knots go to the live script as `data-map` (`value:place value:place …`), which interpolates between them as `Knots.at` does.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

BAND = (0.35, 0.65)
"""Where the normal band of every indicator stands, so that healthy pointers line up [part of the width]."""
LIMITS = (0.12, 0.88)
"""Where its nearest alarm limits stand."""


@dataclass(frozen=True, slots=True)
class Knots:
    """A piecewise linear scale from values to places; outside it stays at its ends."""

    points: tuple[tuple[float, float], ...]
    """(value, place), values rising."""

    def at(self, value: float) -> float:
        """Place of `value`, to a tenth."""
        first, last = self.points[0], self.points[-1]
        if value <= first[0]:
            return tenth(first[1])
        for (a, x), (b, y) in zip(self.points, self.points[1:], strict=False):
            if value <= b:
                return tenth(x + (y - x) * (value - a) / (b - a))
        return tenth(last[1])

    def scaled(self, start: float, length: float) -> "Knots":
        """The same scale to places from `start` over `length` (which may be negative)."""
        return Knots(tuple((value, start + length * place) for value, place in self.points))

    def stretched(self, factor: float) -> "Knots":
        """The scale for values that are `factor` times smaller: a frequency on a scale of speeds."""
        pairs = sorted((value / factor, place) for value, place in self.points)
        return Knots(tuple(pairs))

    def __str__(self) -> str:
        return " ".join(f"{value:.10g}:{place:.6g}" for value, place in self.points)


@dataclass(frozen=True, slots=True)
class Indicator:
    """A moving analog indicator: scale with the normal band at its fixed place and the alarm limits as notches."""

    knots: Knots
    """Value → part of the width, 0 to 1."""
    limits: tuple[float, ...]
    """Values of alarm limits to be marked."""
    low: float
    """Ends of the scale [EU]."""
    high: float


def indicator(low: float, high: float, normal: tuple[float, float], limits: Sequence[float] = ()) -> Indicator:
    """The indicator of a scale from `low` to `high` with its normal band and alarm limits [EU].

    Limits stand at 12 % and 88 %, the band from 35 % to 65 %, linear in between. Where a limit is missing, the scale runs straight from
    the band to its end; a limit beyond the end of the scale pushes the end out.
    """
    band_low, band_high = normal
    below = max((limit for limit in limits if limit < band_low), default=None)
    above = min((limit for limit in limits if limit > band_high), default=None)
    low = min([low, band_low, *limits])
    high = max([high, band_high, *limits])
    places: dict[float, float] = {}
    for value, place in (
        (band_low, BAND[0]),
        (band_high, BAND[1]),
        (below, LIMITS[0]),
        (above, LIMITS[1]),
        (low, 0.0),
        (high, 1.0),
    ):
        if value is not None:
            places.setdefault(value, place)
    return Indicator(Knots(tuple(sorted(places.items()))), tuple(limits), low, high)


@dataclass(frozen=True, slots=True)
class Dial:
    """A semicircle with its lowest value at the left, drawn in user units; angles count from 12 o'clock, clockwise [°]."""

    low: float
    high: float
    x: float = 150.0
    y: float = 138.0
    radius: float = 116.0
    sweep: float = 98.0
    """Half of the arc [°]."""

    @property
    def knots(self) -> Knots:
        """Value → angle [°]."""
        return Knots(((self.low, -self.sweep), (self.high, self.sweep)))

    def angle(self, value: float) -> float:
        """Angle of `value` [°]."""
        return self.knots.at(value)

    def point(self, angle: float, radius: float) -> str:
        """A point of the drawing as `x y`."""
        turn = math.radians(angle)
        return f"{tenth(self.x + radius * math.sin(turn)):g} {tenth(self.y - radius * math.cos(turn)):g}"

    def arc(self, low: float, high: float) -> str:
        """Path of the arc between two values."""
        first, last = sorted((self.angle(low), self.angle(high)))
        large = 1 if last - first > 180 else 0
        return f"M{self.point(first, self.radius)}A{self.radius:g} {self.radius:g} 0 {large} 1 {self.point(last, self.radius)}"

    def notch(self, value: float, inner: float, outer: float) -> str:
        """Path of a short line across the arc at `value`, from radius `inner` to `outer`."""
        angle = self.angle(value)
        return f"M{self.point(angle, inner)}L{self.point(angle, outer)}"

    @property
    def ticks(self) -> tuple[float, ...]:
        """Round values between the ends, at most nine."""
        return round_steps(self.low, self.high, 9)[1:-1]


@dataclass(frozen=True, slots=True)
class Scale:
    """A drawing to scale: lengths from `low` to `high` [EU] on `span` user units from `start`."""

    low: float
    high: float
    start: float
    span: float

    @property
    def factor(self) -> float:
        """User units per unit of length."""
        return self.span / (self.high - self.low)

    def at(self, value: float) -> float:
        """Place of `value`, to a tenth."""
        return tenth(self.start + self.factor * (value - self.low))

    def length(self, value: float) -> float:
        """Length of `value`, to a tenth."""
        return tenth(self.factor * value)

    @property
    def labels(self) -> tuple[float, ...]:
        """Round values to be written at the ruler, its ends included, none so near to the last that they would touch."""
        steps = round_steps(self.low, self.high, 9)
        return tuple(value for value in steps[:-1] if self.high - value > (self.high - self.low) / 18) + steps[-1:]

    @property
    def ticks(self) -> tuple[float, ...]:
        """Values of the short lines of the ruler: five to each step between labels."""
        step = (self.labels[1] - self.labels[0]) / 5 if len(self.labels) > 2 else (self.high - self.low) / 5
        count = int((self.high - self.low) / step + 1e-9)
        return tuple(self.low + step * index for index in range(count + 1))


@dataclass(frozen=True, slots=True)
class Panel:
    """A rectangle of a drawing with its scales; places in the drawing's units, to a tenth."""

    left: float
    top: float
    width: float
    height: float
    across: tuple[float, float]
    """Ends of the horizontal scale [EU]."""
    up: tuple[float, float]
    """Ends of the vertical scale, lower one first [EU]."""

    @property
    def right(self) -> float:
        """Right border."""
        return self.left + self.width

    @property
    def bottom(self) -> float:
        """Lower border."""
        return self.top + self.height

    def x(self, value: float) -> float:
        """Place of a value of the horizontal scale."""
        low, high = self.across
        return round(self.left + (value - low) / (high - low) * self.width, 1)

    def y(self, value: float) -> float:
        """Place of a value of the vertical scale."""
        low, high = self.up
        return round(self.bottom - (value - low) / (high - low) * self.height, 1)

    def path(self, points: Iterable[tuple[float, float]]) -> str:
        """The line through `points` that are inside, as SVG writes it; empty when there is none."""
        (left, right), (low, high) = self.across, self.up
        inside = [(x, y) for x, y in points if left <= x <= right and low <= y <= high]
        return "M" + "L".join(f"{self.x(x)} {self.y(y)}" for x, y in inside) if inside else ""


def round_steps(low: float, high: float, most: int) -> tuple[float, ...]:
    """Round values of equal distance (1, 2 or 5 times a power of ten) from `low` to `high`, at most `most`, the ends included."""
    if not low < high:
        return (low,)
    rough = (high - low) / max(1, most - 1)
    power = 10 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 5, 10, 20) if (high - low) / (power * factor) <= most - 1)
    inner = [index * step for index in range(math.ceil(low / step), math.floor(high / step) + 1)]
    return tuple(dict.fromkeys([low, *(round(value, 9) for value in inner if low < value < high), high]))


def tenth(value: float) -> float:
    """To one decimal, halves upward, as the live script rounds; never −0."""
    return math.floor(value * 10 + 0.5) / 10 + 0.0
