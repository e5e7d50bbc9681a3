"""A move from rest to rest keeps its limits, covers its way exactly, and is the quickest of its kind."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.motion_profile import MotionProfile

POSITIVE = st.floats(0.5, 1000)


@pytest.mark.sweep(8)
@given(st.one_of(st.just(0.0), st.floats(1e-3, 2e4)), POSITIVE, POSITIVE, POSITIVE)
def test_rests_at_both_ends_and_keeps_speed_acceleration_and_jerk(
    distance: float, speed: float, acceleration: float, jerk: float
) -> None:
    move = MotionProfile(distance, speed, acceleration, jerk)
    n = 400
    seen = [move.at(k / n * move.duration) for k in range(n + 1)]
    assert seen[0] == (0.0, 0.0, 0.0) and seen[-1] == (distance, 0.0, 0.0)
    step = move.duration / n
    for before, after in pairwise(seen):
        slack = 1e-6 * (1 + distance)
        assert -slack <= after.way - before.way <= speed * step + slack
        assert 0 <= after.speed <= speed * (1 + 1e-9)
        assert abs(after.acceleration) <= acceleration * (1 + 1e-9)
        assert abs(after.acceleration - before.acceleration) <= jerk * step * (1 + 1e-6) + 1e-9
        assert after.way - before.way == pytest.approx(
            (before.speed + after.speed) / 2 * step, abs=jerk * step**3 + slack
        )
    assert move.peak <= speed * (1 + 1e-12)


@given(st.floats(1e-3, 2e4), POSITIVE, POSITIVE, POSITIVE, st.floats(0, 1))
def test_is_its_own_mirror_about_the_middle(
    distance: float, speed: float, acceleration: float, jerk: float, part: float
) -> None:
    move = MotionProfile(distance, speed, acceleration, jerk)
    there, back = move.at(part * move.duration), move.at((1 - part) * move.duration)
    assert there.way + back.way == pytest.approx(distance, abs=1e-6 * distance + 1e-9)
    assert there.speed == pytest.approx(back.speed, abs=1e-6 * speed)


@pytest.mark.parametrize(
    ("distance", "speed", "acceleration", "jerk", "duration"),
    [
        (1000.0, 100.0, 50.0, 100.0, 10 + 2 + 0.5),
        (200.0, 1000.0, 50.0, 100.0, 2 * (0.25 + math.sqrt(0.0625 + 4))),
        (25.0, 1000.0, 1000.0, 100.0, 4 * (25 / 200) ** (1 / 3)),
        (100.0, 10.0, 100.0, 10.0, 10 + 2.0),
        (0.0, 1.0, 1.0, 1.0, 0.0),
    ],
)  # fmt: skip
def test_takes_the_time_of_the_textbook(
    distance: float, speed: float, acceleration: float, jerk: float, duration: float
) -> None:
    assert MotionProfile(distance, speed, acceleration, jerk).duration == pytest.approx(duration)


@pytest.mark.parametrize("name", ["distance", "speed", "acceleration", "jerk"])
@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_limits_must_be_numbers(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match=name):
        MotionProfile(**({"distance": 1.0, "speed": 1.0, "acceleration": 1.0, "jerk": 1.0} | {name: bad}))
