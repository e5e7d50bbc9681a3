"""The absolute encoder on the shaft of a virtual drive."""

import pytest

from app.sim.sinamics.shaft_encoder import TURNS, ShaftEncoder


def test_the_encoder_counts_both_ways_and_begins_again_after_its_last_turn() -> None:
    encoder = ShaftEncoder(turns=1.0)
    encoder.step(600, 0.05)
    assert encoder.position(10_000) == pytest.approx(15_000)
    encoder.step(-600, 0.25)
    assert encoder.turns == pytest.approx(TURNS - 1)
