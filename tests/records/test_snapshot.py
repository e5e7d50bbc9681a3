from math import inf, nan

import pytest

from app.records.event import WORDS, packed, unpacked
from app.records.snapshot import TYPES, Field, decode
from app.registers.plc_map import long_words, real

SIX = (0x0003, 0x0005, 0x8000, 0xFFFE, *long_words(real(-2.5)))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        (Field(0, "u16"), 3),
        (Field(2, "u16"), 0x8000),
        (Field(2, "i16"), -0x8000),
        (Field(3, "i16"), -2),
        (Field(0, "u32"), 0x0003_0005),
        (Field(2, "u32"), 0x8000_FFFE),
        (Field(2, "i32"), -0x7FFF_0002),
        (Field(4, "f32"), -2.5),
        (Field(1, "u16", none=5), None),
        (Field(1, "u16", none=6), 5),
        (Field(0, "u32", none=0), 0x0003_0005),
    ],
)
def test_a_field_is_read_where_and_as_the_layout_says(field: Field, value: float | None) -> None:
    assert decode({"it": field}, SIX, 1) == {"it": value}


def test_the_same_words_say_other_things_of_other_events() -> None:
    layout = {"second": Field(2, "u32", but=frozenset({42})), "order": Field(2, "u32", only=frozenset({42}))}
    assert decode(layout, (0, 0, 0, 7), 20) == {"second": 7}
    assert decode(layout, (0, 0, 0, 7), 42) == {"order": 7}


@pytest.mark.parametrize("number", [nan, inf, -inf])
def test_what_is_no_number_is_no_value(number: float) -> None:
    assert decode({"it": Field(4, "f32")}, (0, 0, 0, 0, *long_words(real(number))), 1) == {"it": None}


@pytest.mark.parametrize("type", sorted(TYPES))
@pytest.mark.parametrize("words", [(), (1,), (1, 2, 3)])
def test_words_that_are_missing_are_zero(type: str, words: tuple[int, ...]) -> None:
    assert decode({"it": Field(4, type)}, words, 1) == {"it": 0}


@pytest.mark.parametrize("used", range(WORDS + 1))
def test_packed_words_come_back_and_zeros_at_the_end_cost_nothing(used: int) -> None:
    words = (*range(0xFFFF, 0xFFFF - used, -1), *(0,) * (WORDS - used))
    assert len(packed(words)) == 2 * used
    assert unpacked(packed(words)) == words


def test_a_zero_between_is_kept() -> None:
    assert unpacked(packed((0, 7, 0, 9, 0, 0))) == (0, 7, 0, 9, 0, 0)
