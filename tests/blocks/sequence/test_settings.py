"""Settings of a sequence that cannot be are refused by name."""

import pytest

from app.blocks.sequence import (
    SequenceSettings,
    StepSettings,
)
from tests.blocks.sequence.stand import Bench


def test_no_step_is_no_sequence() -> None:
    with pytest.raises(ValueError, match="steps = 0"):
        SequenceSettings(())


@pytest.mark.parametrize("value", [-0.1, float("inf"), float("nan")])
def test_a_time_that_is_none_is_named(value: float) -> None:
    with pytest.raises(ValueError, match="minimum ="):
        StepSettings(minimum=value)


@pytest.mark.parametrize("number", [0, 4])
def test_times_of_a_step_that_is_not_there(number: int) -> None:
    with pytest.raises(ValueError, match="expected 1 to 3"):
        Bench().block.set_times(number, 1, 2)
