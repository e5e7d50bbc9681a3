"""Words without a meaning, and values that mean nothing."""

from app.links.conformance.images import free_words, unknown_value
from app.registers.register import Register
from tests.links.conformance.servers import data_of


def test_free_words_are_those_that_no_register_takes() -> None:
    used = [Register(0x101), Register(0x104, words=2), Register(0x101, mask=1, shift=3)]
    assert list(free_words(used, 0x101, 0x107)) == [0x102, 0x103, 0x106]


def test_an_enumeration_takes_its_own_values_only() -> None:
    points = data_of("conveyor").type.points
    assert unknown_value(points["mode"], [2], 0x102) == []
    assert unknown_value(points["mode"], [3], 0x102) == [("0x0102 = 3", "mode: 0, 1, 2")]
    assert unknown_value(points["products"], [3000], 0x108) == []
