"""Rest-to-rest move with bounded speed, acceleration and jerk, as a formula of time."""

from dataclasses import dataclass, field
from math import cbrt, isfinite, sqrt
from typing import NamedTuple


class Motion(NamedTuple):
    """Where a move is."""

    way: float
    """[mm]"""
    speed: float
    """[mm/s]"""
    acceleration: float
    """[mm/s²]"""


@dataclass(frozen=True, slots=True)
class MotionProfile:
    """The quickest way over `distance` from rest to rest: seven phases of constant jerk, mirrored about the middle.

    Source: double-S velocity profile, L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, Springer 2008,
    section 3.4, with start and end at rest.

    Raises:
        ValueError: distance is below 0 or not finite, or a limit is not a finite number above 0.
    """

    distance: float
    """[mm], at least 0."""
    speed: float
    """Greatest [mm/s]; `peak` is what is reached."""
    acceleration: float
    """Greatest [mm/s²]."""
    jerk: float
    """Greatest [mm/s³]."""
    peak: float = field(init=False)
    """[mm/s]"""
    duration: float = field(init=False)
    """[s]"""
    _jerk_time: float = field(init=False)
    _rise_time: float = field(init=False)
    _half: tuple[Motion, ...] = field(init=False)

    def __post_init__(self) -> None:
        if not (isfinite(self.distance) and self.distance >= 0):
            raise ValueError(f"distance is {self.distance}, a finite number of at least 0 expected")
        for name in ("speed", "acceleration", "jerk"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")
        distance, acceleration, jerk = self.distance, self.acceleration, self.jerk
        short = self.speed * jerk < acceleration**2
        jerk_time = sqrt(self.speed / jerk) if short else acceleration / jerk
        rise_time = 2 * jerk_time if short else jerk_time + self.speed / acceleration
        peak, cruise = self.speed, distance / self.speed - rise_time
        if cruise < 0:
            cruise, jerk_time = 0.0, acceleration / jerk
            rise_time = jerk_time / 2 + sqrt(jerk_time**2 / 4 + distance / acceleration)
            if rise_time < 2 * jerk_time:
                jerk_time = cbrt(distance / (2 * jerk))
                rise_time = 2 * jerk_time
            peak = distance / rise_time if rise_time else 0.0
        ends = [Motion(0.0, 0.0, 0.0)]
        for change, time in ((jerk, jerk_time), (0.0, rise_time - 2 * jerk_time), (-jerk, jerk_time)):
            ends.append(_after(ends[-1], change, time))
        for name, value in (
            ("peak", peak),
            ("duration", 2 * rise_time + cruise),
            ("_jerk_time", jerk_time),
            ("_rise_time", rise_time),
            ("_half", tuple(ends)),
        ):
            object.__setattr__(self, name, value)

    def at(self, time: float) -> Motion:
        """Where the move is `time` [s] after its start; before it and after its end it rests."""
        if time <= 0:
            return self._half[0]
        if time >= self.duration:
            return Motion(self.distance, 0.0, 0.0)
        if 2 * time > self.duration:
            way, speed, acceleration = self._first_half(self.duration - time)
            return Motion(self.distance - way, speed, -acceleration)
        return self._first_half(time)

    def _first_half(self, time: float) -> Motion:
        start, low, high, top = self._half
        if time < self._jerk_time:
            return _after(start, self.jerk, time)
        if time < self._rise_time - self._jerk_time:
            return _after(low, 0.0, time - self._jerk_time)
        if time < self._rise_time:
            return _after(high, -self.jerk, time - self._rise_time + self._jerk_time)
        return Motion(top.way + self.peak * (time - self._rise_time), self.peak, 0.0)


def _after(begin: Motion, jerk: float, time: float) -> Motion:
    """Constant `jerk` for `time`."""
    way, speed, acceleration = begin
    return Motion(
        way + time * (speed + time * (acceleration / 2 + time * jerk / 6)),
        speed + time * (acceleration + time * jerk / 2),
        acceleration + time * jerk,
    )
