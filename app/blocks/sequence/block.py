"""The sequence block: steps as the chart leads, each entered when its 16 permissives are there and its predecessor has had its time.

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
| several steps stalled | the first-out is of the one that stalled first, and when it is left of the one that has stalled longest then |
| stall of a safe step | its state says so; no event, and the first-out of what stopped the run stays |
| several in one scan | the lowest bit; the event says how many fell together, forced ones not counted |
| abort condition and the operator's abort in one scan | the abort condition is the cause |
| commands of a step | it is not left before all are confirmed; one that is refused or not confirmed stops the sequence |
| several steps active (parallel paths) | each times out and stalls by itself; all stop with one of them |
| end of a path whose neighbours still run | stays active, its time stands still: nothing times out or stalls by waiting for others |
| single step | one `advance` lets every step go on that could |
| loop | a step that is entered again begins its time anew; the statistics count every passage |
| safe steps | entered by what stops a run, a restart aside, if the first can be entered; then the run ends as what stopped it says |
| what stops safe steps | all but abort conditions, for good; the first cause stays |
| force | sets a permissive, never clears one; released by the block when its time is over |

No clock: time is what the caller says, in integer microseconds, and it is the device's own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.blocks.sequence.forces import Forces
from app.blocks.sequence.reports import Fall, FirstOut, Report, StepTimes
from app.blocks.sequence.settings import SequenceSettings, Signals
from app.blocks.sequence.states import ABORT, ALL, Cause, SequenceEvent, SequenceState, StepState
from app.blocks.sequence.watch import Values, Watch, lowest


@dataclass(slots=True)
class _Passage:
    """A step that is active."""

    ordinal: int
    missing_for: int = 0
    """How long nothing that follows could be entered [µs]."""
    stalled: bool = False


@dataclass(slots=True)
class _Plan:
    """What an active step does in a scan."""

    number: int
    due: bool
    """Its minimum is over."""
    through: bool
    """It is due and its commands are confirmed."""
    waits: bool = False
    """For the other paths that meet with its own."""
    missing: bool = False
    leaves: bool = False
    target: tuple[int, ...] | None = None
    """What is entered then; None = nothing can be."""
    group: tuple[int, ...] = ()
    """Steps that are left together."""


class SequenceBlock:
    """One sequence. `scan` is called once per cycle of the device."""

    def __init__(self, settings: SequenceSettings, values: Values = lambda step, bit: 0.0) -> None:
        self.settings = settings
        self.state = SequenceState.IDLE
        self.step = 0
        """Active step, the lowest of several; the one it stopped in after an abort or a time-out; 0 = none."""
        self.safe = False
        """It was stopped and does its safe steps."""
        self.first_out: FirstOut | None = None
        self.forces = Forces()
        self._watch = Watch(self.forces, values)
        self.times = [StepTimes() for _ in settings.steps]
        self.needs_acknowledge = False
        self._elapsed = [0] * (len(settings.steps) + 1)
        self._run = 0
        self._active: dict[int, _Passage] = {}
        self._entered = 0
        self._passes: dict[int, int] = {}
        self._why = (Cause.NONE, 0)
        self._start = self._acknowledge = self._abort = self._advance = True
        self._states = [StepState.IDLE] * (len(settings.steps) + 1)

    # ---- what others look at --------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether a step is active, suspended or not."""
        return self.state in (SequenceState.RUNNING, SequenceState.SUSPENDED)

    @property
    def falls(self) -> list[Fall]:
        """What was lost during the active step, oldest first."""
        return self._watch.falls

    @property
    def active(self) -> tuple[int, ...]:
        """Steps that are active, suspended or not, in their order."""
        return tuple(sorted(self._active))

    @property
    def stalled(self) -> bool:
        """Whether a step has had its minimum and none that follows can be entered."""
        return any(passage.stalled for passage in self._active.values())

    def passage(self, number: int) -> int:
        """A number that is another one whenever step `number` is entered; 0 = it is not active."""
        found = self._active.get(number)
        return found.ordinal if found else 0

    def passes(self, number: int) -> int:
        """How often the loop that ends with step `number` went back in this run since it was entered."""
        return self._passes.get(number, 0)

    def following(self, number: int) -> tuple[tuple[int, ...], ...]:
        """What may follow step `number` now, in the order of priority, each entered together; (()) = the end."""
        loop = self.settings.chart.loop(number)
        if loop is not None and self.passes(number) + 1 < loop.times:
            return ((loop.first,),)
        return self.settings.chart.ways(number, len(self.settings.steps)).targets

    def left_with(self, number: int) -> tuple[int, ...]:
        """Last steps of parallel paths that are left together with `number`; none while its loop leads back."""
        ways = self.settings.chart.ways(number, len(self.settings.steps))
        return ways.together if ways.targets == self.following(number) else ()

    def step_state(self, number: int) -> StepState:
        """State of step `number`, from 1."""
        passage = self._active.get(number)
        if passage is not None:
            if self.state is SequenceState.SUSPENDED:
                return StepState.SUSPENDED
            return StepState.STALLED if passage.stalled else StepState.ACTIVE
        return self._states[number]

    def output(self, number: int) -> bool:
        """Output of step `number`."""
        if number not in self._active:
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
        return self._watch.word(number)

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
        words = (signals.abort & ALL, *(word & ALL for word in signals.permissives))
        self._watch.follow(words, now, self._matters, reports)
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
        if not self.safe and not self.ready(ABORT):
            self._stop(Cause.ABORT_CONDITION, self.step, now, reports)
            return
        if abort:
            self._stop(Cause.OPERATOR, self.step, now, reports)
            return
        suspended = self.state is SequenceState.SUSPENDED
        if signals.suspend is not suspended:
            self.state = SequenceState.SUSPENDED if signals.suspend else SequenceState.RUNNING
            event = SequenceEvent.SUSPENDED if signals.suspend else SequenceEvent.RESUMED
            reports.append(Report(event, self.step))
        if signals.suspend:
            return
        for number in self.active:
            refused = signals.refused.get(number, 0)
            if refused or (self.settings.step(number).loss_aborts and not self.ready(number)):
                self._stop(Cause.COMMAND if refused else Cause.PERMISSIVE_LOST, number, now, reports, refused)
                return
        plans = _plans(self, signals, passed, advance)
        for plan in plans:
            maximum, elapsed = round(self.settings.step(plan.number).maximum * 1e6), self._elapsed[plan.number]
            if plan.waits or not maximum or elapsed <= maximum or (plan.leaves and elapsed - passed <= maximum):
                continue
            self._stop(Cause.TIME, plan.number, now, reports)
            return
        for plan in plans:
            _judge_stall(self, plan, passed, now, reports)
        for plan in plans:
            if plan.leaves and plan.number in self._active:
                self._leave(plan, reports)
        if self.first_out is None:
            self.first_out = _first_stall(self, now)

    def _begin(self, reports: list[Report]) -> None:
        if self.needs_acknowledge or not self.ready(1) or not self.ready(ABORT):
            missing = 1 if self.ready(ABORT) else ABORT
            word = self.word(missing)
            bit = -1 if word == ALL else lowest(~word & ALL)
            reports.append(Report(SequenceEvent.START_REFUSED, missing, bit))
            return
        self._clear()
        self._elapsed = [0] * (len(self.settings.steps) + 1)
        self._states = [StepState.IDLE] * (len(self.settings.steps) + 1)
        self._run, self._passes, self.safe = 0, {}, False
        self.state = SequenceState.RUNNING
        reports.append(Report(SequenceEvent.STARTED))
        self._enter(1, reports)

    def _enter(self, number: int, reports: list[Report]) -> None:
        if not self._active:
            self._watch.falls = []
        self._entered += 1
        self._active[number] = _Passage(self._entered)
        self._elapsed[number] = 0
        self.step = min(self._active)
        reports.append(Report(SequenceEvent.STEP_ENTERED, number))

    def _leave(self, plan: _Plan, reports: list[Report]) -> None:
        for number in plan.group:
            self._count_loop(number)
            seconds = self.elapsed(number)
            self.times[number - 1].add(seconds)
            self._states[number] = StepState.DONE
            del self._active[number]
            if self.first_out is not None and self.first_out.cause is Cause.STALL and self.first_out.at_step == number:
                self.first_out = None
            reports.append(Report(SequenceEvent.STEP_ENDED, number, value=seconds))
        for number in plan.target or ():
            self._enter(number, reports)
        if self._active:
            self.step = min(self._active)
        else:
            self._finish(reports)

    def _count_loop(self, number: int) -> None:
        loop, back = self.settings.chart.loop(number), self.passes(number) + 1
        if loop is not None:
            self._passes[number] = back if back < loop.times else 0

    def _finish(self, reports: list[Report]) -> None:
        if self.safe:
            self._end(reports)
        else:
            self.state, self.step = SequenceState.DONE, 0
            reports.append(Report(SequenceEvent.DONE, value=self.run_time))

    def _stop(self, cause: Cause, at: int, now: int, reports: list[Report], value: float = 0.0) -> None:
        if not self.safe:  # what stopped it first counts
            self.first_out = self._what_fell(cause, at, now, value)
            self._why = cause, at
        for number in self._active:
            timed_out = cause is Cause.TIME and number == at
            self._states[number] = StepState.TIMED_OUT if timed_out else StepState.ABORTED
        self._active = {}
        self.needs_acknowledge = True
        start = self.settings.chart.safe
        if not start or self.safe or cause is Cause.POWER_UP or not self.ready(start):
            self._end(reports)
            return
        self.safe, self.state = True, SequenceState.RUNNING
        reports.append(self._told(SequenceEvent.ABORTING))
        self._enter(start, reports)

    def _end(self, reports: list[Report]) -> None:
        """The run is over before its end, as what stopped it says."""
        timed_out = self._why[0] is Cause.TIME
        self.state = SequenceState.TIMED_OUT if timed_out else SequenceState.ABORTED
        self.step, self.safe = self._why[1], False
        reports.append(self._told(SequenceEvent.TIMED_OUT if timed_out else SequenceEvent.ABORTED))

    def _told(self, event: SequenceEvent) -> Report:
        """What stopped it, as an event."""
        (cause, at), out = self._why, self.first_out
        if out is None or out.bit < 0:
            return Report(event, at, -1, float(cause), out.together if out else 0)
        return Report(event, out.step, out.bit, float(cause), out.together)

    def _what_fell(self, cause: Cause, at: int, now: int, value: float = 0.0) -> FirstOut:
        """The permissive that fell first of those that are missing and matter to `cause` in step `at`."""
        places: tuple[int, ...] = ()
        if cause in (Cause.ABORT_CONDITION, Cause.PERMISSIVE_LOST):
            places = (ABORT if cause is Cause.ABORT_CONDITION else at,)
        elif cause in (Cause.TIME, Cause.STALL):
            places = () if any(all(map(self.ready, steps)) for steps in self.following(at)) else _next(self, at)
        return self._watch.first_out(cause, places, at, now, value)

    def _matters(self, step: int) -> bool:
        return self.running and (
            step == ABORT or step in self._active or any(step in _next(self, number) for number in self._active)
        )

    def _clear(self) -> None:
        self.first_out = None
        self.needs_acknowledge = False
        self._watch.falls = []
        if self.state in (SequenceState.TIMED_OUT, SequenceState.ABORTED):
            self.state, self.step = SequenceState.IDLE, 0

    # ---- restart --------------------------------------------------------------------------------------

    def retained(self) -> dict[str, object]:
        """What survives a restart of the device: times, statistics, first-out and the forces, as plain values."""
        return _retained(self)

    def restore(self, kept: Mapping[str, Any], now: int) -> list[Report]:
        """Go on after a restart. A sequence that was running is aborted; forces are gone unless `keep_forces`."""
        return _restored(self, kept, now)


def _retained(run: SequenceBlock) -> dict[str, object]:
    out = run.first_out
    return {
        "times": [(step.minimum, step.maximum) for step in run.settings.steps],
        "statistics": [(one.runs, one.least, one.most, one.total, one.last) for one in run.times],
        "forces": run.forces.retained(),
        "first_out": None if out is None else out.plain(),
        "running": run.running,
        "step": run.step,
        "active": run.active,
        "why": None if run.safe is False else run._why,
        "state": int(run.state),
        "needs_acknowledge": run.needs_acknowledge,
    }


def _restored(run: SequenceBlock, kept: Mapping[str, Any], now: int) -> list[Report]:
    """Statistics and times of another number of steps are left out."""
    reports: list[Report] = []
    if len(kept["times"]) == len(run.settings.steps):
        for number, (minimum, maximum) in enumerate(kept["times"], 1):
            run.set_times(number, minimum, maximum)
        run.times = [StepTimes(*row) for row in kept["statistics"]]
        for step, bit, until in kept["forces"]:
            ended = run.forces.restore(step, bit, until, now, keep=run.settings.keep_forces)
            reports += [ended] if ended else []
        run.first_out = None if kept["first_out"] is None else FirstOut.of(kept["first_out"])
        run.step = kept["step"]
        run.needs_acknowledge = kept["needs_acknowledge"]
        run.state = SequenceState(kept["state"])
        if run.needs_acknowledge and run.step:
            timed_out = run.state is SequenceState.TIMED_OUT
            run._states[run.step] = StepState.TIMED_OUT if timed_out else StepState.ABORTED
    if run.running:
        run._active = {number: _Passage(0) for number in kept["active"]}
        if kept["why"] is not None:
            run.safe, run._why = True, kept["why"]
        run._stop(Cause.POWER_UP, run.step, now, reports)
    return reports


def _plans(run: SequenceBlock, signals: Signals, passed: int, advance: bool) -> list[_Plan]:
    """What each active step does in this scan."""
    plans: dict[int, _Plan] = {}
    for number in run.active:
        step = run.settings.step(number)
        elapsed = run._elapsed[number] + passed
        due = step.maximum > 0 and elapsed >= round(step.minimum * 1e6)
        plans[number] = _Plan(number, due, due and number not in signals.pending)
    for number, plan in plans.items():
        following = run.following(number)
        beside = run.left_with(number)
        through = all(other in plans and plans[other].through and bool(run.left_with(other)) for other in beside)
        plan.waits = bool(beside) and plan.through and not through
        elapsed, minimum = run._elapsed[number], round(run.settings.step(number).minimum * 1e6)
        run._elapsed[number] = max(elapsed, min(elapsed + passed, minimum)) if plan.waits else elapsed + passed
        plan.group = beside or (number,)
        plan.target = next((steps for steps in following if all(run.ready(step) for step in steps)), None)
        plan.missing = plan.due and not plan.waits and plan.target is None
        plan.leaves = plan.through and through and plan.target is not None and (not signals.single or advance)
    return list(plans.values())


def _judge_stall(run: SequenceBlock, plan: _Plan, passed: int, now: int, reports: list[Report]) -> None:
    passage = run._active[plan.number]
    passage.missing_for = passage.missing_for + passed if plan.missing else 0
    if passage.stalled and not plan.missing:
        passage.stalled = False
        if not run.safe:
            reports.append(Report(SequenceEvent.STALL_OVER, plan.number))
    elif not passage.stalled and plan.missing and passage.missing_for >= round(run.settings.stall_after * 1e6):
        passage.stalled = True
        if not run.safe:  # what stopped the run counts, and its safe steps tell no stall
            out = run._what_fell(Cause.STALL, plan.number, now)
            first = run._active.get(run.first_out.at_step) if run.first_out else None
            if first is None or first is passage or not first.stalled:
                run.first_out = out
            reports.append(Report(SequenceEvent.STALLED, out.step, out.bit))


def _first_stall(run: SequenceBlock, now: int) -> FirstOut | None:
    """First-out of the step that has stalled longest of those that are active; None = none has."""
    stalled = [number for number in run.active if run._active[number].stalled]
    longest = max(stalled, key=lambda number: run._active[number].missing_for, default=0)
    return run._what_fell(Cause.STALL, longest, now) if longest else None


def _next(run: SequenceBlock, number: int) -> tuple[int, ...]:
    """Every step that may follow step `number` now."""
    return tuple(step for steps in run.following(number) for step in steps)


def awaited(run: SequenceBlock, stopped: int = 0) -> tuple[int, ...]:
    """Steps that may be entered next, as the chart and its loops say; `stopped`: the step in which it ended. Before all the first."""

    def waits(number: int) -> bool:
        return any(other not in run.active or not run.left_with(other) for other in run.left_with(number))

    numbers = (
        [number for number in run.active if not waits(number)] or list(run.active) or ([stopped] if stopped else [])
    )
    if not numbers:
        return (1,)
    return tuple(dict.fromkeys(step for number in numbers for step in _next(run, number)))
