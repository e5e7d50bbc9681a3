"""Words of a snapshot as the history keeps them."""

import pytest

from app.records.event import WORDS, packed, unpacked


@pytest.mark.parametrize(
    ("words", "size"),
    [
        ((), 0),
        ((0, 0, 0, 0, 0, 0), 0),
        ((1,), 2),
        ((0, 0, 7, 0, 0, 0), 6),
        ((1, 2, 3, 4, 5, 65535), 12),
        ((0xFFFF, 0, 0, 0, 0, 1), 12),
    ],
)
def test_zeros_at_the_end_take_no_room_and_come_back(words: tuple[int, ...], size: int) -> None:
    kept = packed(words)
    assert len(kept) == size
    assert unpacked(kept) == (*words, *(0,) * (WORDS - len(words)))


def test_a_torn_byte_is_no_word() -> None:
    assert unpacked(packed((1, 2)) + b"\x07") == (1, 2, 0, 0, 0, 0)


def test_the_high_byte_goes_first() -> None:
    assert packed((0x1234,)) == b"\x12\x34"
