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

    select_automatic: bool = False
    """Counts when it comes (edge)."""
    start: bool = False
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
    """It runs by itself; latched by a start in mode automatic."""
    forward: bool
    """Manual movement, never together with `reverse` or `automatic`."""
    reverse: bool


@dataclass(slots=True)
class ModeControl:
    """A mode is chosen and starts nothing; automatic then runs from a start on (SR), manual is hold-to-run in one direction, stop wins.

    - Automatic is chosen by a new request without a manual direction held. It runs from a new start on, only in mode automatic and without
      stop. Stop or the selection of manual ends the run; stop changes no mode.
    - Manual moves only in mode manual, with exactly one direction held. Both directions, stop, automatic, or a change from one
      direction straight to the other end the movement, and it takes a new request: both released, then one held. So nothing that was
      held before can start a belt.

    Source: thesis 003, modes (PTRK_BC_AutoMode), where choosing automatic starts it; the separate start and the new request after any
    interruption are ours (hmi-design section 12).
    """

    mode: Mode = Mode.OFF
    running: bool = False
    """Automatic, started."""
    direction: int = 0
    """Manual movement: 1 forward, −1 reverse, 0 none."""
    ready: bool = False
    """Both directions were seen released, so a held one counts."""
    before: tuple[bool, bool, bool] = (True, True, True)
    """Requests for automatic, start and manual; one that is already there at the first cycle is not new."""

    def step(self, inputs: ModeInputs) -> ModeOutputs:
        """One cycle."""
        requests = inputs.select_automatic, inputs.start, inputs.select_manual
        automatic, start, manual = (now and not before for now, before in zip(requests, self.before, strict=True))
        self.before = requests
        held = inputs.forward or inputs.reverse
        if manual and not inputs.stop:
            self.mode = Mode.MANUAL
        elif automatic and not inputs.stop and not held:
            self.mode = Mode.AUTOMATIC
        if inputs.stop or self.mode is not Mode.AUTOMATIC:
            self.running = False
        elif start and not held:
            self.running = True
        self.direction = self._direction(inputs, held)
        return ModeOutputs(self.mode, self.running, self.direction > 0, self.direction < 0)

    def _direction(self, inputs: ModeInputs, held: bool) -> int:
        wanted = inputs.forward - inputs.reverse
        if self.mode is not Mode.MANUAL or inputs.stop:
            self.ready = False
        elif not held:
            self.ready = True
        elif wanted == 0 or (self.direction and wanted != self.direction):
            self.ready = False
        return wanted if self.ready else 0
