"""Counts and times of the runs of a sequence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from app.blocks.sequence import SequenceEvent, SequenceState

OUTCOMES: Mapping[SequenceEvent, int] = MappingProxyType(
    {
        SequenceEvent.DONE: int(SequenceState.DONE),
        SequenceEvent.TIMED_OUT: int(SequenceState.TIMED_OUT),
        SequenceEvent.ABORTED: int(SequenceState.ABORTED),
    }
)
"""Events that end a run → state that it ends in."""


@dataclass(slots=True)
class RunCounts:
    """Retained. Times [s] are of completed runs."""

    done: int = 0
    aborted: int = 0
    timed_out: int = 0
    shortest: float = 0.0
    longest: float = 0.0
    total: float = 0.0
    last: float = 0.0
    """Of the last run, whatever became of it."""
    last_outcome: int = 0
    """State that the last run ended in, 0 = none yet."""
    start: int = 0
    """Start of the run [µs of device time]."""
    lost: dict[int, int] = field(default_factory=dict)
    """Step → bits that were lost in this run."""

    @property
    def mean(self) -> float:
        """Of completed runs [s], 0 = none."""
        return self.total / self.done if self.done else 0.0

    def begin(self, time: int) -> None:
        """A run begins at `time` [µs]."""
        self.start, self.lost = time, {}

    def lose(self, step: int, bit: int) -> None:
        """A permissive of `step` was lost."""
        self.lost[step] = self.lost.get(step, 0) | 1 << bit

    def end(self, event: SequenceEvent, seconds: float) -> None:
        """A run ended by `event` (one of `OUTCOMES`) after `seconds`."""
        self.last_outcome, self.last = OUTCOMES[event], seconds
        if event is SequenceEvent.ABORTED:
            self.aborted += 1
        elif event is SequenceEvent.TIMED_OUT:
            self.timed_out += 1
        else:
            self.shortest = min(self.shortest, seconds) if self.done else seconds
            self.longest = max(self.longest, seconds)
            self.total += seconds
            self.done += 1
