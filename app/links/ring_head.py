"""What the head of an event ring says."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.registers import plc_map


@dataclass(frozen=True, slots=True)
class Head:
    """What the head of the ring says."""

    capacity: int
    words: int
    """Per row."""
    oldest: int
    newest: int
    acknowledged: int


def head_of(words: Sequence[int]) -> Head | None:
    """The head in a whole image of it, None when it was being changed."""
    if not plc_map.is_whole(words):
        return None
    at = (plc_map.AT_OLDEST, plc_map.AT_NEWEST, plc_map.AT_ACKNOWLEDGED)
    return Head(words[1], words[2], *(words[n] << 16 | words[n + 1] for n in at))
