"""Words ↔ values: types, the four byte orders, masks, scaling (reference/modbus.md section 2)."""

import math
import struct
from collections.abc import Callable, Sequence
from functools import lru_cache

from app.registers.register import REALS, Order, Register, Type

Value = float | int | str | None
Decoder = Callable[[Sequence[int]], Value]

_FORMATS = {
    Type.U16: ">H",
    Type.I16: ">h",
    Type.U32: ">I",
    Type.I32: ">i",
    Type.F32: ">f",
    Type.U64: ">Q",
    Type.I64: ">q",
    Type.F64: ">d",
}
_SIGNED = (Type.I16, Type.I32, Type.I64)
_SWAPPED_WORDS = (Order.CDAB, Order.DCBA)
_SWAPPED_BYTES = (Order.BADC, Order.DCBA)


def decode(register: Register, words: Sequence[int]) -> Value:
    """The value of `words`: `((raw >> shift) & mask) * scale + offset`, or None for "no value" (the raw value `none`, NaN, ±inf).

    A number whose scale is 1 and whose offset is 0 stays an integer; others are rounded to the decimals that scale and offset imply, so
    4000 hundredths are 40.0. Text ends at the first NUL; bytes that are no UTF-8 become U+FFFD.

    Raises:
        ValueError: not as many words as the register has, a word outside 0…65535, or a bit that is neither 0 nor 1.
    """
    return decoder(register)(words)


@lru_cache(maxsize=65536)
def decoder(register: Register) -> Decoder:
    """`decode` for one register, with everything that does not depend on the words done once: for what is done with every value."""
    length = _length(register)
    if register.type is Type.STRING:
        return lambda words: _text(register, _checked(words, length))
    scale, offset = register.scale, register.offset
    none = None if register.none is None else _as_signed(register, register.none)
    plain = scale == 1 and offset == 0
    if register.type is Type.BIT:
        return lambda words: _bit(_checked(words, length)[0])
    if register.type in REALS:
        return lambda words: _real(register, _checked(words, length))
    places = _decimals(scale, offset)
    mask, shift = register.mask, register.shift
    unsigned_word = register.type is Type.U16 and register.order in (Order.ABCD, Order.CDAB)

    def whole(words: Sequence[int]) -> Value:
        raw = _checked(words, length)[0] if unsigned_word else int(_unpack(register, _checked(words, length)))
        if raw == none:
            return None
        if shift:
            raw >>= shift
        if mask is not None:
            raw &= mask
        return raw if plain else round(raw * scale + offset, places)

    return whole


def encode(register: Register, value: Value) -> list[int]:
    """The words that a device must get to hold `value`; of a masked register only the bits that belong to the value.

    A number between two steps of the scale goes to the nearer one. None becomes the raw value `none`, or NaN for a real.

    Raises:
        ValueError: the value does not fit; names the value and the limits.
    """
    length = _length(register)
    if register.type is Type.STRING:
        return _text_words(register, value, length)
    if value is None:
        if register.type in REALS:
            return _pack(register, math.nan)
        if register.none is None:
            raise ValueError(f'register 0x{register.address:04X} has no word for "no value", expected a number')
        return _pack(register, _as_signed(register, register.none))
    if isinstance(value, str) or not math.isfinite(value):
        raise ValueError(f"register 0x{register.address:04X} takes a finite number, not {value!r}")
    if register.type in REALS:
        return _pack_real(register, value)
    low, high = raw_limits(register)
    # whole numbers without scaling stay exact beyond 2**53
    exact = isinstance(value, int) and register.scale == 1 and register.offset == 0
    raw = int(value) if exact else round((value - register.offset) / register.scale)
    if not low <= raw <= high:
        ends = sorted((low * register.scale + register.offset, high * register.scale + register.offset))
        raise ValueError(f"register 0x{register.address:04X} takes {ends[0]:g} to {ends[1]:g}, not {value:g}")
    if register.none is not None and _as_signed(register, register.none) == raw:
        raise ValueError(f'register 0x{register.address:04X} takes no {value:g}: its raw value {raw} means "no value"')
    if register.mask is not None:
        raw = (raw & register.mask) << register.shift
        return _pack(register, _as_signed(register, raw))
    return _pack(register, raw << register.shift)


def raw_limits(register: Register) -> tuple[int, int]:
    """Least and greatest raw number that the register's type and mask can hold (before scaling)."""
    if register.type is Type.BIT:
        return 0, 1
    bits = 16 * _length(register)
    if register.mask is not None:
        return 0, min(register.mask, (1 << bits) - 1 >> register.shift)
    if register.type in _SIGNED:
        return -(1 << bits - 1) >> register.shift, (1 << bits - 1) - 1 >> register.shift
    return 0, (1 << bits) - 1 >> register.shift


def own_bits(register: Register) -> list[int] | None:
    """Of each of its words the bits that belong to the value, in the order in which the device has them; None when all do."""
    if register.mask is None and not register.shift:
        return None
    whole = (1 << 16 * _length(register)) - 1
    own = (whole if register.mask is None else register.mask) << register.shift & whole
    return _pack(register, _as_signed(register, own))


def with_own(now: Sequence[int], words: Sequence[int], own: Sequence[int]) -> list[int]:
    """`words`, where the bits that are not `own` are as they are `now`."""
    return [(old & ~bits) | (new & bits) for old, new, bits in zip(now, words, own, strict=True)]


def _length(register: Register) -> int:
    if register.type is Type.STRING:
        return register.words
    if register.type is Type.BIT:
        return 1
    return struct.calcsize(_FORMATS[register.type]) // 2


def _checked(words: Sequence[int], length: int) -> Sequence[int]:
    if len(words) != length:
        raise ValueError(f"{len(words)} words, expected {length}")
    for word in words:
        if not 0 <= word <= 0xFFFF:
            raise ValueError(f"word {word}, expected 0 to 65535")
    return words


def _bytes(words: Sequence[int], order: Order) -> bytes:
    ordered = list(reversed(words)) if order in _SWAPPED_WORDS else list(words)
    return struct.pack(f"{'<' if order in _SWAPPED_BYTES else '>'}{len(ordered)}H", *ordered)


def _words(data: bytes, order: Order) -> list[int]:
    words = list(struct.unpack(f"{'<' if order in _SWAPPED_BYTES else '>'}{len(data) // 2}H", data))
    return words[::-1] if order in _SWAPPED_WORDS else words


def _unpack(register: Register, words: Sequence[int]) -> float:
    number: float = struct.unpack(_FORMATS[register.type], _bytes(words, register.order))[0]
    return number


def _pack(register: Register, raw: float) -> list[int]:
    if register.type is Type.BIT:
        return [int(raw)]
    return _words(struct.pack(_FORMATS[register.type], raw), register.order)


def _bit(word: int) -> int:
    if word > 1:
        raise ValueError(f"bit {word}, expected 0 or 1")
    return word


def _real(register: Register, words: Sequence[int]) -> float | None:
    number = _unpack(register, words)
    if not math.isfinite(number):
        return None
    double = register.type is Type.F64
    raw = int.from_bytes(struct.pack(">d" if double else ">f", number))
    if register.none is not None and raw == register.none:
        return None
    shortest = number if double else shortest_of(number)
    if register.scale == 1 and register.offset == 0:
        return shortest
    scaled = shortest * register.scale + register.offset
    return float(f"{scaled:.{15 if double else 9}g}") if math.isfinite(scaled) else None


def shortest_of(number: float) -> float:
    """The decimal number with the fewest digits that is this float32: 0.1, not 0.10000000149."""
    for digits in range(6, 9):
        short = float(f"{number:.{digits}g}")
        try:
            if struct.unpack(">f", struct.pack(">f", short))[0] == number:
                return short
        except OverflowError:
            continue
    return float(f"{number:.9g}")


def _pack_real(register: Register, value: float) -> list[int]:
    try:
        raw = (value - register.offset) / register.scale
        if math.isfinite(raw):
            return _pack(register, raw)
    except OverflowError:
        pass
    most = "1.8e+308" if register.type is Type.F64 else "3.4e+38"
    raise ValueError(f"register 0x{register.address:04X} takes -{most} to {most}, not {value:g}")


def _text(register: Register, words: Sequence[int]) -> str:
    return _bytes(words, register.order).partition(b"\0")[0].decode("utf-8", "replace")


def _text_words(register: Register, value: Value, length: int) -> list[int]:
    if value is not None and not isinstance(value, str):
        raise ValueError(f"register 0x{register.address:04X} takes a text, not {value!r}")
    data = (value or "").encode("utf-8")
    if len(data) > 2 * length:
        raise ValueError(
            f"register 0x{register.address:04X} takes at most {2 * length} bytes of UTF-8, not {len(data)}"
        )
    if b"\0" in data:
        raise ValueError(f"register 0x{register.address:04X} takes a text without NUL")
    return _words(data.ljust(2 * length, b"\0"), register.order)


def _as_signed(register: Register, raw: int) -> int:
    bits = 16 * _length(register)
    return raw - (1 << bits) if register.type in _SIGNED and raw >= 1 << bits - 1 else raw


def _decimals(scale: float, offset: float) -> int:
    """Decimals that a product with `scale` and a sum with `offset` can have, at most 12."""
    return min(12, max(_places(scale), _places(offset)))


def _places(number: float) -> int:
    mantissa, _, exponent = repr(float(number)).partition("e")
    fraction = mantissa.partition(".")[2]
    digits = 0 if fraction in ("", "0") else len(fraction)
    return max(0, digits - int(exponent or 0))
