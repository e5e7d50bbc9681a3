"""Pulses of a belt: none lost, wrapped as the counter wraps, millimetres as the roller turns."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.encoder import Encoder, pulses_between, wrapped


def test_simulation_preset_has_the_numbers_of_the_thesis() -> None:
    encoder = Encoder(resolution=1024, rated_speed=60, radius=15)
    assert encoder.mm_per_pulse == pytest.approx(0.0920, abs=5e-5)
    assert encoder.full_speed == pytest.approx(94.25, abs=5e-3)
    assert encoder.step(100.0, 1.0) == 1024
    assert encoder.distance(1024) == pytest.approx(94.25, abs=5e-3)


def test_model_preset_has_the_numbers_of_the_thesis() -> None:
    encoder = Encoder(resolution=1650, rated_speed=40, radius=15)
    assert encoder.mm_per_pulse == pytest.approx(0.0571, abs=5e-5)
    assert encoder.full_speed == pytest.approx(62.8, abs=5e-2)
    assert encoder.step(100.0, 1.5) == 1650


@given(st.lists(st.tuples(st.floats(-100, 100), st.sampled_from([0.001, 0.01, 0.05])), max_size=200))
def test_no_fraction_of_a_pulse_is_lost(cycles: list[tuple[float, float]]) -> None:
    encoder = Encoder(1650, 40, 15)
    counted = sum(encoder.step(speed, dt) for speed, dt in cycles)
    turned = sum(speed / 100 * 40 / 60 * 1650 * dt for speed, dt in cycles)
    assert counted == encoder.pulses
    assert counted + encoder.fraction == pytest.approx(turned, abs=1e-6)
    assert 0 <= encoder.fraction <= 1


def test_scan_period_does_not_change_what_is_counted() -> None:
    fine, coarse = Encoder(1024, 60, 15), Encoder(1024, 60, 15)
    for _ in range(5000):
        fine.step(33.3, 0.001)
    for _ in range(100):
        coarse.step(33.3, 0.05)
    assert abs(fine.pulses - coarse.pulses) <= 1


def test_backwards_counts_down_and_comes_back_to_where_it_was() -> None:
    encoder = Encoder(1650, 40, 15)
    for speed in (30.0, -30.0):
        for _ in range(77):
            encoder.step(speed, 0.01)
    assert encoder.pulses in (0, -1)
    assert encoder.pulses + encoder.fraction == pytest.approx(0.0, abs=1e-9)


def test_counter_wraps_at_32_bits_and_the_difference_does_not_notice() -> None:
    encoder = Encoder(1024, 60, 15, pulses=2**31 - 3)
    before = encoder.pulses
    assert encoder.step(100.0, 0.01) == 10
    assert encoder.pulses == -(2**31) + 7
    assert pulses_between(before, encoder.pulses) == 10
    assert pulses_between(encoder.pulses, before) == -10
    assert wrapped(2**31) == -(2**31) and wrapped(-(2**31) - 1) == 2**31 - 1


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31) + 1, 2**31 - 1))
def test_difference_of_two_readings_is_exact_across_any_wrap(before: int, moved: int) -> None:
    assert pulses_between(before, wrapped(before + moved)) == moved


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_what_makes_no_encoder_is_named(bad: float) -> None:
    for name in ("resolution", "rated_speed", "radius"):
        with pytest.raises(ValueError, match=name):
            Encoder(**{"resolution": 1024.0, "rated_speed": 60.0, "radius": 15.0, name: bad})


def test_bad_cycles_are_named_and_change_nothing() -> None:
    encoder = Encoder(1024, 60, 15)
    with pytest.raises(ValueError, match="speed"):
        encoder.step(math.nan, 0.01)
    with pytest.raises(ValueError, match="dt"):
        encoder.step(1.0, -0.01)
    assert (encoder.pulses, encoder.fraction) == (0, 0.0)
