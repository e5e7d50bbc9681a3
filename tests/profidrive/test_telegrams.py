"""Telegrams 1 and 111 have their fields and bits where the reference has them."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.errors import TelegramError
from app.profidrive.position_words import WORDS, word_of
from app.profidrive.telegrams import TELEGRAMS, Side

SIDES = [side for telegram in TELEGRAMS.values() for side in (telegram.out, telegram.into)]
MOVE = [
    "no_coast_stop",
    "no_quick_stop",
    "on",
    "enable_operation",
    "do_not_reject_task",
    "no_intermediate_stop",
    "by_plc",
]


def test_an_absolute_move_is_that_of_the_reference() -> None:
    out = TELEGRAMS[111].out
    words = WORDS["STW1"]
    values = {
        "STW1": word_of(words, MOVE),
        "POS_STW1": word_of(WORDS["POS_STW1"], ["mdi", "absolute"]),
        "OVERRIDE": 0x4000,
        "MDI_TARPOS": -300,
        "MDI_VELOCITY": 12000,
        "MDI_ACC": 0x4000,
        "MDI_DEC": 0x4000,
    }
    packed = out.pack(values)
    assert packed == (0x043F, 0x8100, 0, 0, 0x4000, 0xFFFF, 0xFED4, 0, 12000, 0x4000, 0x4000, 0)
    assert out.unpack(packed) == {field.name: values.get(field.name, 0) for field in out.fields}
    assert word_of(words, [*MOVE, "activate_task"]) == 0x047F


def test_places_of_the_fields() -> None:
    assert [side.length for side in SIDES] == [2, 2, 12, 12]
    came = TELEGRAMS[111].into.unpack([0x1234, 1, 2, 3, 4, 0xFFFF, 0xFFFE, 0x8000, 0, 7452, 7903, 0])
    assert came == {
        "ZSW1": 0x1234, "POS_ZSW1": 1, "POS_ZSW2": 2, "ZSW2": 3, "MELDW": 4, "XIST_A": -2, "NIST_B": -(2**31),
        "FAULT_CODE": 7452, "WARN_CODE": 7903, "free": 0,
    }  # fmt: skip
    assert TELEGRAMS[1].out.pack({"STW1": 0x047F, "NSOLL_A": -0x4000}) == (0x047F, 0xC000)
    assert TELEGRAMS[1].into.unpack([0x0237, 0x2000]) == {"ZSW1": 0x0237, "NIST_A": 0x2000}


@pytest.mark.parametrize("side", SIDES)
def test_what_does_not_fit_is_refused_by_its_name(side: Side) -> None:
    for field in side.fields:
        low, high = field.range
        for value in (low, high):
            assert side.unpack(side.pack({field.name: value}))[field.name] == value
        for wrong in (low - 1, high + 1, 0.5):
            with pytest.raises(
                TelegramError, match=f"^{field.name}: {wrong}, expected a whole number of {low} to {high}$"
            ):
                side.pack({field.name: wrong})  # type: ignore[dict-item]
    with pytest.raises(TelegramError, match="field SPEED, expected one of"):
        side.pack({"SPEED": 1})
    with pytest.raises(TelegramError, match="1 words, expected"):
        side.unpack([0])
    with pytest.raises(TelegramError, match="word -1, expected"):
        side.unpack([-1] * side.length)


@settings(max_examples=40)
@given(st.sampled_from(SIDES), st.data())
def test_words_come_back_as_they_were(side: Side, data: st.DataObject) -> None:
    words = tuple(data.draw(st.lists(st.integers(0, 0xFFFF), min_size=side.length, max_size=side.length)))
    assert side.pack(side.unpack(words)) == words
