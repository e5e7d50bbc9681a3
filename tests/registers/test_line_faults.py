"""Names of line faults are those of the training registers."""

from app.registers.line_faults import LINE_FAULTS, SLOW_DELAY
from app.sim.training import COMMON_LIMITS, LINE_FAULT_MODES, REG_LINE_DELAY


def test_every_mode_but_none_has_one_name() -> None:
    assert sorted(LINE_FAULTS.values()) == [mode for mode in LINE_FAULT_MODES if mode]


def test_the_delay_of_a_slow_answer_can_be_written() -> None:
    low, high = COMMON_LIMITS[REG_LINE_DELAY]
    assert low < SLOW_DELAY <= high
