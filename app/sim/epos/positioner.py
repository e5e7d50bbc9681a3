"""The basic positioner (EPOS) of a drive: jog, direct set-point input (MDI) and traversing blocks make the position set-point.

What no source tells, or tells differently:

| subject | taken here |
| --- | --- |
| profile | trapezoid: p2571, p2572, p2573, no limit of jerk |
| a move that a new one replaces | goes over into it without a stop |
| a task beyond a software limit | is not taken: no acknowledgement, A07477 or A07478 |
| absolute move of an axis that is not adjusted | is not taken: A07461 |
| jog towards a software limit | ends at it; beyond it only away from it |
| software limits | count with bit 14 of POS_STW2, and only of an adjusted axis |
| traversing blocks | each a position, a velocity and a pause; the block number picks the first one, after the last comes the first one |
| a jog while a task is under way, or MDI is selected | is not taken; MDI that is selected ends it |

Source: reference/profidrive.md sections 1, 6 and 7 (bits and parameters with their certainty), reference/theses-facts.md section 4.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import copysign, floor, sqrt
from typing import NamedTuple

from app.profidrive import position_words as words
from app.profidrive.position_words import word_of

NOT_ADJUSTED, BELOW, ABOVE = 7461, 7477, 7478
"""Alarms of a task that is not taken; numbers remembered from the maker's list and unconfirmed."""
TINY = 1e-6
NEAR = 0.5
"""The set-point is there [LU, LU/s]."""

_ACTIVATE, _KEEP, _GO = (
    word_of(words.STW1, [name]) for name in ("activate_task", "do_not_reject_task", "no_intermediate_stop")
)
_JOG_1, _JOG_2 = (word_of(words.STW1, [name]) for name in ("jog_1", "jog_2"))
_MDI, _ABSOLUTE, _POSITIVE, _NEGATIVE, _SET_UP, _CONTINUOUS = (
    word_of(words.POS_STW1, [name])
    for name in ("mdi", "absolute", "positive", "negative", "set_up", "continuous_acceptance")
)
_LIMITS, _INCREMENTAL = (word_of(words.POS_STW2, [name]) for name in ("software_limits", "incremental_jog"))
_BLOCK = 0b111111


class Task(Enum):
    """What the positioner does."""

    NONE = "none"
    JOG = "jog"
    MDI = "mdi"
    SET_UP = "set_up"
    BLOCKS = "blocks"


class Wanted(NamedTuple):
    """What the control says to it."""

    stw1: int
    pos_stw1: int
    pos_stw2: int
    override: float
    """[1 = 100 %]"""
    target: float
    """[LU]"""
    velocity: float
    """[LU/s]"""
    acceleration: float
    deceleration: float
    """[1 = 100 % of p2572 and p2573]"""


class Limits(NamedTuple):
    """What the parameters allow, in LU and s."""

    velocity: float
    acceleration: float
    deceleration: float
    low: float
    """Software limits [LU]."""
    high: float
    jog: tuple[float, float]
    """[LU/s], signed."""
    steps: tuple[float, float]
    """Of an incremental jog [LU]."""


class Block(NamedTuple):
    """A traversing block."""

    position: float
    """[LU]"""
    velocity: float
    """[LU/s]"""
    pause: float
    """Afterwards [s]."""


@dataclass(slots=True)
class BasicPositioner:
    """Position set-point by tasks; a step is done while the drive operates, else `follow`."""

    position: float = 0.0
    """Set-point [LU]."""
    speed: float = 0.0
    """Of the set-point [LU/s]."""
    acceleration: float = 0.0
    """[LU/s²]"""
    task: Task = Task.NONE
    target: float = 0.0
    """[LU]"""
    acknowledged: bool = False
    """The activation was taken and is still asked for."""
    limited: bool = False
    """Slower than asked for."""
    refused: int = 0
    """Alarm of the last task that was not taken."""
    block: int = 0
    """Which of the traversing blocks."""
    blocks: Sequence[Block] = ()
    _velocity: float = 0.0
    _shares: tuple[float, float] = (1.0, 1.0)
    _pause: float = 0.0
    _stw1: int = 0
    _step_from: float | None = field(default=None)

    def follow(self, position: float, stw1: int) -> None:
        """Without operation: the set-point is where the axis is, and no task is kept."""
        self.position, self.speed, self.acceleration = position, 0.0, 0.0
        self.task, self.acknowledged, self.limited, self._step_from = Task.NONE, False, False, None
        self._stw1 = stw1

    def brake(self, deceleration: float, dt: float) -> None:
        """A stop of the drive: to standstill with `deceleration` [LU/s²]; the task is gone."""
        self.task, self.acknowledged = Task.NONE, False
        self._move(0.0, deceleration, deceleration, dt)

    def step(self, wanted: Wanted, limits: Limits, adjusted: bool, dt: float) -> None:
        """One step of `dt` [s] while the drive operates."""
        came = wanted.stw1 & ~self._stw1
        self._stw1 = wanted.stw1
        if not wanted.stw1 & _ACTIVATE:
            self.acknowledged = False
        if not wanted.stw1 & _KEEP:
            self.task = Task.NONE
        else:
            self._take(wanted, limits, adjusted, came)
        held = not wanted.stw1 & _GO
        self._advance(wanted, limits, adjusted, held, dt)

    def _take(self, wanted: Wanted, limits: Limits, adjusted: bool, came: int) -> None:
        """Begin what is asked for."""
        mdi = bool(wanted.pos_stw1 & _MDI)
        jogs = wanted.stw1 & (_JOG_1 | _JOG_2)
        if self.task is Task.JOG and (jogs in (0, _JOG_1 | _JOG_2) or mdi):
            if self._step_from is None or mdi:
                self.task = Task.NONE
        elif self.task is Task.NONE and not mdi and jogs in (_JOG_1, _JOG_2) and came & jogs:
            self.task, self.refused = Task.JOG, 0
            self._step_from = self.position if wanted.pos_stw2 & _INCREMENTAL else None
        if self.task is Task.SET_UP and not (mdi and wanted.pos_stw1 & _SET_UP):
            self.task = Task.NONE
        edge = bool(came & _ACTIVATE)
        if mdi and (edge or (wanted.pos_stw1 & _CONTINUOUS and self.task is Task.MDI)):
            self._take_mdi(wanted, limits, adjusted)
        elif edge and self.blocks and not jogs:
            self._take_blocks(wanted, adjusted)

    def _take_mdi(self, wanted: Wanted, limits: Limits, adjusted: bool) -> None:
        if wanted.pos_stw1 & _SET_UP:
            self.task, self.acknowledged, self.refused = Task.SET_UP, True, 0
            return
        absolute = bool(wanted.pos_stw1 & _ABSOLUTE)
        target = wanted.target if absolute else self.position + wanted.target
        if absolute and not adjusted:
            self.refused = NOT_ADJUSTED
        elif wanted.pos_stw2 & _LIMITS and adjusted and not limits.low <= target <= limits.high:
            self.refused = BELOW if target < limits.low else ABOVE
        elif wanted.velocity > 0:
            self.task, self.acknowledged, self.refused = Task.MDI, True, 0
            self.target, self._velocity = target, wanted.velocity
            self._shares = (wanted.acceleration, wanted.deceleration)

    def _take_blocks(self, wanted: Wanted, adjusted: bool) -> None:
        if not adjusted:
            self.refused = NOT_ADJUSTED
            return
        self.task, self.acknowledged, self.refused = Task.BLOCKS, True, 0
        self.block = min(wanted.pos_stw1 & _BLOCK, len(self.blocks) - 1)
        self._begin_block()

    def _begin_block(self) -> None:
        block = self.blocks[self.block]
        self.target, self._velocity, self._pause = block.position, block.velocity, block.pause
        self._shares = (1.0, 1.0)

    def _advance(self, wanted: Wanted, limits: Limits, adjusted: bool, held: bool, dt: float) -> None:
        bounded = adjusted and bool(wanted.pos_stw2 & _LIMITS)
        up, down = limits.acceleration, limits.deceleration
        if self.task in (Task.MDI, Task.BLOCKS):
            up, down = up * max(self._shares[0], 0.01), down * max(self._shares[1], 0.01)
        speed = 0.0
        if not held:
            speed = self._asked(wanted, limits, bounded, down, dt)
        self.limited = abs(speed) > limits.velocity + TINY
        speed = copysign(min(abs(speed), limits.velocity), speed)
        self._move(speed, up, down, dt)
        if self.task in (Task.MDI, Task.BLOCKS) and not held:
            self._arrive(dt)

    def _asked(self, wanted: Wanted, limits: Limits, bounded: bool, down: float, dt: float) -> float:
        """Speed that the task wants now [LU/s]."""
        low, high = (limits.low, limits.high) if bounded else (-1e12, 1e12)
        if self.task is Task.JOG:
            which = 0 if wanted.stw1 & _JOG_1 else 1
            speed = limits.jog[which] * wanted.override
            if self._step_from is not None:
                end = self._step_from + copysign(limits.steps[which], speed)
                low, high = max(low, min(end, self._step_from)), min(high, max(end, self._step_from))
            return self._within(speed, low, high, down, dt)
        if self.task is Task.SET_UP:
            way = bool(wanted.pos_stw1 & _POSITIVE) - bool(wanted.pos_stw1 & _NEGATIVE)
            return self._within(way * wanted.velocity * wanted.override, low, high, down, dt)
        if self.task in (Task.MDI, Task.BLOCKS):
            speed = self._velocity * wanted.override
            return self._within(copysign(speed, self.target - self.position), self.target, self.target, down, dt)
        return 0.0

    def _within(self, speed: float, low: float, high: float, down: float, dt: float) -> float:
        """`speed`, so that the set-point can stop before `high`, or `low` on its way back."""
        left = high - self.position if speed > 0 else self.position - low
        if left <= 0:
            return 0.0
        return copysign(min(abs(speed), stoppable(left, down, dt)), speed)

    def _move(self, speed: float, up: float, down: float, dt: float) -> None:
        faster = abs(speed) > abs(self.speed) and speed * self.speed >= 0
        most = (up if faster else down) * dt
        before = self.speed
        self.speed += min(max(speed - self.speed, -most), most)
        self.acceleration = (self.speed - before) / dt
        self.position += self.speed * dt

    def _arrive(self, dt: float) -> None:
        """At the end of a way the set-point is the target to the last digit."""
        if abs(self.target - self.position) > NEAR or abs(self.speed) > NEAR:
            return
        self.position, self.speed = self.target, 0.0
        if self.task is Task.MDI:
            return
        self._pause -= dt
        if self._pause <= 0:
            self.block = (self.block + 1) % len(self.blocks)
            self._begin_block()

    @property
    def arrived(self) -> bool:
        """The set-point stands at the target of its task."""
        return self.task in (Task.MDI, Task.BLOCKS) and self.position == self.target and not self.speed


def stoppable(left: float, deceleration: float, dt: float) -> float:
    """Greatest speed of a step of `dt` [s] from which steps of `deceleration` end after `left` [LU], and not beyond [LU/s].

    n whole steps of speed and a part f of one go d·dt²·(n(n + 1)/2 + (n + 1)·f) far.
    """
    steps = left / (deceleration * dt * dt)
    whole = floor((sqrt(1 + 8 * steps) - 1) / 2)
    return deceleration * dt * (whole + (steps - whole * (whole + 1) / 2) / (whole + 1))
