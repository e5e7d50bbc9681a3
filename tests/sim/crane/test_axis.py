"""An axis of the crane: figures, brake, lag, encoder."""

from collections.abc import Mapping

import pytest

from app.sim.crane.axis import Axis, AxisData
from app.sim.crane.figures import AXES, BRIDGE, HOIST, TROLLEY, Figure

IDEAL = AxisData(max_speed=660.4, acceleration=110.0, deceleration=165.0, resolution=0.0)


def test_every_figure_has_a_source_and_what_nobody_gives_says_so() -> None:
    for figures in AXES.values():
        for name, figure in figures.items():
            assert figure.source in ("thesis", "computed", "assumed"), name
            assert figure.note or figure.source == "thesis", name
    assert all(figure.source == "assumed" for figure in BRIDGE.values())


@pytest.mark.parametrize(("figures", "acceleration", "deceleration"), [(TROLLEY, 110.07, 165.1), (HOIST, 44.03, 44.03)])
def test_ramps_are_speed_by_time(figures: Mapping[str, Figure], acceleration: float, deceleration: float) -> None:
    data = AxisData.of(figures)
    assert data.acceleration == pytest.approx(acceleration, abs=5e-3)
    assert data.deceleration == pytest.approx(deceleration, abs=5e-3)


def test_stands_until_the_brake_is_open_and_tells_who_works_against_it() -> None:
    axis = Axis(IDEAL.with_(brake_release=0.4))
    for _ in range(39):
        axis.step(100.0, True, 0.01)
    assert (axis.speed, axis.position, axis.is_open) == (0.0, 0.0, False)
    assert axis.strain > 0.3
    axis.step(100.0, True, 0.01)
    assert axis.is_open and axis.speed > 0


def test_a_closed_brake_ends_motion_whatever_the_drive_does() -> None:
    axis = Axis(IDEAL.with_(brake_deceleration=800.0), speed=660.0, brake=1.0)
    for _ in range(83):
        axis.step(660.0, False, 0.01, torque=False)
    assert axis.speed == 0.0 and axis.position == pytest.approx(660**2 / 1600, rel=0.01)


def test_a_stuck_brake_stays_as_it_is() -> None:
    closed, opened = Axis(IDEAL, stuck=True), Axis(IDEAL, brake=1.0, stuck=True)
    for _ in range(100):
        closed.step(0.0, True, 0.01)
        opened.step(0.0, False, 0.01)
    assert (closed.is_open, opened.is_open) == (False, True)


def test_without_torque_it_coasts_and_a_quick_stop_is_quicker_than_the_ramp() -> None:
    ways = []
    for torque, quick in ((False, False), (True, False), (True, True)):
        axis = Axis(IDEAL, brake=1.0)
        for _ in range(700):
            axis.step(660.0, True, 0.01)
        at = axis.position
        for _ in range(6000):
            axis.step(0.0, True, 0.01, torque=torque, quick_stop=quick)
        assert axis.speed == 0.0
        ways.append(axis.position - at)
    assert ways[0] > 5 * ways[1] and ways[1] == pytest.approx(660**2 / 330, rel=0.01)
    assert ways[2] == pytest.approx(ways[1] / 2, rel=0.02)


@pytest.mark.parametrize(("lag", "dead_time"), [(0.1, 0.0), (0.0, 0.1), (0.05, 0.05)])
def test_lag_and_dead_time_cost_the_same_way(lag: float, dead_time: float) -> None:
    late, ideal = Axis(IDEAL.with_(lag=lag, dead_time=dead_time), brake=1.0), Axis(IDEAL, brake=1.0)
    for _ in range(1000):
        late.step(600.0, True, 0.01)
        ideal.step(600.0, True, 0.01)
    assert ideal.position - late.position == pytest.approx(60.0, abs=3.1)


def test_encoder_shows_whole_pulses_also_below_zero() -> None:
    axis = Axis(IDEAL.with_(resolution=0.3122))
    for position, pulses in ((0.0, 0), (0.3, 0), (0.32, 1), (-0.1, -1), (1000.0, 3203)):
        axis.position = position
        assert axis.measured == pytest.approx(pulses * 0.3122)


def test_a_brake_holds_until_it_is_open_and_again_when_it_is_closed() -> None:
    axis = Axis(IDEAL.with_(brake_release=0.1, brake_close=0.1))
    for _ in range(9):
        axis.step(0.0, True, 0.01)
    assert axis.holds and not axis.is_open
    axis.step(0.0, True, 0.01)
    assert not axis.holds and axis.is_open
    for _ in range(9):
        axis.step(0.0, False, 0.01)
    assert not axis.holds and not axis.is_open, "the feedback is gone before the brake holds"
    axis.step(0.0, False, 0.01)
    assert axis.holds


def test_a_load_without_torque_and_brake_falls_and_the_brake_catches_it() -> None:
    axis = Axis(AxisData.of(HOIST), brake=1.0)
    for _ in range(20):
        axis.step(0.0, False, 0.01, torque=False)
    assert axis.holds and axis.speed == pytest.approx(-190 * 0.19, abs=5.0)
    for _ in range(50):
        axis.step(0.0, False, 0.01, torque=False)
    assert axis.speed == 0.0 and -12.0 < axis.position < -4.0


def test_the_safety_brake_falls_in_at_over_speed_without_anybody_and_stays() -> None:
    axis = Axis(AxisData.of(HOIST), brake=1.0, stuck=True)
    top = 0.0
    for _ in range(300):
        axis.step(0.0, False, 0.01, torque=False)
        top = max(top, abs(axis.speed))
    assert axis.safety_brake and axis.speed == 0.0 and not axis.holds
    assert top == pytest.approx(1.15 * 132.08, abs=4.0) and -150.0 < axis.position < -60.0
    for _ in range(300):
        axis.step(50.0, True, 0.01)
    assert axis.speed == 0.0
    axis.safety_brake = False
    for _ in range(300):
        axis.step(50.0, True, 0.01)
    assert axis.speed == pytest.approx(50.0, abs=0.1)
