"""The output of an E800: its V/f curve with boost, and the slip compensation of vector control."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

from app.sim.induction_motor import SQRT3, InductionMotor

LOWEST_OUTPUT = 0.05
"""Lowest frequency the output makes, also while it passes zero [Hz]."""
SLIP_TIME = 0.2
"""Time constant of the slip compensation [s]."""
ROOT2 = sqrt(2.0)


@dataclass(slots=True)
class Inverter:
    """Voltage and frequency at the terminals of `motor`. `values` in its calls: the parameters by code."""

    motor: InductionMotor
    voltage: float = 0.0
    """Line to line [V rms]."""
    _slip: float = 0.0
    """State of the compensation [Hz]."""

    def off(self) -> None:
        """No voltage; the motor has no current from now on, and its speed."""
        self.voltage = 0.0
        self.motor.step(0.0, 1.0, 0.0, 0.0, 0.0)

    def reset(self) -> None:
        """Nothing compensated yet."""
        self._slip = 0.0

    def supply(self, frequency: float, bus: float, values: Mapping[str, float], dt: float) -> float:
        """Set the voltage for `frequency` [Hz, 0 or above] at a `bus` [V DC]; the frequency that the motor gets [Hz]."""
        supplied = max(LOWEST_OUTPUT, frequency)
        if values["F106"] in (0, 3) and frequency > 1.0:
            data = self.motor.data
            wanted = data.rated_slip_frequency * min(max(self.motor.point.torque / data.rated_torque, -1.5), 1.5)
            self._slip += (wanted - self._slip) * dt / SLIP_TIME
            supplied = max(LOWEST_OUTPUT, frequency + self._slip)
        else:
            self._slip = 0.0
        self.limit(frequency, bus, values)
        return supplied

    def limit(self, frequency: float, bus: float, values: Mapping[str, float]) -> None:
        """Voltage of the curve at `frequency` [Hz], as far as the `bus` [V DC] allows it."""
        self.voltage = min(self.curve(frequency, values), bus / ROOT2)

    def curve(self, frequency: float, values: Mapping[str, float]) -> float:
        """The V/f curve: line voltage [V] at `frequency` [Hz, 0 or above], the bus permitting."""
        nominal = values["F802"]
        part = frequency / values["F118"]
        if part >= 1:
            return nominal
        curve = values["F137"]
        if curve == 3 or values["F106"] in (0, 3):
            return min(nominal, nominal * part + self.motor.data.rs * self.motor.point.current / SQRT3)
        if curve == 1:
            boost = 0.01 * nominal * values["F139"]
            return boost + (nominal - boost) * part * part
        boost = 0.01 * nominal * values["F138"] if curve == 0 else 0.0
        return boost + (nominal - boost) * part
