"""The power section of the virtual drive: injected faults act on its physics."""

import pytest

from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import OC, PATIENCE
from tests.sim.eura_e800.stand import (
    FORWARD,
    QUIET,
    command,
    drive,
    go,
    image,
    inject,
    until,
)


@pytest.mark.parametrize("code", sorted(PATIENCE))
@pytest.mark.parametrize("hertz", [25.0, 50.0])
def test_physical_causes_trip_by_physics(code: int, hertz: float) -> None:
    device = command(drive(F113=hertz), FORWARD, 6)
    inject(device, code)
    taken = until(device, lambda: device.fault != 0, 70)
    assert device.fault == code
    assert 0 < taken < PATIENCE[code]


def test_stalled_motor_draws_the_current_that_trips() -> None:
    device = command(drive(), FORWARD, 6)
    usual = device.motor.point.current
    inject(device, OC)
    peak = 0.0
    while not device.fault:
        peak = max(peak, device.motor.point.current)
        device.step()
    assert peak > usual
    assert device.fault == OC


def test_values_stay_alive_at_a_steady_setpoint() -> None:
    device = VirtualE800(parameters=QUIET, start="forward")
    seen = {image(go(device, 1))[2] for _ in range(60)}
    assert len(seen) > 15
