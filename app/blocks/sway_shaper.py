"""Anti-sway: shapes the speed of a trolley or bridge so that the load hangs still at the end of every change of speed."""

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from math import exp, isfinite, pi, sqrt
from typing import NamedTuple

GRAVITY = 9810.0
"""[mm/s²]"""


class Shaping(Enum):
    """How."""

    OFF = "off"
    ZV = "zv"
    """Zero vibration: two impulses, half a period."""
    ZVD = "zvd"
    """Zero vibration and derivative: three impulses, a period; bears a wrong rope length."""


class Shaped(NamedTuple):
    """What a scan gives."""

    speed: float
    """[mm/s]"""
    held: float
    """Way that would follow yet if the speed asked for were 0 from now [mm], signed."""
    delay: float
    """Mean delay [s]: way of a constant speed that follows after its end, by that speed."""


def period(length: float, damping: float = 0.0) -> float:
    """Period of a pendulum of `length` [mm], `damping` as part of critical [s]."""
    return 2 * pi * sqrt(max(0.0, length) / GRAVITY) / sqrt(1 - damping**2)


@dataclass(slots=True)
class SwayShaper:
    """Input shaper behind a ramp and before the drive.

        K = exp(-ζ·π / √(1-ζ²))     T = 2π·√(L/g) / √(1-ζ²)
        ZV   1/(1+K) now, K/(1+K) after T/2
        ZVD  1/(1+K)² now, 2K/(1+K)² after T/2, K²/(1+K)² after T

    The sum of the parts is 1, so no speed and no acceleration gets greater than what goes in. A change of the kind counts at rest only.
    `clear` forgets what is held: an emergency stop is never shaped.

    Source: N. C. Singer, W. P. Seering, Preshaping Command Inputs to Reduce System Vibration, ASME J. Dyn. Sys. 112 (1990).

    Raises:
        ValueError: longest or dt is not a finite number above 0, or damping is not in 0 to 0.9.
    """

    longest: float
    """Greatest rope length [mm]."""
    dt: float
    """Scan period [s]."""
    shaping: Shaping = Shaping.ZVD
    damping: float = 0.0
    """Part of critical."""
    _past: deque[tuple[float, float]] = field(init=False)
    """(speed, way so far), the newest last."""

    def __post_init__(self) -> None:
        for name in ("longest", "dt"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")
        if not 0 <= self.damping <= 0.9:
            raise ValueError(f"damping is {self.damping}, 0 to 0.9 expected")
        room = int(period(self.longest, self.damping) / self.dt) + 3
        self._past = deque([(0.0, 0.0)] * room, maxlen=room)

    def step(self, speed: float, length: float, shaping: Shaping | None = None) -> Shaped:
        """One scan with `speed` [mm/s] asked for and a rope of `length` [mm]; `shaping` as chosen now.

        Raises:
            ValueError: speed or length is not finite.
        """
        for name, value in (("speed", speed), ("length", length)):
            if not isfinite(value):
                raise ValueError(f"{name} is {value}, a finite number expected")
        past = self._past
        if shaping is not None and shaping is not self.shaping and not speed and not any(v for v, _ in past):
            self.shaping = shaping
        past.append((speed, past[-1][1] + (past[-1][0] + speed) / 2 * self.dt))
        shaped = held = delay = 0.0
        for part, after in self._impulses(min(length, self.longest)):
            then, way = self._at(after)
            shaped += part * then
            held += part * (past[-1][1] - way)
            delay += part * after
        return Shaped(shaped, held, delay)

    def clear(self) -> None:
        """Forget what is held: the drive was stopped elsewhere."""
        self._past.extend([(0.0, 0.0)] * len(self._past))

    def _impulses(self, length: float) -> tuple[tuple[float, float], ...]:
        """(part, after so many seconds)."""
        if self.shaping is Shaping.OFF:
            return ((1.0, 0.0),)
        decay = exp(-self.damping * pi / sqrt(1 - self.damping**2))
        whole = period(length, self.damping)
        if self.shaping is Shaping.ZV:
            return (1 / (1 + decay), 0.0), (decay / (1 + decay), whole / 2)
        square = (1 + decay) ** 2
        return (1 / square, 0.0), (2 * decay / square, whole / 2), (decay**2 / square, whole)

    def _at(self, after: float) -> tuple[float, float]:
        """(speed, way) so many seconds ago, between two scans in proportion."""
        scans = after / self.dt
        whole = int(scans)
        part = scans - whole
        (v, x), (w, y) = self._past[-1 - whole], self._past[-2 - whole]
        return v + part * (w - v), x + part * (y - x)
