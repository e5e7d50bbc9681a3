"""The drive's side of PROFIdrive: states S1 to S5, coast stop, quick stop, ramp stop, faults and their acknowledgement.

Source: reference/profidrive.md section 3.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import NamedTuple

from app.profidrive.words import Control, Status


class State(Enum):
    """General state of the drive."""

    INHIBITED = "S1"
    """Switching-on inhibited."""
    READY_TO_SWITCH_ON = "S2"
    SWITCHED_ON = "S3"
    OPERATION = "S4"
    RAMP_STOP = "S5a"
    """OFF1"""
    QUICK_STOP = "S5b"
    """OFF3"""


class Reaction(IntEnum):
    """What a fault does to the drive, the stronger the greater."""

    NONE = 0
    OFF1 = 1
    """Ramp stop."""
    OFF3 = 2
    """Quick stop."""
    OFF2 = 3
    """Coast stop."""


class Inputs(NamedTuple):
    """Of one step."""

    control: int
    """STW1 as it came."""
    standstill: bool = True
    magnetised: bool = True
    """The motor has its flux: only then does operation begin."""
    cause: Reaction | None = None
    """Reaction of the strongest fault whose cause is there now; None = no cause."""
    pulses_released: bool = True
    """Second source of the coast stop (p0845): a terminal that the control word cannot overrule."""
    no_emergency_stop: bool = True
    """Second source of the quick stop (p0849)."""
    acknowledged: bool = False
    """Second source of the acknowledgement (p3981)."""


STOPPING = frozenset({State.RAMP_STOP, State.QUICK_STOP})
PULSES = frozenset({State.OPERATION, *STOPPING})
"""States in which the motor has torque."""

_ON = Status.CONTROL_REQUESTED | Status.READY_TO_SWITCH_ON
_STATUS = {
    State.INHIBITED: Status.CONTROL_REQUESTED | Status.SWITCHING_ON_INHIBITED,
    State.READY_TO_SWITCH_ON: _ON,
    State.SWITCHED_ON: _ON | Status.READY,
    State.OPERATION: _ON | Status.READY | Status.OPERATION_ENABLED,
    State.RAMP_STOP: _ON | Status.READY,
    State.QUICK_STOP: _ON | Status.READY,
}


@dataclass(slots=True)
class StateMachine:
    """S1 to S5 of one drive, one transition a step; only S5 → S1 → S2 happens at once.

    - Of several conditions that hold, coast stop comes before quick stop, quick stop before ramp stop.
    - A word without "control by PLC" is ignored as a whole: the last one that had it holds.
    - A quick stop that has begun ends in standstill; a ramp stop can be taken back by ON.
    - A fault stays until its cause is gone and an acknowledgement comes after that; switching on again then needs OFF first.
    """

    enabled_while_stopping: bool = True
    """Status bit 2 stays until the pulses are off. Makers differ: uncertain, so it is a parameter."""
    state: State = State.INHIBITED
    faulted: bool = False
    reaction: Reaction = Reaction.NONE
    """Of the fault that stands."""
    control: int = 0
    """The word that holds."""
    released: bool = True
    no_emergency_stop: bool = True
    """The second sources as of the last step."""

    def step(self, inputs: Inputs) -> State:
        """Take one control word and what the motor does."""
        before = self.control
        if inputs.control & Control.BY_PLC:
            self.control = inputs.control & 0xFFFF
        self.released, self.no_emergency_stop = inputs.pulses_released, inputs.no_emergency_stop
        acknowledged = inputs.acknowledged or bool(self.control & ~before & Control.ACKNOWLEDGE)
        if inputs.cause is not None:
            self.faulted, self.reaction = True, max(self.reaction, inputs.cause)
        elif acknowledged:
            self.faulted, self.reaction = False, Reaction.NONE
        self.state = self._next(inputs)
        return self.state

    @property
    def pulses(self) -> bool:
        """Whether the inverter feeds the motor."""
        return self.state in PULSES

    @property
    def status(self) -> int:
        """Bits 0 to 6 and 9 of ZSW1; the rest is the drive's."""
        status = _STATUS[self.state]
        if self.state in STOPPING and self.enabled_while_stopping:
            status |= Status.OPERATION_ENABLED
        if self.faulted:
            status |= Status.FAULT
        if self.control & Control.NO_COAST_STOP and self.released and self.reaction is not Reaction.OFF2:
            status |= Status.NO_COAST_STOP
        if (
            self.control & Control.NO_QUICK_STOP
            and self.no_emergency_stop
            and self.state is not State.QUICK_STOP
            and self.reaction is not Reaction.OFF3
        ):
            status |= Status.NO_QUICK_STOP
        return status

    def _next(self, inputs: Inputs) -> State:
        word, state = self.control, self.state
        no_coast = word & Control.NO_COAST_STOP and self.released
        no_quick = word & Control.NO_QUICK_STOP and self.no_emergency_stop
        coast = not no_coast or self.reaction is Reaction.OFF2
        quick = not no_quick or self.reaction is Reaction.OFF3
        off = not word & Control.ON or self.reaction is Reaction.OFF1
        leaving = no_coast and no_quick and not word & Control.ON and not self.faulted
        may_leave = State.READY_TO_SWITCH_ON if leaving else State.INHIBITED
        if state is State.INHIBITED:
            return may_leave
        if state in (State.READY_TO_SWITCH_ON, State.SWITCHED_ON):
            # without pulses there is nothing to brake: any fault that stops and both stops lead to S1
            if coast or quick or self.reaction > Reaction.NONE:
                return State.INHIBITED
            if off:
                return State.READY_TO_SWITCH_ON
            if state is State.READY_TO_SWITCH_ON:
                return State.SWITCHED_ON
            enabled = word & Control.ENABLE_OPERATION and inputs.magnetised
            return State.OPERATION if enabled else state
        if coast:
            return State.INHIBITED
        if state in STOPPING and (inputs.standstill or not word & Control.ENABLE_OPERATION):
            return may_leave
        if quick or state is State.QUICK_STOP:
            return State.QUICK_STOP
        if off:
            return State.RAMP_STOP
        return State.OPERATION if word & Control.ENABLE_OPERATION else State.SWITCHED_ON
