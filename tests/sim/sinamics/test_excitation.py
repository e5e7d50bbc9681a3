"""Magnetising takes its time, and its current."""

from app.profidrive.state_machine import State
from app.profidrive.words import ENABLES, RUN
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.stand import HALF, command, step, value


def test_magnetising_takes_its_time_and_current_before_anything_turns() -> None:
    drive = VirtualSinamics(parameters={"p0346": 1.0})
    command(drive, ENABLES, HALF)
    command(drive, RUN)
    step(drive, 0.5)
    assert drive.state is State.SWITCHED_ON and drive.speed == 0
    assert 0 < value(drive, 40345) < drive.shaft.magnetising_current
    step(drive, 0.6)
    assert drive.state is State.OPERATION
    assert value(drive, 40345) >= 0.9 * drive.shaft.magnetising_current
