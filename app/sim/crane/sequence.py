"""The crane's automatic sequence, S1 to S423: brings a ladle from one stand to another.

| subject | rule |
| --- | --- |
| step | positions of some axes, a circular move, or a wait for scale or person; it ends when all of it is there |
| suspended | every axis comes to a stop, the load stays where it is; the step begins anew when the cycle is resumed |
| resume | refused when an axis stands where the step must not begin (`needs`): the person drives it back by hand |
| circular move | the circle is laid when its step begins and kept while the cycle is suspended |
| where it is laid | of a lift where the hook has found the ladle, of a lowering through the lock of the stand |
| heights | of the load, by encoder, scale and the stretch of the rope |
| weight | within the tolerance of the plan or not, it is confirmed by a person, who gives what the scale says |
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from typing import NamedTuple, Protocol

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.positioner.positioner import MovePhase
from app.sim.crane.register_map import CraneEvent, Step, StepState, Suspension

BELOW = 200.0
"""Of the hook below the lock while the trolley drives to it [mm]."""
BESIDE = 600.0
"""Of the trolley beside the lock before [mm]."""
SETTLE = 2.0
"""Before a weight is taken [s]."""
READING = 1.0
"""What a person may be beside the scale [t]."""
LOW, HIGH = 0.0, 90.0
"""Ends of the circular move [°]."""
ROOM = 300.0
"""Where an axis may stand beside its place when a step begins [mm]."""


class Job(NamedTuple):
    """What a step does."""

    go: Sequence[str] = ()
    """Axes that go to their place of the step."""
    arc: tuple[float, float] | None = None
    """Angles from and to [°]."""
    fine: Sequence[str] = ()
    """Of those, axes that have to be exact: the load has to be on the circle that begins there."""
    needs: Sequence[str] = ()
    """Axes that stand at their places before."""


JOBS: Mapping[Step, Job] = {
    Step.INIT: Job(),
    Step.START: Job(),
    Step.SAFE_HEIGHT: Job(("hoist",)),
    Step.TO_PICK_UP: Job(("bridge", "trolley"), needs=("hoist",)),
    Step.BELOW_LOCK: Job(("hoist",), needs=("bridge", "trolley")),
    Step.TO_LOCK: Job(("trolley",), needs=("bridge", "hoist")),
    Step.INTO_LOCK: Job(("hoist",), needs=("bridge", "trolley")),
    Step.ARC_LIFT: Job(arc=(LOW, HIGH), needs=("bridge",)),
    Step.WEIGHT_CHECK: Job(),
    Step.WEIGHT_CONFIRMATION: Job(),
    Step.LOADED_SAFE_HEIGHT: Job(("hoist",), needs=("bridge",)),
    Step.TO_SET_DOWN: Job(("bridge", "trolley"), needs=("hoist",)),
    Step.LOWER: Job(("hoist",), fine=("hoist",), needs=("bridge", "trolley")),
    Step.ARC_LOWERING: Job(arc=(HIGH, LOW), needs=("bridge",)),
    Step.BELOW_LOCK_AGAIN: Job(("hoist",), needs=("bridge", "trolley")),
    Step.OUT_OF_LOCK: Job(("trolley",), needs=("bridge", "hoist")),
    Step.SAFE_HEIGHT_AGAIN: Job(("hoist",), needs=("bridge", "trolley")),
}
"""In their order."""
ORDER: Sequence[Step] = tuple(JOBS)


class Crane(Protocol):
    """What the sequence uses of its crane."""

    @property
    def settings(self) -> Mapping[str, float]: ...
    def event(self, code: int, source: int = 0, value: float = 0.0) -> None: ...
    def stand(self, number: int) -> Mapping[str, float]: ...
    def position(self, axis: str) -> float: ...
    def positioning(self, axis: str, target: float, fine: bool) -> MovePhase: ...
    def circling(self, angles: tuple[float, float]) -> bool: ...
    def load_place(self) -> Point: ...
    def lay_circle(self, circle: Circle) -> None: ...
    def weighed(self) -> float: ...
    def sway(self) -> float: ...


@dataclass(slots=True)
class Cycle:
    """One cycle, and where it is; it is the retained part of the sequence."""

    number: int = 0
    start: int = 0
    """Stand that the ladle is brought from."""
    end: int = 0
    planned: float = nan
    """[t]"""
    confirmed: float = nan
    step: Step = Step.NONE
    state: StepState = StepState.NONE
    suspension: Suspension = Suspension.NONE
    seconds: float = 0.0
    """Since it was started."""
    in_step: float = 0.0
    """As long as it was not suspended."""
    fits: bool = False
    """The weight is as planned."""
    laid: Circle | None = None

    @property
    def open(self) -> bool:
        """Under way, or suspended."""
        return self.state in (StepState.RUNNING, StepState.WAITING, StepState.SUSPENDED)

    @property
    def runs(self) -> bool:
        """Under way."""
        return self.state in (StepState.RUNNING, StepState.WAITING)


@dataclass(slots=True)
class CraneSequence:
    """Steps of one crane."""

    crane: Crane
    cycle: Cycle = field(default_factory=Cycle)

    def start(self, start: int, end: int, planned: float) -> None:
        """Begin a cycle."""
        self.cycle = Cycle(self.cycle.number + 1 & 0xFFFFFFFF, start, end, planned, state=StepState.RUNNING)
        self.crane.event(CraneEvent.CYCLE_STARTED, start, float(end))
        self._enter(Step.INIT)

    def suspend(self, why: Suspension) -> None:
        """Stand still until somebody resumes."""
        if self.cycle.runs:
            self.cycle.state, self.cycle.suspension = StepState.SUSPENDED, why
            self.crane.event(CraneEvent.SUSPENDED, why, float(self.cycle.step))

    def out_of_place(self) -> str:
        """Axis that does not stand where the step needs it; empty = none."""
        places = self._places(self.cycle.step)
        for axis in JOBS[self.cycle.step].needs:
            room = BELOW / 4 if axis != "hoist" or self.cycle.step not in HIGH_STEPS else ROOM
            off = self.crane.position(axis) - places[axis]
            if not (off >= -room if axis == "hoist" and self.cycle.step in HIGH_STEPS else abs(off) <= room):
                return axis
        return ""

    def resume(self) -> None:
        """Go on with the step."""
        waits = self.cycle.step is Step.WEIGHT_CONFIRMATION
        self.cycle.state = StepState.WAITING if waits else StepState.RUNNING
        self.cycle.suspension = Suspension.NONE
        self.crane.event(CraneEvent.RESUMED, self.cycle.step)

    def abort(self) -> None:
        """Give the cycle up; the load stays where it is."""
        self.cycle.state, self.cycle.suspension = StepState.ABORTED, Suspension.NONE
        self.crane.event(CraneEvent.CYCLE_ABORTED, self.cycle.step, self.cycle.seconds)

    def confirm(self, weight: float) -> None:
        """A person says what the scale says."""
        self.cycle.confirmed = weight
        self.crane.event(CraneEvent.WEIGHT_CONFIRMED, int(self.cycle.fits), weight)

    def step(self, dt: float) -> None:
        """One scan of `dt` [s] of a cycle that is open."""
        cycle = self.cycle
        cycle.seconds += dt
        cycle.in_step += dt if cycle.runs else 0.0
        if cycle.runs and self._done():
            self.crane.event(CraneEvent.STEP_ENDED, cycle.step, cycle.in_step)
            if cycle.step is Step.TO_SET_DOWN:
                self.crane.event(CraneEvent.SWAY_LEFT, cycle.step, self.crane.sway())
            after = ORDER.index(cycle.step) + 1
            if after < len(ORDER):
                self._enter(ORDER[after])
            else:
                cycle.state = StepState.DONE
                self.crane.event(CraneEvent.CYCLE_DONE, 0, cycle.seconds)

    def _enter(self, step: Step) -> None:
        cycle = self.cycle
        cycle.step, cycle.in_step = step, 0.0
        cycle.state = StepState.WAITING if step is Step.WEIGHT_CONFIRMATION else StepState.RUNNING
        self.crane.event(CraneEvent.STEP_ENTERED, step)
        arc = JOBS[step].arc
        if arc:
            places = self._places(step)
            lifts = step is Step.ARC_LIFT
            at = self.crane.load_place() if lifts else Point(places["trolley"], places["hoist"])
            cycle.laid = Circle.through(at, arc[0], self.crane.settings["arc_radius"])
            self.crane.lay_circle(cycle.laid)

    def _done(self) -> bool:
        """Do what the step does; whether all of it is there."""
        cycle, job = self.cycle, JOBS[self.cycle.step]
        if job.arc:
            return self.crane.circling(job.arc)
        if job.go:
            places = self._places(cycle.step)
            phases = [self.crane.positioning(axis, places[axis], axis in job.fine) for axis in job.go]
            if MovePhase.MISSED in phases:
                self.suspend(Suspension.MISSED)
            return all(phase is MovePhase.DONE for phase in phases)
        if cycle.step is Step.WEIGHT_CHECK:
            return cycle.in_step >= SETTLE and self._check_weight()
        if cycle.step is Step.WEIGHT_CONFIRMATION:
            return cycle.confirmed == cycle.confirmed
        return True

    def _check_weight(self) -> bool:
        measured = self.crane.weighed()
        self.cycle.fits = abs(measured - self.cycle.planned) <= self.crane.settings["weight_tolerance"]
        self.crane.event(CraneEvent.WEIGHT_CHECKED, int(self.cycle.fits), measured)
        return True

    def _places(self, step: Step) -> Mapping[str, float]:
        """Where the axes are in a step [mm]."""
        settings = self.crane.settings
        lock = self.crane.stand(self.cycle.start if step < Step.TO_SET_DOWN else self.cycle.end)
        radius, safe = settings["arc_radius"], settings["safe_height"]
        hoist = {
            Step.BELOW_LOCK: lock["hoist"] - BELOW,
            Step.TO_LOCK: lock["hoist"] - BELOW,
            Step.INTO_LOCK: lock["hoist"],
            Step.ARC_LIFT: lock["hoist"],
            Step.LOWER: lock["hoist"] + radius,
            Step.ARC_LOWERING: lock["hoist"] + radius,
            Step.BELOW_LOCK_AGAIN: lock["hoist"] - BELOW,
            Step.OUT_OF_LOCK: lock["hoist"] - BELOW,
        }.get(step, safe)
        trolley = {
            Step.TO_PICK_UP: lock["trolley"] + BESIDE,
            Step.BELOW_LOCK: lock["trolley"] + BESIDE,
            Step.OUT_OF_LOCK: lock["trolley"] + BESIDE,
            Step.SAFE_HEIGHT_AGAIN: lock["trolley"] + BESIDE,
            Step.TO_SET_DOWN: lock["trolley"] - radius,
            Step.LOWER: lock["trolley"] - radius,
            Step.ARC_LOWERING: lock["trolley"] - radius,
        }.get(step, lock["trolley"])
        return {"hoist": hoist, "trolley": trolley, "bridge": lock["bridge"]}


HIGH_STEPS = frozenset({Step.TO_PICK_UP, Step.TO_SET_DOWN})
"""Steps in which the hoist may be higher than its place, but not lower."""
