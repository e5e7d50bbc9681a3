"""Path error of a circular lift in the mechanics: speed x radius x angle x lag, beside the original's formulas in the same run.

And what a scan of the crane's blocks costs: limits and drive control of three axes, and the circular lift.
"""

import math
import time
from itertools import product

from app.blocks.arc_positioner import following
from app.blocks.arc_positioner.circle import Point
from app.blocks.limit_switches import Switches, SwitchPlaces
from app.profidrive.words import Status
from app.sim.crane.driven import DrivenAxis
from app.sim.crane.lift import HOIST_DATA, Case, Lift
from benchmarks.common import Row, milliseconds

SPEEDS = (HOIST_DATA.max_speed, 66.0, 20.0)
"""[mm/s]; the first is the slower axis' maximum."""
RADII = (1000.0, 3000.0, 6000.0)
"""[mm]"""
ANGLES = ((0.0, 90.0), (90.0, 0.0), (30.0, 60.0), (0.0, 10.0))
LAGS = (0.05, 0.1, 0.2)
"""Of both axes [s]."""
TARGET = 2.0
"""[mm]"""
LONGEST = 200.0
"""Lifts that take longer than this are not run [s]."""


async def measure() -> list[Row]:
    """One row for each speed and radius: the worst of all angles and lags, and where it was."""
    rows = []
    for speed, radius in product(SPEEDS, RADII):
        seen = []
        for (start, end), lag in product(ANGLES, LAGS):
            if math.radians(abs(end - start)) * radius / speed <= LONGEST:
                case = Case(speed, radius, start, end, lag=(lag, lag))
                seen.append((case, Lift(case).run(), Lift(case, original=True).run()))
        case, worst, beside = max(seen, key=lambda one: one[1].worst)
        met = all(o.phase is following.ArcPhase.DONE and o.worst <= TARGET and o.worst <= b.worst for _, o, b in seen)
        rows.append(
            Row(
                f"circular lift {speed:g} mm/s, radius {radius / 1000:g} m: path error",
                f"{worst.worst:.2f} mm",
                f"{TARGET:g} mm, not above the original",
                f"{beside.worst:.2f} mm, the original's formulas",
                worst.worst / beside.worst,
                met,
                f"worst of {len(seen)}: {case.start:g}° to {case.end:g}°, lag {case.lag[0] * 1000:g} ms; "
                f"the original {min(b.worst for *_, b in seen):.2f} to {max(b.worst for *_, b in seen):.2f} mm; "
                "brakes 0.4 s apart, encoders, full load on the rope",
            )
        )
    return [*rows, _scan()]


def _scan(scans: int = 5_000) -> Row:
    """CPU time of the blocks, the mechanics left out."""
    axes = [DrivenAxis(HOIST_DATA, SwitchPlaces(300, 1300, 33080, 34080, 500, 20.32), 15000.0) for _ in range(3)]
    for axis in axes:
        for n in range(400):
            axis.step(50.0 if n > 50 else 0.0, 0.01)
    lift = Lift(Case(50.0, 6000.0))
    for _ in range(400):
        lift.step()
    at = following.ArcInputs(True, lift.measured, 0.0, 90.0, 6000.0, 50.0)
    seen = [axis.seen._replace(status=(axis.seen.status or 0) | Status.OPERATION_ENABLED) for axis in axes]
    began = time.process_time()
    for _ in range(scans):
        for axis, inputs in zip(axes, seen, strict=True):
            axis.limits.step(Switches(), Switches(), 15000.0)
            axis.control.step(inputs, 0.01)
        place = lift.follower._reference(0.0)[0]
        lift.follower.step(at._replace(position=Point(*place)), 0.01)
    cost = (time.process_time() - began) / scans
    return Row(
        "one scan of the crane's blocks: three axes driven and a circular lift",
        milliseconds(cost),
        note=f"{100 * cost / 0.01:.1f} % of a scan of 10 ms; the mechanics left out",
    )
