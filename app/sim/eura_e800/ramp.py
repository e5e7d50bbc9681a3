"""What an E800 is doing and at which frequency: run, stop and jog commands, and the ramps between them."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Phase(Enum):
    """What the drive is doing."""

    STOPPED = "stopped"
    RUNNING = "running"
    STOPPING = "stopping"
    JOGGING = "jogging"
    JOG_STOPPING = "jog stopping"


_JOG = (Phase.JOGGING, Phase.JOG_STOPPING)
_STOPPING = (Phase.STOPPING, Phase.JOG_STOPPING)


@dataclass(slots=True)
class Ramp:
    """Phase, direction and output frequency. `values` in its calls: the parameters by code."""

    phase: Phase = Phase.STOPPED
    direction: int = 1
    """1 forward, -1 reverse."""
    frequency: float = 0.0
    """Output [Hz], negative in reverse."""

    @property
    def on(self) -> bool:
        """Whether the inverter feeds the motor."""
        return self.phase is not Phase.STOPPED

    @property
    def sense(self) -> float:
        """Sign of what turns the motor: the frequency's, at 0 the direction's."""
        return self.frequency or self.direction

    def begin(self, direction: int, values: Mapping[str, float]) -> None:
        """It runs since long: at the frequency that is asked for."""
        self.run(direction)
        self.frequency = direction * max(reference(values), values["F112"])

    def run(self, direction: int) -> None:
        """Run, also out of a stop or a jog."""
        self.phase, self.direction = Phase.RUNNING, direction

    def stop(self) -> None:
        """By the ramp."""
        if self.on:
            self.phase = Phase.STOPPING

    def jog(self) -> None:
        """Forward, unless the drive runs."""
        if self.phase is not Phase.RUNNING:
            self.phase, self.direction = Phase.JOGGING, 1

    def jog_stop(self, direction: int) -> None:
        """End a jog in that direction, and nothing else."""
        if self.phase is Phase.JOGGING and self.direction == direction:
            self.phase = Phase.JOG_STOPPING

    def off(self) -> None:
        """The output is off at once; the direction stays."""
        self.phase, self.frequency = Phase.STOPPED, 0.0

    def step(self, values: Mapping[str, float], dt: float) -> bool:
        """Advance by `dt` [s]; True when a stop has arrived below F112 and the output is to go off."""
        phase = self.phase
        if phase is Phase.STOPPED:
            return False
        target = self._target(values)
        now = self.frequency
        slower = now * (target - now) < 0
        jog = phase in _JOG
        time = values[("F126" if jog else "F115") if slower else ("F125" if jog else "F114")]
        reach = (values["F111"] if values["F119"] == 1 else 50.0) / time * dt
        gap = target - now
        if slower and now * target < 0:
            # Zero is a stop on the way: from there on the other ramp counts.
            gap = -now
        # Rounded far below a raw step, so that ten ramps do not drift off their grid.
        self.frequency = now + gap if abs(gap) <= reach else round(now + (reach if gap > 0 else -reach), 9)
        return phase in _STOPPING and (abs(self.frequency) < values["F112"] or self.frequency == 0)

    def _target(self, values: Mapping[str, float]) -> float:
        if self.phase is Phase.RUNNING:
            return self.direction * min(max(reference(values), values["F112"]), values["F111"])
        if self.phase is Phase.JOGGING:
            return self.direction * min(max(values["F124"], values["F112"]), values["F111"])
        return 0.0


def reference(values: Mapping[str, float]) -> float:
    """Frequency that is asked for [Hz]: F113 where F203 lets Modbus set it, else 0."""
    return values["F113"] if values["F203"] in (0, 10) else 0.0
