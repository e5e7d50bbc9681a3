"""Limit switches of one axis: slow-down, stop, switches that do not answer, acknowledgement."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from math import inf, isfinite
from typing import NamedTuple


class End(IntEnum):
    """Which end of the axis."""

    LOW = -1
    HIGH = 1


class LimitAlarm(Enum):
    """Of one end."""

    STOP_HIT = "stop_hit"
    """The stop switch was hit."""
    SLOW_FAILED = "slow_failed"
    """Beyond the place of the slow-down switch, or on the stop switch, without it."""
    STOP_FAILED = "stop_failed"
    """Beyond the place of the stop switch without it."""
    SWITCH_STUCK = "switch_stuck"
    """A switch is hit far inside its place."""


class Switches(NamedTuple):
    """Of one end: True = hit (a broken wire too)."""

    slow: bool = False
    stop: bool = False


class Allowed(NamedTuple):
    """What the limits leave, after one scan."""

    low: float
    """Greatest speed towards the low end [mm/s]."""
    high: float
    """Greatest speed towards the high end [mm/s]."""
    healthy: bool
    """No switch has failed."""

    def limit(self, speed: float) -> float:
        """`speed` [mm/s], signed, as far as it is allowed."""
        return min(max(speed, -self.low), self.high)


FREE = Allowed(inf, inf, True)
"""No limit."""


@dataclass(frozen=True, slots=True)
class SwitchPlaces:
    """Where the switches are [mm].

    Raises:
        ValueError: they are not finite or not in this order, or tolerance or slow_speed is not above 0.
    """

    low_stop: float
    low_slow: float
    high_slow: float
    high_stop: float
    tolerance: float
    """By which a place may be passed before the switch counts as failed [mm] (END_STOP_TOL)."""
    slow_speed: float
    """The lowest manual speed [mm/s]."""

    def __post_init__(self) -> None:
        places = (self.low_stop, self.low_slow, self.high_slow, self.high_stop)
        if not (all(map(isfinite, places)) and list(places) == sorted(places)):
            raise ValueError(f"places are {places}, finite numbers in rising order expected")
        for name in ("tolerance", "slow_speed"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")

    def beyond(self, end: End, position: float) -> tuple[float, float]:
        """How far `position` is beyond (slow-down, stop) of an end [mm], negative inside."""
        if end is End.HIGH:
            return position - self.high_slow, position - self.high_stop
        return self.low_slow - position, self.low_stop - position


@dataclass(slots=True)
class LimitSwitches:
    """Both ends of one axis.

    - Slow-down switch: lowest manual speed towards that end. Stop switch: nothing towards that end, and an alarm.
    - Beyond the place of a switch by more than the tolerance without it, the switch has failed: alarm, and nothing towards that end. So has
      the slow-down switch when the stop switch comes before it. A switch that is hit far inside its place is obeyed and told.
    - An alarm can be acknowledged only after moving away: its switches released and the position inside. Until then nothing moves towards
      that end; away from it everything is allowed. An acknowledgement that is held from before does not count.
    - Without a position (encoder bad) no switch can be watched: lowest manual speed both ways.

    Source: thesis 002, limit logic (reference/theses-facts.md section 2). The stuck switch, slow-down judged by the stop switch and the
    lowest speed without a position are ours.
    """

    places: SwitchPlaces
    alarms: dict[End, set[LimitAlarm]] = field(default_factory=lambda: {End.LOW: set(), End.HIGH: set()})
    """That stand, unacknowledged."""
    _seen: bool = True
    """An acknowledgement that is there at the first scan is not new."""

    def step(self, low: Switches, high: Switches, position: float | None, *, acknowledge: bool = False) -> Allowed:
        """One scan; `position` [mm], None = the encoder is bad; `acknowledge` counts when it comes."""
        acknowledge, self._seen = acknowledge and not self._seen, acknowledge
        if position is not None and not isfinite(position):
            position = None
        if position is not None and self._undisturbed(low, high, position):
            return FREE
        speeds = {}
        for end, hit in ((End.LOW, low), (End.HIGH, high)):
            now = set(self._alarms(end, hit, position))
            away = not hit.stop and not now and (position is not None or not hit.slow)
            if acknowledge and away:
                self.alarms[end].clear()
            self.alarms[end] |= now
            speeds[end] = self._speed(end, hit, position)
        failed = self.alarms[End.LOW] | self.alarms[End.HIGH]
        return Allowed(speeds[End.LOW], speeds[End.HIGH], failed <= {LimitAlarm.STOP_HIT})

    def _undisturbed(self, low: Switches, high: Switches, position: float) -> bool:
        """Between both slow-down switches, none of them hit, and no alarm: the usual case."""
        hit = low.slow or low.stop or high.slow or high.stop
        inside = self.places.low_slow <= position <= self.places.high_slow
        return inside and not hit and not any(self.alarms.values())

    @property
    def active(self) -> Sequence[tuple[End, LimitAlarm]]:
        """All alarms, in order."""
        return [(end, alarm) for end in End for alarm in LimitAlarm if alarm in self.alarms[end]]

    def _alarms(self, end: End, hit: Switches, position: float | None) -> Sequence[LimitAlarm]:
        """What is wrong at an end now."""
        slow, stop, tolerance = -inf, -inf, self.places.tolerance
        found = [LimitAlarm.STOP_HIT] if hit.stop else []
        if position is not None:
            slow, stop = self.places.beyond(end, position)
            if (hit.slow and slow < -tolerance) or (hit.stop and stop < -tolerance):
                found.append(LimitAlarm.SWITCH_STUCK)
        if not hit.slow and (slow > tolerance or (hit.stop and stop >= -tolerance)):
            found.append(LimitAlarm.SLOW_FAILED)
        if not hit.stop and stop > tolerance:
            found.append(LimitAlarm.STOP_FAILED)
        return found

    def _speed(self, end: End, hit: Switches, position: float | None) -> float:
        if hit.stop or self.alarms[end] - {LimitAlarm.SWITCH_STUCK}:
            return 0.0
        if hit.slow or position is None or self.alarms[end]:
            return self.places.slow_speed
        return inf
