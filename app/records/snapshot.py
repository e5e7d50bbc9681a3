"""What the six snapshot words of an event say, by the layout of its type (`[snapshot]` in events.toml)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from struct import pack, unpack

from app.records.event import WORDS

TYPES: Mapping[str, str] = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "f32": ">f"}
"""Type of a field → how it lies in its words: big-endian, high word first."""

PARTS = ("source", "whole")
"""Whose bits a field is about: of the part that is the source of the event, of the machine as a whole."""
BITS = 16
"""In a word."""


@dataclass(frozen=True, slots=True)
class Field:
    """One value in the words."""

    word: int
    """The first of its words, 0–5."""
    type: str
    """Key of `TYPES`."""
    none: int | None = None
    """Number that means "no value"; NaN always does."""
    all: str = ""
    """Name under which an alarm lists all of them since it was acknowledged; empty = it does not."""
    only: frozenset[int] = frozenset()
    """Codes of the events that say it; empty = all but those of `but`."""
    but: frozenset[int] = frozenset()
    bit_of: str = ""
    """Key of `PARTS`: it is the number of a bit of this part, which the definition of the machine names; empty = it is a number."""
    bits_of: str = ""
    """The same: it is a word of such bits."""

    @property
    def words(self) -> int:
        """How many it takes, from `word` on."""
        return words_of(self.type)

    def is_said(self, code: int) -> bool:
        """Whether an event of this code says it."""
        return code not in self.but and (not self.only or code in self.only)


Layout = Mapping[str, Field]
"""Name → field."""


def words_of(type: str) -> int:
    """Words of a value of this type."""
    return 2 if type.endswith("32") else 1


def decode(layout: Layout, words: Sequence[int], code: int) -> dict[str, int | float | None]:
    """The value of each field that an event of this `code` says, in its `words`, which may be fewer than six (the rest is 0); None = no
    value."""
    padded = [*words, *(0,) * WORDS]
    return {name: _value(field, padded) for name, field in layout.items() if field.is_said(code)}


def _value(field: Field, words: Sequence[int]) -> int | float | None:
    taken = words[field.word : field.word + field.words]
    value: int | float = unpack(TYPES[field.type], pack(f">{len(taken)}H", *taken))[0]
    if value == field.none or (isinstance(value, float) and not math.isfinite(value)):
        return None
    return value
