"""How the sequence moves the crane: positioners of single axes, and the circular move of trolley and hoist."""

from collections.abc import Mapping, Sequence
from math import asin, degrees, isfinite, nan

from app.blocks.arc_positioner.circle import Circle, Point
from app.blocks.arc_positioner.following import ArcFollower, ArcInputs, ArcPhase, AxisLimits, Fault
from app.blocks.arc_positioner.original import OriginalArc
from app.blocks.positioner.positioner import MoveInputs, MovePhase, Positioner
from app.blocks.ramp import Ramp
from app.blocks.rope import stretch
from app.blocks.sway_shaper import Shaped, Shaping, SwayShaper
from app.sim.crane.figures import HOIST
from app.sim.crane.plc_axis import Asked, PlcAxis

LAG = 0.1
"""Of the drives, as commissioned [s]."""
MARGIN = 0.05
"""What a positioner adds to it: with less lag than told it stops short, with more it would overshoot [s]."""
UNSHAPED = Shaped(0.0, 0.0, 0.0)
TINY = 1e-9
SLOW_DISTANCE: Mapping[str, float] = {"hoist": 60.0, "trolley": 200.0, "bridge": 200.0}
"""At the lowest manual speed before a target [mm]."""
JERK_TIME = 0.5
"""In which an axis reaches its acceleration [s]."""
MIDDLE = 45.0
"""Of the two ends of a circular move: the angle of a load is looked for around it [°]."""
CREEP = 1.0
"""Slower than this for so long, the original's formulas have come to their end [mm/s]."""
CREEPING = 3.0
"""[s]"""
STRAIN = HOIST["rope_strain"].value
USUAL, FINE = (5.0, 3), (1.0, 6)
"""Tolerance of a position [mm] and attempts to reach it."""
TOP = HOIST["max_position"].value + HOIST["rope_length_at_top"].value
SET_DOWN_WAY, SET_DOWN_SPEED = 600.0, 60.0
"""Height of the load over the lock in which the ladle is taken up or set down, and the greatest speed there (assumed) [mm, mm/s]: as much
as the rope gets longer meanwhile, the drum turns more."""
SET_DOWN_BELOW = 10.0
"""The zone goes on so far below the end of the circle [°]."""
FASTEST_STRETCH = 20.0
"""Of a rope that takes up its load; what is more is a leap of the scale [mm/s]."""
STILL = Asked()
SWAYING = ("trolley", "bridge")
"""Axes under which the load swings."""
SHAPINGS: Sequence[Shaping] = (Shaping.OFF, Shaping.ZV, Shaping.ZVD)
"""By the value of the setting."""


class CalmMove:
    """A positioner; of trolley and bridge with a ramp and the sway shaper behind it, so that the load hangs still when they are there.

    The shaper takes a speed every `scan` [s], however long the scans of the program are. Its positioner is told the drive's lag without
    `MARGIN`, half a scan on it for the steps of the shaper: a further attempt costs the delay of the shaper once more. What stops an axis
    otherwise (suspension, fault, emergency stop) is never shaped.
    """

    def __init__(self, axis: PlcAxis, shaping: Shaping, scan: float) -> None:
        data = axis.axis.data
        self._axis, self._scan = axis, scan
        calms = axis.name in SWAYING and shaping is not Shaping.OFF
        self.block = Positioner(
            axis.max_speed,
            data.acceleration,
            data.deceleration,
            slow_speed=axis.steps[0],
            slow_distance=SLOW_DISTANCE[axis.name],
            lag=LAG + (scan / 2 if calms else MARGIN),
        )
        self._shaper = SwayShaper(TOP, scan, shaping) if calms else None
        self._ramp = Ramp(data.acceleration, data.deceleration)
        self._shaped, self._since = UNSHAPED, 0.0

    def step(self, target: float, speed: float, rope: float, dt: float) -> tuple[MovePhase, float]:
        """(phase, command [mm/s]) of a scan of `dt` [s] on the way to `target` [mm] at `speed` [mm/s], with `rope` [mm] of rope out."""
        axis = self._axis
        low, high = axis.low, axis.high
        if self.block.phase is MovePhase.OFF:
            self._ramp.speed = axis.speed
        out = self.block.step(
            MoveInputs(
                True,
                axis.position,
                target,
                axis.speed,
                speed,
                low.slow,
                high.slow,
                low.stop,
                high.stop,
                self._shaped.held,
            ),
            dt,
        )
        if self._shaper is None:
            return out.phase, out.speed
        self._since += dt
        self._ramp.step(out.speed, dt)
        while self._since >= self._scan - TINY:
            self._since -= self._scan
            self._shaped = self._shaper.step(self._ramp.speed, rope)
        self.block.shaper_delay = self._shaped.delay
        return out.phase, self._shaped.speed

    def forget(self) -> None:
        """The axis was stopped elsewhere: nothing is under way, nothing is held."""
        if self.block.phase is MovePhase.OFF:
            return
        self.block.safe()
        if self._shaper is not None:
            self._shaper.clear()
        self._shaped, self._since = UNSHAPED, 0.0


class Travel:
    """Positioners and the circular move of one crane; asked anew in every scan, of usually `scan` [s]."""

    def __init__(self, axes: Mapping[str, PlcAxis], settings: Mapping[str, float], scan: float) -> None:
        self._axes, self._scan = axes, scan
        self.asked: dict[str, Asked] = {}
        """Of this scan, by axis."""
        self._load = 0.0
        """What hangs on the rope, as was known last [1 = full]."""
        self._rate = 0.0
        """[1/s]"""
        self._known = False
        """It was in the last scan."""
        self.take(settings)

    def take(self, settings: Mapping[str, float]) -> None:
        """Settings in effect; what was under way is forgotten."""
        speed = settings["automatic_speed"] / 100
        shaping = SHAPINGS[round(settings["sway_shaping"])]
        self._moves = {name: CalmMove(axis, shaping, self._scan) for name, axis in self._axes.items()}
        self._speeds = {name: axis.max_speed * speed for name, axis in self._axes.items()}
        self._radius = settings["arc_radius"]
        self._speed = settings["arc_speed"]
        x, y = (self._limits(self._axes[name]) for name in ("trolley", "hoist"))
        self.follower = ArcFollower(x, y)
        self._original = self._formulas()
        self.path_error = self.radial_error = nan
        self.worst = 0.0
        self.angle = self.goal = self._leg = nan
        self.phase, self.fault = ArcPhase.OFF, Fault.NONE
        self.circle: Circle | None = None
        self._creeping = 0.0
        self._moved: set[str] = set()
        self._circled = False

    def begin(self, load: float, dt: float) -> None:
        """A scan of `dt` [s] begins; nothing is asked yet. `load` by the scale [1 = full]; NaN = unknown, then the last one counts."""
        known = isfinite(load)
        self._rate = (load - self._load) / dt if known and self._known else 0.0
        self._load, self._known = load if known else self._load, known
        self.asked = {}
        self._moved.clear()
        self._circled = False

    def end(self, dt: float) -> None:
        """What was not asked for in this scan is forgotten."""
        for name, move in self._moves.items():
            if name not in self._moved and move.block.phase is not MovePhase.OFF:
                move.forget()
                self._axes[name].target = nan
        if self._circled:
            return
        if self.phase is ArcPhase.FAULT:
            self.follower.release()  # it is told until the next start, which counts
        elif self.phase not in (ArcPhase.OFF, ArcPhase.DONE):
            self._drop(dt)

    def position(self, name: str, target: float, dt: float, *, fine: bool = False) -> MovePhase:
        """Bring an axis to `target` [mm], the hoist so that the load on its rope is there; its brakes are open before it counts.

        `fine`: within 1 mm, in more attempts.
        """
        axis, move = self._axes[name], self._moves[name]
        self._moved.add(name)
        block = move.block
        block.tolerance, block.attempts = FINE if fine else USUAL
        if name == "hoist":
            strain = self._load * STRAIN
            target = (target + strain * TOP) / (1 + strain)
        there = block.phase in (MovePhase.DONE, MovePhase.MISSED)
        if block.phase is MovePhase.OFF and abs(axis.position - target) < block.tolerance and not axis.moving:
            return MovePhase.DONE
        axis.target = target
        if not axis.running and not there:
            move.forget()
            self.asked[name] = Asked(0.0, True)
            return MovePhase.OFF
        phase, speed = move.step(target, self._speeds[name], TOP - self._axes["hoist"].position, dt)
        if phase in (MovePhase.DONE, MovePhase.MISSED):
            axis.target = nan
        else:
            self.asked[name] = Asked(speed, True)
        return phase

    def lay(self, circle: Circle) -> None:
        """The circle of the next circular move."""
        self.circle = circle
        self.follower.release()
        self.follower.lay(circle, MIDDLE)
        self._original = self._formulas()
        self._original.circle = circle
        self.worst, self._creeping = 0.0, 0.0
        self.phase, self.fault = ArcPhase.OFF, Fault.NONE

    def circle_to(self, angles: tuple[float, float], original: bool, dt: float) -> bool:
        """Move the load on the circle to the second angle [°]; whether it is there. `fault` says when it ended otherwise."""
        self._circled = True
        trolley, hoist = self._axes["trolley"], self._axes["hoist"]
        self.goal = angles[1]
        if original:
            return self._by_formulas(angles, trolley, hoist, dt)
        if self.follower.phase in (ArcPhase.OFF, ArcPhase.FAULT):
            self._leg = self.follower.first_leg(self.load_at, angles)
        out = self.follower.step(
            ArcInputs(
                self.follower.phase is not ArcPhase.STOPPING,
                self.load_at,
                angles[0],
                self._leg,
                self._radius,
                self._speed,
                brakes_open=(trolley.running, hoist.running),
                rope_strain=self._load * STRAIN,
                rope_rate=self._rope_rate,
                slow_zone=(-SET_DOWN_BELOW, degrees(asin(min(1.0, SET_DOWN_WAY / self._radius)))),
                slow_speed=SET_DOWN_SPEED,
                stop_switch=any(axis.low.stop or axis.high.stop for axis in (trolley, hoist)),
            ),
            dt,
        )
        self.phase, self.fault = out.phase, out.fault
        self.angle, self.path_error, self.radial_error = out.angle, out.path_error, out.radial_error
        if isfinite(out.path_error):
            self.worst = max(self.worst, out.path_error)
        if out.run:
            self._ask_both(out.speed)
        if out.phase is ArcPhase.DONE and self._leg != angles[1]:  # it went back to the circle: now forward
            self.follower.release()
            self.phase = ArcPhase.BRAKES
            return False
        return out.phase is ArcPhase.DONE

    @property
    def load_at(self) -> Point:
        """Where the load is, by encoders and scale [mm]."""
        y = self._axes["hoist"].position
        return Point(self._axes["trolley"].position, y - stretch(self._load, max(0.0, TOP - y), STRAIN))

    @property
    def _rope_rate(self) -> float:
        """How fast the rope gets longer because the load does [mm/s]."""
        rate = self._rate * STRAIN * (TOP - self._axes["hoist"].position)
        return min(max(rate, -FASTEST_STRETCH), FASTEST_STRETCH)

    @property
    def circles(self) -> bool:
        """A circular move is under way, or waits for its brakes."""
        return self.phase in (ArcPhase.BRAKES, ArcPhase.MOVING, ArcPhase.HELD, ArcPhase.STOPPING)

    @property
    def planned(self) -> Point:
        """Where the load should be [mm]; NaN without a circular move."""
        if self.circle is None or self.phase not in (ArcPhase.MOVING, ArcPhase.HELD, ArcPhase.STOPPING):
            return Point(nan, nan)
        return self.circle.at(self.angle)

    def _drop(self, dt: float) -> None:
        """A suspended move comes to a stop on its circle."""
        trolley, hoist = self._axes["trolley"], self._axes["hoist"]
        if self.phase in (ArcPhase.MOVING, ArcPhase.HELD, ArcPhase.STOPPING) and trolley.running and hoist.running:
            out = self.follower.step(
                ArcInputs(
                    False,
                    self.load_at,
                    0.0,
                    self.goal,
                    self._radius,
                    self._speed,
                    rope_strain=self._load * STRAIN,
                    rope_rate=self._rope_rate,
                ),
                dt,
            )
            self.phase, self.fault = out.phase, out.fault
            if out.run:
                self._ask_both(out.speed)
                return
        self.follower.release()
        self.phase = ArcPhase.OFF

    def _ask_both(self, speed: Point) -> None:
        self.asked["trolley"], self.asked["hoist"] = Asked(speed.x, True), Asked(speed.y, True)

    def _by_formulas(self, angles: tuple[float, float], trolley: PlcAxis, hoist: PlcAxis, dt: float) -> bool:
        """The original's, with its defects, for comparison."""
        position = Point(trolley.position, hoist.position)
        speeds = Point(trolley.speed, hoist.speed)
        out = self._original.step(True, False, position, speeds, *angles, self._radius, self._speed)
        finished = self._original.stopped == (True, True)
        self._creeping = self._creeping + dt if max(map(abs, out.speed)) < CREEP else 0.0
        self.phase = ArcPhase.MOVING
        self.angle = out.angle
        assert self.circle is not None
        self.radial_error = self.circle.radial_error(position)
        self.path_error = abs(self.radial_error)
        self.worst = max(self.worst, self.path_error)
        if finished or self._creeping > CREEPING:
            self.phase = ArcPhase.DONE
            return True
        self._ask_both(out.speed)
        return False

    def _limits(self, axis: PlcAxis) -> AxisLimits:
        data = axis.axis.data
        weaker = min(data.acceleration, data.deceleration)
        return AxisLimits(axis.max_speed, weaker, data.acceleration / JERK_TIME, LAG, data.resolution)

    def _formulas(self) -> OriginalArc:
        trolley, hoist = self._axes["trolley"], self._axes["hoist"]
        times = Point(*(axis.max_speed / axis.axis.data.deceleration for axis in (trolley, hoist)))
        return OriginalArc(Point(trolley.max_speed, hoist.max_speed), times)
