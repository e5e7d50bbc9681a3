"""Energy, and a drive that has been running for long."""

import pytest

from app.profidrive.state_machine import State
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.stand import running, step, value


def test_energy_is_counted_in_whole_kilowatt_hours_and_never_goes_back() -> None:
    drive = running(setpoint=0x4000)
    before = drive.power.energy
    step(drive, 10)
    assert drive.power.energy > before
    drive.power.energy = 12.7
    assert value(drive, 40348) == 13


@pytest.mark.parametrize(("start", "sign"), [("forward", 1), ("reverse", -1)])
def test_a_drive_that_runs_since_long_stays_where_it_is(start: str, sign: int) -> None:
    drive = VirtualSinamics(start=start, setpoint=60, disturbance=0)
    for _ in range(100):
        step(drive, 0.05)
        assert drive.speed == pytest.approx(sign * 900, abs=3)
    assert drive.state is State.OPERATION and not drive.faults and not drive.alarms
