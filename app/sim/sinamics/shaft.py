"""A motor under speed control with its load: torque up to the limit that the current allows, speed implicitly integrated.

Data of the motor as in `sim/induction_motor.py`. That model's quasi-static V/f supply does not fit here: a SINAMICS closes a speed loop
over the torque, so torque is given and the circuit follows. Current is √(magnetising² + torque-producing²); above rated frequency the flux
falls with the speed. Loop gains are ours.
"""

from dataclasses import dataclass, field
from math import copysign, pi, sqrt
from typing import NamedTuple

from app.sim.induction_motor import SQRT3, MotorData, operating_point, rated_point

RATED_VOLTAGE, RATED_FREQUENCY = 400.0, 50.0
BANDWIDTH = 10.0
"""Of the speed loop [1/s]."""
RPM = 30 / pi
"""[rpm] of 1 rad/s."""


class Supply(NamedTuple):
    """What the drive asks of the motor in one step."""

    pulses: bool
    setpoint: float = 0.0
    """[rad/s]"""
    flux: float = 0.0
    """[1 = rated]"""
    current_limit: float = 0.0
    """[A rms]"""


class Resistance(NamedTuple):
    """What resists the shaft."""

    constant: float
    """[Nm], against the motion"""
    breakaway: float
    """[Nm]"""
    quadratic: float
    """[Nm s²]"""


@dataclass(slots=True)
class Shaft:
    """Motor, speed loop and rotating mass."""

    data: MotorData
    inertia: float
    """[kg m²], with the load"""
    speed: float = 0.0
    """[rad/s], negative in reverse"""
    torque: float = 0.0
    """At the shaft [Nm]."""
    current: float = 0.0
    """[A rms]"""
    voltage: float = 0.0
    """Line to line [V rms]."""
    frequency: float = 0.0
    """Of the field [Hz], negative in reverse."""
    power: float = 0.0
    """Electrical, negative when it comes back [W]."""
    losses: float = 0.0
    """[W]"""
    limited: bool = False
    """Whether the torque is at its limit."""
    magnetising_current: float = field(init=False)
    """[A rms]"""
    torque_current: float = field(init=False)
    """Torque-producing current at rated torque [A rms]."""
    _integral: float = 0.0

    def __post_init__(self) -> None:
        rated = rated_point(self.data, RATED_VOLTAGE, "star").current
        self.magnetising_current = operating_point(self.data, RATED_VOLTAGE, RATED_FREQUENCY, 1e-6, "star").current
        self.torque_current = sqrt(rated * rated - self.magnetising_current**2)

    def weakening(self, speed: float) -> float:
        """Flux that the voltage allows at `speed` [rad/s]; 1 = rated."""
        synchronous = 2 * pi * RATED_FREQUENCY / self.data.pole_pairs
        return min(1.0, synchronous / max(abs(speed), 1e-9))

    def torque_limit(self, flux: float, current_limit: float) -> float:
        """Greatest torque [Nm] at `flux` [1 = rated] with `current_limit` [A]."""
        idle = flux * self.magnetising_current
        left = sqrt(max(0.0, current_limit * current_limit - idle * idle))
        return flux * self.data.rated_torque * left / self.torque_current

    def step(self, supply: Supply, load: Resistance, dt: float) -> None:
        """Advance by `dt` [s]."""
        before = self.speed
        flux = supply.flux * self.weakening(before)
        limit = self.torque_limit(flux, supply.current_limit) if supply.pulses else 0.0
        gain = BANDWIDTH * self.inertia
        resistance = load.constant + load.quadratic * before * before
        side = copysign(1.0, before) if before else 0.0
        if supply.pulses:
            per_second = self.inertia / dt
            after = (per_second * before + gain * supply.setpoint + self._integral - side * resistance) / (
                per_second + gain
            )
            wanted = gain * (supply.setpoint - after) + self._integral
            self.torque = min(max(wanted, -limit), limit)
            self.limited = abs(wanted) > limit
            if not self.limited:
                self._integral += gain * BANDWIDTH / 4 * (supply.setpoint - after) * dt
        else:
            self.torque, self.limited, self._integral = 0.0, False, 0.0
        self.speed = self._moved(before, side, resistance, load.breakaway, dt)
        self._electrical(supply, flux)

    def _moved(self, before: float, side: float, resistance: float, breakaway: float, dt: float) -> float:
        """Speed after `dt`; friction stops, it never drives."""
        if not side:
            if abs(self.torque) <= breakaway:
                return 0.0
            side = copysign(1.0, self.torque)
        after = before + (self.torque - side * resistance) * dt / self.inertia
        if before and after * before < 0 and abs(self.torque) <= breakaway:
            return 0.0
        return after

    def _electrical(self, supply: Supply, flux: float) -> None:
        data = self.data
        if not supply.pulses:
            self.current = self.voltage = self.frequency = self.power = self.losses = 0.0
            return
        part = self.torque / data.rated_torque / flux if flux > 0.05 else 0.0
        slip = data.rated_slip_frequency * part / max(flux, 0.05) if flux else 0.0
        self.frequency = self.speed * data.pole_pairs / (2 * pi) + slip
        self.current = sqrt((flux * self.magnetising_current) ** 2 + (part * self.torque_current) ** 2)
        drop = SQRT3 * data.rs * self.current
        self.voltage = min(RATED_VOLTAGE, RATED_VOLTAGE * abs(self.frequency) / RATED_FREQUENCY * flux + drop)
        copper = 3 * data.rs * self.current**2
        rotor = abs(self.torque * 2 * pi * slip / data.pole_pairs)
        iron = RATED_VOLTAGE * RATED_VOLTAGE / data.r_fe * flux * flux * min(1.0, abs(self.frequency) / RATED_FREQUENCY)
        self.losses = copper + rotor + iron
        self.power = self.torque * self.speed + self.losses

    def settle(self, speed: float, supply: Supply, load: Resistance) -> None:
        """Turn at `speed` [rad/s] as if for long, loop and currents included."""
        self.speed = speed
        self._integral = copysign(load.constant + load.quadratic * speed * speed, speed) if speed else 0.0
        self.torque = self._integral
        self._electrical(supply, supply.flux * self.weakening(speed))
