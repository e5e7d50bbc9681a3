"""The registers and bits of a machine as its device holds them, and the values of points that lie in them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from app.registers.codec import Value, decode, encode, own_bits, raw_limits
from app.registers.register import REALS, Register, Type

Place = tuple[str, int]
"""Table and address."""


@dataclass(slots=True)
class Image:
    """What is at each place; a place that no register has is not there."""

    words: dict[Place, int] = field(default_factory=dict)

    def value(self, register: Register) -> Value:
        """The value of a register."""
        return decode(register, [self.words.get(place, 0) for place in places(register)])

    def put(self, register: Register, value: Value) -> None:
        """Hold `value`, or what is nearest to it; other bits of its words stay. What its registers cannot say changes nothing."""
        try:
            words = encode(register, nearest(register, value))
        except ValueError:
            return
        own = own_bits(register) or [0xFFFF] * len(words)
        for place, word, bits in zip(places(register), words, own, strict=True):
            self.words[place] = self.words.get(place, 0) & ~bits & 0xFFFF | word & bits


def places(register: Register) -> list[Place]:
    """Its words, in order."""
    return [(register.table, register.address + at) for at in range(register.words)]


def overlapping(registers: Mapping[str, Register]) -> dict[str, tuple[str, ...]]:
    """Key of a register → keys of the others that share a word with it."""
    owners: dict[Place, list[str]] = {}
    for key, register in registers.items():
        for place in places(register):
            owners.setdefault(place, []).append(key)
    return {
        key: tuple(dict.fromkeys(other for place in places(one) for other in owners[place] if other != key))
        for key, one in registers.items()
    }


def ends(register: Register) -> tuple[float, float]:
    """Least and greatest number that it can say [EU]."""
    if register.type is Type.F64:
        return -1.7e308, 1.7e308
    if register.type in REALS:
        low, high = sorted((-3.4e38 * register.scale + register.offset, 3.4e38 * register.scale + register.offset))
        return low, high
    low, high = sorted(raw * register.scale + register.offset for raw in raw_limits(register))
    return low, high


def nearest(register: Register, value: Value) -> Value:
    """`value`, or the end of what the register can say."""
    if isinstance(value, str) or value is None:
        return value
    low, high = ends(register)
    if low <= value <= high:
        return value
    return low if value < low else high


def joined(registers: Iterable[Register]) -> frozenset[Place]:
    """Every place of these."""
    return frozenset(place for register in registers for place in places(register))
