"""The commands that the steps of a sequence give to other machines: given when a step is entered, taken back when it stops.

Who gives them is handed in: here nobody knows gates or telegrams. What a run set in motion is stopped when the run is suspended (unless
its outputs stay on), aborted or timed out; after a resume each machine gets its last command again. A run that is done leaves things as
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
    """Who carries the commands of one sequence to the machines."""

    def give(self, orders: Sequence[SequenceOrder]) -> Given:
        """Give `orders`: those of one machine one after the other, machines side by side."""
        ...

    def stop(self, machines: Sequence[str]) -> None:
        """Give up what is under way, and stop `machines`."""
        ...

    def leave(self, machines: Sequence[str]) -> None:
        """The run is over: `machines` go on as they are and are anybody's."""
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
        self._commanded: dict[str, tuple[SequenceOrder, ...]] = {}
        """Machine → what it was given last in this run."""
        self._at = 0
        """Step whose commands were given; 0 = none."""
        self._off = False
        """The outputs are off: what was commanded stands."""

    @property
    def pending(self) -> bool:
        """Whether commands of the active step are not confirmed yet."""
        return self._given is not None and self._given.pending

    @property
    def refused(self) -> int:
        """Number of the first command of the active step that was refused or not confirmed; 0 = none."""
        return self._given.refused if self._given is not None else 0

    def follow(self, run: SequenceBlock) -> None:
        """Give what the step wants that the scan has just entered, or stop what a run set in motion that goes on no more."""
        if not self.any:
            return
        if not run.running:
            self._end(run.state)
        elif not run.output(run.step):
            self._switch_off()
        elif self._at != run.step:
            self._at = run.step
            self._take(self._orders[run.step - 1])
        elif self._off:
            self._take([order for orders in self._commanded.values() for order in orders])

    def withdraw(self) -> None:
        """This sequence is no more: what its run set in motion is stopped."""
        self._end(SequenceState.ABORTED)

    def _take(self, orders: Sequence[SequenceOrder]) -> None:
        again = [order for held in self._commanded.values() for order in held] if self._off else []
        self._off = False
        named = {order.machine for order in orders}
        orders = [*orders, *(order for order in again if order.machine not in named)]
        for machine in dict.fromkeys(order.machine for order in orders):
            self._commanded[machine] = tuple(order for order in orders if order.machine == machine)
        desk = self.desk()
        self._given = (desk.give(orders) if desk else _Refused()) if orders else None

    def _switch_off(self) -> None:
        if self._off:
            return
        self._off, self._given = True, None
        if (desk := self.desk()) and self._commanded:
            desk.stop(list(self._commanded))

    def _end(self, state: SequenceState) -> None:
        if not self._at:
            return
        if (desk := self.desk()) and self._commanded:
            machines = list(self._commanded)
            if state is not SequenceState.DONE and not self._off:
                desk.stop(machines)
            desk.leave(machines)
        self._at, self._off, self._given, self._commanded = 0, False, None, {}
