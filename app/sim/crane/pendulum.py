"""The load on its rope under a trolley or bridge."""

from dataclasses import dataclass
from math import cos, sin, sqrt

GRAVITY = 9810.0
"""[mm/s²]"""


@dataclass(slots=True)
class Pendulum:
    """Plane pendulum of changing length under a moving point.

    L·φ̈ = -g·sin φ - a·cos φ - 2·L̇·φ̇ - 2·D·√(g·L)·φ̇, with a the acceleration of the point; fourth-order Runge-Kutta.
    """

    damping: float = 0.0
    """D, part of critical."""
    angle: float = 0.0
    """[rad], ahead of the point positive."""
    rate: float = 0.0
    """[rad/s]"""

    def step(self, acceleration: float, length: float, hoisting: float, dt: float) -> float:
        """`dt` [s] under `acceleration` [mm/s²] with a rope of `length` [mm] that gets longer at `hoisting` [mm/s]; gives the sway [mm]."""
        damp = 2 * self.damping * sqrt(GRAVITY * length)

        def slope(angle: float, rate: float) -> tuple[float, float]:
            push = GRAVITY * sin(angle) + acceleration * cos(angle) + (2 * hoisting + damp) * rate
            return rate, -push / length

        angle, rate = self.angle, self.rate
        a = slope(angle, rate)
        b = slope(angle + dt / 2 * a[0], rate + dt / 2 * a[1])
        c = slope(angle + dt / 2 * b[0], rate + dt / 2 * b[1])
        d = slope(angle + dt * c[0], rate + dt * c[1])
        self.angle += dt / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        self.rate += dt / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        return self.sway(length)

    def sway(self, length: float) -> float:
        """How far the load is ahead of the point [mm]."""
        return length * sin(self.angle)

    def amplitude(self, length: float) -> float:
        """How far it will swing if the point goes on without a change of speed [mm]; small angles."""
        return length * sqrt(self.angle**2 + self.rate**2 * length / GRAVITY)
