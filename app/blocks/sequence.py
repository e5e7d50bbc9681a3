"""The sequence block: steps one after the other, each entered when its 16 permissives are there and its predecessor has had its time.

Source: thesis 001 (reference/theses-facts.md section 1); its block has 8 steps, this one any number. What the source leaves open:

| subject | decided |
| --- | --- |
| abort conditions | a word of permissives like those of the steps: 1 = healthy; the sequence aborts when one is missing |
| step time beyond the maximum | times out, but in the first scan beyond it the next step is entered if it can be |
| maximum 0 | the step stays until a maximum is entered, whatever else is fulfilled; a maximum below the time that has passed times out |
| suspended | time and transitions stand still; abort conditions and the operator's abort act, a lost permissive after the resume |
| start after an abort or a time-out | only after an acknowledge; one that is held all the time does not start again: a rising edge does |
| start while something is missing | nothing happens, and an event says so |
| stall | the minimum is over, the maximum is not 0, and the next step has missed permissives for `stall_after` |
| first-out of a stall or a time-out | the permissive missing then that fell first; one never seen fulfilled fell at the first scan |
| several in one scan | the lowest bit; the event says how many fell together, forced ones not counted |
| abort condition and the operator's abort in one scan | the abort condition is the cause |
| force | sets a permissive, never clears one; released by the block when its time is over |

No clock: time is what the caller says, in integer microseconds, and it is the device's own.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, NamedTuple

ALL = 0xFFFF
BITS = 16
ABORT = 0
"""Number of the word of abort conditions where a step number is expected."""


class SequenceState(IntEnum):
    """What the whole sequence does."""

    IDLE = 0
    RUNNING = 1
    SUSPENDED = 2
    DONE = 3
    TIMED_OUT = 4
    ABORTED = 5


class StepState(IntEnum):
    """What one step does."""

    IDLE = 0
    ACTIVE = 1
    SUSPENDED = 2
    DONE = 3
    TIMED_OUT = 4
    ABORTED = 5
    STALLED = 6
    """Active, and the next step cannot be entered."""


class SequenceEvent(IntEnum):
    """What a scan reports."""

    STARTED = 1
    START_REFUSED = 2
    STEP_ENTERED = 3
    STEP_ENDED = 4
    """Value: how long it was active [s]."""
    SUSPENDED = 5
    RESUMED = 6
    STALLED = 7
    STALL_OVER = 8
    PERMISSIVE_LOST = 9
    """Of the active step, of the next one or of the abort conditions, while the sequence runs."""
    PERMISSIVE_BACK = 10
    TIMED_OUT = 11
    ABORTED = 12
    DONE = 13
    """Value: how long the sequence ran, suspended time included [s]."""
    ACKNOWLEDGED = 14
    FORCED = 15
    """Value: for how long [s]."""
    RELEASED = 16
    """A force ended; value 1: its time was over, 0: a person released it, 2: the device was started."""


class Cause(IntEnum):
    """Why a sequence stopped before its end."""

    NONE = 0
    ABORT_CONDITION = 1
    PERMISSIVE_LOST = 2
    OPERATOR = 3
    TIME = 4
    STALL = 5
    POWER_UP = 6


@dataclass(frozen=True, slots=True)
class StepSettings:
    """Times of a step and what its permissives may do."""

    minimum: float = 0.0
    """[s]"""
    maximum: float = 0.0
    """[s]; 0 = stay."""
    loss_aborts: bool = False
    """Whether a permissive that is lost while the step is active aborts; else they only count for entering it."""
    forceable: int = ALL
    """Permissives that may be forced."""

    def __post_init__(self) -> None:
        for name in ("minimum", "maximum"):
            value = getattr(self, name)
            if not 0 <= value < float("inf"):
                raise ValueError(f"{name} = {value}: expected seconds from 0 up")
        if not 0 <= self.forceable <= ALL:
            raise ValueError(f"forceable = {self.forceable}: expected 16 bits")


@dataclass(frozen=True, slots=True)
class SequenceSettings:
    """Everything of a sequence that is not a signal."""

    steps: Sequence[StepSettings]
    abort_forceable: int = 0
    """Abort conditions that may be forced."""
    output_while_suspended: bool = False
    stall_after: float = 1.0
    """[s]"""
    longest_force: float = 8 * 3600.0
    """[s]"""
    keep_forces: bool = False
    """Whether forces outlive a restart of the device; else they are gone then."""

    def __post_init__(self) -> None:
        if not self.steps:
            raise ValueError("steps = 0: expected at least one")

    def step(self, number: int) -> StepSettings:
        """The settings of step `number`, from 1."""
        return self.steps[number - 1]


@dataclass(slots=True)
class Signals:
    """Inputs of one scan."""

    permissives: Sequence[int]
    """16 bits per step."""
    abort: int = ALL
    """Abort conditions; 1 = healthy."""
    start: bool = False
    suspend: bool = False
    abort_request: bool = False
    acknowledge: bool = False
    single: bool = False
    """Single step: a step is left only on a rising edge of `advance`."""
    advance: bool = False


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


class Fall(NamedTuple):
    """A permissive that is missing now or was for a while during the active step."""

    step: int
    bit: int
    fell: int
    """[µs]"""
    back: int
    """[µs]; 0 = not yet."""


@dataclass(frozen=True, slots=True)
class Force:
    """One forced permissive."""

    step: int
    bit: int
    until: int
    """[µs]"""


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


class ForceRefused(ValueError):
    """A permissive cannot be forced: `reason` is `unknown`, `forbidden` or `duration`."""

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


Values = Callable[[int, int], float]
"""(step, bit) → the analog value behind a permissive, for the first-out."""


@dataclass(slots=True)
class _Snapshot:
    time: int
    words: tuple[int, ...]
    value: float
    together: int


FALLS_KEPT = 64
"""Short losses remembered per step."""


class SequenceBlock:
    """One sequence. `scan` is called once per cycle of the device."""

    def __init__(self, settings: SequenceSettings, values: Values = lambda step, bit: 0.0) -> None:
        self.settings = settings
        self.state = SequenceState.IDLE
        self.step = 0
        """Active step; the one it stopped in after an abort or a time-out; 0 = none."""
        self.first_out: FirstOut | None = None
        self.falls: list[Fall] = []
        """What was lost during the active step, oldest first."""
        self.forces: dict[tuple[int, int], Force] = {}
        self.times = [StepTimes() for _ in settings.steps]
        self.stalled = False
        self.needs_acknowledge = False
        self._values = values
        self._elapsed = [0] * (len(settings.steps) + 1)
        self._run = 0
        self._missing_for = 0
        self._inputs: tuple[int, ...] = ()
        self._fell: dict[tuple[int, int], _Snapshot] = {}
        self._start = self._acknowledge = self._abort = self._advance = True
        self._states = [StepState.IDLE] * (len(settings.steps) + 1)

    # ---- what others look at --------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether a step is active, suspended or not."""
        return self.state in (SequenceState.RUNNING, SequenceState.SUSPENDED)

    def step_state(self, number: int) -> StepState:
        """State of step `number`, from 1."""
        if self.running and number == self.step:
            if self.state is SequenceState.SUSPENDED:
                return StepState.SUSPENDED
            return StepState.STALLED if self.stalled else StepState.ACTIVE
        return self._states[number]

    def output(self, number: int) -> bool:
        """Output of step `number`."""
        if number != self.step:
            return False
        return self.state is SequenceState.RUNNING or (
            self.state is SequenceState.SUSPENDED and self.settings.output_while_suspended
        )

    def elapsed(self, number: int) -> float:
        """How long step `number` was active in this run [s], suspended time not counted."""
        return self._elapsed[number] / 1e6

    @property
    def run_time(self) -> float:
        """Time since the start of this run [s], suspended time included; after its end its length."""
        return self._run / 1e6

    def word(self, number: int) -> int:
        """Permissives of step `number` (0 = abort conditions) as they count: inputs and forces."""
        return (self._inputs[number] if self._inputs else 0) | self.forced(number)

    def forced(self, number: int) -> int:
        """Forced bits of step `number` (0 = abort conditions)."""
        return sum(1 << force.bit for force in self.forces.values() if force.step == number)

    def ready(self, number: int) -> bool:
        """Whether every permissive of step `number` (0 = abort conditions) is there."""
        return self.word(number) == ALL

    def remaining(self, step: int, bit: int, now: int) -> float:
        """How long a force still holds [s]; 0 = not forced."""
        force = self.forces.get((step, bit))
        return max(0.0, (force.until - now) / 1e6) if force else 0.0

    # ---- what people do -------------------------------------------------------------------------------

    def set_times(self, number: int, minimum: float, maximum: float) -> None:
        """New times of step `number` [s]; they act from the next scan on.

        Raises:
            ValueError: no such step, or no times.
        """
        if not 1 <= number <= len(self.settings.steps):
            raise ValueError(f"step {number}: expected 1 to {len(self.settings.steps)}")
        steps = list(self.settings.steps)
        steps[number - 1] = replace(steps[number - 1], minimum=minimum, maximum=maximum)
        self.settings = replace(self.settings, steps=tuple(steps))

    def force(self, step: int, bit: int, seconds: float, now: int) -> Report:
        """Set permissive `bit` of `step` (0 = abort conditions) for `seconds`; a second time changes how long.

        Raises:
            ForceRefused: no such permissive, one that may not be forced, no such duration.
        """
        if not (0 <= step <= len(self.settings.steps) and 0 <= bit < BITS):
            raise ForceRefused("unknown", f"step {step} bit {bit}: no such permissive")
        allowed = self.settings.step(step).forceable if step else self.settings.abort_forceable
        if not allowed >> bit & 1:
            raise ForceRefused("forbidden", f"step {step} bit {bit}: may not be forced")
        if not 0 < seconds <= self.settings.longest_force:
            raise ForceRefused(
                "duration", f"{seconds} s: expected more than 0, at most {self.settings.longest_force:g}"
            )
        self.forces[step, bit] = Force(step, bit, now + round(seconds * 1e6))
        return Report(SequenceEvent.FORCED, step, bit, seconds)

    def release(self, step: int, bit: int) -> Report | None:
        """End a force; None when there was none."""
        if self.forces.pop((step, bit), None) is None:
            return None
        return Report(SequenceEvent.RELEASED, step, bit, 0.0)

    # ---- a scan ---------------------------------------------------------------------------------------

    def scan(self, signals: Signals, dt: float, now: int) -> list[Report]:
        """One cycle of `dt` [s] that ends at `now` [µs].

        Raises:
            ValueError: not as many permissive words as steps.
        """
        if len(signals.permissives) != len(self.settings.steps):
            raise ValueError(f"{len(signals.permissives)} permissive words: expected {len(self.settings.steps)}")
        reports: list[Report] = []
        passed = round(dt * 1e6)
        self._expire(now, reports)
        self._follow((signals.abort & ALL, *(word & ALL for word in signals.permissives)), now, reports)
        start, self._start = signals.start and not self._start, signals.start
        acknowledge, self._acknowledge = signals.acknowledge and not self._acknowledge, signals.acknowledge
        abort, self._abort = signals.abort_request and not self._abort, signals.abort_request
        advance, self._advance = signals.advance and not self._advance, signals.advance
        if acknowledge and not self.running and (self.needs_acknowledge or self.first_out):
            self._clear()
            reports.append(Report(SequenceEvent.ACKNOWLEDGED))
        if self.running:
            self._run += passed
            self._go(signals, passed, now, abort, advance, reports)
        elif start:
            self._begin(reports)
        return reports

    def _go(self, signals: Signals, passed: int, now: int, abort: bool, advance: bool, reports: list[Report]) -> None:
        if not self.ready(ABORT):
            self._stop(Cause.ABORT_CONDITION, now, reports)
            return
        if abort:
            self._stop(Cause.OPERATOR, now, reports)
            return
        if signals.suspend:
            if self.state is SequenceState.RUNNING:
                self.state = SequenceState.SUSPENDED
                reports.append(Report(SequenceEvent.SUSPENDED, self.step))
            return
        if self.state is SequenceState.SUSPENDED:
            self.state = SequenceState.RUNNING
            reports.append(Report(SequenceEvent.RESUMED, self.step))
        step = self.settings.step(self.step)
        if step.loss_aborts and not self.ready(self.step):
            self._stop(Cause.PERMISSIVE_LOST, now, reports)
            return
        self._elapsed[self.step] += passed
        elapsed, maximum = self._elapsed[self.step], round(step.maximum * 1e6)
        due = maximum > 0 and elapsed >= round(step.minimum * 1e6)
        last = self.step == len(self.settings.steps)
        missing = due and not last and not self.ready(self.step + 1)
        leaves = due and not missing and (not signals.single or advance)
        if maximum and elapsed > maximum and not (leaves and elapsed - passed <= maximum):
            self._stop(Cause.TIME, now, reports)
            return
        self._judge_stall(missing, passed, now, reports)
        if leaves:
            self._leave(reports, last)

    def _begin(self, reports: list[Report]) -> None:
        if self.needs_acknowledge or not self.ready(1) or not self.ready(ABORT):
            missing = 1 if self.ready(ABORT) else ABORT
            word = self.word(missing)
            bit = -1 if word == ALL else _lowest(~word & ALL)
            reports.append(Report(SequenceEvent.START_REFUSED, missing, bit))
            return
        self._clear()
        self._elapsed = [0] * (len(self.settings.steps) + 1)
        self._states = [StepState.IDLE] * (len(self.settings.steps) + 1)
        self._run = 0
        self.state = SequenceState.RUNNING
        reports.append(Report(SequenceEvent.STARTED))
        self._enter(1, reports)

    def _enter(self, number: int, reports: list[Report]) -> None:
        self.step = number
        self.falls = []
        self._missing_for = 0
        self.stalled = False
        reports.append(Report(SequenceEvent.STEP_ENTERED, number))

    def _leave(self, reports: list[Report], last: bool) -> None:
        seconds = self.elapsed(self.step)
        self.times[self.step - 1].add(seconds)
        self._states[self.step] = StepState.DONE
        if self.first_out is not None and self.first_out.cause is Cause.STALL:
            self.first_out = None
        reports.append(Report(SequenceEvent.STEP_ENDED, self.step, value=seconds))
        if not last:
            self._enter(self.step + 1, reports)
            return
        self.state, self.step, self.stalled = SequenceState.DONE, 0, False
        reports.append(Report(SequenceEvent.DONE, value=self.run_time))

    def _stop(self, cause: Cause, now: int, reports: list[Report]) -> None:
        timed_out = cause is Cause.TIME
        self.first_out = self._what_fell(cause, now)
        self.state = SequenceState.TIMED_OUT if timed_out else SequenceState.ABORTED
        self._states[self.step] = StepState.TIMED_OUT if timed_out else StepState.ABORTED
        self.stalled = False
        self.needs_acknowledge = True
        event = SequenceEvent.TIMED_OUT if timed_out else SequenceEvent.ABORTED
        out = self.first_out
        reports.append(Report(event, out.step if out.bit >= 0 else self.step, out.bit, float(cause), out.together))

    def _judge_stall(self, missing: bool, passed: int, now: int, reports: list[Report]) -> None:
        self._missing_for = self._missing_for + passed if missing else 0
        if self.stalled and not missing:
            self.stalled = False
            reports.append(Report(SequenceEvent.STALL_OVER, self.step))
        elif not self.stalled and missing and self._missing_for >= round(self.settings.stall_after * 1e6):
            self.stalled = True
            self.first_out = self._what_fell(Cause.STALL, now)
            reports.append(Report(SequenceEvent.STALLED, self.step + 1, self.first_out.bit))

    def _what_fell(self, cause: Cause, now: int) -> FirstOut:
        """The permissive that fell first of those that are missing and matter to `cause`."""
        step = {Cause.ABORT_CONDITION: ABORT, Cause.PERMISSIVE_LOST: self.step}.get(cause, self.step + 1)
        missing: list[tuple[int, int]] = []
        if cause not in (Cause.OPERATOR, Cause.POWER_UP) and step <= len(self.settings.steps):
            missing = [(step, bit) for bit in range(BITS) if not self.word(step) >> bit & 1]
        if not missing:
            return FirstOut(cause, 0, -1, now, self.step, 0.0, self._inputs)
        first = min(missing, key=lambda place: (self._fell[place].time, place))
        seen = self._fell[first]
        return FirstOut(cause, *first, seen.time, self.step, seen.value, seen.words, seen.together)

    # ---- permissives ----------------------------------------------------------------------------------

    def _follow(self, words: tuple[int, ...], now: int, reports: list[Report]) -> None:
        """Note when each permissive fell or came back."""
        before = self._inputs
        if words == before:
            return
        self._inputs = words
        fallen: list[tuple[int, int]] = []
        for step, word in enumerate(words):
            changed = word ^ before[step] if before else ~word & ALL
            while changed:
                bit = _lowest(changed)
                changed &= changed - 1
                if word >> bit & 1:
                    self._came_back(step, bit, now, reports)
                else:
                    fallen.append((step, bit))
        if not fallen:
            return
        together = {
            step: max(1, sum(1 for place in fallen if place[0] == step and place not in self.forces))
            for step, _ in fallen
        }
        for step, bit in fallen:
            self._fell[step, bit] = _Snapshot(now, words, self._values(step, bit), together[step])
            if before and self._matters(step):
                if len(self.falls) < FALLS_KEPT:
                    self.falls.append(Fall(step, bit, now, 0))
                reports.append(Report(SequenceEvent.PERMISSIVE_LOST, step, bit, together=together[step]))

    def _came_back(self, step: int, bit: int, now: int, reports: list[Report]) -> None:
        self._fell.pop((step, bit), None)
        for index, fall in enumerate(self.falls):
            if (fall.step, fall.bit) == (step, bit) and not fall.back:
                self.falls[index] = fall._replace(back=now)
        if self._matters(step):
            reports.append(Report(SequenceEvent.PERMISSIVE_BACK, step, bit))

    def _matters(self, step: int) -> bool:
        return self.running and step in (ABORT, self.step, self.step + 1)

    def _expire(self, now: int, reports: list[Report]) -> None:
        for place, force in list(self.forces.items()):
            if force.until <= now:
                del self.forces[place]
                reports.append(Report(SequenceEvent.RELEASED, *place, 1.0))

    def _clear(self) -> None:
        self.first_out = None
        self.needs_acknowledge = False
        self.falls = []
        if self.state in (SequenceState.TIMED_OUT, SequenceState.ABORTED):
            self.state, self.step = SequenceState.IDLE, 0

    # ---- restart --------------------------------------------------------------------------------------

    def retained(self) -> dict[str, object]:
        """What survives a restart of the device: times, statistics, first-out and the forces, as plain values."""
        out = self.first_out
        return {
            "times": [(step.minimum, step.maximum) for step in self.settings.steps],
            "statistics": [(one.runs, one.least, one.most, one.total, one.last) for one in self.times],
            "forces": [(force.step, force.bit, force.until) for force in self.forces.values()],
            "first_out": None if out is None else (int(out.cause), *_fields(out)),
            "running": self.running,
            "step": self.step,
            "state": int(self.state),
            "needs_acknowledge": self.needs_acknowledge,
        }

    def restore(self, kept: Mapping[str, Any], now: int) -> list[Report]:
        """Go on after a restart. A sequence that was running is aborted; forces are gone unless `keep_forces`.

        Statistics and times of another number of steps are left out.
        """
        reports: list[Report] = []
        if len(kept["times"]) == len(self.settings.steps):
            for number, (minimum, maximum) in enumerate(kept["times"], 1):
                self.set_times(number, minimum, maximum)
            self.times = [StepTimes(*row) for row in kept["statistics"]]
            for step, bit, until in kept["forces"]:
                if self.settings.keep_forces and until > now:
                    self.forces[step, bit] = Force(step, bit, until)
                else:
                    reports.append(Report(SequenceEvent.RELEASED, step, bit, 2.0))
            if kept["first_out"] is not None:
                cause, *rest = kept["first_out"]
                self.first_out = FirstOut(Cause(cause), *rest)
            self.step = kept["step"]
            self.needs_acknowledge = kept["needs_acknowledge"]
            self.state = SequenceState(kept["state"])
            if self.needs_acknowledge and self.step:
                timed_out = self.state is SequenceState.TIMED_OUT
                self._states[self.step] = StepState.TIMED_OUT if timed_out else StepState.ABORTED
        if self.running:
            self._stop(Cause.POWER_UP, now, reports)
        return reports


def _fields(out: FirstOut) -> tuple[Any, ...]:
    return out.step, out.bit, out.time, out.at_step, out.value, out.snapshot, out.together


def _lowest(word: int) -> int:
    return (word & -word).bit_length() - 1
