"""0x4000 is 100 %: sign, rounding and limits of the words."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.profidrive.scaling import Scaling

REFERENCES = st.sampled_from([1193.0, 1187.0, 132.08, 660.4, 0.5, 3e4])


@pytest.mark.parametrize(
    ("value", "word"),
    [(0, 0), (1193, 0x4000), (-1193, 0xC000), (596.5, 0x2000), (-596.5, 0xE000), (1e9, 0x7FFF), (-1e9, 0x8000), (-2386, 0x8000),
     (2386, 0x7FFF), (math.inf, 0x7FFF), (-math.inf, 0x8000), (1193 / 0x4000, 1), (-1193 / 0x4000, 0xFFFF),
     (0.4 * 1193 / 0x4000, 0), (-0.4 * 1193 / 0x4000, 0), (-0.0, 0)],
)  # fmt: skip
def test_speed_of_the_hoist_as_a_word(value: float, word: int) -> None:
    assert Scaling(1193.0).encode(value) == (word,)


def test_long_value_has_its_high_word_first() -> None:
    scaling = Scaling(1193.0, words=2)
    assert scaling.encode(1193.0) == (0x4000, 0) and scaling.encode(-1193.0) == (0xC000, 0)
    assert scaling.encode(1e9) == (0x7FFF, 0xFFFF) and scaling.encode(-1e9) == (0x8000, 0)
    assert scaling.decode(0x2000, 0) == 596.5


@pytest.mark.parametrize("words", [1, 2])
@given(reference=REFERENCES, part=st.floats(-3, 3, allow_nan=False))
def test_value_comes_back_within_half_a_step_or_as_the_limit(words: int, reference: float, part: float) -> None:
    scaling = Scaling(reference, words)
    back = scaling.decode(*scaling.encode(part * reference))
    expected = min(max(part * reference, scaling.low), scaling.high)
    assert abs(back - expected) <= reference / scaling.one / 2 * (1 + 1e-9)
    assert back * part >= 0


@given(REFERENCES, st.integers(-0x8000, 0x7FFF))
def test_every_word_comes_back_and_its_mirror_is_its_opposite(reference: float, raw: int) -> None:
    scaling = Scaling(reference)
    assert scaling.encode(scaling.value(raw)) == (raw & 0xFFFF,)
    if raw > -0x8000:
        assert scaling.value(-raw) == -scaling.value(raw)


@given(REFERENCES, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_greater_speed_is_never_a_smaller_word(reference: float, one: float, other: float) -> None:
    scaling = Scaling(reference)
    assert (scaling.raw(one) - scaling.raw(other)) * (one - other) >= 0


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_reference_must_be_finite_and_above_zero(bad: float) -> None:
    with pytest.raises(ValueError, match="reference"):
        Scaling(bad)


def test_what_is_no_number_or_no_word_is_refused() -> None:
    scaling = Scaling(1.0)
    with pytest.raises(ValueError, match="not a number"):
        scaling.encode(math.nan)
    for words in ((), (1, 2), (-1,), (0x10000,)):
        with pytest.raises(ValueError, match="words"):
            scaling.decode(*words)
    for raw in (0x8000, -0x8001):
        with pytest.raises(ValueError, match="16 bits"):
            scaling.value(raw)
    with pytest.raises(ValueError, match="words is 3"):
        Scaling(1.0, 3)
