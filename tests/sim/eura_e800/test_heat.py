"""What gets warm in the virtual drive, and its overload images."""

import pytest

from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import OL1, OL2
from tests.sim.eura_e800.stand import FORWARD, QUIET, STOP, command, drive, go, until


def test_motor_overload_at_150_percent_trips_in_a_minute() -> None:
    device = VirtualE800(rated_current=2.5, parameters=QUIET, load=157, quadratic_load=0, disturbance=0)
    command(device, FORWARD, 8)
    ratio = device.motor.point.current / 2.5
    assert 1.35 < ratio < 1.65
    left = (1 - device.heat.motor_overload) * 60 * (2.25 - 1.21) / (ratio**2 - 1.21)
    assert until(device, lambda: device.fault != 0, 120) == pytest.approx(left, rel=0.05)
    assert device.fault == OL2


@pytest.mark.sweep(8)
def test_f707_lowers_and_f803_moves_the_motor_protection() -> None:
    for parameters in ({"F707": 50.0}, {"F803": 2.2}):
        device = command(drive(**parameters), FORWARD, 6)
        until(device, lambda device=device: device.fault != 0, 120)
        assert device.fault == OL2
    assert go(command(drive(), FORWARD, 6), 120).fault == 0


def test_drive_overload_by_its_own_curve() -> None:
    device = command(drive(F706=120, F803=6.0), FORWARD, 6)
    device.write(6, 0xE020, [90])
    until(device, lambda: device.fault != 0, 60)
    assert device.fault == OL1


@pytest.mark.sweep(8)
def test_heat_sink_and_winding_warm_slowly_and_cool_again() -> None:
    device = VirtualE800(parameters=QUIET, load=100, quadratic_load=0, disturbance=0)
    command(device, FORWARD, 1)
    after_a_second = device.heat.heat_sink
    go(device, 240)
    assert after_a_second < 27
    assert 25 + 0.55 * 30 < device.heat.heat_sink < 25 + 0.75 * 30
    assert 50 < device.heat.winding < 85
    hot = device.heat.heat_sink
    command(device, STOP, 120)
    assert device.heat.heat_sink < hot - 5
