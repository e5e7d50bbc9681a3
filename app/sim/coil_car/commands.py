"""What the commands of the coil car do, and why one is refused."""

from collections.abc import Mapping
from types import MappingProxyType

from app.registers.plc_map import AnswerState, Request
from app.sim.coil_car.interlock import InterlockedCar
from app.sim.coil_car.machine import Hit
from app.sim.coil_car.recoiler import Recoiler
from app.sim.coil_car.register_map import (
    SADDLES,
    WIND,
    Block,
    CoilCarCommand,
    CoilCarEvent,
    CoilCarReason,
    Fault,
    Mode,
)
from app.sim.plc import Verdict
from app.sim.plc import rejected as no

_WINDING_REASONS: Mapping[Block, CoilCarReason] = MappingProxyType(
    {
        Block.EMERGENCY_STOP: CoilCarReason.EMERGENCY_STOP,
        Block.GUARD: CoilCarReason.GUARD,
        Block.HELD: CoilCarReason.HELD,
        Block.PRESSURE: CoilCarReason.HYDRAULICS,
        Block.OIL: CoilCarReason.HYDRAULICS,
        Block.WINDING: CoilCarReason.WINDING,
        Block.COIL_THERE: CoilCarReason.COIL_ON_MANDREL,
        Block.NOT_COLLAPSED: CoilCarReason.NOT_EXPANDED,
        Block.MANDREL: CoilCarReason.NOT_EXPANDED,
        Block.CAR: CoilCarReason.CAR_IN_THE_WAY,
    }
)


class CarCommands:
    """Takes the commands of one line, from a power-up on."""

    def __init__(self, car: InterlockedCar, recoiler: Recoiler) -> None:
        self._car, self._recoiler = car, recoiler

    def execute(self, request: Request) -> Verdict:
        """Do what `request` asks, or say why not."""
        code, first = request.code, request.arguments[0]
        self._car.interlock.renew()
        match code:
            case CoilCarCommand.STOP:
                return self._stop()
            case CoilCarCommand.RESET:
                return self._reset()
            case CoilCarCommand.AUTOMATIC:
                return self._change_mode(Mode.AUTOMATIC)
            case CoilCarCommand.MANUAL:
                return self._change_mode(Mode.MANUAL)
            case CoilCarCommand.TARGET:
                return self._select_target(first)
            case CoilCarCommand.REMOVED:
                return self._removed(first)
            case CoilCarCommand.WIND:
                return self._wind()
            case CoilCarCommand.STOP_WINDING:
                return self._stop_winding()
        return no(CoilCarReason.UNKNOWN)

    def _stop(self) -> Verdict:
        car = self._car
        car.event(CoilCarEvent.STOP)
        car.mode = Mode.OFF
        car.machine.winding = False
        if not car.moving:
            return Verdict()
        car.stopping = True

        def stopped() -> AnswerState:
            return AnswerState.RUNNING if car.moving else AnswerState.DONE

        return Verdict(AnswerState.RUNNING, until=stopped)

    def _reset(self) -> Verdict:
        car, machine = self._car, self._car.machine
        if (unsafe := self._unsafe()) is not None:
            return unsafe
        if car.moving:
            return no(CoilCarReason.MOVING)
        if machine.hit is not Hit.NONE and car.interlocks:
            return no(CoilCarReason.HELD, Fault.COLLISION)
        car.event(CoilCarEvent.RESET)
        car.fault = Fault.NONE
        return Verdict()

    def _change_mode(self, mode: Mode) -> Verdict:
        car = self._car
        if (unsafe := self._unsafe()) is not None:
            return unsafe
        if car.fault:
            return no(CoilCarReason.HELD, car.fault)
        if mode is car.mode and not car.stopping:
            return Verdict()
        if car.moving or car.hold:
            return no(CoilCarReason.MOVING)
        if mode is Mode.AUTOMATIC and car.host_silent:
            return no(CoilCarReason.WRONG_STATE, car.state)
        car.mode, self._recoiler.inhibited = mode, False
        car.event(CoilCarEvent.AUTOMATIC if mode is Mode.AUTOMATIC else CoilCarEvent.MANUAL)
        return Verdict()

    def _unsafe(self) -> Verdict | None:
        """What a person must put right at the line first."""
        machine = self._car.machine
        if machine.emergency_stop:
            return no(CoilCarReason.EMERGENCY_STOP)
        if not all(machine.guard(n) for n in (1, 2, 3)):
            return no(CoilCarReason.GUARD)
        return None

    def _select_target(self, saddle: int) -> Verdict:
        car = self._car
        if not 0 <= saddle <= SADDLES:
            return no(CoilCarReason.NO_SUCH_SADDLE)
        if car.machine.load and not car.horizontal_standstill:
            return no(CoilCarReason.MOVING)
        car.target_selected = saddle
        car.choose_target()
        car.event(CoilCarEvent.TARGET, saddle)
        return Verdict()

    def _removed(self, saddle: int) -> Verdict:
        machine = self._car.machine
        if not 1 <= saddle <= SADDLES:
            return no(CoilCarReason.NO_SUCH_SADDLE)
        if not machine.saddles[saddle - 1]:
            return no(CoilCarReason.SADDLE_EMPTY, saddle)
        if machine.below(saddle):
            return no(CoilCarReason.CRANE_BLOCKED, saddle)
        machine.saddles[saddle - 1] = 0.0
        return Verdict(detail=saddle)

    def _wind(self) -> Verdict:
        car = self._car
        if car.mode is Mode.OFF and not car.fault:
            return no(CoilCarReason.WRONG_STATE, car.state)
        block = car.interlock.block(WIND)
        if block is not Block.FREE:
            return no(_WINDING_REASONS[block])
        self._recoiler.wind, self._recoiler.inhibited = True, False
        return Verdict()

    def _stop_winding(self) -> Verdict:
        machine = self._car.machine
        if not machine.winding:
            return no(CoilCarReason.NOT_WINDING)
        machine.winding, self._recoiler.inhibited = False, True
        return Verdict()
