"""Automatic or manual, and which way the belts may go."""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple


class Mode(IntEnum):
    """Mode word of the machine."""

    OFF = 0
    AUTOMATIC = 1
    MANUAL = 2


class ModeInputs(NamedTuple):
    """Requests of one cycle."""

    start_automatic: bool = False
    """Counts when it comes (edge)."""
    select_manual: bool = False
    """Counts when it comes (edge)."""
    stop: bool = False
    """As long as it is there nothing moves: stop command, emergency stop, fault."""
    forward: bool = False
    """Held: run forward (left → right) in manual."""
    reverse: bool = False


class ModeOutputs(NamedTuple):
    """What holds after the cycle."""

    mode: Mode
    automatic: bool
    """Latched."""
    forward: bool
    """Manual movement, never together with `reverse` or `automatic`."""
    reverse: bool


@dataclass(slots=True)
class ModeControl:
    """Automatic is latched (SR), manual is hold-to-run in exactly one direction, stop wins.

    - Automatic starts with a new request, only without stop and without a manual direction held; it also leaves manual mode. Stop or the
      selection of manual ends it; stop leads to off, out of manual it leads nowhere else.
    - Manual moves only in mode manual, with exactly one direction held. Both directions, stop, automatic, or a change from one
      direction straight to the other end the movement, and it takes a new request: both released, then one held. So nothing that was
      held before can start a belt.

    Source: thesis 003, modes (PTRK_BC_AutoMode); the new request after any interruption is ours (hmi-design section 12).
    """

    mode: Mode = Mode.OFF
    direction: int = 0
    """Manual movement: 1 forward, −1 reverse, 0 none."""
    ready: bool = False
    """Both directions were seen released, so a held one counts."""
    start_before: bool = True
    """A request that is already there at the first cycle is not new."""
    select_before: bool = True

    def step(self, inputs: ModeInputs) -> ModeOutputs:
        """One cycle."""
        start = inputs.start_automatic and not self.start_before
        select = inputs.select_manual and not self.select_before
        self.start_before, self.select_before = inputs.start_automatic, inputs.select_manual
        held = inputs.forward or inputs.reverse
        if inputs.stop:
            if self.mode is Mode.AUTOMATIC:
                self.mode = Mode.OFF
        elif select:
            self.mode = Mode.MANUAL
        elif start and not held:
            self.mode = Mode.AUTOMATIC
        self.direction = self._direction(inputs, held)
        return ModeOutputs(self.mode, self.mode is Mode.AUTOMATIC, self.direction > 0, self.direction < 0)

    def _direction(self, inputs: ModeInputs, held: bool) -> int:
        wanted = inputs.forward - inputs.reverse
        if self.mode is not Mode.MANUAL or inputs.stop:
            self.ready = False
        elif not held:
            self.ready = True
        elif wanted == 0 or (self.direction and wanted != self.direction):
            self.ready = False
        return wanted if self.ready else 0
