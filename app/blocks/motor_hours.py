"""Running hours of a motor, and the run-on of its fan."""

from dataclasses import dataclass
from math import isfinite


@dataclass(slots=True)
class RunningHours:
    """Counts while the motor is energised; a reset keeps what there was.

    Source: thesis 002, hours counter per motor with reset from the HMI.
    """

    seconds: float = 0.0
    before: float = 0.0
    """What the last reset took [s]."""
    _resetting: bool = True

    @property
    def hours(self) -> float:
        """[h]"""
        return self.seconds / 3600

    def step(self, running: bool, dt: float, *, reset: bool = False) -> float:
        """One scan of `dt` [s]; `reset` counts when it comes. Gives the hours."""
        if reset and not self._resetting:
            self.before, self.seconds = self.seconds, 0.0
        self._resetting = reset
        if running:
            self.seconds += dt
        return self.hours


@dataclass(slots=True)
class FanRunOn:
    """The fan is on with every use of the motor and `run_on` longer.

    Source: thesis 002, fan run-on time; its value is in no source.

    Raises:
        ValueError: run_on is not a finite number of at least 0.
    """

    run_on: float
    """[s]"""
    left: float = 0.0
    """Of the run-on [s]; counts down with the motor off."""

    def __post_init__(self) -> None:
        if not (isfinite(self.run_on) and self.run_on >= 0):
            raise ValueError(f"run_on is {self.run_on}, a finite number of at least 0 expected")

    def step(self, motor: bool, dt: float) -> bool:
        """One scan of `dt` [s]; whether the fan is on."""
        self.left = self.run_on if motor else max(0.0, self.left - dt)
        return motor or self.left > 0
