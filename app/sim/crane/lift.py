"""A circular lift in the mechanics, by our mode or by the original's formulas: how far from the true circle the load gets."""

from dataclasses import dataclass
from math import hypot

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.arc_positioner.following import ArcFollower, ArcInputs, ArcPhase, AxisLimits, Fault
from app.blocks.arc_positioner.original import OriginalArc
from app.blocks.rope import stretch
from app.sim.crane.axis import Axis, AxisData
from app.sim.crane.figures import HOIST, TROLLEY
from app.sim.crane.rope import Rope

TROLLEY_DATA, HOIST_DATA = AxisData.of(TROLLEY), AxisData.of(HOIST)
STRAIN = HOIST["rope_strain"].value
JERK_TIME = 0.5
"""In which an axis reaches its acceleration [s] (assumed)."""
RELEASE = (0.2, 0.6)
"""Of the brakes of trolley and hoist [s]: 0.4 s apart."""
CREEP = 1.0
"""Slower than this with both axes for 3 s, the original's formulas have come to their end [mm/s]."""
LONGEST = 3000.0
"""Of a lift that has not ended by then [s]."""


@dataclass(frozen=True, slots=True)
class Case:
    """One lift."""

    speed: float
    """Along the path [mm/s]."""
    radius: float
    """[mm]"""
    start: float = 0.0
    """[°]"""
    end: float = 90.0
    """[°]"""
    lag: tuple[float, float] = (0.1, 0.1)
    """First-order lag of trolley and hoist [s]."""
    dead_time: tuple[float, float] = (0.0, 0.0)
    """[s]"""
    assumed_lag: tuple[float, float] | None = None
    """What the block was told; None = the true one."""
    release: tuple[float, float] = RELEASE
    """[s]"""
    load: float = 1.0
    """[1 = full load]"""
    weighed: float = 1.0
    """What the scale says of it [1 = the truth]."""
    gain: tuple[float, float] = (1.0, 1.0)
    """Speed of the axis to what is asked for."""
    offset: tuple[float, float] = (0.0, 0.0)
    """Where it begins, beside the usual place: other positions between two pulses of the encoders [mm]."""


@dataclass(slots=True)
class Result:
    """What became of a lift."""

    worst: float
    """Greatest way from the true circle [mm]."""
    end: float
    """Distance from the true end point [mm]."""
    seconds: float
    phase: ArcPhase
    fault: Fault
    top: Point
    """Greatest speeds [mm/s]."""
    acceleration: Point
    """Greatest of the commands [mm/s²]."""
    strain: float
    """Time for which a drive worked against its brake [s]."""


class Lift:
    """Both axes, the hoist's rope, and either mode; `step` by `step` or to the end with `run`."""

    def __init__(self, case: Case, *, original: bool = False, dt: float = 0.01) -> None:
        self.case, self.original, self.dt = case, original, dt
        self.trolley, self.hoist = (
            Axis(
                data.with_(
                    lag=case.lag[n],
                    dead_time=case.dead_time[n],
                    brake_release=case.release[n],
                )
            )
            for n, data in enumerate((TROLLEY_DATA, HOIST_DATA))
        )
        self.trolley.position, self.hoist.position = 10000.0 + case.offset[0], 12000.0 + case.offset[1]
        self.rope = Rope(case.load, STRAIN, HOIST["max_position"].value + HOIST["rope_length_at_top"].value)
        self.rope.settle(self.hoist.position)
        lag = case.assumed_lag or (case.lag[0] + case.dead_time[0], case.lag[1] + case.dead_time[1])
        x, y = (
            AxisLimits(d.max_speed, min(d.acceleration, d.deceleration), d.acceleration / JERK_TIME, at, d.resolution)
            for d, at in zip((TROLLEY_DATA, HOIST_DATA), lag, strict=True)
        )
        self.follower = ArcFollower(x, y)
        times = Point(TROLLEY["slow_down_time"].value, HOIST["slow_down_time"].value)
        self.formulas = OriginalArc(Point(TROLLEY_DATA.max_speed, HOIST_DATA.max_speed), times)
        self.circle = Circle.through(self.true, case.start, case.radius)
        """The true one."""
        self.result = Result(0.0, 0.0, 0.0, ArcPhase.OFF, Fault.NONE, Point(0.0, 0.0), Point(0.0, 0.0), 0.0)
        self.path_error = 0.0
        self.command = Point(0.0, 0.0)
        self.start, self.hold = True, False
        self.blocked = [False, False]
        """Fault: the axis does not move whatever it is told."""
        self._scans = self._slow = 0

    @property
    def true(self) -> Point:
        """Where the load is [mm]."""
        return Point(self.trolley.position, self.hoist.position - self.rope.stretch)

    @property
    def measured(self) -> Point:
        """Where the control believes that the load is [mm]: encoders and scale."""
        y = self.hoist.measured
        if self.original:
            return Point(self.trolley.measured, y)
        return Point(self.trolley.measured, y - stretch(self.case.load * self.case.weighed, self.rope.top - y, STRAIN))

    def run(self) -> Result:
        """To the end."""
        while not self.step():
            if self.result.seconds > LONGEST:
                raise TimeoutError(f"{self.case} not done in {LONGEST:g} s")
        self.result.end = hypot(*(a - b for a, b in zip(self.true, self.circle.at(self.case.end), strict=True)))
        return self.result

    def step(self) -> bool:
        """One scan; whether the lift has ended and both axes stand."""
        first, self._scans = self._scans == 0, self._scans + 1
        (x, y), run, ended = self._formulas(first) if self.original else self._follow(first)
        result, dt = self.result, self.dt
        if self._scans > 2:
            result.acceleration = Point(
                *(max(w, abs(b - a) / dt) for w, a, b in zip(result.acceleration, self.command, (x, y), strict=True))
            )
        self.command = Point(x, y)
        before = self.hoist.speed
        for axis, command, gain, blocked in zip(
            (self.trolley, self.hoist), (x, y), self.case.gain, self.blocked, strict=True
        ):
            # the drive's control gives it a reference only with its own brake open
            axis.step(command * gain if axis.is_open and not blocked else 0.0, run, dt, quick_stop=blocked)
        self.rope.step(self.hoist.position, (self.hoist.speed - before) / dt, dt)
        result.seconds += dt
        result.worst = max(result.worst, abs(self.circle.radial_error(self.true)))
        result.top = Point(max(result.top.x, abs(self.trolley.speed)), max(result.top.y, abs(self.hoist.speed)))
        result.strain = self.trolley.strain + self.hoist.strain
        return ended and max(abs(self.trolley.speed), abs(self.hoist.speed)) < (CREEP if self.original else 1e-3)

    def _follow(self, first: bool) -> tuple[Point, bool, bool]:
        case = self.case
        out = self.follower.step(
            ArcInputs(
                self.start and not first,
                self.measured,
                case.start,
                case.end,
                case.radius,
                case.speed,
                take_zero=self._scans == 2,
                brakes_open=(self.trolley.is_open, self.hoist.is_open),
                rope_strain=case.load * case.weighed * STRAIN,
                hold=self.hold,
            ),
            self.dt,
        )
        self.result.phase, self.result.fault, self.path_error = out.phase, out.fault, out.path_error
        return out.speed, out.run, out.phase in (ArcPhase.DONE, ArcPhase.FAULT)

    def _formulas(self, first: bool) -> tuple[Point, bool, bool]:
        case = self.case
        speeds = Point(self.trolley.speed, self.hoist.speed)
        out = self.formulas.step(not first, first, self.measured, speeds, case.start, case.end, case.radius, case.speed)
        finished = self.formulas.stopped == (True, True)
        self.result.phase = ArcPhase.DONE if finished else ArcPhase.MOVING
        # near its end it may creep on for ever
        self._slow = self._slow + 1 if max(map(abs, out.speed)) < CREEP else 0
        return out.speed, True, finished or self._slow * self.dt > 3
