"""Flux of the motor and pulses of the power unit, as the drive's states allow them."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.profidrive.state_machine import State, StateMachine
from app.profidrive.words import Control

BRAKE_TIME = 0.1
"""The brake is open so long after the pulses came [s]."""


@dataclass(slots=True)
class Excitation:
    """Builds up over p0346 and dies away over p0347, linearly."""

    flux: float = 0.0
    """[1 = rated]"""
    pulsing: float = 0.0
    """Pulses for so long [s], 0 = none."""

    @property
    def complete(self) -> bool:
        """Whether the motor is magnetised."""
        return self.flux >= 1.0

    @property
    def brake_open(self) -> bool:
        """Whether the motor may turn."""
        return self.pulsing >= BRAKE_TIME

    def step(self, machine: StateMachine, values: Mapping[str, float], dt: float) -> None:
        """Advance by `dt` [s]; `values`: parameters by code."""
        if machine.pulses or (machine.state is State.SWITCHED_ON and machine.control & Control.ENABLE_OPERATION):
            self.flux = min(1.0, self.flux + (dt / values["p0346"] if values["p0346"] else 1.0))
        else:
            self.flux = max(0.0, self.flux - (dt / values["p0347"] if values["p0347"] else 1.0))
        self.pulsing = self.pulsing + dt if machine.pulses else 0.0
