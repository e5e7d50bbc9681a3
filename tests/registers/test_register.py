"""What a register says of itself is what its words become."""

import pytest

from app.registers.codec import decode, encode
from app.registers.register import Order, Register, Type

BYTES = {
    Order.ABCD: (0x1234, 0x5678),
    Order.CDAB: (0x5678, 0x1234),
    Order.BADC: (0x3412, 0x7856),
    Order.DCBA: (0x7856, 0x3412),
}


@pytest.mark.parametrize("order", Order)
def test_each_order_puts_the_bytes_of_a_long_where_its_letters_say(order: Order) -> None:
    register = Register(0, Type.U32, order, words=2, writable=True)
    assert tuple(encode(register, 0x12345678)) == BYTES[order]
    assert decode(register, list(BYTES[order])) == 0x12345678


@pytest.mark.parametrize("type", [one for one in Type if one not in (Type.STRING, Type.BIT)])
def test_every_number_goes_there_and_back(type: Type) -> None:
    words = {Type.U16: 1, Type.I16: 1, Type.U64: 4, Type.I64: 4, Type.F64: 4}.get(type, 2)
    for value in (0, 1, 25, 32767, *((-1, -32768) if type.value[0] in "if" else ())):
        register = Register(0, type, words=words, writable=True)
        assert decode(register, list(encode(register, value))) == value


def test_what_nothing_is_said_of_is_a_plain_word_that_is_only_read() -> None:
    plain = Register(7)
    assert (plain.type, plain.scale, plain.offset, plain.words) == (Type.U16, 1.0, 0.0, 1)
    assert plain.readable and not plain.writable
