"""A rope is longer under its load."""

from math import inf, nan

import pytest

from app.blocks.rope import stretch


@pytest.mark.parametrize(
    ("load", "length", "longer"),
    [(0, 10_000, 0), (1, 10_000, 12), (0.5, 10_000, 6), (1.2, 5_000, 7.2), (-0.1, 10_000, 0), (1, -5, 0), (1, 0, 0)],
)
def test_it_is_the_load_times_the_length_times_the_strain(load: float, length: float, longer: float) -> None:
    assert stretch(load, length, 0.0012) == pytest.approx(longer)


@pytest.mark.parametrize("name", ["load", "length", "strain"])
@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_what_is_no_number_is_named(name: str, value: float) -> None:
    given = {"load": 1.0, "length": 1.0, "strain": 1.0} | {name: value}
    with pytest.raises(ValueError, match=f"{name} is {value}, a finite number expected"):
        stretch(**given)
