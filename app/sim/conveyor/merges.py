"""What the conveyor's program knows of its merging gates; what it does with them: `merge_control`."""

from collections.abc import Sequence
from enum import IntEnum

from app.sim.conveyor.lanes import MergePlan


class MergeState(IntEnum):
    """State word of a merging gate."""

    FREE = 0
    """Nobody waits in the lane."""
    WAITING = 1
    MERGING = 2
    BLOCKED = 3
    """Its product has waited for too long."""


class GateOrder(IntEnum):
    """What an operator has it do."""

    AUTOMATIC = 0
    OPEN = 1
    """Into any gap, whoever's turn it is, by hand too."""
    CLOSED = 2


class Merge:
    """What the program knows of one merging gate."""

    def __init__(self, plan: MergePlan) -> None:
        self.plan = plan
        self.order = GateOrder.AUTOMATIC
        self.present = False
        """Something is in the lane."""
        self.length = 0.0
        """Of what stands at its stop [mm]; 0 = nobody does."""
        self.started = 0
        """Count of those that began to go in, as last seen."""
        self.open = False
        """Its stop is to let a product go."""
        self.merging = False
        """A part of one is still in the lane."""
        self.waited = 0.0
        """For so long the one at the stop has waited while the line ran [s]."""
        self.blocked = False
        self.turn = False
        """It is the lane's turn."""
        self.passing = 0
        """Product of the line that comes next, 0 = none was seen."""
        self.holds = -1
        """Index of the last belt that waits for the lane, those before it wait too; −1 = none."""

    @property
    def state(self) -> MergeState:
        """Its state word."""
        if self.blocked:
            return MergeState.BLOCKED
        if self.merging:
            return MergeState.MERGING
        return MergeState.WAITING if self.present else MergeState.FREE


class Merges:
    """All of one line, retained over a power cycle."""

    def __init__(self, plans: Sequence[MergePlan]) -> None:
        self.all = [Merge(plan) for plan in plans]

    @property
    def open(self) -> list[bool]:
        """What is asked of each stop."""
        return [merge.open for merge in self.all]

    @property
    def held_belt(self) -> int:
        """Index of the last belt that waits for a lane; −1 = none."""
        return max((merge.holds for merge in self.all), default=-1)

    def power_up(self, started: Sequence[int]) -> None:
        """Each stop is closed, and waits anew."""
        for merge, count in zip(self.all, started, strict=True):
            merge.open = merge.blocked = merge.merging = False
            merge.waited, merge.holds, merge.started = 0.0, -1, count
