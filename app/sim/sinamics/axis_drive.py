"""The drive of an axis behind telegram 1: states, magnetising, stops, faults; its motion is the axis' (`sim/crane`)."""

from dataclasses import dataclass, field
from typing import NamedTuple

from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import Inputs, Reaction, State, StateMachine
from app.profidrive.words import Control, Status

CALM = (
    Status.LIMIT_NOT_REACHED
    | Status.NO_MOTOR_OVERTEMPERATURE
    | Status.NO_POWER_UNIT_OVERLOAD
    | Status.SPEED_WITHIN_TOLERANCE
)
"""Bits of ZSW1 that this drive always tells."""


class Driven(NamedTuple):
    """What the drive does to its motor."""

    setpoint: float
    """Of the ramp [mm/s], signed."""
    torque: bool
    quick_stop: bool


@dataclass(slots=True)
class VirtualDrive:
    """Takes STW1 and NSOLL_A, gives ZSW1.

    The set-point counts in state S4 with bits 4 and 6 of STW1; bit 5 = 0 keeps the last one. Standstill is told after `closing_time` at
    rest, so that a brake can close before the pulses go (p1217).

    Source: reference/profidrive.md sections 1 to 4; times assumed.
    """

    scaling: Scaling
    magnetising_time: float = 0.5
    """[s]"""
    closing_time: float = 0.3
    """[s]"""
    monitoring_time: float = 0.1
    """Without a telegram of the PLC for so long, a fault with quick stop (F01910, p2040) [s]."""
    zero_speed: float = 1.0
    """[mm/s]"""
    machine: StateMachine = field(default_factory=StateMachine)
    cause: Reaction | None = None
    """Fault whose cause is there."""
    _flux: float = 0.0
    _rest: float = 0.0
    _setpoint: float = 0.0
    _silent: float = 0.0

    def step(self, control: int, raw: int, speed: float, dt: float) -> Driven:
        """One step with STW1, signed NSOLL_A and the axis' speed [mm/s]."""
        machine = self.machine
        self._rest = self._rest + dt if abs(speed) < self.zero_speed else 0.0
        excites = machine.state is State.SWITCHED_ON and bool(machine.control & Control.ENABLE_OPERATION)
        self._flux = min(self._flux + dt, self.magnetising_time) if machine.pulses or excites else 0.0
        magnetised = self._flux >= self.magnetising_time - dt / 2
        self._silent = 0.0 if control & Control.BY_PLC else self._silent + dt
        cause = self.cause
        if self._silent >= self.monitoring_time:
            cause = max(cause or Reaction.NONE, Reaction.OFF3)
        state = machine.step(Inputs(control, self._rest >= self.closing_time, magnetised, cause))
        word = machine.control
        if state is not State.OPERATION or not (word & Control.ENABLE_RAMP and word & Control.ENABLE_SETPOINT):
            self._setpoint = 0.0
        elif word & Control.CONTINUE_RAMP and control & Control.BY_PLC:
            self._setpoint = self.scaling.value(-raw if word & Control.INVERT else raw)
        return Driven(self._setpoint, machine.pulses, state is State.QUICK_STOP)

    @property
    def status(self) -> int:
        """ZSW1"""
        return self.machine.status | CALM
