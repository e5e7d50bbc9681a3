"""Standard telegrams 1 (speed) and 111 (basic positioner): which fields their words are.

Source: reference/profidrive.md sections 4 and 6. Scalings: `scaling.py` (0x4000 is 100 %); positions are in LU, velocities in 1000 LU/min.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from app.errors import TelegramError


class Field(NamedTuple):
    """One value of a telegram."""

    name: str
    words: int = 1
    signed: bool = False

    @property
    def range(self) -> tuple[int, int]:
        """Least and greatest value."""
        bits = 16 * self.words
        return (-(1 << bits - 1), (1 << bits - 1) - 1) if self.signed else (0, (1 << bits) - 1)


@dataclass(frozen=True, slots=True)
class Side:
    """What goes one way."""

    fields: tuple[Field, ...]

    @property
    def length(self) -> int:
        """[words]"""
        return sum(field.words for field in self.fields)

    def pack(self, values: Mapping[str, int]) -> tuple[int, ...]:
        """The words, the high one first; a field that is not given is 0.

        Raises:
            TelegramError: an unknown field, or a value that does not fit.
        """
        unknown = sorted(set(values) - {field.name for field in self.fields})
        if unknown:
            raise TelegramError("telegram", f"field {unknown[0]}", f"one of {', '.join(f.name for f in self.fields)}")
        words: list[int] = []
        for field in self.fields:
            value, (low, high) = values.get(field.name, 0), field.range
            if not isinstance(value, int) or not low <= value <= high:
                raise TelegramError(field.name, repr(value), f"a whole number of {low} to {high}")
            raw = value % (1 << 16 * field.words)
            words += (raw >> 16 * place & 0xFFFF for place in range(field.words - 1, -1, -1))
        return tuple(words)

    def unpack(self, words: Sequence[int]) -> dict[str, int]:
        """Every field of `words`.

        Raises:
            TelegramError: another number of words, or one that is not of 16 bits.
        """
        if len(words) != self.length:
            raise TelegramError("telegram", f"{len(words)} words", f"{self.length}")
        wrong = next((word for word in words if not 0 <= word <= 0xFFFF), None)
        if wrong is not None:
            raise TelegramError("telegram", f"word {wrong}", "0 to 65535")
        found, place = {}, 0
        for field in self.fields:
            raw = 0
            for word in words[place : place + field.words]:
                raw = raw << 16 | word
            place += field.words
            found[field.name] = raw - (1 << 16 * field.words) if raw > field.range[1] else raw
        return found


@dataclass(frozen=True, slots=True)
class Telegram:
    """A telegram by its number."""

    number: int
    out: Side
    """Control to drive."""
    into: Side
    """Drive to control."""


def _side(*fields: Field) -> Side:
    return Side(fields)


TELEGRAMS: Mapping[int, Telegram] = MappingProxyType(
    {
        1: Telegram(
            1,
            _side(Field("STW1"), Field("NSOLL_A", signed=True)),
            _side(Field("ZSW1"), Field("NIST_A", signed=True)),
        ),
        111: Telegram(
            111,
            _side(
                Field("STW1"),
                Field("POS_STW1"),
                Field("POS_STW2"),
                Field("STW2"),
                Field("OVERRIDE", signed=True),
                Field("MDI_TARPOS", 2, signed=True),
                Field("MDI_VELOCITY", 2, signed=True),
                Field("MDI_ACC", signed=True),
                Field("MDI_DEC", signed=True),
                Field("free"),
            ),
            _side(
                Field("ZSW1"),
                Field("POS_ZSW1"),
                Field("POS_ZSW2"),
                Field("ZSW2"),
                Field("MELDW"),
                Field("XIST_A", 2, signed=True),
                Field("NIST_B", 2, signed=True),
                Field("FAULT_CODE"),
                Field("WARN_CODE"),
                Field("free"),
            ),
        ),
    }
)
"""Number → telegram."""
