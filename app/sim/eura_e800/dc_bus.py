"""The DC bus of an E800: rectifier, capacitor and what the inverter takes out or, braking, puts in; there is no chopper."""

from dataclasses import dataclass
from math import sqrt
from random import Random

from app.sim.eura_e800.inverter import ROOT2

DRIVE_RATED_CURRENT = 4.5
"""E800-0007S2 [A]; a bigger motor gets a drive of its own size."""
CAPACITY = 470e-6
"""[F], for the drive of 4.5 A at 230 V; a drive of another class keeps the energy, not the charge."""
CHARGING_TIME = 0.03
"""Time constant of the rectifier [s]."""


@dataclass(slots=True)
class DcBus:
    """Its voltage, from a mains that never stands quite still. The same random sequence gives the same voltages."""

    random: Random
    size: float
    """Of the drive [1 = 4.5 A]."""
    level: float
    """Of its class [1 = 230 V]."""
    voltage: float
    """[V DC]"""
    _mains: float = 0.0
    _ticks: int = 0

    def step(self, supply: float, disturbed: float, power: float, dt: float) -> None:
        """Advance by `dt` [s] on a `supply` [V rms] times `disturbed`, while `power` [W] is drawn; below 0 it is fed back."""
        if self._ticks % 10 == 0:
            self._mains = 0.97 * self._mains + 0.25 * self.level * self.random.gauss(0.0, 1.0)
        self._ticks += 1
        supplied = (supply + self._mains) * disturbed
        rectified = max(0.0, ROOT2 * supplied - 9.0 * max(0.0, power) / (750.0 * self.size))
        bus = self.voltage
        if power < 0 or bus > rectified:
            left = sqrt(max(0.0, bus * bus - 2 * power * dt / (CAPACITY * self.size / self.level)))
            self.voltage = max(left, min(rectified, bus))
        else:
            self.voltage = bus + (rectified - bus) * dt / CHARGING_TIME
