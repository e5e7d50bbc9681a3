"""The commands that the steps of a sequence give to other machines: given when a step is entered, taken back when it stops.

Who gives them is handed in: here nobody knows gates or telegrams. What a run set in motion stands still while the run is suspended
(unless its outputs stay on) and goes on with it; it is stopped when the run is aborted or timed out. A run that is done leaves things as
its last step wants them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from app.blocks.sequence import SequenceBlock, SequenceState
from app.plant.sequence_definition import SequenceDefinition, SequenceOrder


class Given(Protocol):
    """Commands under way."""

    @property
    def pending(self) -> bool:
        """Whether some are not confirmed yet."""
        ...

    @property
    def refused(self) -> int:
        """Number, from 1, of the first that was refused or not confirmed; 0 = none."""
        ...


class Desk(Protocol):
    """Who carries the commands of one sequence to the machines, and knows what the run has them do."""

    def give(self, orders: Sequence[SequenceOrder]) -> Given:
        """Give `orders`: those of one machine one after the other, machines side by side."""
        ...

    def suspend(self) -> None:
        """Give up what is under way, and have everything that this run commanded stand still."""
        ...

    def resume(self) -> Given:
        """What stood still goes on; the orders of earlier steps that are given again for it."""
        ...

    def stop(self) -> None:
        """Give up what is under way, and stop everything that this run commanded."""
        ...

    def leave(self) -> None:
        """The run is over: its machines go on as they are and are anybody's."""
        ...


@dataclass(slots=True)
class _Refused:
    """What becomes of commands where nobody carries them."""

    pending: bool = False
    refused: int = 1


class StepOrders:
    """Follows the block of one sequence and gives what its steps command."""

    def __init__(self, definition: SequenceDefinition) -> None:
        self._orders = tuple(tuple(step.orders) for step in definition.steps)
        self.any = any(self._orders)
        """Whether a step commands anything."""
        self.desk: Callable[[], Desk | None] = lambda: None
        self._given: Given | None = None
        self._again: Given | None = None
        """What goes on after a suspension, of earlier steps."""
        self._at = 0
        """Step whose commands were given; 0 = none."""
        self._off = False
        """The outputs are off: what was commanded stands."""

    @property
    def pending(self) -> bool:
        """Whether commands of the active step are not confirmed yet."""
        return any(given is not None and given.pending for given in (self._given, self._again))

    @property
    def refused(self) -> int:
        """Number of the first command of the active step that was refused or not confirmed; 0 = none."""
        return next((given.refused for given in (self._given, self._again) if given is not None and given.refused), 0)

    def follow(self, run: SequenceBlock) -> None:
        """Give what the step wants that the scan has just entered, or stop what a run set in motion that goes on no more."""
        if not self.any:
            return
        if not run.running:
            self._end(run.state)
            return
        if not run.output(run.step):
            self._switch_off()
            return
        if self._off:
            self._off, desk = False, self.desk()
            self._again = desk.resume() if desk else None
        if self._at != run.step:
            self._at = run.step
            self._take(self._orders[run.step - 1])

    def withdraw(self) -> None:
        """This sequence is no more: what its run set in motion is stopped."""
        self._end(SequenceState.ABORTED)

    def _take(self, orders: Sequence[SequenceOrder]) -> None:
        desk = self.desk()
        self._given = (desk.give(orders) if desk else _Refused()) if orders else None

    def _switch_off(self) -> None:
        if self._off:
            return
        self._off, self._again = True, None
        if desk := self.desk():
            desk.suspend()

    def _end(self, state: SequenceState) -> None:
        if not self._at:
            return
        if desk := self.desk():
            if state is not SequenceState.DONE:
                desk.stop()
            desk.leave()
        self._at, self._off, self._given, self._again = 0, False, None, None
