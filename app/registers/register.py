"""Where a value lives in a device and how its words become a number (reference/modbus.md section 2)."""

from dataclasses import dataclass
from enum import StrEnum


class Type(StrEnum):
    """How words become a number."""

    U16 = "u16"
    I16 = "i16"
    U32 = "u32"
    I32 = "i32"
    F32 = "f32"
    U64 = "u64"
    I64 = "i64"
    F64 = "f64"
    STRING = "string"
    BIT = "bit"
    """A coil or a discrete input: no word, but 0 or 1."""


REALS = (Type.F32, Type.F64)
"""Types of numbers that are not whole, with a "no value" of their own."""
BIT_TABLES = ("coil", "discrete")
"""Tables of single bits, each with an address of its own."""


class Order(StrEnum):
    """Order of the bytes of 0x12345678 in two registers (reference/modbus.md section 2)."""

    ABCD = "abcd"
    CDAB = "cdab"
    BADC = "badc"
    DCBA = "dcba"


@dataclass(frozen=True, slots=True)
class Register:
    """Where a value lives in a device and how its words become a number: `((word >> shift) & mask) * scale + offset`."""

    address: int
    """0-based protocol address."""
    type: Type = Type.U16
    order: Order = Order.ABCD
    table: str = "holding"
    """`holding` (read by function code 03) or `input` (04) of registers, `coil` (01) or `discrete` (02) of bits."""
    mask: int | None = None
    """Bits that belong to the value, after the shift: splits a word into bytes or bits."""
    shift: int = 0
    scale: float = 1.0
    """[EU per raw unit]"""
    offset: float = 0.0
    """[EU]"""
    words: int = 1
    """Length in registers: 1, 2, 4, or the length of a string; 1 of a bit."""
    writable: bool = False
    readable: bool = True
    """False for command registers: they are never polled."""
    none: int | None = None
    """Raw value that means "no value": the bits as they come, so 0x8000 also of an i16."""
