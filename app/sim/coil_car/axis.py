"""One axis of the coil car: positioned by an S-ramp, with a brake."""

from math import nan

from app.blocks.s_ramp import SRamp

MORE_ROOM = 5.0
"""A positioning that brakes goes on when there is this much more room [mm]."""


class Axis:
    """One axis: its ramp and whether it is braking."""

    __slots__ = ("braking", "cut", "ramp", "target")

    def __init__(self, acceleration: float, jerk: float) -> None:
        self.ramp = SRamp(acceleration, jerk)
        self.braking = False
        """A positioning that has begun to brake goes on to brake."""
        self.cut = False
        """The brake holds until the axis stands."""
        self.target = nan
        """[mm]"""

    def go(self, way: int, speed: float, room: float, dt: float) -> None:
        """One scan `way` (+1 or −1) at up to `speed` [mm/s] without coming to a stop beyond `room` [mm]."""
        ramp = self.ramp
        if not self.braking or ramp.stop_distance() * way < room - MORE_ROOM:
            before = ramp.speed, ramp.acceleration
            out = ramp.step(way * speed, dt)
            if ((before[0] + ramp.speed) / 2 * dt + out.stop_distance) * way <= room:
                self.braking = False
                return
            ramp.speed, ramp.acceleration = before
        self.braking = True
        self.stop(dt)

    def stop(self, dt: float) -> None:
        """One scan of the ramp to standstill."""
        ramp = self.ramp
        if ramp.speed or ramp.acceleration:
            ramp.step(0.0, dt)
        else:
            self.braking = False
