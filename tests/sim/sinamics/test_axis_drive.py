"""The drive of an axis behind telegram 1: it moves in S4 only, and a silent PLC stops it."""

import pytest

from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import Reaction, State
from app.profidrive.words import ENABLES, RUN, Control, Status
from app.sim.sinamics.axis_drive import VirtualDrive

DT = 0.01
HALF = 0x2000


def drive() -> VirtualDrive:
    return VirtualDrive(Scaling(100.0))


def run(it: VirtualDrive, word: int, seconds: float, raw: int = HALF, speed: float = 0.0) -> float:
    setpoint = 0.0
    for _ in range(round(seconds / DT)):
        setpoint = it.step(word, raw, speed, DT).setpoint
    return setpoint


def running() -> VirtualDrive:
    it = drive()
    run(it, ENABLES, 0.05)
    run(it, RUN, 1.0)
    assert it.machine.state is State.OPERATION
    return it


def test_the_setpoint_counts_once_the_motor_is_magnetised() -> None:
    it = drive()
    run(it, ENABLES, 0.05)
    assert run(it, RUN, 0.3) == 0
    assert run(it, RUN, 0.7) == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("bit", "setpoint"), [(Control.ENABLE_RAMP, 0.0), (Control.ENABLE_SETPOINT, 0.0), (Control.CONTINUE_RAMP, 50.0)]
)
def test_without_its_bits_it_is_0_and_without_bit_5_the_last_one_holds(bit: Control, setpoint: float) -> None:
    assert run(running(), RUN & ~bit, 0.05, raw=0x1000) == pytest.approx(setpoint)


def test_inverted_it_is_its_negative() -> None:
    assert run(running(), RUN | Control.INVERT, 0.05) == pytest.approx(-50.0)


def test_a_plc_that_falls_silent_is_a_fault_with_a_quick_stop() -> None:
    it = running()
    assert not it.machine.faulted
    it.step(0, 0, 50.0, DT)
    assert not it.machine.faulted, "one telegram may be missing"
    run(it, 0, 0.2, raw=0, speed=50.0)
    assert it.machine.faulted and it.machine.state is not State.OPERATION


@pytest.mark.parametrize("cause", [Reaction.OFF2, Reaction.OFF3])
def test_a_cause_stops_it_and_coasting_takes_the_torque_at_once(cause: Reaction) -> None:
    it = running()
    it.cause = cause
    driven = it.step(RUN, HALF, 50.0, DT)
    assert it.machine.faulted and driven.setpoint == 0
    assert driven.torque is (cause is Reaction.OFF3)


def test_it_tells_no_limit_and_no_heat() -> None:
    calm = Status.LIMIT_NOT_REACHED | Status.NO_MOTOR_OVERTEMPERATURE | Status.NO_POWER_UNIT_OVERLOAD
    assert running().status & calm == calm
