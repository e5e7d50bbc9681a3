"""The V/f curve of the virtual drive, its boost and its slip compensation."""

import pytest

from app.sim.eura_e800.drive import VirtualE800
from tests.sim.eura_e800.stand import (
    FORWARD,
    QUIET,
    command,
    drive,
)


@pytest.mark.parametrize("curve", [0, 1, 2, 3])
@pytest.mark.parametrize("base", [40.0, 50.0, 87.0])
def test_v_over_f_never_falls_and_ends_at_rated_voltage(curve: int, base: float) -> None:
    device = drive(F137=curve, F118=base)
    volts = [device.output_voltage(hertz / 2) for hertz in range(0, 241)]
    assert volts == sorted(volts)
    assert volts[-1] == 230.0
    assert device.output_voltage(base) == 230.0
    assert device.output_voltage(base - 1) < 230.0


def test_boost_lifts_the_low_end_and_square_saves_in_the_middle() -> None:
    assert drive(F138=10).output_voltage(1.0) > drive(F138=2).output_voltage(1.0) + 15
    assert drive(F137=1, F139=4).output_voltage(1.0) > drive(F137=1, F139=1).output_voltage(1.0)
    assert drive(F137=1).output_voltage(25.0) < 0.6 * drive().output_voltage(25.0)


def test_vector_control_holds_the_speed_under_load() -> None:
    slips = {}
    for mode in (2, 0):
        device = VirtualE800(parameters=QUIET | {"F106": mode, "F113": 30.0}, load=80, quadratic_load=0, disturbance=0)
        slips[mode] = 900 - command(device, FORWARD, 8).shaft_speed
    assert 0 < abs(slips[0]) < 0.4 * slips[2]
