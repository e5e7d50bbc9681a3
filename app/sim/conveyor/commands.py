"""What the commands of the conveyor do, and why one is refused."""

from math import isfinite

from app.blocks import product_tracking as tracking
from app.blocks.mode_control import Mode
from app.blocks.product_tracking import EditReason, EditRefused, TrackingEvent
from app.registers.plc_map import AnswerState, Request, real_of
from app.sim.conveyor.drives import BeltDrives
from app.sim.conveyor.gap_stop import GapStop
from app.sim.conveyor.gate_control import GateControl
from app.sim.conveyor.merge_control import MergeControl
from app.sim.conveyor.plausibility import UncertainProducts
from app.sim.conveyor.register_map import GATE_COMMANDS, MERGE_COMMANDS, ConveyorCommand, ConveyorEvent, ConveyorReason
from app.sim.conveyor.state import LineState
from app.sim.plc import Verdict
from app.sim.plc import rejected as no

_ON_PRODUCTS = (ConveyorCommand.DELETE, ConveyorCommand.EDIT, ConveyorCommand.CONFIRM, ConveyorCommand.INSERT)
_MODES = (ConveyorCommand.AUTOMATIC, ConveyorCommand.START, ConveyorCommand.MANUAL)
_WHILE_STANDING = (ConveyorCommand.EDIT, ConveyorCommand.INSERT)


class LineCommands:
    """Takes the commands of one line, from a power-up on."""

    def __init__(
        self,
        line: LineState,
        drives: BeltDrives,
        gap: GapStop,
        uncertain: UncertainProducts,
        gates: GateControl,
        merges: MergeControl,
        *,
        start: bool,
    ) -> None:
        """Over the parts that it commands; `start`: automatic is chosen and started already."""
        self._line, self._drives, self._gap, self._uncertain = line, drives, gap, uncertain
        self._gates, self._merges = gates, merges
        self._automatic = self._start = start
        self._manual = False

    def execute(self, request: Request) -> Verdict:
        """Do what `request` asks, or say why not."""
        code = request.code
        if code == ConveyorCommand.STOP:
            return self._stop()
        if code == ConveyorCommand.RESET:
            return self._reset()
        if code in _MODES:
            return self._change_mode(code)
        if code in _ON_PRODUCTS:
            return self._change_product(request)
        if code >= MERGE_COMMANDS:
            number, what = divmod(code - MERGE_COMMANDS, 3)
            reason = self._merges.order(number + 1, what)
            return no(reason) if reason else Verdict()
        if code >= GATE_COMMANDS:
            number, lane = divmod(code - GATE_COMMANDS, 2)
            reason = self._gates.order(number + 1, bool(lane))
            return no(reason) if reason else Verdict()
        return no(ConveyorReason.UNKNOWN)

    def modes_asked(self) -> tuple[bool, bool, bool]:
        """Whether mode automatic, its start, and mode manual were asked for since the last call."""
        asked = self._automatic, self._start, self._manual
        self._automatic = self._start = self._manual = False
        return asked

    def _change_product(self, request: Request) -> Verdict:
        code, first = request.code, request.arguments[0]
        if code in _WHILE_STANDING and self._line.moving:
            return no(ConveyorReason.MOVING)
        try:
            event = self._changed(code, request)
        except EditRefused as refusal:
            return no(refusal.reason)
        self._line.report(event)
        if first or code == ConveyorCommand.CONFIRM:
            self._uncertain.confirmed(first)
        self._line.renew_table()
        return Verdict(detail=event.id)

    def _changed(self, code: int, request: Request) -> TrackingEvent:
        """What tracking tells of it.

        Raises:
            EditRefused: it would make the table wrong.
        """
        line, first = self._line, request.arguments[0]
        if code == ConveyorCommand.DELETE:
            return line.tracking.delete(first)
        if code == ConveyorCommand.CONFIRM:
            return line.tracking.confirm(first)
        at = 1 if code == ConveyorCommand.EDIT else 0
        head, length = real_of(request.arguments[at]), real_of(request.arguments[at + 1])
        if not isfinite(length):
            raise EditRefused(EditReason.LENGTH, f"length = {length}: expected a number [mm]")
        if not isfinite(head):
            raise EditRefused(EditReason.OUTSIDE_LINE, f"head = {head}: expected a number [mm]")
        if code == ConveyorCommand.EDIT:
            return line.tracking.edit(first, head, length)
        return line.tracking.insert(head, length, line.time)

    def _stop(self) -> Verdict:
        line = self._line
        line.event(ConveyorEvent.STOP)
        if not line.moving and not line.modes.running:
            return Verdict()
        line.stopping = True

        def stopped() -> AnswerState:
            return AnswerState.RUNNING if line.stopping else AnswerState.DONE

        return Verdict(AnswerState.RUNNING, until=stopped)

    def _reset(self) -> Verdict:
        line = self._line
        line.event(ConveyorEvent.RESET)
        if line.held and not line.pressed:
            line.held, self._drives.enabled = False, True
        self._drives.reset()
        self._gap.reset()
        line.gates.reset()
        line.first_out.reset()
        if line.pressed:
            line.stopped_by(ConveyorEvent.EMERGENCY_STOP)
        elif line.tracking.gap_stop and (gap := line.tracking.gap):
            line.stopped_by(tracking.Code.GAP_STOP, 0, gap.gap, rear=gap.rear, front=gap.front)
        return Verdict()

    def _change_mode(self, code: int) -> Verdict:
        line = self._line
        if line.held:
            return no(ConveyorReason.EMERGENCY_STOP)
        if line.faulty:
            return no(ConveyorReason.FAULT)
        if code == ConveyorCommand.START and line.modes.mode is not Mode.AUTOMATIC:
            return no(ConveyorReason.NOT_AUTOMATIC)
        if code != ConveyorCommand.MANUAL and line.modes.running and not line.stopping:
            return Verdict()
        if line.moving or line.stopping or line.hold:
            return no(ConveyorReason.MOVING)
        if code == ConveyorCommand.START:
            if line.host_silent:
                return no(ConveyorReason.WRONG_STATE, line.state)
            self._start = True
            line.causes(ConveyorEvent.STARTED)
        elif code == ConveyorCommand.AUTOMATIC:
            self._automatic = True
            line.causes(ConveyorEvent.AUTOMATIC)
        else:
            self._manual = True
            line.causes(ConveyorEvent.ENDED, ConveyorEvent.MANUAL)
        return Verdict()
