"""The ramp generator of a SINAMICS drive: from the set-point of the telegram to the speed that the motor is asked for."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import STOPPING, State, StateMachine
from app.profidrive.words import Control
from app.sim.sinamics.excitation import Excitation
from app.sim.sinamics.power import PowerUnit


@dataclass(slots=True)
class RampGenerator:
    """`values` in its calls: parameters by code."""

    output: float = 0.0
    """[rpm], signed."""
    held: int = 0
    """The last set-point word that counted, signed."""

    def take(self, raw: int) -> None:
        """A set-point word that counts."""
        self.held = raw - 0x10000 if raw >= 0x8000 else raw

    def reference(self, machine: StateMachine, values: Mapping[str, float]) -> float:
        """Set-point before the ramp [rpm]."""
        word = machine.control
        if not machine.pulses or machine.state in STOPPING or not word & Control.ENABLE_SETPOINT:
            return 0.0
        wanted = Scaling(values["p2000"]).value(self.held)
        wanted = -wanted if word & Control.INVERT else wanted
        return min(max(wanted, -values["p1082"]), values["p1082"])

    def step(
        self,
        machine: StateMachine,
        values: Mapping[str, float],
        excitation: Excitation,
        power: PowerUnit,
        dt: float,
    ) -> None:
        """Advance by `dt` [s]; while the torque is at its limit and the shaft stays behind, it waits.

        Without pulses, and in their first step, it stands at the speed that the shaft has.
        """
        word, speed = machine.control, power.speed
        if not machine.pulses or excitation.pulsing <= dt + 1e-9:
            self.output = speed
            if not machine.pulses:
                return
        stopping = machine.state in STOPPING
        if not stopping and not word & Control.ENABLE_RAMP:
            self.output = 0.0
            return
        if not stopping and (not word & Control.CONTINUE_RAMP or not excitation.brake_open):
            return
        target, now = self.reference(machine, values), self.output
        slower = now * (target - now) < 0
        if power.shaft.limited and not slower and abs(now - speed) > values["p2163"]:
            return
        braking = "p1121" if slower else "p1120"
        time = values["p1135" if machine.state is State.QUICK_STOP else braking]
        reach = values["p1082"] / time * dt if time > 0 else float("inf")
        gap = -now if slower and now * target < 0 else target - now
        self.output = now + gap if abs(gap) <= reach else round(now + (reach if gap > 0 else -reach), 9)
