"""POSITIONER: one axis to one position, down to a slow speed before it, in either direction."""

from dataclasses import dataclass
from enum import Enum
from math import isfinite, nan
from typing import NamedTuple

from app.blocks.ramp import approach


class MovePhase(Enum):
    """What a positioning does."""

    OFF = "off"
    TRAVEL = "travel"
    SLOW = "slow"
    STOP = "stop"
    """The command is 0, the axis is on its way to standstill."""
    DONE = "done"
    """Stands within the tolerance."""
    MISSED = "missed"
    """Stands elsewhere: a stop switch, or too many attempts."""


class MoveInputs(NamedTuple):
    """Of one scan."""

    start: bool
    """Held; dropping it ends the positioning."""
    position: float
    """[mm]"""
    target: float
    """[mm], taken when `start` comes."""
    speed: float
    """Measured [mm/s], signed."""
    set_speed: float
    """[mm/s]"""
    slow_min: bool = False
    """Slow-down switch at the low end is hit."""
    slow_max: bool = False
    stop_min: bool = False
    stop_max: bool = False
    held: float = 0.0
    """What a sway shaper behind this block still owes: the way it would travel yet if the command were 0 from now [mm], signed."""


class Outputs(NamedTuple):
    """Of one scan."""

    speed: float
    """Command [mm/s], signed; the ramp is the drive's."""
    percent: float
    """Of the greatest speed, without sign."""
    forward: bool
    reverse: bool
    slow_down_position: float
    """Where the slow-down of the present speed begins [mm]."""
    stop_position: float
    """Where the stop of the present speed begins [mm]."""
    phase: MovePhase


@dataclass(slots=True)
class Positioner:
    """Travels at the set speed, is down to the slow speed `slow_distance` before the target, and stops on it.

        area = (v² - slow²) / 2·dec            slow-down position = target - (area + slow_distance)
        stop = v² / 2·dec                      stop position      = target - stop              (+ for the other direction)

    The same in both directions: all ways are counted towards the target. Beside the source's formulas the block looks ahead by one scan
    and by the drive's lag, with the speed that the drive's ramp has then; so it does not overshoot as long as `lag` is not less than the
    drive's. An axis that stands short of the tolerance approaches again, each time at half the slow speed, in `attempts` attempts
    at most; so a lag that was not told costs time and not the tolerance.

    Source: thesis 002, POSITIONER (FB1102), reference/theses-facts.md section 2. Look-ahead by lag, use of the acceleration, further
    attempts and the switches by direction are ours.

    Raises:
        ValueError: a speed, ramp or tolerance is not a finite number above 0, or another value not a finite number of at least 0.
    """

    max_speed: float
    """[mm/s]"""
    acceleration: float
    """Of the drive's ramp [mm/s²]."""
    deceleration: float
    """[mm/s²]"""
    slow_speed: float = 0.0
    """[mm/s]; 0 = no slow travel."""
    slow_distance: float = 0.0
    """[mm]; 0 = no slow travel."""
    lag: float = 0.0
    """Greatest lag of the drive, set-point to speed [s]."""
    shaper_delay: float = 0.0
    """Mean delay of a sway shaper behind this block [s]."""
    tolerance: float = 5.0
    """Done within this of the target [mm]."""
    attempts: int = 3
    phase: MovePhase = MovePhase.OFF
    target: float = nan
    """[mm]"""
    way: int = 0
    """+1 or -1."""
    ramp: float = 0.0
    """Speed that the drive's ramp has by now [mm/s], counted towards the target."""
    attempt: int = 0
    begun: float = 0.0
    """Where this attempt began [mm]."""
    owed: float = 0.0
    """Way of the ramp since then [mm]; what the axis lacks of it is still to come, however late it follows."""
    still: float = 0.0
    """Since when the ramp is down [s]: the axis itself follows as late as `lag`."""

    def __post_init__(self) -> None:
        for name in ("max_speed", "acceleration", "deceleration", "tolerance"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")
        for name in ("slow_speed", "slow_distance", "lag", "shaper_delay"):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value}, a finite number of at least 0 expected")

    def step(self, inputs: MoveInputs, dt: float) -> Outputs:
        """One scan of `dt` [s].

        Raises:
            ValueError: a number of the inputs is not finite; `safe` is what holds then.
        """
        for name in ("position", "target", "speed", "set_speed", "held"):
            if not isfinite(getattr(inputs, name)):
                raise ValueError(f"{name} is {getattr(inputs, name)}, a finite number expected")
        if not inputs.start:
            return self.safe()
        if self.phase is MovePhase.OFF:
            self.target, self.attempt = inputs.target, 0
            self._begin(inputs)
        speed = min(abs(inputs.set_speed), self.max_speed)
        slow = min(self.slow_speed / 2**self.attempt, speed) if self.slow_distance else 0.0
        left = self.way * (self.target - inputs.position)
        measured, held = self.way * inputs.speed, self.way * inputs.held
        going = max(self._going(measured), 0.0)
        area, stop = self._area(going, slow), going**2 / (2 * self.deceleration)
        then = max(going, min(going + self.acceleration * dt, slow if self.phase is MovePhase.SLOW else speed))
        owed = max(0.0, self.owed - self.way * (inputs.position - self.begun))
        delay = min(self.lag * max(measured, then), owed + then * dt) + then * dt + held
        if self.phase is MovePhase.TRAVEL:
            early = max(0.0, delay - slow * (self.lag + dt + self.shaper_delay))
            near = left <= self.slow_distance + self._area(then, slow) + early
            if slow and (near or self._ahead(inputs.slow_min, inputs.slow_max)):
                self.phase = MovePhase.SLOW
        if self.phase in (MovePhase.TRAVEL, MovePhase.SLOW):
            if self._ahead(inputs.stop_min, inputs.stop_max):
                self.phase, self.attempt = MovePhase.STOP, self.attempts
            elif left <= then**2 / (2 * self.deceleration) + delay:
                self.phase = MovePhase.STOP
        elif self.phase is MovePhase.STOP and self.still >= self.lag and self._stands(measured, held):
            self._settle(inputs)
        command = {MovePhase.TRAVEL: speed, MovePhase.SLOW: slow}.get(self.phase, 0.0)
        self.ramp = approach(self.ramp, command, self.acceleration * dt, self.deceleration * dt)
        self.owed += self.ramp * dt
        self.still = 0.0 if self.ramp >= 0.5 else self.still + dt
        travels = command > 0
        return Outputs(
            self.way * command,
            command / self.max_speed * 100,
            travels and self.way > 0,
            travels and self.way < 0,
            self.target - self.way * (area + self.slow_distance * bool(slow)),
            self.target - self.way * stop,
            self.phase,
        )

    def safe(self) -> Outputs:
        """Stand still and forget the positioning: not started, or an input is bad."""
        self.phase, self.way, self.ramp, self.still = MovePhase.OFF, 0, 0.0, 0.0
        return Outputs(0.0, 0.0, False, False, nan, nan, MovePhase.OFF)

    def _begin(self, inputs: MoveInputs) -> None:
        """Take the direction; an axis that is there already is done."""
        gap = self.target - inputs.position
        self.way = 1 if gap >= 0 else -1
        self.ramp = self.way * inputs.speed
        self.begun, self.owed = inputs.position, self.lag * abs(inputs.speed)
        there = abs(gap) < self.tolerance and self._stands(self.ramp, inputs.held)
        self.phase = MovePhase.DONE if there else MovePhase.TRAVEL

    def _settle(self, inputs: MoveInputs) -> None:
        """Standstill: there, once more, or missed."""
        if abs(self.target - inputs.position) < self.tolerance:
            self.phase = MovePhase.DONE
        elif self.attempt + 1 >= self.attempts:
            self.phase = MovePhase.MISSED
        else:
            self.attempt += 1
            self._begin(inputs)
            if self.slow_speed and self.slow_distance and self.phase is MovePhase.TRAVEL:
                self.phase = MovePhase.SLOW

    def _area(self, going: float, slow: float) -> float:
        """Way from one speed down to the slow one [mm]."""
        return max(0.0, going**2 - slow**2) / (2 * self.deceleration) if slow else 0.0

    def _going(self, measured: float) -> float:
        """Speed from which the ramp would brake: the block's own picture of it, or the measured one when that says more.

        Behind a shaper the axis is faster than its ramp for a while; that way is `held` and not counted twice.
        """
        if self.shaper_delay:
            return self.ramp
        if self.phase is MovePhase.SLOW or self.phase is MovePhase.STOP:
            return max(self.ramp, measured - self.deceleration * self.lag)
        return max(self.ramp, measured)

    def _stands(self, measured: float, held: float) -> bool:
        return abs(measured) < 0.5 and abs(held) < 0.5 and self.ramp < 0.5

    def _ahead(self, low: bool, high: bool) -> bool:
        return high if self.way > 0 else low
