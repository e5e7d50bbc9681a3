"""What a motor turns: a constant and a quadratic torque that never stand quite still."""

from dataclasses import dataclass, field
from math import exp, sqrt
from random import Random

DRAW = 10
"""Steps between two random draws; the torque glides from one to the next."""
WALK_TIME = 8.0
"""Correlation time of the slow walk [s]."""
BUMP_EVERY = 25.0
"""Mean time between bumps [s]."""


@dataclass(slots=True)
class Load:
    """Load torque in parts of the rated torque, with a seeded disturbance. The same seed gives the same torque, step by step."""

    random: Random
    constant: float = 0.0
    """Opposes motion at any speed [1 = rated torque]."""
    quadratic: float = 0.0
    """At rated speed [1 = rated torque]."""
    disturbance: float = 0.0
    """Usual size of the variation [1 = rated torque]."""
    stiction: float = 1.25
    """Torque to break away, as a multiple of `constant`."""
    variation: float = 0.0
    """State: present variation [1 = `disturbance`]."""
    _walk: float = 0.0
    _bump: float = 0.0
    _bump_left: float = 0.0
    _steps: int = 0
    _slope: float = field(default=0.0)

    def step(self, dt: float) -> None:
        """Advance the variation by `dt` [s]."""
        if self._steps % DRAW == 0:
            self._draw(DRAW * dt)
        self._steps += 1
        self.variation += self._slope

    @property
    def torque(self) -> float:
        """Part that does not depend on speed, never driving [1 = rated torque]."""
        return max(0.0, self.constant + self.disturbance * self.variation)

    @property
    def breakaway(self) -> float:
        """To be overcome from standstill [1 = rated torque]."""
        return max(self.torque, self.stiction * self.constant)

    def _draw(self, dt: float) -> None:
        """An Ornstein-Uhlenbeck step of `dt` [s], and now and then a bump of 1 to 3 times the disturbance."""
        keep = exp(-dt / WALK_TIME)
        self._walk = keep * self._walk + 0.5 * sqrt(1 - keep * keep) * self.random.gauss(0.0, 1.0)
        self._bump_left -= dt
        if self._bump_left <= 0:
            self._bump = 0.0
            if self.random.random() < dt / BUMP_EVERY:
                self._bump = self.random.uniform(1.0, 3.0)
                self._bump_left = self.random.uniform(0.4, 1.5)
        self._slope = (self._walk + self._bump - self.variation) / DRAW
