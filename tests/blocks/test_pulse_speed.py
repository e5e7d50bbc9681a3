"""A speed from whole pulses stands still while the speed does, and follows it at once."""

from math import floor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.pulse_speed import LONGEST, SHORTEST, pulse_speed


def counts(way: list[float]) -> list[int]:
    """What an encoder counts, newest first."""
    return [floor(at) for at in reversed(way)]


def even(speed: float, start: float, cycles: int) -> list[float]:
    return [start + speed * n for n in range(cycles)]


def millionths(low: int, high: int) -> st.SearchStrategy[float]:
    """Numbers whose differences a float can tell: of 1e-266 beside 1 it cannot."""
    return st.integers(low * 1_000_000, high * 1_000_000).map(lambda n: n / 1_000_000)


@given(millionths(-20, 20), millionths(-5, 5))
def test_an_even_speed_is_known_to_less_than_a_pulse_in_the_longest_window(speed: float, start: float) -> None:
    way = even(speed, start, LONGEST + 51)
    told = [pulse_speed(counts(way[n : n + LONGEST + 1])) for n in range(50)]
    assert all(abs(one - speed) < 1 / LONGEST for one in told)


@pytest.mark.parametrize("speed", [3.3, 0.07, -2.5, 9.999])
def test_a_change_is_followed_within_the_shortest_window(speed: float) -> None:
    way = even(0.0, 0.5, LONGEST) + [0.5 + speed * (n + 1) for n in range(SHORTEST + 1)]
    assert pulse_speed(counts(way)) == pytest.approx(speed, abs=1 / SHORTEST)


def test_what_stands_has_no_speed_though_it_moved_before() -> None:
    way = [*even(5.0, 0.0, 60), *[295.0] * 41]
    assert pulse_speed(counts(way)) == 0.0
    assert pulse_speed([7] * (LONGEST + 1)) == 0.0


def test_while_it_changes_it_is_the_mean_of_the_last_cycles() -> None:
    way = [0.5 * 0.8 * n * n for n in range(SHORTEST + 1)]
    assert pulse_speed(counts(way)) == pytest.approx(0.8 * SHORTEST / 2, abs=1 / SHORTEST)


def test_too_few_counts_are_refused() -> None:
    with pytest.raises(ValueError, match="12 counts, at least 13 expected"):
        pulse_speed([0] * SHORTEST)
