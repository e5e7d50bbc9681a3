"""The axis behind a servo drive: motor, ball screw and slide, absolute encoder, position and speed controller.

Friction, inertia and time constants are assumed, of a motor of 0.38 kW with a screw of 10 mm; the thesis names only the motor's family
(reference/theses-facts.md section 4).
"""

from dataclasses import dataclass
from math import copysign, pi

LU_PER_TURN = 10_000.0
"""p2506: 1 LU = 1 µm with a screw of 10 mm."""
RATED_SPEED = 3000.0
"""[rpm]"""
RATED_TORQUE, MOST_TORQUE = 1.2, 3.6
"""[Nm]"""
TORQUE_PER_AMPERE = 0.8
"""[Nm/A]"""
INERTIA = 1.5e-4
"""Motor, screw and slide [kgm²]."""
FRICTION = 0.2
"""[Nm]"""
DAMPING = 4e-4
"""[Nm per rad/s]"""
SPEED_TIME = 0.015
"""Of the speed controller [s]."""
WARMING = 600.0
"""Time constant of the motor [s]."""
TEMPERATURE_RISE = 70.0
"""At rated current [K]."""
OVERTRAVEL = 5_000.0
"""Of the slide beyond its software limits, up to the mechanical stops [LU]."""


@dataclass(slots=True)
class Axis:
    """What turns and slides; positions from 0 at the lower end of the travel."""

    travel: float
    """From 0 to here between the software limits [LU]."""
    position: float = 0.0
    """True position [LU]."""
    speed: float = 0.0
    """[LU/s]"""
    torque: float = 0.0
    """[Nm]"""
    temperature: float = 40.0
    """Of the motor [°C]."""
    energy: float = 0.0
    """[kWh]"""
    limited: bool = False
    """The torque is at its limit."""

    @property
    def rpm(self) -> float:
        """Of the motor."""
        return self.speed / LU_PER_TURN * 60

    @property
    def current(self) -> float:
        """[A]"""
        return abs(self.torque) / TORQUE_PER_AMPERE

    @property
    def power(self) -> float:
        """At the shaft [kW], negative while it brakes."""
        return self.torque * self.speed / LU_PER_TURN * 2 * pi / 1000

    def drive(self, command: float, load: float, blocked: bool, dt: float) -> None:
        """One step of `dt` [s] with pulses, towards `command` [LU/s]; `load`: more friction [1 = rated torque]."""
        wanted = (command - self.speed) / max(SPEED_TIME, dt)
        friction = self._friction(command, load)
        torque = _radians(wanted) * INERTIA + friction + DAMPING * _radians(self.speed)
        self.limited = abs(torque) > MOST_TORQUE
        self.torque = copysign(min(abs(torque), MOST_TORQUE), torque)
        self._turn(self.torque, friction, blocked, dt)

    def coast(self, load: float, blocked: bool, dt: float) -> None:
        """One step without pulses."""
        self.torque, self.limited = 0.0, False
        if self.speed:
            self._turn(0.0, self._friction(self.speed, load), blocked, dt, coasting=True)

    def warm(self, ambient: float, dt: float) -> None:
        """Heat of one step."""
        share = (self.torque / RATED_TORQUE) ** 2
        self.temperature += (ambient + TEMPERATURE_RISE * share - self.temperature) * dt / WARMING
        self.energy += max(0.0, self.power) * dt / 3600

    def _turn(self, torque: float, friction: float, blocked: bool, dt: float, *, coasting: bool = False) -> None:
        before = self.speed
        if not before and abs(torque) <= abs(friction):
            return  # friction stops, it never drives
        self.speed += _units((torque - friction - DAMPING * _radians(self.speed)) / INERTIA) * dt
        if before * self.speed <= 0 and (coasting or (before and abs(torque) <= abs(friction))):
            self.speed = 0.0
        self.position += self.speed * dt
        low, high = -OVERTRAVEL, self.travel + OVERTRAVEL
        if blocked:
            self.position -= self.speed * dt
            self.speed = 0.0
        elif not low <= self.position <= high:
            self.position, self.speed = min(max(self.position, low), high), 0.0

    @staticmethod
    def _friction(towards: float, load: float) -> float:
        return copysign(FRICTION + load * RATED_TORQUE, towards) if towards else 0.0


def _radians(units: float) -> float:
    """[rad] of [LU], and so for speeds and accelerations."""
    return units / LU_PER_TURN * 2 * pi


def _units(radians: float) -> float:
    return radians / (2 * pi) * LU_PER_TURN
