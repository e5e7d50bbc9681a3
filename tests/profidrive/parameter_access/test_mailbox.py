"""The window of a drive's map holds what the reference writes into it and reads from it."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.errors import TelegramError
from app.profidrive.parameter_access.mailbox import HEAD, LOOK, WORDS, Look, data_of, look, request_words, words_of


def words(text: str) -> tuple[int, ...]:
    return tuple(int(word, 16) for word in text.split())


@pytest.mark.parametrize(
    "text",
    [
        "0001 2F0A 0101 0101 1001 0012 0000",
        "0001 2F0A 0201 0201 1040 03B1 0000",
        "0001 2F1C 0302 0202 1001 0A19 0000 1001 0A1A 0000 0401 FFFF FED4 0401 0000 012C",
        "0001 2F10 0502 0201 1001 0A27 0000 0401 0000 2EE0",
        "0001 2F0E 0402 0201 1001 09CB 0000 0301 0002",
    ],
)
def test_requests_are_written_as_in_the_reference(text: str) -> None:
    assert request_words(data_of(words(text), words(text)[1] & 0xFF)) == words(text)


@pytest.mark.parametrize(
    ("text", "said", "data"),
    [
        ("0001 2F00 0004", Look(False), ""),
        ("0001 2F0A 0101", Look(False), ""),
        ("0000 2F0A 0101", Look(False, idle=True), ""),
        ("0002 2F00 0004", Look(False, error=4), ""),
        ("0002 2F0A 0101 0101 0701 0047 C50C", Look(True, 10, 1), "01010101 07010047C50C"),
        ("0002 2F04 0302 0202", Look(True, 4, 3), "03020202"),
        ("0002 2F0C 0382 0202 4000 4402 0002 0000", Look(True, 12, 3), "03820202 4000 440200020000"),
        ("0002 2F08 0581 0201 4401 0000 FFFF", Look(True, 8, 5), "05810201 44010000"),
        ("0002 2F00 0003", Look(True, error=3), ""),
        ("0002 2F00 0000", Look(True), ""),
    ],
)
def test_answers_are_read_as_in_the_reference(text: str, said: Look, data: str) -> None:
    assert look(words(text)) == look(words(text)[:LOOK]) == said
    assert data_of(words(text), said.length) == bytes.fromhex(data)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("0001 2F00", "mailbox: 2 words"),
        ("0003 2F00 0000", "mailbox, word 0: 3"),
        ("0002 3F04 0101", "mailbox, word 1: 0x3F04"),
        ("0002 2F05 0101", "mailbox, word 1: 5 bytes"),
        ("0002 2FF2 0101", "mailbox, word 1: 242 bytes"),
    ],
)
def test_what_is_no_window_is_refused_by_its_place(text: str, place: str) -> None:
    with pytest.raises(TelegramError) as caught:
        look(words(text))
    assert str(caught.value).startswith(place)


@pytest.mark.parametrize("data", [b"", b"\1", bytes(242)])
def test_what_no_window_can_hold_is_not_written(data: bytes) -> None:
    with pytest.raises(TelegramError, match=f"request: {len(data)} bytes, expected an even number of 2 to 240"):
        request_words(data)


def test_an_answer_that_is_cut_off_is_told() -> None:
    with pytest.raises(TelegramError, match="mailbox: 2 bytes, expected 4"):
        data_of(words("0002 2F04 0302"), 4)


@settings(max_examples=60)
@given(st.lists(st.integers(0, 0xFFFF), max_size=WORDS))
def test_whatever_lies_in_it_only_our_own_error_goes_out(found: list[int]) -> None:
    try:
        said = look(found)
        assert words_of(data_of(found, said.length)) == tuple(found[HEAD : HEAD + said.length // 2])
    except TelegramError as error:
        assert error.expected
