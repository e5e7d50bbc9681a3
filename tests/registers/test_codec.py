"""Words become the numbers that the sheets say, and go back without loss."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.registers.codec import decode, encode, raw_limits
from app.registers.register import REALS, Order, Register, Type

LENGTH = {
    Type.U16: 1, Type.I16: 1, Type.U32: 2, Type.I32: 2, Type.F32: 2, Type.U64: 4, Type.I64: 4, Type.F64: 4, Type.BIT: 1,
}  # fmt: skip
WHOLE = [kind for kind in LENGTH if kind not in (*REALS, Type.BIT)]


def register(kind: Type = Type.U16, **fields: object) -> Register:
    return Register(0x1000, type=kind, words=LENGTH.get(kind, 16), **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (Order.ABCD, [0x1234, 0x5678]),
        (Order.CDAB, [0x5678, 0x1234]),
        (Order.BADC, [0x3412, 0x7856]),
        (Order.DCBA, [0x7856, 0x3412]),
    ],
)
def test_four_orders_of_0x12345678(order: Order, words: list[int]) -> None:
    assert decode(register(Type.U32, order=order), words) == 0x12345678
    assert encode(register(Type.U32, order=order), 0x12345678) == words


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (Order.ABCD, [0x1234, 0x5678, 0x9ABC, 0xDEF0]),
        (Order.CDAB, [0xDEF0, 0x9ABC, 0x5678, 0x1234]),
        (Order.BADC, [0x3412, 0x7856, 0xBC9A, 0xF0DE]),
        (Order.DCBA, [0xF0DE, 0xBC9A, 0x7856, 0x3412]),
    ],
)
@pytest.mark.parametrize("kind", [Type.U64, Type.I64, Type.F64])
def test_four_orders_of_64_bits(kind: Type, order: Order, words: list[int]) -> None:
    wanted = struct.unpack({"u": ">Q", "i": ">q", "f": ">d"}[kind.value[0]], bytes.fromhex("123456789abcdef0"))[0]
    assert decode(register(kind, order=order), words) == wanted
    assert encode(register(kind, order=order), wanted) == words


def test_numbers_of_64_bits_are_exact_and_have_ends() -> None:
    for value in (-(2**63), -1, 2**53 + 1, 2**63 - 1):
        assert decode(register(Type.I64), encode(register(Type.I64), value)) == value
    with pytest.raises(ValueError, match=r"takes -9\.22337e\+18 to 9\.22337e\+18"):
        encode(register(Type.I64), 2**63)
    minus = register(Type.I64, none=0x8000_0000_0000_0000)
    assert decode(minus, [0x8000, 0, 0, 0]) is None and encode(minus, None) == [0x8000, 0, 0, 0]
    for value in (0.1, 1e300, 123456789.123456789, -5e-324):
        assert decode(register(Type.F64), encode(register(Type.F64), value)) == value
    assert decode(register(Type.F64, scale=0.1), encode(register(Type.F64), 3.0)) == 0.3
    assert decode(register(Type.F64), encode(register(Type.F64), None)) is None
    for kind, value, most in ((Type.F32, 1e30, "3.4e"), (Type.F64, 1e300, "1.8e")):
        with pytest.raises(ValueError, match=rf"takes -{most}"):
            encode(register(kind, scale=1e-30), value)
    assert decode(register(Type.F64, scale=1e10), encode(register(Type.F64), 1e308)) is None, "no infinite value"


def test_a_bit_is_0_or_1_and_nothing_else() -> None:
    for bit in (0, 1):
        assert decode(register(Type.BIT, table="coil"), [bit]) == bit
        assert encode(register(Type.BIT, table="coil"), bit) == [bit]
    with pytest.raises(ValueError, match="bit 2"):
        decode(register(Type.BIT, table="coil"), [2])
    for value in (2, -1):
        with pytest.raises(ValueError, match="takes 0 to 1"):
            encode(register(Type.BIT, table="coil"), value)


def test_frame_of_the_manual_is_50_hertz_400_volts_and_0_6_amperes() -> None:
    assert decode(register(scale=0.01), [0x1388]) == 50.0
    assert decode(register(), [0x0190]) == 400
    assert decode(register(scale=0.01), [0x003C]) == 0.6


def test_scaling_leaves_no_float_dust() -> None:
    assert all(len(repr(decode(register(scale=0.01), [raw]))) <= 6 for raw in range(65536))
    assert decode(register(Type.F32), list(struct.unpack(">HH", struct.pack(">f", 0.1)))) == 0.1
    assert decode(register(scale=0.1, offset=-40.0), [2153]) == 175.3


def test_a_word_is_split_into_bytes() -> None:
    assert decode(register(mask=0xFF), [0x0102]) == 2
    assert decode(register(mask=0xFF, shift=8), [0x0102]) == 1
    assert encode(register(mask=0xFF, shift=8), 1) == [0x0100]
    with pytest.raises(ValueError, match="takes 0 to 255, not 256"):
        encode(register(mask=0xFF), 256)


def test_no_value_is_none_both_ways() -> None:
    assert decode(register(none=0x8000), [0x8000]) is None
    assert encode(register(none=0x8000), None) == [0x8000]
    assert decode(register(Type.I16, none=None), [0x8000]) == -32768
    assert decode(register(Type.I16, none=0x8000), [0x8000]) is None
    assert decode(register(Type.I32, none=0x8000_0000, order=Order.CDAB), [0, 0x8000]) is None
    assert decode(register(Type.I16, none=0x8000), [0x7FFF]) == 32767
    assert decode(register(Type.F32), encode(register(Type.F32), None)) is None
    assert decode(register(Type.F32), [0x7F80, 0]) is None
    with pytest.raises(ValueError, match="no word"):
        encode(register(), None)
    with pytest.raises(ValueError, match="means"):
        encode(register(none=0x8000), 32768)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "40"])
def test_what_is_no_number_is_refused(value: float | str) -> None:
    with pytest.raises(ValueError, match="finite number"):
        encode(register(scale=0.01), value)


def test_out_of_range_names_value_and_limits() -> None:
    with pytest.raises(ValueError, match=r"0x1000 takes 0 to 655\.35, not 655\.36"):
        encode(register(scale=0.01), 655.36)
    with pytest.raises(ValueError, match=r"takes -32768 to 32767, not 40000"):
        encode(register(Type.I16), 40000)
    with pytest.raises(ValueError, match=r"takes -3.4e\+38"):
        encode(register(Type.F32), 1e39)


@pytest.mark.parametrize("words", [[], [1, 2], [-1], [65536]])
def test_wrong_words_are_refused(words: list[int]) -> None:
    with pytest.raises(ValueError, match="expected"):
        decode(register(), words)


def test_text_is_utf_8_padded_with_nul() -> None:
    text = register(Type.STRING)
    assert decode(text, encode(text, "Lüfter č")) == "Lüfter č"
    assert encode(text, "AB")[:2] == [0x4142, 0]
    assert decode(text, [0xFF41] + [0] * 15) == "\ufffdA"
    with pytest.raises(ValueError, match="at most 32 bytes"):
        encode(text, "x" * 33)
    with pytest.raises(ValueError, match="NUL"):
        encode(text, "a\0b")


@given(
    st.data(),
    st.sampled_from(WHOLE),
    st.sampled_from(list(Order)),
    st.sampled_from([1.0, 0.1, 0.01, 0.001, 10.0, 0.5, -0.1]),
)
def test_every_whole_type_survives_the_round_trip(data: st.DataObject, kind: Type, order: Order, scale: float) -> None:
    if kind in (Type.U64, Type.I64):
        scale = 1.0
    where = register(kind, order=order, scale=scale)
    raw = data.draw(st.integers(*raw_limits(where)))
    words = encode(register(kind, order=order), raw)
    value = decode(where, words)
    assert encode(where, value) == words
    assert value == pytest.approx(raw * scale)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False), st.sampled_from(list(Order)))
def test_every_float_survives_the_round_trip(value: float, order: Order) -> None:
    where = register(Type.F32, order=order)
    words = encode(where, value)
    back = decode(where, words)
    assert isinstance(back, float)
    assert encode(where, back) == words
    assert struct.pack(">f", back) == struct.pack(">f", value)


@given(
    st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=8), st.sampled_from(list(Order))
)
def test_every_text_survives_the_round_trip(text: str, order: Order) -> None:
    where = register(Type.STRING, order=order)
    assert decode(where, encode(where, text)) == text


@given(st.integers(0, 15), st.integers(1, 16), st.integers(0, 65535))
def test_a_masked_part_takes_only_its_own_bits(shift: int, width: int, raw: int) -> None:
    mask = (1 << min(width, 16 - shift)) - 1
    where = register(mask=mask, shift=shift)
    value = decode(where, [raw])
    assert value == raw >> shift & mask
    assert encode(where, value) == [raw & mask << shift]
