"""Frames of RTU: their times, their lengths, and how silence cuts them."""

import pytest

from app.registers.crc import with_crc
from app.registers.rtu import (
    Framer,
    answer_length,
    build_frame,
    character_time,
    parse_frame,
    read_time,
    request_length,
    silence,
    write_time,
)


@pytest.mark.parametrize(
    ("baud", "expected"),
    [(1200, 0.0320833), (9600, 0.0040104), (19200, 0.0020052), (19201, 0.00175), (115200, 0.00175)],
)
def test_the_silence_is_three_and_a_half_characters_and_fixed_above_19200(baud: int, expected: float) -> None:
    assert silence(baud) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("count", [1, 25, 125])
@pytest.mark.parametrize("baud", [1200, 9600, 115200])
def test_a_poll_takes_its_bytes_and_two_silences(baud: int, count: int) -> None:
    assert read_time(baud, count) == pytest.approx((13 + 2 * count) * 11 / baud + 2 * silence(baud))
    assert write_time(baud) == pytest.approx(16 * character_time(baud) + 2 * silence(baud))
    assert write_time(baud, count, 16) == pytest.approx((17 + 2 * count) * character_time(baud) + 2 * silence(baud))


@pytest.mark.parametrize("size", [1, 2, 60, 253])
def test_a_frame_goes_there_and_back(size: int) -> None:
    pdu = bytes(range(size))
    assert parse_frame(build_frame(17, pdu)) == (17, pdu)


@pytest.mark.parametrize(
    "frame", [b"", b"\x01\x03", with_crc(b"\x01"), with_crc(bytes(255)), build_frame(1, b"\x03")[:-1]]
)
def test_what_is_too_short_too_long_or_damaged_is_no_frame(frame: bytes) -> None:
    assert parse_frame(frame) is None


@pytest.mark.parametrize(
    ("begun", "length"),
    [
        ("", None),
        ("01", None),
        ("01 03", 8),
        ("01 04", 8),
        ("01 06", 8),
        ("01 10 00 00 00 02", None),
        ("01 10 00 00 00 02 04", 13),
        ("01 17 00 00 00 02 00 09 00 01", None),
        ("01 17 00 00 00 02 00 09 00 01 02", 15),
        ("01 16", 10),
        ("01 2B", None),
    ],
)
def test_a_request_announces_its_length(begun: str, length: int | None) -> None:
    assert request_length(bytes.fromhex(begun)) == length


@pytest.mark.parametrize(
    ("begun", "length"),
    [
        ("01", None),
        ("01 83", 5),
        ("01 03", None),
        ("01 03 04", 9),
        ("01 03 00", 0),
        ("01 03 03", 0),
        ("01 03 FE", 0),
        ("01 17 02", 7),
        ("01 06", 8),
        ("01 10", 8),
        ("01 16", 10),
        ("01 2B", 0),
    ],
)
def test_an_answer_announces_its_length_and_0_is_none(begun: str, length: int | None) -> None:
    assert answer_length(bytes.fromhex(begun)) == length


def test_a_frame_is_over_after_the_silence_and_one_in_pieces_after_the_patience() -> None:
    framer, frame = Framer(0.004, 0.02), build_frame(1, bytes.fromhex("03 00 00 00 01"))
    assert framer.due is None
    framer.feed(frame[:5], 1.0)
    assert framer.due == pytest.approx(1.02)
    framer.feed(frame[5:], 1.01)
    assert (framer.began, framer.due) == (1.0, pytest.approx(1.014))
    assert framer.take() == (1, bytes.fromhex("03 00 00 00 01"))
    assert framer.due is None


def test_noise_without_end_is_not_kept_and_the_next_frame_is_whole() -> None:
    framer, frame = Framer(0.004), build_frame(1, b"\x03\x00\x00\x00\x01")
    for n in range(100):
        framer.feed(b"\xff" * 50, n / 1000)
    assert framer.take() is None
    framer.feed(frame, 1.0)
    assert framer.take() == (1, frame[1:-2])
