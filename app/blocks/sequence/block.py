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
| commands of a step | it is not left before all are confirmed; one that is refused or not confirmed stops the sequence |
| force | sets a permissive, never clears one; released by the block when its time is over |

No clock: time is what the caller says, in integer microseconds, and it is the device's own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.blocks.sequence.forces import Forces
from app.blocks.sequence.reports import Fall, FirstOut, Report, StepTimes
from app.blocks.sequence.settings import SequenceSettings, Signals
from app.blocks.sequence.states import ABORT, ALL, BITS, Cause, SequenceEvent, SequenceState, StepState

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
        self.forces = Forces()
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
        return (self._inputs[number] if self._inputs else 0) | self.forces.bits(number)

    def ready(self, number: int) -> bool:
        """Whether every permissive of step `number` (0 = abort conditions) is there."""
        return self.word(number) == ALL

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
        return self.forces.force(self.settings, step, bit, seconds, now)

    # ---- a scan ---------------------------------------------------------------------------------------

    def scan(self, signals: Signals, dt: float, now: int) -> list[Report]:
        """One cycle of `dt` [s] that ends at `now` [µs].

        Raises:
            ValueError: not as many permissive words as steps.
        """
        if len(signals.permissives) != len(self.settings.steps):
            raise ValueError(f"{len(signals.permissives)} permissive words: expected {len(self.settings.steps)}")
        passed = round(dt * 1e6)
        reports = self.forces.expire(now)
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
        if signals.refused or (step.loss_aborts and not self.ready(self.step)):
            self._stop(Cause.COMMAND if signals.refused else Cause.PERMISSIVE_LOST, now, reports, signals.refused)
            return
        self._elapsed[self.step] += passed
        elapsed, maximum = self._elapsed[self.step], round(step.maximum * 1e6)
        due = maximum > 0 and elapsed >= round(step.minimum * 1e6)
        last = self.step == len(self.settings.steps)
        missing = due and not last and not self.ready(self.step + 1)
        leaves = due and not missing and not signals.pending and (not signals.single or advance)
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

    def _stop(self, cause: Cause, now: int, reports: list[Report], value: float = 0.0) -> None:
        timed_out = cause is Cause.TIME
        self.first_out = self._what_fell(cause, now, value)
        self.state = SequenceState.TIMED_OUT if timed_out else SequenceState.ABORTED
        self._states[self.step] = StepState.TIMED_OUT if timed_out else StepState.ABORTED
        self.stalled = False
        self.needs_acknowledge = True
        event, out = SequenceEvent.TIMED_OUT if timed_out else SequenceEvent.ABORTED, self.first_out
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

    def _what_fell(self, cause: Cause, now: int, value: float = 0.0) -> FirstOut:
        """The permissive that fell first of those that are missing and matter to `cause`."""
        step = {Cause.ABORT_CONDITION: ABORT, Cause.PERMISSIVE_LOST: self.step}.get(cause, self.step + 1)
        missing: list[tuple[int, int]] = []
        if cause not in (Cause.OPERATOR, Cause.POWER_UP, Cause.COMMAND) and step <= len(self.settings.steps):
            missing = [(step, bit) for bit in range(BITS) if not self.word(step) >> bit & 1]
        if not missing:
            return FirstOut(cause, 0, -1, now, self.step, value, self._inputs)
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
            "forces": self.forces.retained(),
            "first_out": None if out is None else out.plain(),
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
                ended = self.forces.restore(step, bit, until, now, keep=self.settings.keep_forces)
                reports += [ended] if ended else []
            self.first_out = None if kept["first_out"] is None else FirstOut.of(kept["first_out"])
            self.step = kept["step"]
            self.needs_acknowledge = kept["needs_acknowledge"]
            self.state = SequenceState(kept["state"])
            if self.needs_acknowledge and self.step:
                timed_out = self.state is SequenceState.TIMED_OUT
                self._states[self.step] = StepState.TIMED_OUT if timed_out else StepState.ABORTED
        if self.running:
            self._stop(Cause.POWER_UP, now, reports)
        return reports


def _lowest(word: int) -> int:
    return (word & -word).bit_length() - 1
