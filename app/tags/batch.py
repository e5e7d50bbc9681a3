"""What a source publishes: one block of values as columns."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.tags.quality import GOOD

Value = float | int | str | None
"""A number, a text, or None for no value. Booleans travel as 0 and 1."""


@dataclass(frozen=True, slots=True)
class Batch:
    """The values of one block that changed, and that the whole block was seen.

    `handles`, `values` (and `qualities`, when given) have the same length n >= 0. A batch with n = 0 says that nothing changed and
    everything of the block is still as fresh as `seen`. When the quality of the block changes, every handle of it is listed.
    """

    source: str
    """Who publishes: a link, a part of the system, or the derivation."""
    block: int
    """Number of the block within the source; age is kept per block."""
    time: int
    """When the values were true [µs UTC]."""
    seen: int
    """When the source last made sure of the block [µs UTC]."""
    handles: Sequence[int]
    values: Sequence[Value]
    quality: int = GOOD
    """Quality of all values without one of their own."""
    qualities: Sequence[int] | None = None
    """Quality of each value, when they differ."""
