"""Linear ramp of a speed, with an acceleration and a deceleration of its own."""

from dataclasses import dataclass
from math import copysign, isfinite


def approach(value: float, target: float, rise: float, fall: float) -> float:
    """`value` moved towards `target` by at most `rise` away from zero and `fall` towards it, both of one step.

    A reversal first falls to zero and rises from there with what is left of the step.
    """
    if value * target < 0 or abs(target) < abs(value):
        end = target if value * target > 0 else 0.0
        gap = abs(value - end)
        if fall < gap:
            return value - copysign(fall, value)
        if end == target:
            return target
        value, rise = 0.0, rise * (1 - gap / fall)
    gap = abs(target - value)
    return target if gap <= rise else value + copysign(rise, target - value)


@dataclass(slots=True)
class Ramp:
    """Ramp generator: speed follows its target with bounded acceleration and deceleration.

    Source: thesis 002, RampFunction of S120_MNG (reference/theses-facts.md section 2).

    Raises:
        ValueError: acceleration or deceleration is not a finite number above 0.
    """

    acceleration: float
    """Away from standstill [U/s], above 0."""
    deceleration: float
    """Towards standstill [U/s], above 0."""
    speed: float = 0.0
    """[U]"""

    def __post_init__(self) -> None:
        for name in ("acceleration", "deceleration"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")

    def step(self, target: float, dt: float) -> float:
        """Speed after `dt` [s] towards `target` [U].

        Raises:
            ValueError: target is not finite.
        """
        if not isfinite(target):
            raise ValueError(f"target is {target}, a finite number expected")
        self.speed = approach(self.speed, target, self.acceleration * dt, self.deceleration * dt)
        return self.speed

    @property
    def stop_distance(self) -> float:
        """Way to standstill [U·s], signed."""
        return self.speed * abs(self.speed) / (2 * self.deceleration)
