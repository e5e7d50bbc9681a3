"""Telegrams against the frames of the drive's sheet, and against every mistake a line can make."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import BadAnswer, DeviceException
from app.registers.crc import crc16, crc_holds, with_crc
from app.registers.pdu import (
    READ_WRITE,
    Request,
    build_answer,
    build_request,
    exception_answer,
    masked,
    parse_answer,
    parse_request,
    read_request,
    write_request,
)
from app.registers.rtu import Framer, answer_length, build_frame, parse_frame, read_time, request_length, silence

REQUESTS = [
    ("01 06 01 0E 00 64 E8 1E", 1, write_request(0x010E, [100])),
    ("02 03 10 00 00 04 40 FA", 2, read_request(0x1000, 4)),
    ("01 06 20 00 00 01 43 CA", 1, write_request(0x2000, [1])),
    ("02 03 01 0D 00 02 54 07", 2, read_request(0x010D, 2)),
    ("01 06 20 00 00 03 C2 0B", 1, write_request(0x2000, [3])),
    ("01 06 20 00 00 04 83 C9", 1, write_request(0x2000, [4])),
    ("01 06 20 00 00 02 03 CB", 1, write_request(0x2000, [2])),
    ("01 06 20 00 00 08 83 CC", 1, write_request(0x2000, [8])),
    ("01 06 20 00 00 09 42 0C", 1, write_request(0x2000, [9])),
    ("01 06 01 0D 13 88 14 A3", 1, write_request(0x010D, [5000])),
    ("01 03 10 00 00 19 80 C0", 1, read_request(0x1000, 25)),
]
"""Verified frames of reference/eura-e800.md section 3."""


@pytest.mark.parametrize(("printed", "unit", "pdu"), REQUESTS)
def test_requests_are_the_frames_of_the_sheet(printed: str, unit: int, pdu: bytes) -> None:
    assert build_frame(unit, pdu) == bytes.fromhex(printed)
    assert parse_frame(bytes.fromhex(printed)) == (unit, pdu)
    assert build_request(parse_request(pdu)) == pdu
    assert request_length(bytes.fromhex(printed)) == 8


@pytest.mark.parametrize(
    ("printed", "request_", "words"),
    [
        ("02 03 08 13 88 01 90 00 3C 02 00 D3 22", Request(3, 0x1000, 4), [5000, 400, 60, 0x0200]),
        ("02 03 04 03 E8 00 78 49 61", Request(3, 0x010D, 2), [1000, 120]),
        ("01 06 01 0E 00 64 E8 1E", Request(6, write_address=0x010E, words=(100,)), []),
    ],
)
def test_answers_are_the_frames_of_the_sheet(printed: str, request_: Request, words: list[int]) -> None:
    frame = bytes.fromhex(printed)
    unit, pdu = parse_frame(frame) or (0, b"")
    assert build_frame(unit, build_answer(request_, words)) == frame
    assert parse_answer(request_, pdu) == words


def test_the_check_sum_printed_in_the_manual_is_refused() -> None:
    assert parse_frame(bytes.fromhex("02 03 08 13 88 01 90 00 3C 02 00 82 F6")) is None


@pytest.mark.parametrize(
    ("printed", "function", "code"),
    [("01 86 04 43 A3", 6, 4), ("01 86 01 83 A0", 6, 1), ("02 83 08 B0 F6", 3, 8)],
)
def test_exceptions_are_the_frames_of_the_sheet(printed: str, function: int, code: int) -> None:
    frame = bytes.fromhex(printed)
    assert build_frame(frame[0], exception_answer(function, code)) == frame
    request = Request(6, write_address=0, words=(0,)) if function == 6 else Request(3, 0, 1)
    with pytest.raises(DeviceException) as refusal:
        parse_answer(request, frame[1:-2])
    assert refusal.value.code == code


def test_the_published_check_value_of_crc_16_modbus() -> None:
    assert crc16(b"123456789") == 0x4B37


@given(st.binary(max_size=300), st.integers(0, 7), st.data())
def test_one_turned_bit_is_always_found(data: bytes, bit: int, draw: st.DataObject) -> None:
    frame = bytearray(with_crc(data + b"\x01"))
    assert crc_holds(bytes(frame))
    frame[draw.draw(st.integers(0, len(frame) - 1))] ^= 1 << bit
    assert not crc_holds(bytes(frame))


@pytest.mark.parametrize(
    ("pdu", "code"),
    [
        ("", 1),
        ("07", 1),
        ("01 00 00 00 00", 3),
        ("01 00 00 07 D1", 3),
        ("02 FF FF 00 02", 2),
        ("05 00 00 00 01", 3),
        ("05 00 00 FF 01", 3),
        ("0F 00 00 00 09 01 FF", 3),
        ("0F 00 00 00 03 01 0F", 3),
        ("0F 00 00 07 B1 F7" + " 00" * 247, 3),
        ("2B 0E 01 00", 1),
        ("83 02", 1),
        ("03 10 00 00", 3),
        ("03 10 00 00 01 00", 3),
        ("03 10 00 00 00", 3),
        ("03 10 00 00 7E", 3),
        ("04 FF FF 00 02", 2),
        ("06 10 00", 3),
        ("10 01 00 00 00 00", 3),
        ("10 01 00 00 02 04 00 01", 3),
        ("10 01 00 00 02 03 00 01 00", 3),
        ("10 01 00 00 02 02 00 01 00 02", 3),
        ("10 FF FF 00 02 04 00 01 00 02", 2),
        ("10 00 00 00 7C F8" + " 00" * 248, 3),
        ("16 00 04 00 F2", 3),
        ("16 00 04 00 F2 00 25 00", 3),
        ("17 10 00 00 01 01 00 00 01 02 00", 3),
    ],
)
def test_a_malformed_request_names_its_exception(pdu: str, code: int) -> None:
    with pytest.raises(DeviceException) as refusal:
        parse_request(bytes.fromhex(pdu))
    assert refusal.value.code == code


def test_the_largest_telegrams_pass() -> None:
    assert len(build_request(Request(READ_WRITE, 0, 125, 0x100, (1,) * 121))) <= 253
    assert parse_request(write_request(0xFF85, [0xFFFF] * 123)).words == (0xFFFF,) * 123
    assert parse_request(read_request(0xFFFF, 1)).address == 0xFFFF
    assert parse_request(read_request(0, 2000, 1)).count == 2000
    most = build_request(Request(15, write_address=0, words=(1,) * 1968))
    assert len(most) <= 253 and parse_request(most).words == (1,) * 1968


@pytest.mark.parametrize(
    ("asked", "answer", "request_", "bits"),
    [
        ("01 00 13 00 13", "01 03 CD 6B 05", Request(1, 19, 19), "1011001111010110101"),
        ("02 00 C4 00 16", "02 03 AC DB 35", Request(2, 196, 22), "0011010111011011101011"),
        ("05 00 AC FF 00", "05 00 AC FF 00", Request(5, write_address=172, words=(1,)), ""),
        ("05 00 AC 00 00", "05 00 AC 00 00", Request(5, write_address=172, words=(0,)), ""),
        (
            "0F 00 13 00 0A 02 CD 01",
            "0F 00 13 00 0A",
            Request(15, write_address=19, words=(1, 0, 1, 1, 0, 0, 1, 1, 1, 0)),
            "",
        ),
    ],
)
def test_telegrams_of_bits_are_those_of_the_protocol(asked: str, answer: str, request_: Request, bits: str) -> None:
    """Sections 6.1, 6.2, 6.5 and 6.11 of the application protocol 1.1b3."""
    assert build_request(request_) == bytes.fromhex(asked)
    assert parse_request(bytes.fromhex(asked)) == request_
    words = [int(bit) for bit in bits]
    assert build_answer(request_, words) == bytes.fromhex(answer)
    assert parse_answer(request_, bytes.fromhex(answer)) == words
    frame = build_frame(1, bytes.fromhex(asked))
    assert request_length(frame) == len(frame)
    assert answer_length(build_frame(1, bytes.fromhex(answer))) == len(bytes.fromhex(answer)) + 3


def test_the_telegram_of_masks_is_that_of_the_protocol() -> None:
    """Section 6.16 of the application protocol 1.1b3: 0x12 AND 0xF2, OR 0x25 AND NOT 0xF2, is 0x17."""
    asked, request_ = bytes.fromhex("16 00 04 00 F2 00 25"), Request(22, write_address=4, words=(0xF2, 0x25))
    assert build_request(request_) == asked and parse_request(asked) == request_
    assert build_answer(request_) == asked and parse_answer(request_, asked) == []
    with pytest.raises(BadAnswer):
        parse_answer(request_, bytes.fromhex("16 00 04 00 F2 00 24"))
    frame = build_frame(1, asked)
    assert request_length(frame) == answer_length(frame) == len(frame) == 10
    assert masked(0x12, (0xF2, 0x25)) == 0x17
    assert masked(0xABCD, (0xFF0F, 0x0030)) == 0xAB3D and masked(0xFFFF, (0, 0)) == 0
    assert parse_request(bytes.fromhex("16 FF FF 00 00 FF FF")).write_address == 0xFFFF, "it is one register"


@pytest.mark.parametrize("words", [(), (1,), (1, 2, 3), (0x10000, 0), (0, -1)])
def test_masks_that_no_telegram_can_carry_are_refused(words: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="no telegram"):
        build_request(Request(22, write_address=4, words=words))


@pytest.mark.sweep(8)
@given(st.lists(st.integers(0, 1), min_size=1, max_size=1968), st.integers(0, 60_000))
def test_bits_go_there_and_back(bits: list[int], address: int) -> None:
    write = Request(15, write_address=address, words=tuple(bits))
    assert parse_request(build_request(write)) == write
    read = Request(1, address, len(bits))
    assert parse_answer(read, build_answer(read, bits)) == bits
    full = bytearray(build_answer(read, bits))
    full[-1] |= 0xFF << ((len(bits) - 1) % 8 + 1) & 0xFF
    assert parse_answer(read, bytes(full)) == bits, "what fills up the last byte means nothing"


@pytest.mark.parametrize("answer", ["01", "01 01", "01 01 00 00", "01 02 00 00", "02 01 00", "01 00"])
def test_an_answer_of_other_bits_is_none(answer: str) -> None:
    with pytest.raises(BadAnswer):
        parse_answer(Request(1, 0, 8), bytes.fromhex(answer))


@pytest.mark.parametrize(
    "request_",
    [
        Request(1, 0, 2001),
        Request(2, 0, 0),
        Request(5, write_address=0, words=(2,)),
        Request(5, write_address=0, words=(0, 1)),
        Request(15, write_address=0, words=(1,) * 1969),
        Request(15, write_address=0, words=(2,)),
        Request(15, write_address=0xFFFF, words=(1, 1)),
    ],
)
def test_bits_that_no_telegram_can_carry_are_refused(request_: Request) -> None:
    with pytest.raises(ValueError, match="no telegram"):
        build_request(request_)


@pytest.mark.parametrize("words", [[], [65536], [-1], [0] * 124])
def test_a_request_that_no_telegram_can_carry_is_refused(words: list[int]) -> None:
    with pytest.raises(ValueError, match="no telegram"):
        write_request(0, words)


@pytest.mark.parametrize(
    "answer", ["", "03", "03 02 00", "03 02 00 01", "03 06 00 01 00 02 00 03", "03 04 00 01 00 02 00"]
)
def test_a_read_answer_of_another_length_is_no_answer(answer: str) -> None:
    with pytest.raises(BadAnswer):
        parse_answer(Request(3, 0x1000, 2), bytes.fromhex(answer))


@pytest.mark.parametrize("echo", ["06 20 00 00 02", "06 20 01 00 01", "06 20 00 00", "03 02 00 01", "86", "83 02"])
def test_an_echo_that_differs_is_no_answer(echo: str) -> None:
    with pytest.raises(BadAnswer):
        parse_answer(Request(6, write_address=0x2000, words=(1,)), bytes.fromhex(echo))


@given(st.binary(max_size=260))
def test_any_bytes_are_a_request_or_an_exception(pdu: bytes) -> None:
    try:
        request = parse_request(pdu)
    except DeviceException as refusal:
        assert refusal.code in (1, 2, 3)
    else:
        assert build_request(request) == pdu


@given(
    st.binary(max_size=260),
    st.sampled_from([Request(3, 0, 2), Request(6, write_address=1, words=(2,)), Request(1, 0, 16)]),
)
def test_any_bytes_are_an_answer_or_a_link_error(pdu: bytes, request_: Request) -> None:
    try:
        words = parse_answer(request_, pdu)
    except (BadAnswer, DeviceException):
        return
    assert build_answer(request_, words) == pdu


@pytest.mark.parametrize(
    ("baud", "count", "milliseconds"),
    [(9600, 25, 80.21), (1200, 125, 2475), (19200, 10, 22.9), (38400, 25, 21.5), (115200, 125, 28.6), (4800, 1, 50.4)],
)
def test_wire_time_is_that_of_the_sheet(baud: int, count: int, milliseconds: float) -> None:
    assert read_time(baud, count) * 1000 == pytest.approx(milliseconds, rel=0.005)


@pytest.mark.parametrize(("baud", "milliseconds"), [(9600, 4.01), (19200, 2.005), (38400, 1.75), (115200, 1.75)])
def test_silence_is_that_of_the_sheet(baud: int, milliseconds: float) -> None:
    assert silence(baud) * 1000 == pytest.approx(milliseconds, rel=0.001)


GOOD = bytes.fromhex("01 03 10 00 00 19 80 C0")


def test_a_frame_ends_with_the_silence_behind_its_last_byte() -> None:
    framer = Framer(0.004)
    assert framer.due is None
    framer.feed(GOOD[:3], 1.0)
    framer.feed(GOOD[3:], 1.003)
    assert framer.due == pytest.approx(1.007)
    assert framer.began == 1.0
    assert framer.take() == (1, GOOD[1:-2])
    assert framer.due is None


def test_an_unfinished_telegram_gets_the_patience_of_an_adapter() -> None:
    framer = Framer(0.002, 0.02)
    framer.feed(GOOD[:5], 1.0)
    assert framer.due == pytest.approx(1.02)
    framer.feed(GOOD[5:], 1.016)
    assert framer.due == pytest.approx(1.018)
    assert framer.take() == (1, GOOD[1:-2])


@given(st.lists(st.binary(min_size=1, max_size=300), min_size=1, max_size=8))
def test_whatever_was_heard_the_next_telegram_is_whole(noise: list[bytes]) -> None:
    framer = Framer(0.002)
    for number, piece in enumerate(noise):
        framer.feed(piece, float(number))
        assert framer.due is not None
    heard = b"".join(noise)
    taken = framer.take()
    assert (taken is not None) == (4 <= len(heard) <= 256 and crc_holds(heard))
    framer.feed(GOOD, 100.0)
    assert framer.take() == (1, GOOD[1:-2])
