"""The hoist's rope as a spring with the load on it."""

from dataclasses import dataclass
from math import sqrt

GRAVITY = 9810.0
"""[mm/s²]"""


@dataclass(slots=True)
class Rope:
    """Stretch of the rope: at rest load x length x strain, swinging about it when the drum speeds up or slows down.

    With s the stretch, s̈ = ÿ_drum + g - ω²·s - 2·D·ω·ṡ and ω² = g / s_rest (spring and mass; all falls of the reeving are stressed alike).
    Trapezoidal rule, so stable at any step.
    """

    load: float
    """[1 = full load]; 0 = no rope to speak of."""
    strain: float
    """At full load."""
    top: float
    """Drum position at which the rope would have no length [mm]."""
    damping: float = 0.02
    """D, part of critical."""
    stretch: float = 0.0
    """[mm]"""
    speed: float = 0.0
    """[mm/s]"""

    def at_rest(self, drum: float) -> float:
        """Stretch at rest with the drum at `drum` [mm]."""
        return self.load * max(0.0, self.top - drum) * self.strain

    def settle(self, drum: float) -> None:
        """Come to rest."""
        self.stretch, self.speed = self.at_rest(drum), 0.0

    def step(self, drum: float, acceleration: float, dt: float) -> None:
        """`dt` [s] with the drum at `drum` [mm] and speeding up at `acceleration` [mm/s²]."""
        rest = self.at_rest(drum)
        if rest < 1e-3:
            self.settle(drum)
            return
        square = GRAVITY / rest
        damp = 2 * self.damping * sqrt(square)
        force = acceleration + GRAVITY
        before = self.speed
        stiff = square * dt / 4 * dt
        self.speed = (before * (1 - damp * dt / 2 - stiff) + dt * (force - square * self.stretch)) / (
            1 + damp * dt / 2 + stiff
        )
        self.stretch += (before + self.speed) / 2 * dt
