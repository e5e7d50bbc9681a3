"""The speed loop and its motor: limits, friction, field weakening, and standing still."""

from math import copysign

import pytest

from app.sim.induction_motor import MOTOR_SETS
from app.sim.sinamics.shaft import RPM, Resistance, Shaft, Supply

DATA = MOTOR_SETS["B"].sized(20.0)
FREE = Resistance(0.0, 0.0, 0.0)


def shaft(inertia: float = 0.2) -> Shaft:
    return Shaft(DATA, inertia)


def turned(it: Shaft, supply: Supply, load: Resistance = FREE, seconds: float = 5.0, dt: float = 0.01) -> Shaft:
    for _ in range(round(seconds / dt)):
        it.step(supply, load, dt)
    return it


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.02])
@pytest.mark.parametrize("rpm", [-1400, -60, 30, 700, 1500])
def test_the_loop_reaches_its_speed_under_load_whatever_the_step(rpm: float, dt: float) -> None:
    load = Resistance(0.5 * DATA.rated_torque, 0.6 * DATA.rated_torque, 0.0)
    it = turned(shaft(), Supply(True, rpm / RPM, 1.0, 60.0), load, dt=dt)
    assert it.speed * RPM == pytest.approx(rpm, abs=2)
    assert it.torque == pytest.approx(copysign(0.5 * DATA.rated_torque, rpm), rel=0.02)
    assert not it.limited


@pytest.mark.parametrize("limit", [10.0, 20.0, 40.0])
def test_torque_and_current_stay_at_what_the_limit_allows(limit: float) -> None:
    it = shaft()
    it.step(Supply(True, 1500 / RPM, 1.0, limit), Resistance(1e4, 1e4, 0.0), 0.01)
    assert it.limited and it.torque == pytest.approx(it.torque_limit(1.0, limit))
    assert it.current == pytest.approx(max(limit, it.magnetising_current), rel=1e-6)
    assert it.speed == 0, "what resists more than the torque is not moved"


def test_without_flux_or_with_less_current_than_the_flux_takes_there_is_no_torque() -> None:
    it = shaft()
    assert it.torque_limit(0.0, 100.0) == 0
    assert it.torque_limit(1.0, it.magnetising_current * 0.9) == 0


@pytest.mark.parametrize("sign", [-1, 1])
def test_without_pulses_it_coasts_and_friction_stops_it_for_good(sign: int) -> None:
    it = shaft()
    it.speed = sign * 100.0
    load = Resistance(5.0, 6.0, 0.0)
    speeds = []
    for _ in range(600):
        it.step(Supply(False), load, 0.01)
        speeds.append(sign * it.speed)
    assert speeds == sorted(speeds, reverse=True) and speeds[-1] == 0
    assert (it.torque, it.current, it.voltage, it.power) == (0, 0, 0, 0)


@pytest.mark.parametrize(("part", "flux"), [(0.5, 1.0), (1.0, 1.0), (2.0, 0.5), (4.0, 0.25)])
def test_above_rated_frequency_the_flux_falls_with_the_speed(part: float, flux: float) -> None:
    synchronous = 2 * 3.141592653589793 * 50 / DATA.pole_pairs
    assert shaft().weakening(-part * synchronous) == pytest.approx(flux)


@pytest.mark.parametrize("rpm", [-900, 900])
def test_settled_it_stays_where_it_is(rpm: float) -> None:
    it, supply, load = shaft(), Supply(True, rpm / RPM, 1.0, 40.0), Resistance(10.0, 12.0, 0.001)
    it.settle(rpm / RPM, supply, load)
    before = (it.current, it.voltage, it.power)
    turned(it, supply, load, seconds=1.0)
    assert it.speed * RPM == pytest.approx(rpm, abs=0.5)
    assert (it.current, it.voltage, it.power) == pytest.approx(before, rel=0.01)
    assert it.power > it.losses > 0
