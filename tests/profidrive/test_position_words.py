"""Words of the positioner's telegram: every named bit is one bit, and comes back."""

import pytest

from app.errors import TelegramError
from app.profidrive.position_words import WORDS, bits_of, word_of
from app.profidrive.words import CONTROL_BITS, STATUS_BITS, Bit


@pytest.mark.parametrize("name", WORDS)
def test_every_named_bit_is_one_bit_and_comes_back(name: str) -> None:
    bits = WORDS[name]
    assert len({bit.name for bit in bits}) == len({bit.number for bit in bits}) == len(bits)
    for bit in bits:
        assert bits_of(bits, word_of(bits, [bit.name])) == {other.name: other is bit for other in bits}
        assert 0 <= bit.number <= 15
    assert not any(bits_of(bits, 0).values()) and all(bits_of(bits, 0xFFFF).values())
    with pytest.raises(TelegramError, match="bit: 'jump', expected one of"):
        word_of(bits, ["jump"])
    with pytest.raises(TelegramError, match="word: 65536, expected 0 to 65535"):
        bits_of(bits, 0x10000)


@pytest.mark.parametrize(
    ("word", "of_speed", "same"),
    [("STW1", CONTROL_BITS, {0, 1, 2, 3, 7, 8, 9, 10}), ("ZSW1", STATUS_BITS, {0, 1, 2, 3, 4, 5, 6, 7, 9})],
)
def test_the_first_words_agree_with_telegram_1_where_the_profile_says_so(
    word: str, of_speed: tuple[Bit, ...], same: set[int]
) -> None:
    assert {bit.number for bit in WORDS[word] if of_speed[bit.number].key.endswith(f".{bit.name}")} == same
