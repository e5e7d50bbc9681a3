"""The linear ramp: bounded both ways, exact on the target, the same at every scan period."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.ramp import Ramp


def test_rises_and_falls_at_its_own_rates_and_lands_on_the_target() -> None:
    ramp = Ramp(acceleration=2.0, deceleration=4.0)
    assert [ramp.step(5.0, 1.0) for _ in range(4)] == [2.0, 4.0, 5.0, 5.0]
    assert [ramp.step(1.0, 0.5) for _ in range(3)] == [3.0, 1.0, 1.0]
    assert [ramp.step(-4.0, 0.5) for _ in range(5)] == [-0.5, -1.5, -2.5, -3.5, -4.0]


def test_a_reversal_brakes_first_and_rises_with_the_rest_of_the_scan() -> None:
    ramp = Ramp(acceleration=1.0, deceleration=4.0, speed=2.0)
    assert ramp.step(-3.0, 1.0) == pytest.approx(-0.5)


@given(
    st.lists(st.tuples(st.floats(-100, 100), st.integers(1, 40)), min_size=1, max_size=6),
    st.sampled_from([5.0, 110.0]),
    st.sampled_from([8.0, 165.0]),
)
def test_ten_small_scans_are_one_large_one(
    orders: list[tuple[float, int]], acceleration: float, deceleration: float
) -> None:
    fine, coarse = Ramp(acceleration, deceleration), Ramp(acceleration, deceleration)
    for target, scans in orders:
        for _ in range(scans):
            before = coarse.speed
            coarse.step(target, 0.01)
            for _ in range(10):
                fine.step(target, 0.001)
            assert coarse.speed == pytest.approx(fine.speed, abs=1e-6)
            assert min(before, target) <= coarse.speed <= max(before, target)
            assert abs(coarse.speed - before) <= max(acceleration, deceleration) * 0.01 * (1 + 1e-9)


@pytest.mark.sweep(8)
@given(st.floats(-700, 700), st.sampled_from([44.0, 165.1]))
def test_way_to_standstill_is_what_a_stop_covers(speed: float, deceleration: float) -> None:
    ramp, x = Ramp(100.0, deceleration, speed), 0.0
    expected = ramp.stop_distance
    while ramp.speed:
        before = ramp.speed
        x += (before + ramp.step(0.0, 0.001)) / 2 * 0.001
    assert x == pytest.approx(expected, abs=abs(speed) * 0.001)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_rates_and_target_must_be_numbers(bad: float) -> None:
    for rates in ((bad, 1.0), (1.0, bad)):
        with pytest.raises(ValueError, match="eleration is"):
            Ramp(*rates)
    if not math.isfinite(bad):
        with pytest.raises(ValueError, match="target"):
            Ramp(1.0, 1.0).step(bad, 0.01)
