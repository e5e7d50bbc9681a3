"""How a value stands in a parameter message: format number, size, signed or not.

Source: reference/profidrive.md section 9, "format". All numbers are big-endian.
"""

import struct
from collections.abc import Mapping, Sequence
from enum import IntEnum
from types import MappingProxyType
from typing import NamedTuple

from app.errors import TelegramError
from app.profidrive.parameter_access.error_numbers import ErrorNumber

Number = int | float
"""One value; octets are integers, too."""


class Format(IntEnum):
    """Format of values in a message."""

    BOOLEAN = 0x01
    INTEGER8 = 0x02
    INTEGER16 = 0x03
    INTEGER32 = 0x04
    UNSIGNED8 = 0x05
    UNSIGNED16 = 0x06
    UNSIGNED32 = 0x07
    FLOAT32 = 0x08
    VISIBLE_STRING = 0x09
    OCTET_STRING = 0x0A
    TIME_DIFFERENCE = 0x0D
    OCTET_STRING_10 = 0x10
    """As a maker's manual prints it; the profile is remembered as 0x0A."""
    TIME_DIFFERENCE_13 = 0x13
    """As a maker's manual prints it; the profile is remembered as 0x0D."""
    ZERO = 0x40
    """No value: this parameter was written, or was not the one that failed."""
    BYTE = 0x41
    WORD = 0x42
    DOUBLE_WORD = 0x43
    ERROR = 0x44
    N2 = 0x71
    """Normalised, 0x4000 is 100 %."""
    N4 = 0x72


class Layout(NamedTuple):
    """One value of a format."""

    code: str
    """As `struct` names it, big-endian."""
    certainty: str
    """M a manual's page, T a thesis, G unconfirmed."""

    @property
    def size(self) -> int:
        """Of one value [bytes]."""
        return struct.calcsize(f">{self.code}")


LAYOUTS: Mapping[Format, Layout] = MappingProxyType(
    {
        Format.BOOLEAN: Layout("B", "G"),
        Format.INTEGER8: Layout("b", "T"),
        Format.INTEGER16: Layout("h", "TM"),
        Format.INTEGER32: Layout("i", "TM"),
        Format.UNSIGNED8: Layout("B", "TM"),
        Format.UNSIGNED16: Layout("H", "TM"),
        Format.UNSIGNED32: Layout("I", "TM"),
        Format.FLOAT32: Layout("f", "TM"),
        Format.VISIBLE_STRING: Layout("B", "G"),
        Format.OCTET_STRING: Layout("B", "G"),
        Format.TIME_DIFFERENCE: Layout("I", "G"),
        Format.OCTET_STRING_10: Layout("B", "M"),
        Format.TIME_DIFFERENCE_13: Layout("I", "G"),
        Format.BYTE: Layout("B", "M"),
        Format.WORD: Layout("H", "M"),
        Format.DOUBLE_WORD: Layout("I", "M"),
        Format.N2: Layout("h", "G"),
        Format.N4: Layout("i", "G"),
    }
)
"""The formats that hold values; whether a time difference has 4 or 6 bytes is unconfirmed."""
INTEGERS: Mapping[str, tuple[int, int]] = MappingProxyType(
    {
        "b": (-0x80, 0x7F),
        "B": (0, 0xFF),
        "h": (-0x8000, 0x7FFF),
        "H": (0, 0xFFFF),
        "i": (-0x8000_0000, 0x7FFF_FFFF),
        "I": (0, 0xFFFF_FFFF),
    }
)
"""`struct` code → least and greatest value."""
LARGEST_SIZE = 4
"""Of a number [bytes]."""
LARGEST_FLOAT = 3.4028234663852886e38


def format_of(number: int, place: str) -> Format:
    """The format `number` of values.

    Raises:
        TelegramError: it is unknown, or holds no values.
    """
    if number not in LAYOUTS:
        found, illegal = f"format 0x{number:02X}", ErrorNumber.ILLEGAL_FORMAT
        raise TelegramError(place, found, "a format of values (0x01 to 0x0A, 0x41 to 0x43 …)", illegal)
    return Format(number)


def size_of(format: Format | None) -> int:
    """Of one value [bytes]; where nobody knows the format, the most that a number has."""
    return LAYOUTS[format].size if format is not None and format in LAYOUTS else LARGEST_SIZE


def encode_values(format: Format, values: Sequence[Number], place: str) -> bytes:
    """`values` one after the other, without filling.

    Raises:
        TelegramError: a value does not fit the format, or the format holds no values.
    """
    layout = LAYOUTS[format_of(format, place)]
    for index, value in enumerate(values):
        _check(value, format, layout.code, f"{place}, value {index}")
    return struct.pack(f">{len(values)}{layout.code}", *values)


def decode_values(format: Format, data: bytes) -> tuple[Number, ...]:
    """The values that `data` holds, whose length is a multiple of the format's size."""
    return tuple(one[0] for one in struct.iter_unpack(f">{LAYOUTS[format].code}", data))


def rounded(format: Format, value: Number) -> Number:
    """`value`, which fits, as it comes back in `format`: of 0.01 as 32 bits there is only a neighbour.

    Raises:
        TelegramError: it does not fit.
    """
    return decode_values(format, encode_values(format, (value,), "value"))[0]


def fits(format: Format, value: Number) -> bool:
    """Whether `value` can be said in `format`."""
    try:
        _check(value, format, LAYOUTS[format_of(format, "")].code, "")
    except TelegramError:
        return False
    return True


def _check(value: object, format: Format, code: str, place: str) -> None:
    if code == "f":
        if isinstance(value, (int, float)) and abs(value) <= LARGEST_FLOAT:
            return
        raise TelegramError(place, repr(value), "a finite number of 32 bits")
    low, high = INTEGERS[code]
    if not isinstance(value, int) or not low <= value <= high:
        raise TelegramError(place, repr(value), f"a whole number of {low} to {high} ({format.name.lower()})")
