"""The tests that the thesis recorded, run anew: fresh axes, or a fresh crane, with its own numbers. No plant is touched.

Source: thesis 002, reference/theses-facts.md section 2. The thesis prints what it ran; where its curves have no printed numbers, what is
expected is computed from its nameplate figures (`figures.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import NamedTuple

from app.blocks.arc_positioner.following import ArcPhase
from app.blocks.positioner.positioner import MoveInputs, MovePhase, Positioner
from app.sim.crane.axis import Axis, AxisData
from app.sim.crane.figures import HOIST, TROLLEY
from app.sim.crane.lift import Case, Lift
from app.sim.crane.program import VirtualCrane
from app.sim.crane.register_map import Step, StepState

START, TARGET = 5000.0, 10000.0
"""Of the trolley [mm]."""
SLOW_SPEED, SLOW_DISTANCE = 50.0, 200.0
"""[mm/s] over the last [mm]."""
TOLERANCE = 5.0
"""[mm]"""
SCAN = 0.01
"""[s]"""
LONGEST = 60.0
"""Of a positioning that does not end [s]."""
EVERY = 5
"""Scans from one point of a curve to the next."""

PIECES = 40
"""Of each part of the curve that is expected."""


class Moment(NamedTuple):
    """A point of a curve."""

    time: float
    """[s]"""
    position: float
    """[mm]"""
    speed: float
    """[mm/s]"""


class Compared(NamedTuple):
    """One number: what the thesis expects, and what came out."""

    key: str
    expected: float
    ours: float
    unit: str

    @property
    def difference(self) -> float:
        """[unit]"""
        return self.ours - self.expected


EXPECTED = {
    "top_speed": 660.4,
    "accelerated": 6981.2,
    "slow_down": 8486.8,
    "seconds": 16.1,
    "end": TARGET,
    "overshoot": 0.0,
}
"""[mm/s, mm, mm, s, mm, mm]: greatest speed, where it is reached, where the slow-down begins, time, end position, beyond it."""
UNITS = {"top_speed": "mm/s", "seconds": "s"}


@dataclass(frozen=True, slots=True)
class PositionerRun:
    """The trolley from 5000 to 10 000 mm in the ideal simulation."""

    ours: Sequence[Moment]
    expected: Sequence[Moment]
    numbers: Sequence[Compared]
    phase: MovePhase
    """In which it ended."""


def run_positioner() -> PositionerRun:
    """Our positioner on an axis without lag, brake time and encoder steps, as the thesis simulated it.

    Raises:
        TimeoutError: it has not ended in `LONGEST`.
    """
    data = AxisData.of(TROLLEY).with_(lag=0.0, brake_release=0.0, resolution=0.0)
    axis = Axis(data, position=START, brake=1.0)
    block = Positioner(
        data.max_speed, data.acceleration, data.deceleration, SLOW_SPEED, SLOW_DISTANCE, tolerance=TOLERANCE
    )
    curve, scans, accelerated, slow_down, greatest = [Moment(0.0, START, 0.0)], 0, nan, nan, START
    phase = MovePhase.OFF
    while phase not in (MovePhase.DONE, MovePhase.MISSED):
        out = block.step(MoveInputs(True, axis.measured, TARGET, axis.speed, data.max_speed), SCAN)
        if out.phase is MovePhase.SLOW and phase is MovePhase.TRAVEL:
            slow_down = axis.position
        phase, before = out.phase, axis.speed
        axis.step(out.speed, True, SCAN)
        scans += 1
        if before < data.max_speed <= axis.speed:
            accelerated = axis.position
        greatest = max(greatest, axis.position)
        if scans % EVERY == 0 or phase in (MovePhase.DONE, MovePhase.MISSED):
            curve.append(Moment(scans * SCAN, axis.position, axis.speed))
        if scans * SCAN > LONGEST:
            raise TimeoutError(
                f"positioner stands at {axis.position:.1f} mm after {LONGEST:g} s, expected {TARGET:g} mm"
            )
    found = {
        "top_speed": max(moment.speed for moment in curve),
        "accelerated": accelerated,
        "slow_down": slow_down,
        "seconds": scans * SCAN,
        "end": axis.position,
        "overshoot": max(0.0, greatest - TARGET),
    }
    numbers = [Compared(key, EXPECTED[key], found[key], UNITS.get(key, "mm")) for key in EXPECTED]
    return PositionerRun(curve, expected_positioning(), numbers, phase)


def expected_positioning() -> list[Moment]:
    """The curve that the thesis' figures give: ramp up, full speed, ramp to the slow speed, slow travel, stop."""
    top = TROLLEY["max_speed"].value
    up, down = top / TROLLEY["speed_up_time"].value, top / TROLLEY["slow_down_time"].value
    stop = SLOW_SPEED**2 / (2 * down)
    ramps = top**2 / (2 * up) + (top**2 - SLOW_SPEED**2) / (2 * down)
    parts = (
        (top / up, up),
        ((TARGET - START - SLOW_DISTANCE - ramps) / top, 0.0),
        ((top - SLOW_SPEED) / down, -down),
        ((SLOW_DISTANCE - stop) / SLOW_SPEED, 0.0),
        (SLOW_SPEED / down, -down),
    )
    curve = [Moment(0.0, START, 0.0)]
    for seconds, acceleration in parts:
        begin = curve[-1]
        for n in range(1, PIECES + 1):
            t = seconds * n / PIECES
            curve.append(
                Moment(
                    begin.time + t,
                    begin.position + begin.speed * t + acceleration * t**2 / 2,
                    begin.speed + acceleration * t,
                )
            )
    return curve


RADIUS, LIFT_SPEED = 3000.0, HOIST["max_speed"].value
"""Of the circular lift [mm, mm/s]; the radius is not in the text of the thesis (assumed)."""


@dataclass(frozen=True, slots=True)
class ArcRun:
    """The circular lift from 0° to 90°: by angle [°], how far beside the true circle the load was [mm], outwards positive."""

    ideal: Sequence[tuple[float, float]]
    """The original's formulas without lag, brake times and load, as the thesis simulated them."""
    original: Sequence[tuple[float, float]]
    """The original's formulas in the mechanics."""
    ours: Sequence[tuple[float, float]]
    """Our path following in the mechanics."""
    numbers: Sequence[Compared]
    """Greatest ways beside the circle; the thesis tells of its own run that the path is the circle."""
    phase: ArcPhase
    """In which ours ended."""


def run_arc() -> ArcRun:
    """The circular lift by all three.

    Raises:
        TimeoutError: one has not ended.
    """
    real = Case(LIFT_SPEED, RADIUS)
    lifts = {
        "ideal": Lift(Case(LIFT_SPEED, RADIUS, lag=(0.0, 0.0), release=(0.0, 0.0), load=0.0), original=True),
        "original": Lift(real, original=True),
        "ours": Lift(real),
    }
    curves = {name: _deviations(lift) for name, lift in lifts.items()}
    numbers = [Compared(name, 0.0, lift.result.worst, "mm") for name, lift in lifts.items()]
    return ArcRun(**curves, numbers=numbers, phase=lifts["ours"].result.phase)


def _deviations(lift: Lift) -> list[tuple[float, float]]:
    curve, scans, ended = list[tuple[float, float]](), 0, False
    while not ended:
        ended, scans = lift.step(), scans + 1
        if ended or scans % (2 * EVERY) == 1:
            curve.append((lift.circle.angle(lift.true, 45.0), lift.circle.radial_error(lift.true)))
        if lift.result.seconds > 10 * LONGEST:
            raise TimeoutError(f"circular lift at {curve[-1][0]:.1f}° after {10 * LONGEST:g} s, expected 90°")
    return curve


LONGEST_CYCLE = 900.0
"""Of a cycle that does not end [s]."""
EACH = 50
"""Scans from one point of the curves of a cycle to the next."""


class Places(NamedTuple):
    """Where the axes are at a time."""

    time: float
    """[s]"""
    bridge: float
    """[mm]"""
    trolley: float
    hoist: float


class Phase(NamedTuple):
    """A step of the sequence."""

    step: int
    begun: float
    """[s]"""
    seconds: float


@dataclass(frozen=True, slots=True)
class SequenceRun:
    """A cycle of the automatic sequence from stand 1 to stand 2; the source has its steps, but no times and no curve of it."""

    curve: Sequence[Places]
    steps: Sequence[Phase]
    numbers: Sequence[Compared]
    """Nothing is expected of any: NaN."""
    done: bool


def run_sequence() -> SequenceRun:
    """The whole virtual crane from its settings as delivered, 210 t on stand 1; the scale is read and confirmed by the simulated foreman.

    Raises:
        TimeoutError: it has not ended in `LONGEST_CYCLE`.
    """
    crane = VirtualCrane(start="automatic", orders=True, pause=0.0)
    curve, steps, worst, sway = list[Places](), list[Phase](), dict[Step, float](), 0.0
    step, begun = Step.NONE, 0.0
    while crane.cycle.state is not StepState.DONE:
        crane.step()
        now, cycle = crane.steps * crane.dt, crane.cycle
        if crane.steps % EACH == 1 or not cycle.open:
            curve.append(Places(now, *(crane.axes[axis].axis.position for axis in ("bridge", "trolley", "hoist"))))
        if cycle.step is not step or cycle.state is StepState.DONE:
            if step is Step.TO_SET_DOWN:
                sway = crane.sway()
            if step:
                steps.append(Phase(int(step), begun, now - begun))
            step, begun = cycle.step, now
        if step in (Step.ARC_LIFT, Step.ARC_LOWERING):
            worst[step] = max(worst.get(step, 0.0), crane.travel.worst)
        if now > LONGEST_CYCLE:
            raise TimeoutError(f"cycle in {step.name} after {LONGEST_CYCLE:g} s, expected it done")
    found = (
        *((str(one.step), one.seconds, "s") for one in steps if one.step >= Step.SAFE_HEIGHT),
        ("cycle", crane.cycle.seconds, "s"),
        ("lift", worst[Step.ARC_LIFT], "mm"),
        ("lowering", worst[Step.ARC_LOWERING], "mm"),
        ("sway", sway, "mm"),
    )
    numbers = [Compared(key, nan, value, unit) for key, value, unit in found]
    return SequenceRun(curve, steps, numbers, crane.load.stand == crane.cycle.end)
