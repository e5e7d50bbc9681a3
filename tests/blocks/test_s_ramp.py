"""The S-ramp keeps its limits, never overshoots, and knows where it would stop."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.s_ramp import SRamp

SPEEDS = st.floats(-100, 100, allow_nan=False).map(lambda x: round(x, 3))
LIMITS = st.sampled_from([5.0, 20.0, 60.0, 500.0])
JERKS = st.sampled_from([10.0, 240.0, 5000.0])


def unavoidable(speed: float, acceleration: float, jerk: float) -> float:
    """Speed reached when the acceleration is let go at once."""
    return speed + acceleration * abs(acceleration) / (2 * jerk)


def stopped(ramp: SRamp, dt: float = 0.0005) -> tuple[float, float, float]:
    """Simulates the stop: (where it ends, farthest forward, farthest back)."""
    x = high = low = 0.0
    probe = SRamp(ramp.acceleration_limit, ramp.jerk, ramp.speed, ramp.acceleration)
    for _ in range(2_000_000):
        before = probe.speed
        out = probe.step(0.0, dt)
        x += (before + out.speed) / 2 * dt
        high, low = max(high, x), min(low, x)
        if out.done:
            return x, high, low
    raise AssertionError("never stopped")


def test_example_of_the_reference_takes_145_cycles_without_overshoot() -> None:
    ramp = SRamp(acceleration_limit=0.25, jerk=0.01)
    speeds, accelerations = [0.0], [0.0]
    while not (out := ramp.step(30.0, 1.0)).done:
        speeds.append(out.speed)
        accelerations.append(out.acceleration)
        assert len(speeds) < 200
    changes = [b - a for a, b in zip(accelerations, [*accelerations[1:], out.acceleration], strict=True)]
    assert len(speeds) == 145
    assert sum(change > 0.005 for change in changes) == 25
    assert sum(abs(change) < 0.005 for change in changes) == 95
    assert sum(change < -0.005 for change in changes) == 25
    assert max(speeds) <= 30.0
    assert (out.speed, out.acceleration) == (30.0, 0.0)
    assert max(accelerations) == pytest.approx(0.25)


def test_example_of_the_reference_backwards_mirrors_it() -> None:
    there, back = SRamp(0.25, 0.01), SRamp(0.25, 0.01)
    for _ in range(145):
        a, b = there.step(30.0, 1.0), back.step(-30.0, 1.0)
        assert (a.speed, a.stop_distance) == (-b.speed, -b.stop_distance)
    assert a.done and b.done


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.05])
def test_path_does_not_depend_on_the_scan_period(dt: float) -> None:
    fine, coarse = SRamp(60.0, 240.0), SRamp(60.0, 240.0)
    for target, seconds in ((30.0, 0.4), (-20.0, 0.55), (80.0, 0.1), (0.0, 3.0)):
        for _ in range(round(seconds / 0.0005)):
            exact = fine.step(target, 0.0005)
        for _ in range(round(seconds / dt)):
            out = coarse.step(target, dt)
        assert out.speed == pytest.approx(exact.speed, abs=1e-6)
        assert out.acceleration == pytest.approx(exact.acceleration, abs=1e-4)
        assert out.stop_distance == pytest.approx(exact.stop_distance, abs=1e-6)


@pytest.mark.sweep(8)
@given(
    st.lists(st.tuples(SPEEDS, st.integers(1, 60)), min_size=1, max_size=8),
    LIMITS,
    JERKS,
    st.sampled_from([0.001, 0.01, 0.05]),
)
def test_any_targets_at_any_moment_keep_the_limits_and_never_overshoot(
    orders: list[tuple[float, int]], limit: float, jerk: float, dt: float
) -> None:
    ramp = SRamp(limit, jerk)
    for target, cycles in orders:
        reach = unavoidable(ramp.speed, ramp.acceleration, jerk)
        low, high = min(ramp.speed, target, reach), max(ramp.speed, target, reach)
        for _ in range(cycles):
            before = ramp.acceleration
            out = ramp.step(target, dt)
            assert low - 1e-6 <= out.speed <= high + 1e-6
            assert abs(out.acceleration) <= limit * (1 + 1e-9)
            assert abs(out.acceleration - before) <= jerk * dt * (1 + 1e-6) + 1e-9


@given(SPEEDS, SPEEDS, st.integers(0, 200), LIMITS, JERKS)
def test_arrives_exactly_in_the_time_of_the_formula(
    start: float, target: float, _: int, limit: float, jerk: float
) -> None:
    ramp = SRamp(limit, jerk, speed=start)
    change = abs(target - start)
    expected = change / limit + limit / jerk if change >= limit * limit / jerk else 2 * math.sqrt(change / jerk)
    cycles = 0
    while not ramp.step(target, 0.01).done:
        cycles += 1
        assert cycles * 0.01 <= expected + 0.011
    assert ramp.speed == target and ramp.acceleration == 0.0
    assert (cycles + 1) * 0.01 >= expected - 1e-6


@pytest.mark.sweep(8)
@given(
    SPEEDS,
    SPEEDS,
    st.integers(0, 80),
    st.integers(0, 80),
    st.sampled_from([20.0, 60.0, 500.0]),
    st.sampled_from([240.0, 5000.0]),
)
def test_distance_to_stop_is_where_a_simulated_stop_gets_to(
    first: float, second: float, a: int, b: int, limit: float, jerk: float
) -> None:
    ramp = SRamp(limit, jerk)
    for target, cycles in ((first, a), (second, b)):
        for _ in range(cycles):
            ramp.step(target, 0.01)
    end, high, low = stopped(ramp)
    farthest = max((end, high, low), key=abs)
    assert ramp.stop_distance() == pytest.approx(farthest, abs=2e-3 + abs(farthest) * 1e-4)


def test_distance_to_stop_from_constant_speed_is_the_textbook_one() -> None:
    ramp = SRamp(60.0, 240.0, speed=30.0)
    assert ramp.step(30.0, 0.01).stop_distance == pytest.approx(30 / 2 * (30 / 60 + 60 / 240))
    slow = SRamp(60.0, 240.0, speed=6.0)
    assert slow.stop_distance() == pytest.approx(6 * math.sqrt(6 / 240))
    assert SRamp(60.0, 240.0).stop_distance() == 0.0
    assert SRamp(60.0, 240.0, speed=-30.0).stop_distance() == pytest.approx(-11.25)


def test_distance_to_stop_of_a_swing_through_zero_is_the_far_side() -> None:
    ramp = SRamp(500.0, 240.0, speed=1.0, acceleration=-120.0)
    end, high, low = stopped(ramp)
    assert low < 0 < high
    assert ramp.stop_distance() == pytest.approx(low, rel=1e-2) and end == pytest.approx(low, rel=1e-2)


def test_distance_to_stop_grows_by_the_way_covered_while_braking() -> None:
    ramp = SRamp(60.0, 240.0, speed=80.0)
    for _ in range(400):
        distance, before = ramp.stop_distance(), ramp.speed
        ramp.step(0.0, 0.001)
        assert ramp.stop_distance() == pytest.approx(distance - (before + ramp.speed) / 2 * 0.001, abs=1e-4)


def test_reversing_goes_through_zero_without_a_pause() -> None:
    ramp = SRamp(60.0, 240.0, speed=30.0)
    speeds = [ramp.step(-30.0, 0.01).speed for _ in range(125)]
    assert speeds == sorted(speeds, reverse=True)
    assert ramp.speed == -30.0
    at_zero = min(range(125), key=lambda n: abs(speeds[n]))
    assert speeds[at_zero] - speeds[at_zero + 1] == pytest.approx(0.6, abs=1e-6)


def test_a_stop_while_speeding_up_passes_only_by_what_the_jerk_needs() -> None:
    ramp = SRamp(60.0, 240.0)
    while ramp.acceleration < 59.0:
        ramp.step(100.0, 0.01)
    reach = unavoidable(ramp.speed, ramp.acceleration, 240.0)
    top = max(ramp.step(0.0, 0.001).speed for _ in range(2000))
    assert top == pytest.approx(reach, abs=1e-2)
    assert ramp.speed == 0.0


def test_a_lowered_acceleration_limit_is_approached_with_the_jerk() -> None:
    ramp = SRamp(60.0, 240.0)
    while ramp.acceleration < 60.0:
        ramp.step(100.0, 0.01)
    ramp.acceleration_limit = 20.0
    seen = [ramp.step(100.0, 0.01).acceleration for _ in range(60)]
    assert seen[0] == pytest.approx(57.6) and seen[30] == pytest.approx(20.0)
    assert max(ramp.step(100.0, 0.01).speed for _ in range(1000)) == 100.0


def test_reset_stands_at_once() -> None:
    ramp = SRamp(60.0, 240.0, speed=30.0, acceleration=10.0)
    ramp.reset()
    assert ramp.step(0.0, 0.01) == (0.0, 0.0, 0.0, True)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_limits_and_period_must_be_finite_and_above_zero(bad: float) -> None:
    with pytest.raises(ValueError, match="acceleration_limit"):
        SRamp(bad, 1.0)
    with pytest.raises(ValueError, match="jerk"):
        SRamp(1.0, bad)
    with pytest.raises(ValueError, match="dt"):
        SRamp(1.0, 1.0).step(1.0, bad)
    ramp = SRamp(1.0, 1.0)
    ramp.jerk = bad
    with pytest.raises(ValueError, match="jerk"):
        ramp.step(1.0, 0.01)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_target_and_speed_must_be_finite(bad: float) -> None:
    ramp = SRamp(1.0, 1.0)
    with pytest.raises(ValueError, match="target"):
        ramp.step(bad, 0.01)
    with pytest.raises(ValueError, match="speed"):
        ramp.reset(bad)
    assert ramp.speed == 0.0
