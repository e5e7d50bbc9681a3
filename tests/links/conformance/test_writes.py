"""What is staged differs from what is in effect by less than anybody could measure."""

import pytest

from app.links.conformance.writes import _one_bit_off
from app.registers import plc_map


@pytest.mark.parametrize("values", [(30.0, 10.0), (0.0, -5.0), (0.0, 0.0)])
def test_one_number_is_nearer_to_zero_by_its_last_bit(values: tuple[float, ...]) -> None:
    staged = [word for value in values for word in plc_map.long_words(plc_map.real(value))]
    changed = _one_bit_off(staged)
    numbers = [plc_map.real_of(changed[n] << 16 | changed[n + 1]) for n in range(0, len(changed), 2)]
    for new, old in zip(numbers, values, strict=True):
        assert new == pytest.approx(old, rel=1e-6) and abs(new) <= abs(old)
    assert sum(new != old for new, old in zip(numbers, values, strict=True)) == (1 if any(values) else 0)
