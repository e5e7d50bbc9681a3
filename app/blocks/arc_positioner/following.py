"""ARC_POSITIONER, our mode: follows the path by angle, both axes together."""

from dataclasses import dataclass, field
from enum import Enum
from math import cbrt, copysign, cos, degrees, hypot, inf, isfinite, nan, radians, sin, sqrt
from typing import NamedTuple

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.motion_profile import MotionProfile
from app.blocks.s_ramp import SRamp

PATH, CURVE, OVERRIDE, STOP = 0.6, 0.4, 0.4, 0.85
"""Of an axis' acceleration and jerk: for the path as a whole, in it for the curve alone, for slowing down on the path, and for a stop."""
ZONE = 0.25
"""Of an axis' acceleration, with which the load slows down before the slow zone: less than `OVERRIDE`, for the jerk."""
JOIN = 20.0
"""A load beside the circle is led onto it over this many times its offset."""
SPARE = 1.0
"""More than that, when it has to go back first [°]."""
LEAST_RATE = 0.1
"""Of the planned speed, where slowing down for a path error ends; beyond comes the stop."""


class ArcPhase(Enum):
    """What a circular move does."""

    OFF = "off"
    BRAKES = "brakes"
    """Waits until both brakes are open and nothing holds it."""
    MOVING = "moving"
    HELD = "held"
    """Stands on the path and goes on when it is released."""
    STOPPING = "stopping"
    """The start was dropped, or the path error is beyond its limit: to standstill along the path."""
    DONE = "done"
    FAULT = "fault"
    """Stands, with a reason; a new start begins where it stands."""


TRAVELS = frozenset({ArcPhase.MOVING, ArcPhase.HELD, ArcPhase.STOPPING})


class Fault(Enum):
    """Why a move ended, or did not begin."""

    NONE = "none"
    NO_CIRCLE = "no_circle"
    """No zero position was ever taken."""
    OFF_THE_PATH = "off_the_path"
    """Stands too far from the circle to be led onto it."""
    PATH_ERROR = "path_error"
    BRAKE_LOST = "brake_lost"
    STOP_SWITCH = "stop_switch"


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """One axis.

    Raises:
        ValueError: a value is not a finite number above 0; lag or resolution not of at least 0.
    """

    max_speed: float
    """[mm/s]"""
    acceleration: float
    """The smaller one of its two ramps [mm/s²]."""
    jerk: float
    """[mm/s³]"""
    lag: float = 0.0
    """Set-point to speed, as commissioned [s]."""
    resolution: float = 0.0
    """Of the encoder [mm]; what is below it is not corrected, the path alone knows better there."""

    def __post_init__(self) -> None:
        for name in ("max_speed", "acceleration", "jerk"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")
        for name in ("lag", "resolution"):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value}, a finite number of at least 0 expected")


class ArcInputs(NamedTuple):
    """Of one scan."""

    start: bool
    """Held; counts when it comes, dropping it stops along the path."""
    position: Point
    """Of the load [mm], rope stretch taken off (`rope.stretch`)."""
    start_angle: float
    """Where the load is when the zero position is taken [°]."""
    end_angle: float
    """[°]; its side of the present angle gives the direction."""
    radius: float
    """[mm]"""
    set_speed: float
    """Along the path [mm/s]."""
    take_zero: bool = False
    """Counts when it comes, not while moving: the circle is laid through the present position."""
    brakes_open: tuple[bool, bool] = (True, True)
    rope_strain: float = 0.0
    """Of the hoist's rope under its present load: the load rises by this part more than the drum takes up."""
    hold: bool = False
    stop_switch: bool = False
    rope_rate: float = 0.0
    """How fast the hoist's rope gets longer because its load does [mm/s]: the drum has to take up as much."""
    slow_zone: tuple[float, float] = (0.0, 0.0)
    """Lower and upper angle between which the load is taken up or set down [°]; equal = none."""
    slow_speed: float = inf
    """Greatest along the path in there [mm/s], above 0."""


class Outputs(NamedTuple):
    """Of one scan."""

    speed: Point
    """Commands [mm/s], signed."""
    percent: Point
    """Of the axis' greatest speed, without sign."""
    run: bool
    """Both drives are wanted, energised and with open brakes."""
    angle: float
    """[°]"""
    path_error: float
    """Distance from where the load should be by now [mm]."""
    radial_error: float
    """[mm], outwards positive."""
    phase: ArcPhase
    fault: Fault


@dataclass(slots=True)
class ArcFollower:
    """Circular lift by a planned path.

        way along the path   s(t) from rest to rest, bounded speed, acceleration and jerk (`MotionProfile`)
        angle                φ = φ0 ± s / R
        command of an axis   rate·ṡ·t(φ) one drive lag ahead  +  gain·(where it should be - where it is)

    with t the tangent of the circle. The path acceleration is the vector of tangential a and centripetal v²/R, its jerk that of
    s⃛ - v³/R² and 3·v·a/R; both stay below `PATH` of the weaker axis. Whatever slows the move down (hold, path error) slows the time of the
    path (`rate`), so the load stays on it. Path error: above `slow_error` the move slows down, at `stop_error` it stops along the path, and
    when it stands, or at twice that error, it is a fault. A lost brake and a stop switch take both commands at once: each axis then stops
    by its drive's ramp and the load is beside the circle afterwards. The next move leads it back on `JOIN` times as long a way.

    The original's formulas are in `original.py`; what they lack is why this mode exists.

    Raises:
        ValueError: a limit is not a finite number above 0, or slow_error is not below stop_error.
    """

    x: AxisLimits
    y: AxisLimits
    gain: float = 2.0
    """Of the correction [1/s]."""
    correction: float = 10.0
    """Greatest correction of an axis [mm/s]."""
    headroom: float = 0.03
    """Of an axis' greatest speed, kept for the correction."""
    slow_error: float = 4.0
    """[mm]"""
    stop_error: float = 10.0
    """[mm]"""
    tolerance: float = 1.0
    """Done within this of the end [mm]."""
    join: float = 100.0
    """Farthest from the circle that a move may begin [mm]."""
    phase: ArcPhase = ArcPhase.OFF
    fault: Fault = Fault.NONE
    circle: Circle | None = None
    time: float = 0.0
    """On the path [s]."""
    _profile: MotionProfile = field(default_factory=lambda: MotionProfile(0.0, 1.0, 1.0, 1.0))
    _rate: SRamp = field(default_factory=lambda: SRamp(1.0, 1.0))
    _begin: float = 0.0
    """Angle where the move began [°]."""
    _way: float = 1.0
    """+1 or -1."""
    _offset: float = 0.0
    """From the circle where the move began [mm]."""
    _strayed: bool = False
    """It stops for a path error, not because the start was dropped."""
    _angle: float = nan
    _started: bool = True
    """A start that is there already at the first scan is not new."""
    _taken: bool = True

    def __post_init__(self) -> None:
        for name in ("gain", "correction", "headroom", "slow_error", "stop_error", "tolerance", "join"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")
        if not self.slow_error < self.stop_error:
            raise ValueError(f"slow_error is {self.slow_error}, a number below stop_error {self.stop_error} expected")

    def step(self, inputs: ArcInputs, dt: float) -> Outputs:
        """One scan of `dt` [s].

        Raises:
            ValueError: a number of the inputs is not finite, radius or set_speed not above 0, or rope_strain below 0; `safe` is what
                holds then.
        """
        _check(inputs)
        started, self._started = inputs.start and not self._started, inputs.start
        taken, self._taken = inputs.take_zero and not self._taken, inputs.take_zero
        if taken and self.phase in (ArcPhase.OFF, ArcPhase.DONE, ArcPhase.FAULT):
            self.circle = Circle.through(inputs.position, inputs.start_angle, inputs.radius)
            self._angle = inputs.start_angle
        if not inputs.start and self.phase in (ArcPhase.MOVING, ArcPhase.HELD):
            self.phase, self._strayed = ArcPhase.STOPPING, False
        elif not inputs.start and self.phase is not ArcPhase.STOPPING:
            self.phase, self.fault = ArcPhase.OFF, Fault.NONE
        if started and self.phase not in TRAVELS:
            self._plan(inputs)
        error, speed = self._follow(inputs, dt), Point(0.0, 0.0)
        if self.phase in TRAVELS:
            # where it should have been when it was measured, how fast it should be in the middle of the scan that follows
            speed = self._command(inputs, dt)
            self.time += max(0.0, self._rate.speed) * dt
        if self.circle is not None:
            self._angle = self.circle.angle(inputs.position, self._angle)
        return Outputs(
            speed,
            Point(abs(speed.x) / self.x.max_speed * 100, abs(speed.y) / self.y.max_speed * 100),
            self.phase is ArcPhase.BRAKES or self.phase in TRAVELS,
            self._angle,
            error,
            self.circle.radial_error(inputs.position) if self.circle else nan,
            self.phase,
            self.fault,
        )

    def safe(self) -> Outputs:
        """Stand still: an input is bad. A new start is wanted afterwards."""
        self.phase, self._started = ArcPhase.OFF, True
        still = Point(0.0, 0.0)
        return Outputs(still, still, False, self._angle, nan, nan, ArcPhase.OFF, self.fault)

    def lay(self, circle: Circle, near: float) -> None:
        """Take a circle that is known from elsewhere, the load about `near` [°]; not while moving."""
        self.circle, self._angle = circle, near

    def release(self) -> None:
        """Stand still, because an axis does: the next start counts when it comes, and the circle stays."""
        self.safe()
        self._started = False

    def first_leg(self, position: Point, angles: tuple[float, float]) -> float:
        """Angle [°] to which a move between two `angles` [°] has to go first when it begins at `position` [mm]; usually that of its end.

        A load that stands beside the circle too near the end is led onto the circle on the way back, and then moves forward.
        """
        circle, (start, end) = self.circle, angles
        if circle is None:
            return end
        begin, offset = circle.angle(position, self._angle), abs(circle.radial_error(position))
        joining, forward = degrees(JOIN * offset / circle.radius), copysign(1.0, end - start)
        back = begin - forward * (joining + SPARE)
        if offset < self.tolerance or offset > self.join or joining <= abs(end - begin) or (back - start) * forward < 0:
            return end
        return back

    def path_speed(self, radius: float, set_speed: float) -> float:
        """Speed along a path of `radius` [mm] at which neither axis is asked for too much [mm/s]."""
        weaker = min(self.x.acceleration, self.y.acceleration)
        return min(
            set_speed,
            (1 - self.headroom) * min(self.x.max_speed, self.y.max_speed),
            sqrt(CURVE * weaker * radius),
            cbrt(PATH / 4 * min(self.x.jerk, self.y.jerk) * radius**2),
        )

    def _plan(self, inputs: ArcInputs) -> None:
        """A path from where the load is to the end angle."""
        self.fault = Fault.NONE
        if self.circle is None or self.circle.radius != inputs.radius:
            self.phase, self.fault = ArcPhase.FAULT, Fault.NO_CIRCLE
            return
        self._begin = self.circle.angle(inputs.position, self._angle)
        sweep = inputs.end_angle - self._begin
        self._offset = self.circle.radial_error(inputs.position)
        if abs(self._offset) < self.tolerance:
            self._offset = 0.0
        if not abs(self._offset) <= min(self.join, radians(abs(sweep)) * inputs.radius / JOIN):
            self.phase, self.fault = ArcPhase.FAULT, Fault.OFF_THE_PATH
            return
        self._way = copysign(1.0, sweep)
        speed = self.path_speed(inputs.radius, inputs.set_speed)
        acceleration, jerk = min(self.x.acceleration, self.y.acceleration), min(self.x.jerk, self.y.jerk)
        tangential = min(
            sqrt((PATH * acceleration) ** 2 - (speed**2 / inputs.radius) ** 2),
            PATH / 4 * jerk * inputs.radius / (3 * speed),
        )
        self._profile = MotionProfile(radians(abs(sweep)) * inputs.radius, speed, tangential, PATH / 2 * jerk)
        self._rate = SRamp(OVERRIDE * acceleration / speed, OVERRIDE * jerk / speed, speed=1.0)
        self.time = 0.0
        self.phase = ArcPhase.BRAKES

    def _follow(self, inputs: ArcInputs, dt: float) -> float:
        """Advance on the path; gives the path error [mm]."""
        if self.phase is ArcPhase.BRAKES and all(inputs.brakes_open) and not inputs.stop_switch and not inputs.hold:
            self.phase = ArcPhase.MOVING
        elif self.phase in TRAVELS:
            self._supervise(inputs, _distance(self._reference(0.0)[0], inputs.position))
            if self.phase in TRAVELS:
                self._advance(inputs, dt)
        elif self.phase is ArcPhase.BRAKES and inputs.stop_switch:
            self.phase, self.fault = ArcPhase.FAULT, Fault.STOP_SWITCH
        if self.phase is ArcPhase.BRAKES or self.phase in TRAVELS:
            return _distance(self._reference(0.0)[0], inputs.position)
        return nan

    def _advance(self, inputs: ArcInputs, dt: float) -> None:
        """Take the rate at which the time of the path runs; told that it has arrived, stand."""
        error = _distance(self._reference(0.0)[0], inputs.position)
        weaker, rate = min(self.x.acceleration, self.y.acceleration), self._rate
        slowing = -min(0.0, self._profile.at(self.time).acceleration) * rate.speed**2
        share = OVERRIDE if self.phase is ArcPhase.MOVING else max(OVERRIDE, STOP - slowing / weaker)
        rate.acceleration_limit = share * weaker / self._profile.speed
        rate.step(min(self._wanted_rate(error), self._zone_rate(inputs)), dt)
        if self.phase is ArcPhase.MOVING and self.time >= self._profile.duration and error < self.tolerance:
            self.phase = ArcPhase.DONE

    def _supervise(self, inputs: ArcInputs, error: float) -> None:
        """What ends the move."""
        if inputs.stop_switch:
            self.phase, self.fault = ArcPhase.FAULT, Fault.STOP_SWITCH
        elif not all(inputs.brakes_open):
            self.phase, self.fault = ArcPhase.FAULT, Fault.BRAKE_LOST
        elif error >= 2 * self.stop_error:
            self.phase, self.fault = ArcPhase.FAULT, Fault.PATH_ERROR
        elif self.phase is ArcPhase.STOPPING and self._rate.speed <= 0 and self._rate.acceleration == 0:
            self.phase, self.fault = (ArcPhase.FAULT, Fault.PATH_ERROR) if self._strayed else (ArcPhase.OFF, Fault.NONE)
        elif error >= self.stop_error:
            self.phase, self._strayed = ArcPhase.STOPPING, True
        elif self.phase is not ArcPhase.STOPPING:
            self.phase = ArcPhase.HELD if inputs.hold else ArcPhase.MOVING

    def _wanted_rate(self, error: float) -> float:
        if self.phase is not ArcPhase.MOVING:
            return 0.0
        return min(1.0, max(LEAST_RATE, (self.stop_error - error) / (self.stop_error - self.slow_error)))

    def _zone_rate(self, inputs: ArcInputs) -> float:
        """Rate at which the load is no faster than it may be in the slow zone when it gets there."""
        low, high = inputs.slow_zone
        if not low < high:
            return 1.0
        way, speed, _ = self._profile.at(self.time)
        angle = self._begin + degrees(self._way * way / inputs.radius)
        left = low - angle if self._way > 0 else angle - high
        if left < low - high or not speed:  # behind it
            return 1.0
        brake = ZONE * min(self.x.acceleration, self.y.acceleration)
        return min(1.0, sqrt(inputs.slow_speed**2 + 2 * brake * max(0.0, radians(left) * inputs.radius)) / speed)

    def _reference(self, ahead: float) -> tuple[Point, Point]:
        """(where the load should be, how fast) on the path, `ahead` [s] from now."""
        assert self.circle is not None
        rate = max(0.0, self._rate.speed + self._rate.acceleration * ahead)
        way, speed, _ = self._profile.at(self.time + (max(0.0, self._rate.speed) + rate) / 2 * ahead)
        angle = radians(self._begin) + self._way * way / self.circle.radius
        offset, slope = self._joining(way)
        radius, along, out = self.circle.radius + offset, self._way * rate * speed, slope * rate * speed
        along *= radius / self.circle.radius
        return (
            Point(self.circle.x + radius * cos(angle), self.circle.y + radius * sin(angle)),
            Point(out * cos(angle) - along * sin(angle), out * sin(angle) + along * cos(angle)),
        )

    def _joining(self, way: float) -> tuple[float, float]:
        """(offset from the circle, its slope) after `way` [mm]: from that of the begin to none, without a jump of the acceleration."""
        length = JOIN * abs(self._offset)
        if way >= length:
            return 0.0, 0.0
        part = way / length
        left = 1 - part**3 * (10 - 15 * part + 6 * part**2)
        return self._offset * left, -self._offset * 30 * part**2 * (1 - part) ** 2 / length

    def _command(self, inputs: ArcInputs, dt: float) -> Point:
        (x, y), _ = self._reference(0.0)
        feed_x = self._reference(self.x.lag + dt / 2)[1].x
        feed_y = (self._reference(self.y.lag + dt / 2)[1].y + inputs.rope_rate) / (1 + inputs.rope_strain)
        return Point(
            self._axis(self.x, feed_x, x - inputs.position.x), self._axis(self.y, feed_y, y - inputs.position.y)
        )

    def _axis(self, axis: AxisLimits, feed: float, error: float) -> float:
        correction = self.gain * (error - _within(error, axis.resolution))
        return _within(feed + _within(correction, self.correction), axis.max_speed)


def _check(inputs: ArcInputs) -> None:
    numbers = {
        "position x": inputs.position.x,
        "position y": inputs.position.y,
        "start_angle": inputs.start_angle,
        "end_angle": inputs.end_angle,
        "radius": inputs.radius,
        "set_speed": inputs.set_speed,
        "rope_strain": inputs.rope_strain,
        "rope_rate": inputs.rope_rate,
        "slow zone from": inputs.slow_zone[0],
        "slow zone to": inputs.slow_zone[1],
    }
    for name, value in numbers.items():
        if not isfinite(value):
            raise ValueError(f"{name} is {value}, a finite number expected")
    for name in ("radius", "set_speed"):
        if not numbers[name] > 0:
            raise ValueError(f"{name} is {numbers[name]}, a number above 0 expected")
    if not inputs.slow_speed > 0:
        raise ValueError(f"slow_speed is {inputs.slow_speed}, a number above 0 expected")
    if not inputs.rope_strain >= 0:
        raise ValueError(f"rope_strain is {inputs.rope_strain}, a number of at least 0 expected")


def _distance(one: Point, other: Point) -> float:
    return hypot(one.x - other.x, one.y - other.y)


def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
