"""Jerk-limited ramp: speed follows its target with bounded acceleration and bounded change of acceleration."""

from dataclasses import dataclass, field
from math import isfinite, sqrt
from typing import NamedTuple

_NOISE = 1e-9
"""Relative rounding that still counts as arrived."""


class RampOutputs(NamedTuple):
    """What a cycle gives. U is the unit of the speed (%, mm/s)."""

    speed: float
    """[U]"""
    acceleration: float
    """[U/s]"""
    stop_distance: float
    """Where it comes to if it began to brake now [U·s], signed: + is forward. Of a stop that swings
    through zero (the speed was on its way to the other side) the farthest point counts, whichever side that is."""
    done: bool
    """Speed is the target and stays."""


class _Phase(NamedTuple):
    jerk: float
    duration: float


@dataclass(slots=True)
class SRamp:
    """S-shaped ramp of a speed.

    The time-optimal way from the present speed and acceleration to the target is planned anew in every cycle and followed exactly for
    `dt`, so the path does not depend on the scan period and the target is met exactly. The speed never overshoots, with one exception
    that no ramp with bounded jerk can avoid: a target that came nearer than the speed still needs to let its acceleration go (a²/2j) is
    passed by just that much.

    With cycles as the unit of time (`dt` = 1) `jerk` is the accel step and `acceleration_limit` the max accel of the thesis: target 30,
    step 0.01, max 0.25 takes 145 cycles, 25 with rising, 95 with constant, 25 with falling acceleration.

    Limits may be changed at any time; an acceleration above a lowered limit is brought down with the jerk.

    Source: thesis 003, block SRAMP and DTS (reference/theses-facts.md section 3).
    """

    acceleration_limit: float
    """[U/s], above 0."""
    jerk: float
    """[U/s²], above 0."""
    speed: float = 0.0
    """[U]"""
    acceleration: float = 0.0
    """[U/s]"""
    followed: tuple[tuple[float, float], ...] = field(default=(), init=False, repr=False, compare=False)
    """What the last step went through: (jerk [U/s²], duration [s]) of each phase."""

    def __post_init__(self) -> None:
        self._check()

    def step(self, target: float, dt: float) -> RampOutputs:
        """One cycle of `dt` [s] towards `target` [U].

        Raises:
            ValueError: dt, acceleration_limit or jerk is not a finite number above 0, or target is not finite.
        """
        if not isfinite(target):
            raise ValueError(f"target is {target}, a finite number expected")
        if not (isfinite(dt) and dt > 0):
            raise ValueError(f"dt is {dt}, a finite number above 0 expected")
        self._check()
        if self.speed != target or self.acceleration != 0.0:
            self._follow(target, dt)
        done = self.speed == target and self.acceleration == 0.0
        return RampOutputs(self.speed, self.acceleration, self.stop_distance(), done)

    def reset(self, speed: float = 0.0) -> None:
        """Without a ramp to `speed` [U]: power is gone, or the drive took over elsewhere.

        Raises:
            ValueError: speed is not finite.
        """
        if not isfinite(speed):
            raise ValueError(f"speed is {speed}, a finite number expected")
        self.speed = speed
        self.acceleration = 0.0

    def stop_distance(self) -> float:
        """Distance to stop [U·s], see `RampOutputs.stop_distance`."""
        v, a = self.speed, self.acceleration
        if v == 0.0 and a == 0.0:
            return 0.0
        if a == 0.0:
            # the usual case, the same path in one formula
            limit, size = self.acceleration_limit, abs(v)
            long = size * self.jerk >= limit * limit
            return v / 2 * (size / limit + limit / self.jerk) if long else v * sqrt(size / self.jerk)
        x = turn = 0.0
        for jerk, duration in _plan(v, a, 0.0, self.acceleration_limit, self.jerk):
            crossing = _zero(v, a, jerk, duration)
            if crossing is not None and not turn:
                turn = x + crossing * (v + crossing * (a / 2 + crossing * jerk / 6))
            x += duration * (v + duration * (a / 2 + duration * jerk / 6))
            v += duration * (a + duration * jerk / 2)
            a += duration * jerk
        return turn if abs(turn) > abs(x) else x

    def _follow(self, target: float, dt: float) -> None:
        plan = _plan(self.speed, self.acceleration, target, self.acceleration_limit, self.jerk)
        if sum(phase.duration for phase in plan) <= dt * (1 + _NOISE):
            self.speed, self.acceleration = float(target), 0.0
            self.followed = plan
            return
        left, followed = dt, []
        for jerk, duration in plan:
            t = min(left, duration)
            self.speed += t * (self.acceleration + t * jerk / 2)
            self.acceleration += t * jerk
            followed.append((jerk, t))
            left -= t
            if left <= 0:
                break
        self.followed = tuple(followed)

    def _check(self) -> None:
        for name in ("acceleration_limit", "jerk"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")
        for name in ("speed", "acceleration"):
            if not isfinite(getattr(self, name)):
                raise ValueError(f"{name} is {getattr(self, name)}, a finite number expected")


def _plan(v: float, a: float, target: float, limit: float, jerk: float) -> tuple[_Phase, ...]:
    """Phases of constant jerk from speed `v` and acceleration `a` to `target` at rest (acceleration 0), the quickest way.

    The peak of the acceleration follows from Δv = (2·peak² − a²)/(2·jerk) in the direction of the change.
    """
    let_go = a * abs(a) / (2 * jerk)
    missing = target - (v + let_go)
    if abs(missing) <= _NOISE * (abs(target) + abs(v) + abs(let_go)):
        return (_Phase(-jerk if a > 0 else jerk, abs(a) / jerk),)
    way = 1.0 if missing > 0 else -1.0
    rise, change = way * a, way * (target - v)
    if rise > limit:
        # the limit was lowered: down to it, along it, down to nothing
        hold = (change - rise * rise / (2 * jerk)) / limit
        down, end = _Phase(-way * jerk, (rise - limit) / jerk), _Phase(-way * jerk, limit / jerk)
        return down, _Phase(0.0, hold), end
    peak = min(limit, sqrt(max(0.0, jerk * change + rise * rise / 2)))
    peak = max(peak, rise)
    hold = max(0.0, (change - (2 * peak * peak - rise * rise) / (2 * jerk)) / peak) if peak > 0 else 0.0
    return _Phase(way * jerk, (peak - rise) / jerk), _Phase(0.0, hold), _Phase(-way * jerk, peak / jerk)


def _zero(v: float, a: float, jerk: float, duration: float) -> float | None:
    """First time in a phase at which the speed crosses zero; None when it does not."""
    if v == 0.0 or v * a >= 0.0:
        return None
    if jerk == 0.0:
        t = -v / a
        return t if t < duration else None
    root = a * a - 2 * jerk * v
    if root <= 0.0:
        return None
    # the root nearer to now, in the form that does not cancel
    t = -2 * v / (a + (sqrt(root) if a > 0 else -sqrt(root)))
    return t if 0.0 < t < duration else None
