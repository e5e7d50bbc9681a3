"""What moves in the coil car's line: jogs in manual, one at a time, to the interlock; the mandrel, and when it is stuck."""

from collections.abc import Callable

import pytest

from app.registers import plc_map
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import (
    Block,
    CoilCarCommand,
    CoilCarEvent,
    CoilCarReason,
    CoilCarState,
    Fault,
    Mode,
)
from tests.sim.coil_car.bench import line, run, value


@pytest.mark.parametrize(
    ("bit", "moves"),
    [
        (0, lambda car: car.machine.x > 2700),
        (1, lambda car: car.machine.x < 2700),
        (2, lambda car: car.machine.v > 300),
        (3, lambda car: car.machine.v < 300),
    ],
)
def test_a_jog_moves_while_it_is_held(bit: int, moves: Callable[[VirtualCoilCar], bool]) -> None:
    car, talker = line()
    car.preset({"vertical": 300})
    run(car, 2, talker, 1 << bit)
    assert moves(car) and car.state == CoilCarState.MANUAL_MOVING
    run(car, 3)
    assert not car.moving and car.state == CoilCarState.MANUAL


def test_the_mandrel_is_jogged() -> None:
    car, talker = line()
    run(car, 4, talker, 32)
    assert value(car, "mandrel") == 0
    run(car, 4, talker, 16)
    assert value(car, "mandrel") == 2
    told = [code for code, _ in talker.codes() if code in (CoilCarEvent.EXPANDED, CoilCarEvent.COLLAPSED)]
    assert told == [CoilCarEvent.COLLAPSED, CoilCarEvent.EXPANDED]


def test_a_counter_that_stands_still_is_a_released_button() -> None:
    car, talker = line()
    run(car, 2, talker, 1)
    talker.plc.write(16, plc_map.HOLD, car.read(3, plc_map.HOLD, 4))
    run(car, plc_map.HOLD_TIMEOUT + 0.05)
    speed = car.machine.speed_x
    run(car, 0.1)
    assert car.machine.speed_x < speed
    run(car, 2)
    assert car.machine.speed_x == 0


@pytest.mark.parametrize("bits", [0b11, 0b1100, 0b10100, 0b111111, 1 << 6, 1 << 15])
def test_more_than_one_button_or_an_unknown_one_is_none(bits: int) -> None:
    car, talker = line()
    run(car, 1, talker, bits)
    assert not car.moving and car.machine.x == 2700


@pytest.mark.parametrize("start", ["automatic", "stopped"])
def test_jogs_act_in_manual_only(start: str) -> None:
    car, talker = line(start=start)
    run(car, 1, talker, 1)
    assert car.machine.x == 2700


def test_a_button_held_while_manual_is_chosen_does_nothing() -> None:
    _, talker = line(start="stopped")
    talker.hold(1)
    assert talker.ask(CoilCarCommand.MANUAL).reason == CoilCarReason.MOVING


def test_a_manual_transport_is_possible_and_ends_at_the_interlock() -> None:
    car, talker = line(coil=True)
    car.preset({"horizontal": 1000})
    run(car, 16, talker, 4)
    assert value(car, "coil_contact") == 1 and value(car, "block_up") == Block.COIL
    run(car, 4, talker, 32)
    assert value(car, "coil_on_car") == 1
    run(car, 25, talker, 1)
    run(car, 4)
    assert car.machine.x == pytest.approx(3150, abs=2) and value(car, "block_forward") == Block.SADDLE
    assert value(car, "collision") == 0


def test_a_stuck_mandrel_is_noticed() -> None:
    car, talker = line()
    talker.fault(51)
    run(car, 7, talker, 32)
    assert (car.mode, car.fault) == (Mode.OFF, Fault.MANDREL)
    assert CoilCarEvent.MANDREL_STUCK in [code for code, _ in talker.codes()]
