"""POSITIONER: the reference's curve, and every start, target, speed, ramp and lag in both directions."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from app.blocks.positioner.positioner import MoveInputs, MovePhase, Positioner
from app.sim.crane.axis import Axis, AxisData
from tests.blocks.positioner.stand import HOIST_DATA, IDEAL, TROLLEY_DATA


@dataclass
class Run:
    """What a positioning did, in ways counted towards the target."""

    seconds: float
    error: float
    overshoot: float
    slow_at: float
    phases: list[MovePhase]
    top: float


def run(
    start: float,
    target: float,
    data: AxisData = IDEAL,
    *,
    lag: float = 0.0,
    set_speed: float = 660.4,
    slow: tuple[float, float] = (50.0, 200.0),
    dt: float = 0.01,
) -> Run:
    axis = Axis(data, position=start, brake=1.0)
    block = Positioner(data.max_speed, data.acceleration, data.deceleration, *slow, lag=lag)
    way = 1 if target >= start else -1
    seconds, overshoot, slow_at, top, phases = 0.0, -math.inf, math.nan, 0.0, [MovePhase.OFF]
    while phases[-1] not in (MovePhase.DONE, MovePhase.MISSED):
        out = block.step(MoveInputs(True, axis.measured, target, axis.speed, set_speed), dt)
        if out.phase is not phases[-1]:
            phases.append(out.phase)
            if out.phase is MovePhase.SLOW and math.isnan(slow_at):
                slow_at = axis.position
        assert out.forward is (out.speed > 0) and out.reverse is (out.speed < 0)
        assert out.percent == pytest.approx(abs(out.speed) / data.max_speed * 100)
        axis.step(out.speed, True, dt)
        seconds += dt
        overshoot = max(overshoot, way * (axis.position - target))
        top = max(top, abs(axis.speed))
        assert seconds < 2000, "never arrives"
    return Run(seconds, abs(axis.position - target), overshoot, slow_at, phases, top)


@pytest.mark.parametrize(("start", "target"), [(5000.0, 10000.0), (10000.0, 5000.0), (-5000.0, 0.0), (2500.0, -2500.0)])
@pytest.mark.parametrize("dt", [0.005, 0.01])
def test_curve_of_the_reference_in_both_directions(start: float, target: float, dt: float) -> None:
    way = 1 if target > start else -1
    done = run(start, target, dt=dt)
    assert way * (done.slow_at - start) == pytest.approx(3486.8, abs=660.4 * dt)
    assert done.seconds == pytest.approx(16.1, abs=0.1)
    assert done.error < 5.0 and done.overshoot <= 0.0
    assert done.phases == [MovePhase.OFF, MovePhase.TRAVEL, MovePhase.SLOW, MovePhase.STOP, MovePhase.DONE]
    assert done.top == pytest.approx(660.4)


def test_positions_told_are_the_formulas() -> None:
    block = Positioner(660.4, 660.4 / 6, 660.4 / 4, 50.0, 200.0)
    out = block.step(MoveInputs(True, 8000.0, 10000.0, 660.4, 660.4), 0.01)
    assert out.slow_down_position == pytest.approx(8486.8, abs=0.05)
    assert out.stop_position == pytest.approx(10000 - 660.4**2 / (2 * 165.1), abs=0.05)
    block = Positioner(660.4, 660.4 / 6, 660.4 / 4, 50.0, 200.0)
    out = block.step(MoveInputs(True, 8000.0, 5000.0, -660.4, 660.4), 0.01)
    assert out.slow_down_position == pytest.approx(6513.2, abs=0.05)


@pytest.mark.sweep(8)
@settings(max_examples=60, deadline=None)
@given(
    start=st.floats(0, 20000),
    gap=st.one_of(st.floats(-12000, 12000), st.floats(-300, 300)),
    set_speed=st.one_of(st.just(660.4), st.floats(40, 700)),
    times=st.tuples(st.floats(1.5, 8), st.floats(1.5, 8)),
    slow=st.tuples(st.floats(20, 80), st.floats(100, 400)),
    lag=st.floats(0, 0.3),
    part=st.floats(0, 1),
    spare=st.floats(0, 0.05),
)
@example(0.0, 6.0, 660.4, (2.0, 8.0), (29.0, 100.0), 0.0, 0.0, 0.0)  # still gaining speed when it has to brake
@example(0.0, 5.0, 660.4, (2.0, 2.0), (62.0, 100.0), 0.28125, 0.0, 0.0)  # told to stop before it moved
@example(0.0, 7.0, 660.4, (2.0, 2.0), (62.0, 100.0), 0.28125, 0.0, 0.03125)  # never fast enough to owe lag times speed
def test_stops_within_tolerance_and_never_overshoots(
    start: float, gap: float, set_speed: float, times: tuple[float, float], slow: tuple[float, float],
    lag: float, part: float, spare: float,
) -> None:  # fmt: skip
    data = TROLLEY_DATA.with_(
        acceleration=660.4 / times[0], deceleration=660.4 / times[1], lag=lag * part, dead_time=lag * (1 - part)
    )
    done = run(start, start + gap, data, lag=lag + spare + 0.01, set_speed=set_speed, slow=slow)
    assert done.phases[-1] is MovePhase.DONE
    assert done.error < 5.0 + data.resolution
    assert done.overshoot <= data.resolution or abs(gap) < 5.0


@pytest.mark.sweep(8)
@settings(max_examples=15, deadline=None)
@given(gap=st.floats(-4000, 4000), lag=st.floats(0, 0.2), set_speed=st.floats(5, 132.08), creep=st.booleans())
def test_hoist_likewise_with_and_without_slow_travel(gap: float, lag: float, set_speed: float, creep: bool) -> None:
    data = HOIST_DATA.with_(lag=lag)
    slow = (20.32, 60.0) if creep else (0.0, 0.0)
    done = run(15000.0, 15000.0 + gap, data, lag=lag + 0.01, set_speed=set_speed, slow=slow)
    assert done.phases[-1] is MovePhase.DONE and done.error < 5.0 + data.resolution
    assert done.overshoot <= data.resolution or abs(gap) < 5.0


@pytest.mark.sweep(8)
@settings(max_examples=10, deadline=None)
@given(gap=st.floats(20, 9000), lag=st.floats(0, 0.2))
def test_forward_and_back_mirror_each_other(gap: float, lag: float) -> None:
    there = run(0.0, gap, IDEAL.with_(lag=lag), lag=lag)
    back = run(0.0, -gap, IDEAL.with_(lag=lag), lag=lag)
    assert there == Run(back.seconds, back.error, back.overshoot, -back.slow_at, back.phases, back.top) or (
        math.isnan(there.slow_at) and math.isnan(back.slow_at)
    )


def test_a_lag_that_was_not_told_is_made_up_for_by_coming_back() -> None:
    done = run(0.0, 5000.0, IDEAL.with_(lag=0.4), lag=0.05)
    assert done.phases[-1] is MovePhase.DONE and done.error < 5.0 and done.overshoot > 5.0


@pytest.mark.parametrize("way", [1, -1])
def test_switches_ahead_count_and_those_behind_do_not(way: int) -> None:
    slow, stop = ("slow_max", "stop_max") if way > 0 else ("slow_min", "stop_min")
    behind = ("slow_min", "stop_min") if way > 0 else ("slow_max", "stop_max")
    block = Positioner(660.4, 110.0, 165.0, 50.0, 200.0)
    at = MoveInputs(True, 0.0, way * 5000.0, way * 100.0, 660.4)
    assert block.step(at, 0.01).speed == way * 660.4
    for name in behind:
        assert block.step(at._replace(**{name: True}), 0.01).speed == way * 660.4
    assert block.step(at._replace(**{slow: True}), 0.01).speed == way * 50.0
    assert block.step(at, 0.01).speed == way * 50.0, "latched"
    assert block.step(at._replace(**{stop: True}), 0.01).speed == 0.0
    for _ in range(600):
        out = block.step(at._replace(speed=0.0), 0.01)
    assert (out.phase, out.speed, out.percent, out.forward, out.reverse) == (MovePhase.MISSED, 0.0, 0.0, False, False)
    assert block.step(at._replace(start=False), 0.01).phase is MovePhase.OFF


def test_dropping_the_start_stops_and_a_new_one_takes_the_new_target() -> None:
    block = Positioner(660.4, 110.0, 165.0, 50.0, 200.0)
    block.step(MoveInputs(True, 0.0, 5000.0, 0.0, 660.4), 0.01)
    assert block.step(MoveInputs(True, 0.0, -5000.0, 0.0, 660.4), 0.01).speed == 660.4, (
        "the target is taken at the start"
    )
    out = block.step(MoveInputs(False, 0.0, -5000.0, 0.0, 660.4), 0.01)
    assert (out.speed, out.percent, out.forward, out.phase) == (0.0, 0.0, False, MovePhase.OFF)
    assert block.step(MoveInputs(True, 0.0, -5000.0, 0.0, 660.4), 0.01).speed == -660.4


def test_there_already_is_done_without_a_move() -> None:
    for gap in (0.0, 4.9, -4.9):
        assert run(100.0, 100.0 + gap).phases == [MovePhase.OFF, MovePhase.DONE]


@pytest.mark.parametrize("name", ["position", "target", "speed", "set_speed", "held"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_inputs_must_be_finite_and_safe_is_still(name: str, bad: float) -> None:
    block = Positioner(660.4, 110.0, 165.0)
    good = MoveInputs(True, 0.0, 5000.0, 0.0, 660.4)
    block.step(good, 0.01)
    with pytest.raises(ValueError, match=name):
        block.step(good._replace(**{name: bad}), 0.01)  # type: ignore[arg-type]
    assert block.safe().speed == 0.0 and block.phase is MovePhase.OFF


@pytest.mark.parametrize("name", ["max_speed", "acceleration", "deceleration", "tolerance", "lag", "slow_speed"])
@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_limits_must_be_numbers(name: str, bad: float) -> None:
    fields = {"max_speed": 1.0, "acceleration": 1.0, "deceleration": 1.0, name: bad}
    with pytest.raises(ValueError, match=name):
        Positioner(**fields)  # type: ignore[arg-type]
