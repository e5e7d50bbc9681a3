"""Interlocks of the car: what stops it, and in which direction."""

import pytest

from app.sim.coil_car.register_map import (
    Block,
    CoilCarCommand,
    CoilCarEvent,
    Fault,
    Mode,
)
from tests.sim.coil_car.bench import DONE, line, run, value
from tests.sim.coil_car.line import act


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("code", "event", "fault"),
    [
        (1, (CoilCarEvent.DRIVE_TRIPPED, 1), Fault.DRIVE_HORIZONTAL),
        (2, (CoilCarEvent.DRIVE_TRIPPED, 2), Fault.DRIVE_VERTICAL),
        (41, (CoilCarEvent.GUARD_OPENED, 1), Fault.GUARD),
        (42, (CoilCarEvent.GUARD_OPENED, 2), Fault.GUARD),
        (43, (CoilCarEvent.GUARD_OPENED, 3), Fault.GUARD),
        (50, (CoilCarEvent.EMERGENCY_STOP, 0), Fault.EMERGENCY_STOP),
    ],
)
def test_a_fault_brakes_at_once_and_holds_until_a_reset(code: int, event: tuple[int, int], fault: Fault) -> None:
    car, talker = line(start="automatic")
    for _ in range(300):
        car.ask(["drive_to_mandrel"])
        car.step()
    talker.events()
    talker.fault(code)
    for _ in range(60):
        car.ask(["drive_to_mandrel"])
        car.step()
    assert car.machine.speed_x == 0 and (car.mode, car.fault) == (Mode.OFF, fault)
    assert event in talker.codes()
    talker.fault(0)
    run(car, 0.1)
    x = car.machine.x
    for _ in range(50):
        car.ask(["drive_to_mandrel"])
        car.step()
    assert car.machine.x == x and value(car, "held") == 1
    assert talker.ask(CoilCarCommand.RESET).state == DONE and talker.ask(CoilCarCommand.AUTOMATIC).state == DONE
    act(car, "drive_to_mandrel")


@pytest.mark.parametrize(
    ("number", "movement", "bits"), [(1, "back", 2), (2, "forward", 1), (3, "up", 4), (4, "down", 8)]
)
def test_a_limit_switch_stuck_on_blocks_its_direction_only(number: int, movement: str, bits: int) -> None:
    car, talker = line()
    car.preset({"vertical": 300})
    talker.fault(10 + number)
    run(car, 1, talker, bits)
    assert (car.machine.x, car.machine.v) == (2700, 300)
    assert value(car, f"block_{movement}") == Block.LIMIT and value(car, "limits_plausible") == 0
    assert (CoilCarEvent.LIMIT_IMPLAUSIBLE, number) in talker.codes()
    other = bits * 2 if bits in (1, 4) else bits // 2
    run(car, 1, talker, other)
    assert (car.machine.x, car.machine.v) != (2700, 300)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("number", "bits"), [(1, 2), (2, 1), (3, 4), (4, 8)])
def test_a_limit_switch_stuck_off_is_noticed_and_the_position_stops_the_axis(number: int, bits: int) -> None:
    car, talker = line(settings={"manual_horizontal": 200.0, "manual_vertical": 100.0})
    car.preset({"vertical": 100 if number == 4 else 0, "horizontal": 9000 if number == 2 else 2700})
    talker.fault(20 + number)
    run(car, 30, talker, bits)
    assert value(car, "collision") == 0 and -0.01 <= car.machine.x <= 10000.01 and -0.01 <= car.machine.v <= 1400.01
    assert (CoilCarEvent.LIMIT_IMPLAUSIBLE, number) in talker.codes()
