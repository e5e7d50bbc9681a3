"""Set and actual values as words: 0x4000 is 100 % of the drive's reference value.

Source: reference/profidrive.md section 4 (NSOLL_A, NIST_A; NSOLL_B, NIST_B).
"""

from dataclasses import dataclass
from math import isfinite

ONE = 0x4000
"""100 % as a 16-bit value; 0x4000 0000 as a 32-bit one."""


@dataclass(frozen=True, slots=True)
class Scaling:
    """Between a value in its unit and the words of N2 (16 bit) or N4 (32 bit).

    Raises:
        ValueError: reference is not a finite number above 0, or words is neither 1 nor 2.
    """

    reference: float
    """Of the drive (p2000) in the unit of the value [U], above 0."""
    words: int = 1

    def __post_init__(self) -> None:
        if not (isfinite(self.reference) and self.reference > 0):
            raise ValueError(f"reference is {self.reference}, a finite number above 0 expected")
        if self.words not in (1, 2):
            raise ValueError(f"words is {self.words}, 1 or 2 expected")

    @property
    def one(self) -> int:
        """Raw value of 100 %."""
        return ONE << 16 * (self.words - 1)

    @property
    def low(self) -> float:
        """Least value that can be said [U]: −200 %."""
        return -2.0 * self.reference

    @property
    def high(self) -> float:
        """Greatest value that can be said [U]: one step below +200 %."""
        return (2 * self.one - 1) / self.one * self.reference

    def raw(self, value: float) -> int:
        """Nearest signed raw value; what is beyond −200 … +199.99 % becomes the limit, never the other sign.

        Raises:
            ValueError: value is not a number.
        """
        if value != value:
            raise ValueError("value is not a number, a speed expected")
        return round(min(max(value, self.low), self.high) / self.reference * self.one)

    def value(self, raw: int) -> float:
        """Value of a signed raw value [U].

        Raises:
            ValueError: raw does not fit the words.
        """
        if not -2 * self.one <= raw < 2 * self.one:
            raise ValueError(f"{raw} is not a signed number of {16 * self.words} bits")
        return raw / self.one * self.reference

    def encode(self, value: float) -> tuple[int, ...]:
        """Unsigned words of `value`, high word first."""
        raw = self.raw(value) % (4 * self.one)
        return (raw,) if self.words == 1 else (raw >> 16, raw & 0xFFFF)

    def decode(self, *words: int) -> float:
        """Value of unsigned words, high word first [U].

        Raises:
            ValueError: another number of words, or one outside 0 to 0xFFFF.
        """
        if len(words) != self.words or not all(0 <= word <= 0xFFFF for word in words):
            raise ValueError(f"{words}: {self.words} words of 0 to 65535 expected")
        raw = words[0] if self.words == 1 else words[0] << 16 | words[1]
        return self.value(raw - 4 * self.one if raw >= 2 * self.one else raw)
