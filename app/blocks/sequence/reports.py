"""What a sequence tells: events of a scan, what fell first, falls, and the times of its steps."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from app.blocks.sequence.states import Cause, SequenceEvent


class Report(NamedTuple):
    """One event of a scan; `step` is 0 for the abort conditions or the whole sequence."""

    event: SequenceEvent
    step: int = 0
    bit: int = -1
    value: float = 0.0
    together: int = 0
    """How many permissives fell in this scan, where that leaves their order open."""


@dataclass(frozen=True, slots=True)
class FirstOut:
    """What fell first, kept until the sequence is acknowledged or started again."""

    cause: Cause
    step: int
    """Step whose permissive it is; 0 = an abort condition, or none."""
    bit: int
    """-1 = no permissive: the operator, or a maximum that is over although nothing was missing."""
    time: int
    """When it fell [µs]."""
    at_step: int
    """Step that was active."""
    value: float
    """What `values` said of it then."""
    snapshot: tuple[int, ...]
    """All permissive words when it fell, abort conditions first, as the inputs were (forces not counted)."""
    together: int = 1

    def plain(self) -> tuple[Any, ...]:
        """As plain values, to be retained."""
        return int(self.cause), *(getattr(self, each.name) for each in fields(self)[1:])

    @classmethod
    def of(cls, plain: Sequence[Any]) -> "FirstOut":
        """What `plain` said."""
        cause, *rest = plain
        return cls(Cause(cause), *rest)


class Fall(NamedTuple):
    """A permissive that is missing now or was for a while during the active step."""

    step: int
    bit: int
    fell: int
    """[µs]"""
    back: int
    """[µs]; 0 = not yet."""


@dataclass(slots=True)
class StepTimes:
    """What a step took so far: completed passages only."""

    runs: int = 0
    least: float = 0.0
    """[s]"""
    most: float = 0.0
    total: float = 0.0
    last: float = 0.0

    @property
    def mean(self) -> float:
        """[s]; 0 without a run."""
        return self.total / self.runs if self.runs else 0.0

    def add(self, seconds: float) -> None:
        """One more passage."""
        self.least = min(self.least, seconds) if self.runs else seconds
        self.most = max(self.most, seconds)
        self.total += seconds
        self.last = seconds
        self.runs += 1
