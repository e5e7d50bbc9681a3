"""What the drive watches trips it, or warns first."""

import pytest

from app.profidrive.words import ENABLES, Control, Status
from app.sim.sinamics import messages
from app.sim.sinamics import training as own
from app.sim.training import REG_MACHINE_FAULT
from tests.sim.sinamics.stand import command, running, step, value


def test_a_blocked_motor_trips_after_a_second_at_the_limit_and_the_current_stays_at_its_limit() -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [messages.BLOCKED])
    seen = []
    for _ in range(300):
        step(drive, 0.01)
        seen.append((drive.shaft.current, bool(drive.status & Status.LIMIT_NOT_REACHED), drive.faults))
    limited = [current for current, free, faults in seen if not free]
    assert limited and max(limited) <= drive.parameter("p0640") + 0.01
    assert 90 <= len(limited) <= 130
    assert drive.faults == [messages.BLOCKED]


@pytest.mark.sweep(8)
def test_overload_warns_first_and_then_trips() -> None:
    drive = running(setpoint=0x4000)
    drive.write(6, own.REG_LOAD, [100])
    story = []
    for _ in range(300):
        step(drive, 1)
        now = (bool(drive.faults), *drive.alarms)
        story += [] if story and story[-1] == now else [now]
    assert (False, messages.NEAR_OVERLOAD) in story
    assert drive.faults == [messages.OVERLOAD]


@pytest.mark.parametrize(("supply", "number"), [(200, messages.UNDERVOLTAGE), (0, messages.UNDERVOLTAGE)])
def test_a_supply_that_fails_trips_it_and_it_is_not_acknowledged_before_it_is_back(supply: int, number: int) -> None:
    drive = running()
    drive.write(6, own.REG_SUPPLY, [supply])
    step(drive, 2)
    assert drive.faults == [number] and value(drive, 40344) < 360
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == [number]
    drive.write(6, own.REG_SUPPLY, [400])
    step(drive, 1)
    command(drive, ENABLES)
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == []
