"""The original's positioner: right forward, wrong in reverse."""

import pytest

from app.blocks.positioner.original import OriginalPositioner
from app.blocks.positioner.positioner import MoveInputs, Positioner
from app.sim.crane.axis import Axis
from tests.blocks.positioner.stand import IDEAL


def original(start: float, target: float, *, set_speed: float = 660.4) -> tuple[float, float]:
    """(error counted towards the target, percentage left) of the original in the ideal simulation."""
    axis, block = Axis(IDEAL, position=start, brake=1.0), OriginalPositioner(660.4, 165.1, 50.0, 200.0)
    for n in range(3000):
        out = block.step(True, axis.measured, target, axis.speed, set_speed, 0.01)
        axis.step(out.speed, True, 0.01)
        if n > 100 and not axis.speed:
            break
    return (axis.position - target) * (1 if target > start else -1), out.percent


def test_original_is_right_forward_looks_back_in_reverse_and_keeps_its_percentage() -> None:
    there, percent = original(5000.0, 10000.0)
    back, _ = original(10000.0, 5000.0)
    assert -5 < there <= 0
    assert back > there + 0.5, "one scan later than forward"
    assert percent == pytest.approx(50 / 660.4 * 100), "stands, and still says 7.6 %"


def test_original_puts_the_slow_down_beyond_the_slow_travel_below_the_slow_speed() -> None:
    out = OriginalPositioner(660.4, 165.1, 50.0, 200.0).step(True, 0.0, 5000.0, 10.0, 660.4, 0.01)
    assert out.slow_down_position > 4800.0
    fixed = Positioner(660.4, 110.0, 165.1, 50.0, 200.0).step(MoveInputs(True, 0.0, 5000.0, 10.0, 660.4), 0.01)
    assert fixed.slow_down_position == 4800.0
