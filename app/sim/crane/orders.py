"""Who orders the crane while nobody else does: a simulated foreman, who also reads the scale."""

from typing import Protocol

from app.sim.crane.configuration import STANDS
from app.sim.crane.ladle import Load
from app.sim.crane.register_map import Mode, StepState
from app.sim.crane.sequence import Cycle
from app.sim.plc import Verdict

READS = 4.0
"""How long he reads [s]."""
FIRST = 3.0
"""Until his first order after the crane was switched on for the first time, at most [s]."""


class Crane(Protocol):
    """What he sees and does."""

    mode: Mode
    load: Load
    weight: float

    @property
    def cycle(self) -> Cycle: ...
    def order(self, start: int, end: int, planned: float) -> Verdict: ...
    def confirm_weight(self, weight: float) -> Verdict: ...


class Orders:
    """Orders a cycle from where the ladle stands to the next stand, `pause` [s] after the last one, in automatic."""

    def __init__(self, crane: Crane, *, active: bool, pause: float) -> None:
        self._crane = crane
        self._given = (active, pause)
        self.reset()

    def reset(self) -> None:
        """As switched on for the first time."""
        self.active, self.pause = self._given
        self._waited = max(0.0, self.pause - FIRST)

    def step(self, dt: float) -> None:
        """`dt` [s] pass."""
        crane, cycle = self._crane, self._crane.cycle
        waits = cycle.state is StepState.WAITING
        if not self.active or crane.mode is not Mode.AUTOMATIC or (cycle.open and not waits):
            self._waited = 0.0
            return
        self._waited += dt
        if waits and self._waited >= READS:
            crane.confirm_weight(crane.weight)
            self._waited = 0.0
        elif not waits and crane.load.stand and self._waited >= self.pause:
            crane.order(crane.load.stand, crane.load.stand % STANDS + 1, round(crane.load.weight, 1))
            self._waited = 0.0
