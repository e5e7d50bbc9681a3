"""Words of the map of a PLC go there and back, and what is torn or older is read for what it is."""

from math import isnan, nan

import pytest

from app.registers.plc_map import (
    ANSWER_WORDS,
    ANSWERS_KEPT,
    LEAST_EVENT_WORDS,
    Answer,
    AnswerState,
    DeviceEvent,
    Request,
    answer_words,
    answers_of,
    event_of,
    event_words,
    is_whole,
    long_words,
    real,
    real_of,
    request_of,
    request_words,
    time_of,
    time_words,
)


@pytest.mark.parametrize(
    "request_",
    [
        Request(1, id=1),
        Request(0xFFFF, 7, 3, (1, 2, 3, 4), 65535),
        Request(12, arguments=(0xFFFFFFFF, real(-1.5), 0, 1 << 31), id=9),
    ],
)
def test_a_command_is_16_words_and_comes_back(request_: Request) -> None:
    words = request_words(request_)
    assert len(words) == 16 and words[0] == request_.code and words[-1] == request_.id
    assert request_of(words) == request_


def test_missing_arguments_are_0_and_more_than_four_are_left_out() -> None:
    assert request_of(request_words(Request(1, arguments=(5,), id=1))).arguments == (5, 0, 0, 0)
    assert request_of(request_words(Request(1, arguments=(1, 2, 3, 4, 5), id=1))).arguments == (1, 2, 3, 4)


def answers_image(answers: list[Answer], begun: int = 4, ended: int = 4) -> list[int]:
    rows = [word for answer in answers for word in answer_words(answer)]
    return [begun, *rows, *[0] * (ANSWERS_KEPT * ANSWER_WORDS - len(rows)), ended]


@pytest.mark.parametrize("state", AnswerState)
def test_answers_come_back_and_empty_places_are_none(state: AnswerState) -> None:
    answers = [Answer(id, state, id + 1, id + 2, 10**15 + id) for id in (9, 8, 3)]
    assert answers_of(answers_image(answers)) == answers


def test_a_state_that_nobody_knows_is_none_and_a_torn_image_says_nothing() -> None:
    image = answers_image([Answer(5, AnswerState.DONE)])
    image[2] = 99
    assert answers_of(image) == [Answer(5, AnswerState.NONE)]
    assert answers_of(answers_image([], 4, 6)) is None


@pytest.mark.parametrize("value", [0.0, -273.15, 3.4e38, nan])
def test_an_event_comes_back_from_its_row(value: float) -> None:
    event = DeviceEvent(2**32 - 1, 2**63 + 5, 40, 7, value, (1, 2, 3, 4, 5, 65535), 77)
    back = event_of(event_words(event))
    assert (back.sequence, back.time, back.code, back.source, back.snapshot, back.request) == (
        event.sequence,
        event.time,
        40,
        7,
        event.snapshot,
        77,
    )
    assert isnan(back.value) if isnan(value) else back.value == pytest.approx(value, rel=1e-6)


def test_a_row_of_an_older_map_names_no_command_and_words_of_a_newer_one_are_ignored() -> None:
    words = event_words(DeviceEvent(1, 2, 3, 4, 5.0, request=6))
    assert event_of(words[:LEAST_EVENT_WORDS]).request == 0
    assert event_of([*words, 1, 2, 3]) == event_of(words)


@pytest.mark.parametrize(
    ("words", "whole"), [([2, 9, 2], True), ([2, 9, 4], False), ([3, 9, 3], False), ([], False), ([0, 0], True)]
)
def test_an_image_is_whole_with_one_even_generation_at_both_ends(words: list[int], whole: bool) -> None:
    assert is_whole(words) is whole


@pytest.mark.parametrize("value", [0, 1, 0xFFFF, 0x10000, 0x12345678, 2**32 - 1])
def test_longs_and_times_have_their_high_word_first(value: int) -> None:
    high, low = long_words(value)
    assert high << 16 | low == value
    for micros in (value, value << 32 | 0xABCD):
        assert time_of(time_words(micros)) == micros and time_words(micros)[-1] == micros & 0xFFFF
    assert real(real_of(value)) == value
