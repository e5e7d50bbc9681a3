"""The coil car's commands: what they do, and every reason why one is refused."""

import pytest

from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import (
    CoilCarCommand,
    CoilCarEvent,
    CoilCarReason,
    CoilCarState,
    Fault,
    Mode,
)
from tests.sim.coil_car.bench import DONE, REJECTED, RUNNING, line, run, value
from tests.sim.coil_car.line import Talker


def test_automatic_manual_and_stop() -> None:
    car, talker = line(start="stopped")
    assert car.state == CoilCarState.OFF
    assert talker.ask(CoilCarCommand.AUTOMATIC).state == DONE and value(car, "mode") == Mode.AUTOMATIC
    assert talker.ask(CoilCarCommand.AUTOMATIC).state == DONE
    assert talker.ask(CoilCarCommand.MANUAL).state == DONE and value(car, "mode") == Mode.MANUAL
    run(car, 2, talker, 1)
    assert talker.ask(CoilCarCommand.STOP).state == RUNNING and car.state == CoilCarState.STOPPING
    talker.hold(0)
    run(car, 3)
    assert talker.answer(4).state == DONE and value(car, "mode") == Mode.OFF and car.state == CoilCarState.OFF
    assert talker.ask(CoilCarCommand.STOP).state == DONE
    told = [code for code, _ in talker.codes()]
    assert told == [
        CoilCarEvent.AUTOMATIC,
        CoilCarEvent.WINDING,
        CoilCarEvent.MANUAL,
        CoilCarEvent.STOP,
        CoilCarEvent.WINDING_STOPPED,
        CoilCarEvent.STOP,
    ]


def _moving(car: VirtualCoilCar, talker: Talker) -> None:
    run(car, 1, talker, 1)


REFUSED: list[tuple[CoilCarCommand, int, dict[str, float], int]] = [
    (CoilCarCommand.AUTOMATIC, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.AUTOMATIC, 0, {"guard_2": 0}, CoilCarReason.GUARD),
    (CoilCarCommand.MANUAL, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.RESET, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.RESET, 0, {"guard_1": 0}, CoilCarReason.GUARD),
    (CoilCarCommand.TARGET, 4, {}, CoilCarReason.NO_SUCH_SADDLE),
    (CoilCarCommand.REMOVED, 0, {}, CoilCarReason.NO_SUCH_SADDLE),
    (CoilCarCommand.REMOVED, 4, {}, CoilCarReason.NO_SUCH_SADDLE),
    (CoilCarCommand.REMOVED, 2, {}, CoilCarReason.SADDLE_EMPTY),
    (CoilCarCommand.REMOVED, 1, {"saddle_1": 1, "horizontal": 9000, "vertical": 680}, CoilCarReason.CRANE_BLOCKED),
    (CoilCarCommand.WIND, 0, {"coil": 1}, CoilCarReason.COIL_ON_MANDREL),
    (CoilCarCommand.WIND, 0, {"mandrel": 0}, CoilCarReason.NOT_EXPANDED),
    (CoilCarCommand.WIND, 0, {"horizontal": 1000, "vertical": 300}, CoilCarReason.CAR_IN_THE_WAY),
    (CoilCarCommand.WIND, 0, {"winding": 1}, CoilCarReason.WINDING),
    (CoilCarCommand.WIND, 0, {"guard_3": 0}, CoilCarReason.GUARD),
    (CoilCarCommand.WIND, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.WIND, 0, {"pressure": 50}, CoilCarReason.HYDRAULICS),
    (CoilCarCommand.WIND, 0, {"oil_temperature": 5}, CoilCarReason.HYDRAULICS),
    (CoilCarCommand.WIND, 0, {"mode": 0}, CoilCarReason.WRONG_STATE),
    (CoilCarCommand.STOP_WINDING, 0, {}, CoilCarReason.NOT_WINDING),
]


@pytest.mark.parametrize(("code", "argument", "given", "reason"), REFUSED)
def test_a_command_is_refused_with_its_reason(
    code: CoilCarCommand, argument: int, given: dict[str, float], reason: CoilCarReason
) -> None:
    car, talker = line()
    car.preset(given)
    answer = talker.ask(code, argument)
    assert (answer.state, answer.reason) == (REJECTED, reason)


def test_refusals_while_it_moves_is_held_or_the_state_is_another() -> None:
    car, talker = line()
    _moving(car, talker)
    assert talker.ask(CoilCarCommand.AUTOMATIC).reason == CoilCarReason.MOVING
    assert talker.ask(CoilCarCommand.RESET).reason == CoilCarReason.MOVING
    assert talker.ask(99).reason == CoilCarReason.UNKNOWN
    assert talker.ask(CoilCarCommand.MANUAL, expected=CoilCarState.AUTOMATIC).reason == CoilCarReason.WRONG_STATE
    talker.hold(0)
    run(car, 2)
    talker.fault(1)
    car.step()
    talker.fault(0)
    car.step()
    answer = talker.ask(CoilCarCommand.AUTOMATIC)
    assert (answer.reason, answer.detail) == (CoilCarReason.HELD, Fault.DRIVE_HORIZONTAL)
    assert talker.ask(CoilCarCommand.WIND).reason == CoilCarReason.HELD


def test_every_reason_but_those_of_the_base_is_given_somewhere() -> None:
    seen = {reason for _, _, _, reason in REFUSED} | {CoilCarReason.MOVING, CoilCarReason.UNKNOWN, CoilCarReason.HELD}
    assert set(CoilCarReason) == seen


def test_the_crane_took_a_coil() -> None:
    car, talker = line()
    car.preset({"saddle_2": 1})
    assert talker.ask(CoilCarCommand.REMOVED, 2).state == DONE
    assert value(car, "saddle_2") == 0 and talker.codes() == [(CoilCarEvent.COIL_REMOVED, 2)]
