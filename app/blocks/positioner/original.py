"""The original's POSITIONER, formula by formula, with its defects: for comparison only, nothing is driven by it.

Its known defects, reproduced here and nowhere else:

| defect | here |
|---|---|
| for negative speed the position is looked at one scan **back**: pos - Δ with a Δ that is negative already | `OriginalPositioner.step` |
| the percentage of the last scan stays when nothing moves | `percent` |
| the slow-down area gets negative below the slow speed, so its position lies beyond the slow travel | `area` |
| done is told by distance alone, whether the axis stands or not | `done` |

Source: thesis 002, POSITIONER (FB1102), reference/theses-facts.md section 2.
"""

from dataclasses import dataclass
from typing import NamedTuple


class OriginalOutputs(NamedTuple):
    """Of one scan."""

    speed: float
    """[mm/s], signed."""
    percent: float
    forward: bool
    reverse: bool
    slow_down_position: float
    """[mm]"""
    stop_position: float
    """[mm]"""
    done: bool


@dataclass(slots=True)
class OriginalPositioner:
    """FB1102 as printed."""

    max_speed: float
    """[mm/s]"""
    deceleration: float
    """[mm/s²]"""
    slow_speed: float
    """[mm/s]"""
    slow_distance: float
    """[mm]"""
    tolerance: float = 5.0
    """[mm]"""
    slow: bool = False
    stop: bool = False
    percent: float = 0.0

    def step(
        self,
        start: bool,
        position: float,
        target: float,
        speed: float,
        set_speed: float,
        dt: float,
        *,
        slow_switch: bool = False,
        stop_switch: bool = False,
    ) -> OriginalOutputs:
        """One scan of `dt` [s]; positions [mm], speeds [mm/s], `speed` measured and signed."""
        way = 1.0 if target >= position else -1.0
        ahead = dt * speed
        area = 0.0
        if self.slow_distance > 0 and self.slow_speed > 0 and speed != 0:
            area = (speed**2 - self.slow_speed**2) / (2 * self.deceleration)
        stop_area = speed**2 / (2 * self.deceleration)
        sign = -1.0 if speed < 0 else 1.0
        slow_at = target - sign * (area + self.slow_distance)
        stop_at = target - sign * stop_area
        if not start:
            self.slow = self.stop = False
        elif speed > 0:
            self.slow |= position + ahead >= slow_at or slow_switch
            self.stop |= position + ahead >= stop_at or stop_switch
        elif speed < 0:
            self.slow |= position - ahead <= slow_at or slow_switch
            self.stop |= position - ahead <= stop_at or stop_switch
        command = 0.0
        if start and not self.stop:
            command = self.slow_speed if self.slow else min(set_speed, self.max_speed)
            self.percent = command / self.max_speed * 100
        return OriginalOutputs(
            way * command,
            self.percent,
            command > 0 and way > 0,
            command > 0 and way < 0,
            slow_at,
            stop_at,
            abs(target - position) < self.tolerance,
        )
