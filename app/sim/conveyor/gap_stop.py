"""The gap stop of the conveyor: when two products that came too near to each other may go on."""

from math import inf, nan

from app.blocks import product_tracking as tracking
from app.blocks.s_ramp import SRamp
from app.sim.conveyor.state import LineState


class GapStop:
    """Releases what tracking stopped; the rules are in the table of `program`."""

    def __init__(self, line: LineState) -> None:
        self._line = line
        self._age = 0.0
        """For so long the belts have stood [s]."""
        self._speed = nan
        """Setpoint of automatic that `_ways` were computed for [%]; NaN = none."""
        self._ways: tuple[float, ...] = ()
        """On which each belt that starts and stops at once comes to a stop [mm]."""

    def settings_changed(self) -> None:
        """The ramps are others now."""
        self._speed = nan

    def watch(self) -> None:
        """One scan in which it is active."""
        line = self._line
        if line.moving:
            self._age = 0.0
            return
        self._age += line.dt
        if line.modes.running:
            if not self._may_start():
                return
        elif line.direction:
            return
        self._release()

    def reset(self) -> None:
        """A person says that it is over; in automatic it still waits until a start would not bring the pair too near."""
        line = self._line
        if line.tracking.gap_stop:
            self._age = inf
            if not line.modes.running:
                self._release()

    def _may_start(self) -> bool:
        line, values = self._line, self._line.settings
        speed = values["automatic_speed"]
        if speed != self._speed:
            acceleration, jerk = values["acceleration"], values["jerk"]
            self._speed, self._ways = (
                speed,
                tuple(
                    SRamp(acceleration, jerk, speed * share / 100).stop_distance() * line.scale
                    for share in line.geometry.speed_shares
                ),
            )
        if self._age + 1e-9 < values["restart_delay"]:
            return False
        ways, follow = list(self._ways), line.tracking
        if follow.buffer_full:
            ways[0] = 0.0
        if follow.brake:
            ways[-1] = 0.0
        waiting = max(line.gates.held_belt, line.merges.held_belt) + 1
        ways[:waiting] = [0.0] * waiting
        gap = follow.gap_with(ways)
        return gap is None or not gap.stop

    def _release(self) -> None:
        line = self._line
        self._age = 0.0
        for event in line.tracking.release_gap_stop():
            line.report(event)
        line.first_out.end(tracking.Code.GAP_STOP, line.time)
