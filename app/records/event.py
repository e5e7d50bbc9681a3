"""One event of a machine's ring, as it is kept."""

from collections.abc import Sequence
from dataclasses import dataclass
from struct import pack, unpack

WORDS = 6
"""Words of a snapshot."""


@dataclass(frozen=True, slots=True)
class Event:
    """One event of the ring of one machine. Its numbers are the device's; what they mean is said by the type (`events.toml`)."""

    id: int
    """Of its row: rises in the order in which events were stored, over all machines; 0 = not stored yet."""
    equipment: str
    """Name that the machine has now."""
    boot: int
    """How often the device had been switched on."""
    sequence: int
    """1 … 2³²−1 in the ring. A device that lost what it retains counts boot and sequence from 1 again, so they are no key for ever."""
    time: int
    """When it happened [µs UTC]."""
    code: int
    source: int
    value: float | None
    """None = no value."""
    words: tuple[int, ...]
    """The six snapshot words as the device gave them (records/snapshot.py reads them)."""
    request: int = 0
    """Id of the command that caused it, as the device says; 0 = none did, or the device does not say."""
    person: str = ""
    """Who gave that command; empty: nobody, or not known (yet)."""
    reason: str = ""
    """Why, in the words of that person."""


def packed(words: Sequence[int]) -> bytes:
    """Snapshot words as the history keeps them: big-endian, zero words at the end left out."""
    used = len(words)
    while used and not words[used - 1]:
        used -= 1
    return pack(f">{used}H", *words[:used])


def unpacked(kept: bytes) -> tuple[int, ...]:
    """The six words of what `packed` gave."""
    words = unpack(f">{len(kept) // 2}H", kept[: len(kept) // 2 * 2])
    return (*words, *(0,) * (WORDS - len(words)))
