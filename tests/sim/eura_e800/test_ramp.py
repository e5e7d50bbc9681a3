"""Ramps of the virtual drive."""

from itertools import pairwise

import pytest

from tests.sim.eura_e800.stand import FORWARD, REVERSE, STOP, command, drive, go, image, put, until


def test_acceleration_takes_f114_and_deceleration_f115() -> None:
    device = drive(F114=4.0, F115=2.0)
    device.write(6, 0x2000, [FORWARD])
    assert until(device, lambda: image(device)[0] == 5000) == pytest.approx(4.0, abs=0.011)
    device.write(6, 0x2000, [STOP])
    assert until(device, lambda: image(device)[5] & 0xFF == 0) == pytest.approx(2.0, abs=0.035)


def test_ramp_reference_can_be_the_maximum_frequency() -> None:
    device = drive(F111=100.0, F119=1, F114=4.0)
    device.write(6, 0x2000, [FORWARD])
    assert until(device, lambda: image(device)[0] == 5000) == pytest.approx(2.0, abs=0.011)


def test_status_stays_running_until_below_minimum_frequency() -> None:
    device = command(drive(F112=10.0), FORWARD, 6)
    device.write(6, 0x2000, [STOP])
    lowest = 5000
    while image(go(device, 0.01))[5] & 0xFF == 1:
        lowest = image(device)[0]
    assert 1000 <= lowest <= 1010
    assert image(device)[0] == 0


def test_direction_changes_through_zero_by_its_own_ramps() -> None:
    device = command(drive(), FORWARD, 6)
    device.write(6, 0x2000, [REVERSE])
    trace = []
    for _ in range(1100):
        device.step()
        trace.append((device.frequency, device.status, device.shaft_speed))
    steps = [b[0] - a[0] for a, b in pairwise(trace)]
    assert min(steps) >= -0.1001
    assert trace[-1][0] == -50.0
    assert all(status == (1 if frequency > 0 else 2) for frequency, status, _ in trace)
    crossing = next(index for index, row in enumerate(trace) if row[0] <= 0)
    assert crossing == pytest.approx(500, abs=2)
    assert trace[-1][2] < -1395
    speeds = [row[2] for row in trace]
    assert max(abs(b - a) for a, b in pairwise(speeds)) < 30


@pytest.mark.parametrize(("source", "frequency"), [(0, 30), (10, 30), (1, 0.5), (4, 0.5), (9, 0.5)])
def test_f203_decides_whether_the_modbus_setpoint_counts(source: int, frequency: float) -> None:
    device = command(drive(F203=source, F113=30.0), FORWARD, 6)
    assert device.frequency == frequency


def test_setpoint_moves_a_running_drive_by_ramp() -> None:
    device = command(drive(F113=20.0), FORWARD, 3)
    put(device, "F113", 40.0)
    go(device, 1)
    assert device.frequency == pytest.approx(30.0)
    go(device, 2)
    assert device.frequency == 40.0
