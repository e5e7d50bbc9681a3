"""What a machine's day is told in: figures that its type declares (today.toml), in the order in which they are shown."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class How(StrEnum):
    """How a figure comes out of what was recorded."""

    TIME = "time"
    """How long the point `of` was true."""
    COUNT = "count"
    """By how much the counter `of` went up; that it was set back, or began again at nought, takes nothing away."""
    ENERGY = "energy"
    """What the power `of` [kW] amounts to."""
    MEAN = "mean"
    """What those of its records `record` took that ended with `outcome`."""


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of a machine's day."""

    name: str
    how: How
    of: str = ""
    record: str = ""
    outcome: str = ""


Figures = Mapping[str, Figure]
"""By name."""
