"""The original's arc positioner: where it is right, and where it is not."""

import math

import pytest

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.arc_positioner.original import OriginalArc


def test_original_is_right_in_the_ideal_simulation_and_only_up_to_a_quarter() -> None:
    block = OriginalArc(Point(660.4, 132.08), Point(4.0, 3.0))
    x, y, vx, vy, worst = 3000.0, 0.0, 0.0, 0.0, 0.0
    for n in range(20000):
        out = block.step(n > 0, n == 0, Point(x, y), Point(vx, vy), 0.0, 90.0, 3000.0, 50.0)
        vx, vy = out.speed
        x, y = x + vx * 0.005, y + vy * 0.005
        worst = max(worst, abs(math.hypot(x, y) - 3000.0))
        if out.finished:
            break
    assert worst < 30.0
    assert out.percent != (0.0, 0.0), "the percentage of the last move stays"
    wrong = OriginalArc(Point(660.4, 132.08), Point(4.0, 3.0))
    below = wrong.step(False, True, Circle(0.0, 0.0, 1000.0).at(-10.0), Point(0.0, 0.0), -10.0, 80.0, 1000.0, 50.0)
    assert below.angle == pytest.approx(10.0), "the arc cosine has no sign"
