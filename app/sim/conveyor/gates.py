"""What the conveyor's program knows of its diverting gates; what it does with them: `gate_control`."""

from collections.abc import Sequence

from app.blocks.product_tracking import GatePosition
from app.sim.conveyor.blades import GatePlan


class Gate:
    """What the program knows of one gate."""

    def __init__(self, plan: GatePlan) -> None:
        self.plan = plan
        self.position = GatePosition.STRAIGHT
        """By its feedback."""
        self.lane = False
        """What is asked of it: into the lane."""
        self.by_hand = False
        """What an operator asked for last."""
        self.fault = False
        self.held = False
        """Belts wait for it."""
        self.misrouted = 0
        """Products that did not go the way that was decided."""
        self.moving = 0.0
        """For so long it has not been where it is asked to be [s]."""
        self.decided: dict[int, bool] = {}
        """Product → into the lane."""
        self.other = False
        """Which way the last one went of an alternating gate."""

    @property
    def arrived(self) -> bool:
        """It is where it is asked to be."""
        return self.position is (GatePosition.LANE if self.lane else GatePosition.STRAIGHT)


class Gates:
    """All of one line, retained over a power cycle."""

    def __init__(self, plans: Sequence[GatePlan]) -> None:
        self.all = [Gate(plan) for plan in plans]
        self.held_belt = -1
        """Index of the last belt that waits for a gate, those before it wait too; −1 = none."""

    @property
    def wanted(self) -> list[bool]:
        """What is asked of each."""
        return [gate.lane for gate in self.all]

    @property
    def positions(self) -> list[GatePosition]:
        """Where each stands."""
        return [gate.position for gate in self.all]

    def measure(self, open: Sequence[float]) -> None:
        """Read the two feedbacks of each."""
        for gate, part in zip(self.all, open, strict=True):
            gate.position = (
                GatePosition.STRAIGHT if part <= 0.0 else GatePosition.LANE if part >= 1.0 else GatePosition.BETWEEN
            )

    def power_up(self) -> None:
        """Each is to stay where it is."""
        for gate in self.all:
            gate.lane = gate.position is GatePosition.LANE
            gate.fault = gate.held = False
            gate.moving = 0.0
        self.held_belt = -1

    def reset(self) -> None:
        """Each gets its time once more."""
        for gate in self.all:
            gate.moving = 0.0
