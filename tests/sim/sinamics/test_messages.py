"""Every fault and alarm acts as the table of messages says."""

import pytest

from app.profidrive.state_machine import Reaction, State
from app.profidrive.words import ENABLES, RUN, Control, Status
from app.sim.sinamics import messages
from app.sim.sinamics.messages import ALARMS, FAULTS
from app.sim.training import REG_MACHINE_FAULT
from tests.sim.sinamics.stand import command, running, step, value


@pytest.mark.sweep(8)
@pytest.mark.parametrize("number", FAULTS)
def test_every_fault_stops_as_its_reaction_says_and_needs_cause_gone_edge_and_off(number: int) -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [number])
    step(drive, 0.1 if number != messages.BLOCKED else 3)
    assert drive.faults == [number] and drive.status & Status.FAULT
    assert value(drive, 40400) == number
    expected = {Reaction.OFF1: State.RAMP_STOP, Reaction.OFF3: State.QUICK_STOP, Reaction.OFF2: State.INHIBITED}
    assert drive.state is expected[FAULTS[number].reaction]
    step(drive, 5)
    assert drive.state is State.INHIBITED
    if number != messages.BLOCKED:  # a motor that stands is not known to be blocked
        command(drive, ENABLES | Control.ACKNOWLEDGE)
        assert drive.faults == [number], "the cause is still there"
    drive.write(6, REG_MACHINE_FAULT, [0])
    command(drive, ENABLES)
    assert drive.status & Status.FAULT, "nothing acknowledges itself"
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == [] and not drive.status & Status.FAULT
    command(drive, RUN | Control.ACKNOWLEDGE)
    step(drive, 1)
    assert drive.state is State.OPERATION


@pytest.mark.parametrize("number", ALARMS)
def test_every_alarm_warns_leaves_it_running_and_goes_with_its_cause(number: int) -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [number])
    step(drive, 0.1)
    assert drive.state is State.OPERATION and not drive.faults
    assert drive.status & Status.ALARM and value(drive, 40408) == value(drive, 40409) == number
    drive.write(6, REG_MACHINE_FAULT, [0])
    step(drive, 0.1)
    assert not drive.status & Status.ALARM and value(drive, 40408) == 0
