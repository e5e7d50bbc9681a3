"""A crane for tests: telegrams to it, its place and load put where a test wants them, its scans counted."""

from collections.abc import Callable

from app.registers.plc_map import AnswerState, real
from app.sim.crane.configuration import AXES
from app.sim.crane.program import VirtualCrane
from app.sim.crane.register_map import CraneCommand
from tests.sim.coil_car.line import Talker

JOGS = {(axis, way): 1 << 2 * n + (way < 0) for n, axis in enumerate(AXES) for way in (1, -1)}
"""(axis, +1 or -1) → request bits."""


class Stand:
    """One crane and a hand on its lever."""

    def __init__(self, **options: object) -> None:
        self.crane = VirtualCrane(**options)  # type: ignore[arg-type]
        self.talker = Talker(self.crane, self.scan)
        self.lever = 0
        self.watch: Callable[[], None] | None = None
        """Called after every scan."""
        self.run(0.5)

    def scan(self) -> None:
        if self.lever and self.crane.steps % 10 == 0:
            self.talker.hold(self.lever)
        self.crane.step()
        if self.watch:
            self.watch()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self.scan()

    def until(self, met: Callable[[], bool], within: float = 100.0) -> None:
        """Until `met`, else the test fails."""
        for _ in range(round(within * 100)):
            if met():
                return
            self.scan()
        raise AssertionError(f"not within {within:g} s: state {self.crane.state}, {self.crane.cycle}")

    def ask(self, command: CraneCommand, *arguments: int) -> AnswerState:
        return self.talker.ask(command, *arguments).state

    def reason(self, command: CraneCommand, *arguments: int) -> int:
        answer = self.talker.ask(command, *arguments)
        assert answer.state is AnswerState.REJECTED, answer
        return answer.reason

    def cycle(self, start: int = 1, end: int = 2, planned: float = 210.0) -> None:
        """Begin a cycle in automatic."""
        assert self.ask(CraneCommand.AUTOMATIC) is AnswerState.DONE
        assert self.ask(CraneCommand.START_CYCLE, start, end, real(planned)) is AnswerState.DONE

    def jog(self, axis: str, way: int) -> None:
        self.lever = JOGS[axis, way]

    def release(self) -> None:
        """Let go, and wait until everything stands."""
        self.lever = 0
        self.talker.hold(0)
        self.run(0.4)
        self.until(lambda: not self.crane.moving, 20)

    def put(self, axis: str, position: float) -> None:
        """Move the mechanics of an axis that stands."""
        self.crane.axes[axis].axis.position = position
        self.run(0.3)
