"""What a SINAMICS drive watches: faults that trip it, their causes, and alarms that only warn."""

from dataclasses import dataclass, field

from app.sim.sinamics import messages
from app.sim.sinamics.messages import ALARMS, FAULTS
from app.sim.sinamics.power import PowerUnit

REACTION_PATIENCE = 1.0
"""Blocked at the limit for so long: F07900 [s]."""
DEVIATION_PATIENCE = 2.0
"""Away from the set-point for so long: A07903 [s]."""
OVER, UNDER = 820.0, 360.0
"""DC link: trip above, trip below [V]."""
MOTOR_WARM, MOTOR_HOT, MOTOR_RESET = 120.0, 145.0, 110.0
SINK_WARM, SINK_HOT, SINK_RESET = 75.0, 85.0, 70.0
"""[°C]"""


@dataclass(frozen=True, slots=True)
class Watched:
    """What the drive does in this step."""

    pulses: bool
    operating: bool
    ramp: float
    """Asked for [rpm]."""
    tolerance: float
    """How far the speed may be away from that, p2163 [rpm]."""
    standstill: float
    """Below it the motor stands, p1226 [rpm]."""
    greatest_speed: float
    """p1082 [rpm]"""
    injected: int
    """Fault or alarm that the instructor causes, 0 = none."""


@dataclass(slots=True)
class Monitoring:
    """Alarms that are there, and how long something has been wrong."""

    alarms: list[int] = field(default_factory=list)
    """In the order in which they came."""
    _away_for: float = 0.0
    _blocked_for: float = 0.0

    def forgive(self) -> None:
        """The instructor began or ended something: blocking counts anew."""
        self._blocked_for = 0.0

    @staticmethod
    def causes(power: PowerUnit, injected: int, present: list[int]) -> list[int]:
        """Faults whose cause is there now, and that no acknowledgement takes away; `present`: those that stand."""
        found = [injected] if injected in FAULTS and injected != messages.BLOCKED else []
        for number, there in (
            (messages.MOTOR_HOT, power.motor_temperature >= MOTOR_RESET),
            (messages.SINK_HOT, power.sink_temperature >= SINK_RESET),
            (messages.UNDERVOLTAGE, power.bus_voltage < UNDER),
            (messages.OVERVOLTAGE, power.bus_voltage > OVER),
            (messages.OVERLOAD, power.overload >= 0.9),
        ):
            if there and number in present and number not in found:
                found.append(number)
        return found

    def step(self, power: PowerUnit, it: Watched, dt: float) -> list[int]:
        """One step of `dt` [s]: faults that come; alarms come and go."""
        speed = power.speed
        blocked = it.pulses and power.shaft.limited and abs(speed) < it.standstill
        self._blocked_for = self._blocked_for + dt if blocked else 0.0
        away = it.operating and abs(it.ramp - speed) > it.tolerance
        self._away_for = self._away_for + dt if away else 0.0
        self._warn(power, it.injected)
        return [
            number
            for number, there in (
                (messages.MOTOR_HOT, power.motor_temperature > MOTOR_HOT),
                (messages.SINK_HOT, power.sink_temperature > SINK_HOT),
                (messages.OVERLOAD, power.overload >= 1.0),
                (messages.OVERVOLTAGE, power.bus_voltage > OVER),
                (messages.UNDERVOLTAGE, it.pulses and power.bus_voltage < UNDER),
                (messages.OVERSPEED, it.pulses and abs(speed) > 1.2 * it.greatest_speed + 30),
                (messages.BLOCKED, self._blocked_for > REACTION_PATIENCE),
            )
            if there
        ]

    def _warn(self, power: PowerUnit, injected: int) -> None:
        wanted = {
            messages.MOTOR_WARM: power.motor_temperature > MOTOR_WARM,
            messages.SINK_WARM: power.sink_temperature > SINK_WARM,
            messages.NEAR_OVERLOAD: power.overload > 0.8,
            messages.DEVIATION: self._away_for > DEVIATION_PATIENCE,
        }
        if injected in ALARMS:
            wanted[injected] = True
        self.alarms = [number for number in self.alarms if wanted.get(number)]
        self.alarms += [number for number, there in wanted.items() if there and number not in self.alarms]
