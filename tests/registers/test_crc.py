"""The check sum of a frame: published examples, and every single flipped bit is seen."""

import pytest

from app.registers.crc import crc16, crc_holds, with_crc

EXAMPLES = [
    ("02 07", 0x1241),  # Modbus over serial line 1.02, appendix B
    ("01 03 00 00 00 0A", 0xCDC5),
    ("11 03 00 6B 00 03", 0x8776),
    ("", 0xFFFF),
]


@pytest.mark.parametrize(("data", "crc"), EXAMPLES)
def test_the_published_examples(data: str, crc: int) -> None:
    assert crc16(bytes.fromhex(data)) == crc


def test_the_low_byte_goes_first() -> None:
    assert with_crc(bytes.fromhex("02 07")) == bytes.fromhex("02 07 41 12")


def test_every_flipped_bit_is_seen() -> None:
    frame = with_crc(bytes(range(20)))
    assert crc_holds(frame)
    for bit in range(8 * len(frame)):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        assert not crc_holds(bytes(damaged))


@pytest.mark.parametrize("frame", [b"", b"\x00", b"\xff\xff"])
def test_a_check_sum_of_nothing_is_none(frame: bytes) -> None:
    assert not crc_holds(frame)
