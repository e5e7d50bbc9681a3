"""What becomes of the commands that a person sends to the crane's PLC."""

from collections.abc import Mapping
from math import isnan
from types import MappingProxyType

from app.blocks.drive_selection import Selection
from app.registers.plc_map import AnswerState, Request, real_of
from app.sim.crane.configuration import AXES, STAND_NUMBERS
from app.sim.crane.register_map import CraneCommand, CraneEvent, CraneReason, DriveChoice, Mode, Suspension
from app.sim.crane.sequence import READING
from app.sim.crane.state import CraneView
from app.sim.plc import Verdict
from app.sim.plc import rejected as no

_SELECTIONS: Mapping[DriveChoice, Selection] = MappingProxyType(
    {
        DriveChoice.NONE: Selection.NONE,
        DriveChoice.FIRST: Selection.FIRST,
        DriveChoice.SECOND: Selection.SECOND,
        DriveChoice.BOTH: Selection.BOTH,
        DriveChoice.BY_HOURS: Selection.BY_HOURS,
    }
)


class CommandedCrane(CraneView):
    """A crane that takes commands."""

    _hurry: bool
    """The next scan is one of the program: something was asked."""
    _acknowledge: bool
    """Alarms were seen; counts in the next scan of the program."""

    def _execute(self, request: Request) -> Verdict:
        self._hurry = True
        code, first = request.code, request.arguments[0]
        match code:
            case CraneCommand.STOP:
                return self._stop()
            case CraneCommand.RESET:
                return self._reset()
            case CraneCommand.AUTOMATIC:
                return self._change_mode(Mode.AUTOMATIC)
            case CraneCommand.MANUAL:
                return self._change_mode(Mode.MANUAL)
            case CraneCommand.START_CYCLE:
                return self.order(first, request.arguments[1], real_of(request.arguments[2]))
            case CraneCommand.SUSPEND | CraneCommand.RESUME | CraneCommand.ABORT:
                return self._intervene(code)
            case CraneCommand.CONFIRM_WEIGHT:
                return self.confirm_weight(real_of(first))
        return self._select(code, first)

    def _stop(self) -> Verdict:
        self.event(CraneEvent.STOP)
        self.sequence.suspend(Suspension.STOP)
        self.mode = Mode.OFF
        self.stopping = self.moving

        def stopped() -> AnswerState:
            return AnswerState.RUNNING if self.stopping else AnswerState.DONE

        return Verdict(AnswerState.RUNNING, until=stopped) if self.stopping else Verdict()

    def _reset(self) -> Verdict:
        if self.emergency:
            return no(CraneReason.EMERGENCY_STOP)
        if self.moving:
            return no(CraneReason.MOVING)
        self.latched = False
        self.axes["hoist"].lift()
        self._acknowledge = True
        self.event(CraneEvent.RESET)
        return Verdict()

    def _change_mode(self, mode: Mode) -> Verdict:
        if self.emergency:
            return no(CraneReason.EMERGENCY_STOP)
        if self.held:
            return no(CraneReason.HELD)
        if mode is self.mode:
            return Verdict()
        if self.moving or self.hold:
            return no(CraneReason.MOVING)
        if mode is Mode.AUTOMATIC and self.host_silent:
            return no(CraneReason.WRONG_STATE, self.state)
        self.sequence.suspend(Suspension.OPERATOR)
        self.mode = mode
        self.event(CraneEvent.AUTOMATIC if mode is Mode.AUTOMATIC else CraneEvent.MANUAL)
        return Verdict()

    def order(self, start: int, end: int, planned: float) -> Verdict:
        if self.mode is not Mode.AUTOMATIC:
            return no(CraneReason.WRONG_STATE, self.state)
        if self.cycle.open:
            return no(CraneReason.CYCLE_RUNS)
        for number in (start, end):
            if number not in STAND_NUMBERS:
                return no(CraneReason.NO_SUCH_STAND, number)
        if start == end:
            return no(CraneReason.SAME_STAND, start)
        if not 0 <= planned <= self.settings["overload_limit"]:
            return no(CraneReason.OVERLOAD)
        if self.load.locked or not self.load.stand:
            return no(CraneReason.LOADED)
        if self.load.stand != start:
            return no(CraneReason.STAND_OCCUPIED if self.load.stand == end else CraneReason.NO_LADLE, start)
        if verdict := self._not_permitted():
            return verdict
        self.sequence.start(start, end, planned)
        return Verdict()

    def _not_permitted(self) -> Verdict | None:
        for number, met in enumerate(self.start_permissives.values(), 1):
            if not met:
                return no(CraneReason.NOT_ALLOWED, number)
        return None

    def _intervene(self, code: int) -> Verdict:
        if not self.cycle.open:
            return no(CraneReason.NO_CYCLE)
        if code == CraneCommand.SUSPEND:
            self.sequence.suspend(Suspension.OPERATOR)
        elif code == CraneCommand.ABORT:
            self.sequence.suspend(Suspension.OPERATOR)
            self.sequence.abort()
        else:
            if self.mode is not Mode.AUTOMATIC or self.cycle.runs:
                return no(CraneReason.WRONG_STATE, self.state)
            if verdict := self._not_permitted():
                return verdict
            if axis := self.sequence.out_of_place():
                return no(CraneReason.OUT_OF_PLACE, AXES.index(axis) + 1)
            self.sequence.resume()
        return Verdict()

    def confirm_weight(self, weight: float) -> Verdict:
        """A person has read the scale [t]."""
        if not self.weight_asked:
            return no(CraneReason.NO_WEIGHT_ASKED)
        if isnan(weight) or not abs(weight - self.weight) <= READING:
            return no(CraneReason.OTHER_WEIGHT)
        self.sequence.confirm(weight)
        return Verdict()

    def _select(self, code: int, first: int) -> Verdict:
        if code == CraneCommand.SELECT_STEP:
            if not 1 <= first <= 4:
                return no(CraneReason.WRONG_STATE)
            self.speed_step = first
        elif code == CraneCommand.SELECT_DRIVES:
            if first not in DriveChoice._value2member_map_:
                return no(CraneReason.NO_SUCH_DRIVE, first)
            if self.axes["hoist"].moving:
                return no(CraneReason.MOVING)
            self.drives_selected = DriveChoice(first)
            self.axes["hoist"].selection = _SELECTIONS[self.drives_selected]
            self.event(CraneEvent.DRIVES_SELECTED, first)
        elif code == CraneCommand.RESET_HOURS:
            motors = [motor for axis in self.axes.values() for motor in axis.motors]
            if not 1 <= first <= len(motors):
                return no(CraneReason.NO_SUCH_DRIVE, first)
            self.event(CraneEvent.HOURS_RESET, first, motors[first - 1].hours.hours)
            motors[first - 1].reset_hours = True
        elif code == CraneCommand.SELECT_PATH:
            if first not in (0, 1) or self.cycle.open:
                return no(CraneReason.CYCLE_RUNS if self.cycle.open else CraneReason.WRONG_STATE)
            self.path_mode = first
            self.event(CraneEvent.PATH_SELECTED, first)
        else:
            return no(CraneReason.UNKNOWN)
        return Verdict()
