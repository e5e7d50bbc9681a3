"""What the commands of a sequence do, and why one is refused."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

from app.blocks.sequence import (
    ABORT,
    BITS,
    ForceRefused,
    Report,
    SequenceBlock,
    SequenceEvent,
    SequenceState,
)
from app.registers.plc_map import AnswerState, Request, long_words, real, real_of
from app.sim.plc import Verdict
from app.sim.plc import rejected as no
from app.sim.sequence.forces import ForceRows
from app.sim.sequence.operator import OperatorRequests
from app.sim.sequence.orders import StepOrders
from app.sim.sequence.permissives import Permissives
from app.sim.sequence.recipe import Recipe
from app.sim.sequence.register_map import (
    LONGEST,
    NO_BIT,
    SequenceCommand,
    SequenceDeviceEvent,
    SequenceReason,
)


class Device(Protocol):
    """What commands use of the PLC that takes them."""

    dt: float
    orders: StepOrders

    @property
    def time(self) -> int:
        """Device time [µs]."""
        ...

    def event(self, code: int, source: int = 0, value: float = 0.0, snapshot: Sequence[int] = ()) -> None:
        """Put an event into the ring."""
        ...

    def tell(self, report: Report) -> None:
        """Put what the block reports into the ring."""
        ...


REASON_OF: Mapping[str, SequenceReason] = MappingProxyType(
    {"forbidden": SequenceReason.FORBIDDEN, "duration": SequenceReason.DURATION}
)
RECIPE_EVENTS = (
    SequenceDeviceEvent.RECIPE_1,
    SequenceDeviceEvent.RECIPE_2,
    SequenceDeviceEvent.RECIPE_3,
    SequenceDeviceEvent.RECIPE_4,
)
CAUSED: Mapping[int, tuple[int, ...]] = MappingProxyType(
    {
        SequenceCommand.START: (SequenceEvent.STARTED, SequenceEvent.START_REFUSED, *RECIPE_EVENTS),
        SequenceCommand.SUSPEND: (SequenceEvent.SUSPENDED,),
        SequenceCommand.RESUME: (SequenceEvent.RESUMED,),
        SequenceCommand.ABORT: (SequenceEvent.ABORTED, SequenceEvent.ABORTING),
        SequenceCommand.ACKNOWLEDGE: (SequenceEvent.ACKNOWLEDGED,),
        SequenceCommand.ADVANCE: (SequenceEvent.STEP_ENDED,),
    }
)
"""Events of the scan that takes a command and that the block tells after it."""


class SequenceCommands:
    """Takes commands for one `block`, from its power-up on."""

    def __init__(
        self,
        block: SequenceBlock,
        permissives: Permissives,
        operator: OperatorRequests,
        forces: ForceRows,
        recipe: Recipe,
        device: Device,
    ) -> None:
        """Over the parts of the PLC that it commands."""
        self._block, self._permissives, self._operator = block, permissives, operator
        self._forces, self._recipe, self._device = forces, recipe, device
        self._table: Mapping[int, Callable[[Request], Verdict]] = {
            SequenceCommand.START: self._start,
            SequenceCommand.SUSPEND: lambda _: self._suspend(),
            SequenceCommand.RESUME: lambda _: self._resume(),
            SequenceCommand.ABORT: lambda _: self._abort(),
            SequenceCommand.ACKNOWLEDGE: lambda _: self._acknowledge(),
            SequenceCommand.SINGLE_ON: lambda _: self._set_single(True),
            SequenceCommand.SINGLE_OFF: lambda _: self._set_single(False),
            SequenceCommand.ADVANCE: lambda _: self._advance(),
            SequenceCommand.AUTOMATIC_ON: lambda _: self._set_automatic(True),
            SequenceCommand.AUTOMATIC_OFF: lambda _: self._set_automatic(False),
            SequenceCommand.SET_TIMES: self._set_times,
            SequenceCommand.FORCE: self._force,
            SequenceCommand.RELEASE: lambda request: self._release(request.arguments[0], request.arguments[1]),
            SequenceCommand.RELEASE_ALL: lambda _: self._release_all(),
        }

    def execute(self, request: Request) -> Verdict:
        """Do what `request` asks, or say why not."""
        command = self._table.get(request.code)
        return command(request) if command else no(SequenceReason.UNKNOWN)

    @property
    def start_possible(self) -> bool:
        """Whether a start would be taken now."""
        return self._start_refusal() is None

    def keep_forces(self) -> None:
        """Free the rows of forces that are over."""
        self._forces.keep({step * BITS + bit + 1 for step, bit in self._block.forces})

    def _missing(self, number: int) -> int:
        return self._permissives.missing(number, self._block.forces.bits(number))

    def _start_refusal(self) -> Verdict | None:
        run = self._block
        if run.running:
            return no(SequenceReason.WRONG_STATE, run.state)
        if run.needs_acknowledge:
            return no(SequenceReason.NEEDS_ACKNOWLEDGE)
        if self._permissives.machine_manual:
            return no(SequenceReason.MACHINE)
        for number in (ABORT, 1):
            if (bit := self._missing(number)) >= 0:
                return no(SequenceReason.MISSING, number * BITS + bit)
        return None

    def _start(self, request: Request) -> Verdict:
        if self._block.running:
            return no(SequenceReason.WRONG_STATE, self._block.state)
        if number := self._recipe.outside(request.arguments):
            return no(SequenceReason.RECIPE, number)
        before = self._recipe.values
        self._recipe.take(request.arguments)  # the permissives of the first step may ask for them
        if refusal := self._start_refusal():
            self._recipe.put(before)
            return refusal
        self._recipe.apply(self._block)
        self._operator.ask("start")
        return _proved(lambda: self._block.running)

    def _suspend(self) -> Verdict:
        self._operator.suspended = self._block.running or self._operator.start_asked
        return Verdict()

    def _resume(self) -> Verdict:
        if self._block.state is not SequenceState.SUSPENDED:
            return no(SequenceReason.NOT_SUSPENDED, self._block.state)
        self._operator.suspended = False
        return Verdict()

    def _abort(self) -> Verdict:
        if not self._block.running:
            return no(SequenceReason.WRONG_STATE, self._block.state)
        self._operator.ask("abort")
        safe = self._block.safe
        return _proved(lambda: not self._block.running or (self._block.safe and not safe))

    def _acknowledge(self) -> Verdict:
        if self._block.running:
            return no(SequenceReason.WRONG_STATE, self._block.state)
        self._operator.ask("acknowledge")
        return _proved(lambda: not self._block.needs_acknowledge)

    def _set_single(self, on: bool) -> Verdict:
        if self._operator.single is not on:
            self._operator.single = on
            code = SequenceDeviceEvent.SINGLE_ON if on else SequenceDeviceEvent.SINGLE_OFF
            self._device.event(code, self._block.step)
        return Verdict()

    def _set_automatic(self, on: bool) -> Verdict:
        if self._operator.automatic is not on:
            self._operator.automatic = on
            self._device.event(SequenceDeviceEvent.AUTOMATIC_ON if on else SequenceDeviceEvent.AUTOMATIC_OFF)
        return Verdict()

    def _advance(self) -> Verdict:
        run = self._block
        if not self._operator.single:
            return no(SequenceReason.NOT_SINGLE)
        if run.state is not SequenceState.RUNNING:
            return no(SequenceReason.WRONG_STATE, run.state)
        refusals = [self._cannot_leave(step) for step in run.active]
        if None not in refusals:
            missing = (one for one in refusals if one and one.reason == SequenceReason.MISSING)
            return next(missing, None) or no(SequenceReason.WRONG_STATE, run.state)
        passages = {step: run.passage(step) for step in run.active}
        self._operator.ask("advance")
        return _proved(lambda: {step: run.passage(step) for step in run.active} != passages or not run.running)

    def _cannot_leave(self, step: int) -> Verdict | None:
        """Why an advance would not let `step`, and what is left with it, go on; None = it would."""
        run = self._block
        following, beside = run.following(step), run.left_with(step)
        if any(each not in run.active or not run.left_with(each) for each in beside):
            return no(SequenceReason.WRONG_STATE, run.state)  # it waits for the other paths
        if not any(all(self._missing(each) < 0 for each in steps) for steps in following):
            first = next(each for each in following[0] if self._missing(each) >= 0)
            return no(SequenceReason.MISSING, first * BITS + self._missing(first))
        if not all(self._through(each) for each in beside or (step,)):
            return no(SequenceReason.WRONG_STATE, run.state)
        return None

    def _through(self, step: int) -> bool:
        """Whether `step` has had its least time in the next scan and its orders are confirmed."""
        run, times = self._block, self._block.settings.step(step)
        due = times.maximum > 0 and run.elapsed(step) + self._device.dt >= times.minimum - 1e-6
        return due and step not in self._device.orders.pending

    def _set_times(self, request: Request) -> Verdict:
        step, override = request.arguments[0], request.arguments[3]
        minimum, maximum = real_of(request.arguments[1]), real_of(request.arguments[2])
        if not 1 <= step <= self._permissives.steps:
            return no(SequenceReason.NO_SUCH_STEP, step)
        if not (0 <= minimum <= LONGEST and 0 <= maximum <= LONGEST) or (maximum and maximum < minimum):
            return no(SequenceReason.TIMES, step)
        given = (("minimum", minimum), ("maximum", maximum))
        if any(
            (own := self._recipe.time(step, which)) is not None and abs(own - asked) > 1e-3 for which, asked in given
        ):
            return no(SequenceReason.OF_RECIPE, step)
        if self._block.running and override != 1:
            return no(SequenceReason.LOCKED, step)
        self._block.set_times(step, minimum, maximum)
        snapshot = (NO_BIT, 0, 0, 0, *long_words(real(minimum)))
        self._device.event(SequenceDeviceEvent.TIMES_CHANGED, step, maximum, snapshot)
        return Verdict(detail=step)

    def _force(self, request: Request) -> Verdict:
        step, bit = request.arguments[0], request.arguments[1]
        if not 0 <= step <= self._permissives.steps:
            return no(SequenceReason.NO_SUCH_STEP, step)
        if not 0 <= bit < BITS or not self._permissives.named(step, bit):
            return no(SequenceReason.NO_SUCH_BIT, bit)
        seconds, id = real_of(request.arguments[2]), step * BITS + bit + 1
        if (step, bit) not in self._block.forces and self._forces.full:
            return no(SequenceReason.NO_PLACE)
        try:
            report = self._block.force(step, bit, seconds, self._device.time)
        except ForceRefused as refusal:
            return no(REASON_OF[refusal.reason], id - 1)
        self._forces.take(id, seconds, request.owner)
        self._device.tell(report)
        return Verdict(detail=id - 1)

    def _release(self, step: int, bit: int) -> Verdict:
        if not 0 <= step <= self._permissives.steps:
            return no(SequenceReason.NO_SUCH_STEP, step)
        if not 0 <= bit < BITS:
            return no(SequenceReason.NO_SUCH_BIT, bit)
        report = self._block.forces.release(step, bit)
        if report is None:
            return no(SequenceReason.NOT_FORCED, step * BITS + bit)
        self._device.tell(report)
        self.keep_forces()
        return Verdict(detail=step * BITS + bit)

    def _release_all(self) -> Verdict:
        places = list(self._block.forces)
        for step, bit in places:
            self._release(step, bit)
        return Verdict(detail=len(places))


def _proved(holds: Callable[[], bool]) -> Verdict:
    """Running until the scan that follows has shown whether it happened."""
    return Verdict(AnswerState.RUNNING, until=lambda: AnswerState.DONE if holds() else AnswerState.FAILED)
