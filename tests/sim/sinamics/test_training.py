"""What an instructor opens, presses or takes over at the drive."""

import pytest

from app.profidrive.state_machine import State
from app.profidrive.words import ENABLES, RUN, Status
from app.sim.sinamics import training as own
from tests.sim.sinamics.stand import command, running, step, value


@pytest.mark.parametrize(
    ("register", "state", "bit"),
    [
        (own.REG_INTERLOCK, State.INHIBITED, Status.NO_COAST_STOP),
        (own.REG_EMERGENCY, State.QUICK_STOP, Status.NO_QUICK_STOP),
    ],
)
def test_terminals_stop_it_and_it_does_not_start_by_itself_when_they_close(
    register: int, state: State, bit: Status
) -> None:
    drive = running()
    drive.write(6, register, [1])
    step(drive, 0.1)
    assert drive.state is state and not drive.status & bit
    step(drive, 5)
    command(drive, ENABLES)
    command(drive, RUN)
    assert drive.state is State.INHIBITED, "the word cannot overrule it"
    drive.write(6, register, [0])
    step(drive, 1)
    assert drive.state is State.INHIBITED, "OFF is wanted first"
    command(drive, ENABLES)
    command(drive, RUN)
    step(drive, 1)
    assert drive.state is State.OPERATION


def test_local_control_takes_it_off_and_says_so() -> None:
    drive = running()
    drive.write(6, own.REG_LOCAL, [1])
    step(drive, 5)
    assert drive.state is State.READY_TO_SWITCH_ON
    assert not drive.status & Status.CONTROL_REQUESTED and value(drive, 40349) == 0
    command(drive, RUN)
    assert drive.state is State.READY_TO_SWITCH_ON
