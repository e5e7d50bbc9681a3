"""The ramp generator: times, reversing, and the bits that stop or hold it."""

from itertools import pairwise

import pytest

from app.profidrive.state_machine import State
from app.profidrive.words import ENABLES, RUN, Control, Status
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.stand import HALF, command, running, step, value


@pytest.mark.parametrize(("up", "down"), [(2.0, 4.0), (5.0, 5.0), (10.0, 1.0)])
def test_ramps_take_the_parameters_from_zero_to_the_greatest_speed(up: float, down: float) -> None:
    drive = VirtualSinamics(disturbance=0, parameters={"p1120": up, "p1121": down, "p0346": 0, "p1226": 5})
    command(drive, ENABLES, 0x4000)
    command(drive, RUN)
    step(drive, up / 2)
    assert drive.ramp == pytest.approx(750, abs=1500 / up * 0.2)
    step(drive, up)
    command(drive, ENABLES)
    step(drive, down / 2 - 0.05)
    assert drive.ramp == pytest.approx(750, abs=1500 / down * 0.1)
    assert drive.state is State.RAMP_STOP
    step(drive, down / 2 + 3)
    assert drive.state is State.READY_TO_SWITCH_ON


def test_reversing_goes_through_zero_on_the_ramps_and_never_jumps() -> None:
    drive = running()
    drive.write(6, 99, [RUN | Control.INVERT])
    seen = []
    for _ in range(800):
        step(drive, 0.01)
        seen.append(drive.ramp)
    assert seen[-1] == pytest.approx(-750)
    assert max(abs(b - a) for a, b in pairwise(seen)) <= 1500 / 5 * 0.01 + 1e-6
    assert not drive.status & Status.FORWARD and value(drive, 40341) < 0
    assert drive.read(3, 110, 1)[0] > 0x8000


def test_a_negative_setpoint_turns_backwards_and_inverted_forwards() -> None:
    assert running(setpoint=-HALF).speed < -700
    assert running(RUN | Control.INVERT, setpoint=-HALF).speed > 700


def test_setpoint_is_zero_without_its_enable_and_held_without_control_by_plc() -> None:
    drive = running()
    command(drive, RUN & ~Control.ENABLE_SETPOINT)
    step(drive, 5)
    assert abs(drive.speed) < 5 and drive.state is State.OPERATION
    command(drive, RUN, HALF)
    step(drive, 5)
    command(drive, RUN & ~Control.BY_PLC, 0x1000)
    step(drive, 5)
    assert drive.speed == pytest.approx(750, abs=5), "word and set-point are ignored as a whole"


@pytest.mark.parametrize(("bit", "speed"), [(Control.ENABLE_RAMP, 0.0), (Control.CONTINUE_RAMP, 750.0)])
def test_the_ramp_generator_stops_or_stands_still(bit: Control, speed: float) -> None:
    drive = running()
    command(drive, RUN & ~bit, 0x4000)
    step(drive, 6)
    assert drive.speed == pytest.approx(speed, abs=6) and drive.state is State.OPERATION
    command(drive, ENABLES & ~bit)
    step(drive, 4)
    assert drive.state is State.READY_TO_SWITCH_ON, "a stop goes on regardless"
