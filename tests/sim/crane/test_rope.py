"""The rope as a spring: its rest, its period, its damping."""

import math

import pytest

from app.blocks.rope import stretch
from app.sim.crane.rope import GRAVITY, Rope


@pytest.mark.parametrize(("load", "drum"), [(1.0, 12000.0), (0.3, 30000.0), (0.0, 0.0)])
def test_rests_where_hooke_says_and_stays(load: float, drum: float) -> None:
    rope = Rope(load, 0.0018, 37080.0)
    rope.settle(drum)
    assert rope.stretch == pytest.approx(stretch(load, 37080.0 - drum, 0.0018))
    for _ in range(1000):
        rope.step(drum, 0.0, 0.01)
    assert rope.stretch == pytest.approx(stretch(load, 37080.0 - drum, 0.0018))


@pytest.mark.parametrize("dt", [0.001, 0.01])
def test_swings_with_the_period_of_spring_and_mass(dt: float) -> None:
    rope = Rope(1.0, 0.0018, 37080.0, damping=0.0)
    rope.settle(12000.0)
    rest = rope.stretch
    rope.stretch += 1.0
    crossings, before, t = list[float](), 1.0, 0.0
    while len(crossings) < 9:
        rope.step(12000.0, 0.0, dt)
        t += dt
        if before * (rope.stretch - rest) < 0:
            crossings.append(t)
        before = rope.stretch - rest
    period = (crossings[-1] - crossings[0]) / 4
    assert period == pytest.approx(2 * math.pi * math.sqrt(rest / GRAVITY), rel=0.02)


def test_damping_brings_it_to_rest() -> None:
    rope = Rope(1.0, 0.0018, 37080.0)
    rope.settle(12000.0)
    rope.stretch += 10.0
    for _ in range(2000):
        rope.step(12000.0, 0.0, 0.01)
    assert rope.stretch == pytest.approx(rope.at_rest(12000.0), abs=0.1)


def test_no_load_and_no_length_do_not_stretch() -> None:
    assert stretch(-0.1, 1000.0, 0.002) == stretch(1.0, -5.0, 0.002) == 0.0
    with pytest.raises(ValueError, match="load"):
        stretch(math.nan, 1.0, 1.0)
