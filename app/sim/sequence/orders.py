"""The commands that the steps of a sequence give to other machines: given when a step is entered, taken back when it stops.

Who gives them is handed in: here nobody knows gates or telegrams. What a run set in motion stands still while the run is suspended
(unless its outputs stay on) and goes on with it; it is stopped when the run is aborted or timed out. A run that is done leaves things as
its last step wants them.
"""

from collections.abc import Callable, Mapping, Sequence
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
        self.values: Callable[[], Mapping[str, float]] = dict
        """The values of the run, by key."""
        self.any = any(self._orders)
        """Whether a step commands anything."""
        self.desk: Callable[[], Desk | None] = lambda: None
        self._given: dict[int, Given] = {}
        """Active step → its commands."""
        self._former: dict[int, Given] = {}
        """Step that was left → the commands of its last passage: a machine may lose them yet."""
        self._again: Given | None = None
        """What goes on after a suspension, of earlier steps."""
        self._at: dict[int, int] = {}
        """Active step → the passage in which its commands were given."""
        self._off = self._safe = False
        """The outputs are off: what was commanded stands; the safe steps are done."""

    @property
    def pending(self) -> frozenset[int]:
        """Active steps whose commands are not confirmed yet."""
        again = self._at if self._again is not None and self._again.pending else ()
        return frozenset((*again, *(step for step, given in self._given.items() if given.pending)))

    @property
    def refused(self) -> dict[int, int]:
        """Step → number of its first command that was refused or not confirmed."""
        found = {step: given.refused for step, given in self._given.items() if given.refused}
        others = (*self._former.values(), *((self._again,) if self._again is not None else ()))
        if self._at and any(given.refused for given in others):
            step = min(self._at)
            found.setdefault(step, len(self._orders[step - 1]) + 1)
        return found

    def follow(self, run: SequenceBlock) -> None:
        """Give what the steps want that the scan has just entered, or stop what a run set in motion that goes on no more."""
        if not self.any:
            return
        if not run.running:
            self._end(run.state)
            return
        if run.safe and not self._safe:
            self._safe, self._off, self._given, self._former, self._again = True, False, {}, {}, None
            if self._at and (desk := self.desk()):
                desk.stop()
        if not run.output(run.step):
            self._switch_off()
            return
        if self._off:
            self._off, desk = False, self.desk()
            self._again = desk.resume() if desk else None
        self._former |= {step: given for step, given in self._given.items() if step not in run.active}
        self._given = {step: given for step, given in self._given.items() if step in run.active}
        entered = [step for step in run.active if self._at.get(step) != run.passage(step)]
        self._at = {step: run.passage(step) for step in run.active}
        for step in entered:
            self._take(step)

    def withdraw(self) -> None:
        """This sequence is no more: what its run set in motion is stopped."""
        self._end(SequenceState.ABORTED)

    def _take(self, step: int) -> None:
        self._given.pop(step, None)
        if orders := [order.given(self.values()) for order in self._orders[step - 1]]:
            desk = self.desk()
            self._given[step] = desk.give(orders) if desk else _Refused()

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
        self._at, self._off, self._safe, self._given, self._former, self._again = {}, False, False, {}, {}, None
