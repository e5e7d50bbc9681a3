"""The head of an event ring as its image says it."""

import pytest

from app.links.ring_head import Head, head_of
from app.registers import plc_map


def image(oldest: int, newest: int, acknowledged: int, *, begun: int = 8, ended: int = 8) -> list[int]:
    words = [0] * plc_map.EVENTS_WORDS
    words[0], words[-1], words[1], words[2] = begun, ended, 59, 16
    for at, number in (
        (plc_map.AT_OLDEST, oldest),
        (plc_map.AT_NEWEST, newest),
        (plc_map.AT_ACKNOWLEDGED, acknowledged),
    ):
        words[at : at + 2] = plc_map.long_words(number)
    return words


@pytest.mark.parametrize("numbers", [(0, 0, 0), (1, 59, 7), (65535, 65536, 65535), (2**32 - 60, 2**32 - 1, 2**31)])
def test_a_whole_head_says_its_numbers(numbers: tuple[int, int, int]) -> None:
    assert head_of(image(*numbers)) == Head(59, 16, *numbers)


@pytest.mark.parametrize(("begun", "ended"), [(8, 10), (7, 7), (9, 8)])
def test_a_head_that_was_being_changed_says_nothing(begun: int, ended: int) -> None:
    assert head_of(image(1, 2, 0, begun=begun, ended=ended)) is None
