"""Request bits count only while the counter moves."""

import pytest

from app.registers import plc_map
from app.sim.plc.hold import HoldRequest


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.05, 0.1])
def test_bits_count_for_the_time_out_after_the_counter_moved(dt: float) -> None:
    hold = HoldRequest()
    assert hold.bits == 0
    hold.take((5, 1, *plc_map.long_words(plc_map.real(2.5))))
    held = 0
    while hold.bits:
        assert (hold.bits, hold.argument) == (5, 2.5)
        hold.step(dt)
        held += 1
    assert held == round(plc_map.HOLD_TIMEOUT / dt) + 1
    hold.take((5, 1, 0, 0))
    assert hold.bits == 0, "the same counter says nothing new"
    hold.take((5, 2, 0, 0))
    assert hold.bits == 5
    hold.take((0, 3, 0, 0))
    assert hold.bits == 0


def test_a_power_cycle_releases() -> None:
    hold = HoldRequest()
    hold.take((1, 0xFFFF, 0, 0))
    hold.start_up()
    assert (hold.bits, any(hold.words)) == (0, False)
    hold.take((1, 0xFFFF, 0, 0))
    assert hold.bits == 1
