"""What gets warm in an E800 and its motor: heat sink, winding, and the overload images of both."""

from dataclasses import dataclass

SINK_RISE, SINK_TIME, FAN_LOST_TIME = 30.0, 240.0, 20.0
"""Heat sink: rise at rated current [K], time constant with and without fan [s]."""
FAN_LOST_RISE = 125.0
"""Where the heat sink goes without its fan [K]."""
WINDING_RISE, WINDING_TIME = 75.0, 360.0
"""Winding: rise at rated losses [K], time constant [s]."""
OVERLOAD_FREE = 1.1
"""Multiple of the rated current that is carried for ever."""
OVERLOAD_TIME = 60.0
"""Time to trip at 150 % (OL2) or at F706 (OL1) [s]."""
MOTOR_LIMIT = 1.5
"""Where the motor's curve has its minute [1 = its protected current]."""


@dataclass(frozen=True, slots=True)
class Loading:
    """What warms in one step."""

    ambient: float
    """[°C]"""
    on: bool
    """Whether the inverter feeds the motor."""
    drive: float
    """Output current [1 = rated of the drive]."""
    drive_limit: float
    """Where the drive's curve has its minute, F706 [1 = rated of the drive]."""
    motor: float
    """Output current [1 = the motor's protected current, F803 x F707]."""
    losses: float
    """Of the motor [1 = rated]."""
    fan_lost: bool = False


@dataclass(slots=True)
class Heat:
    """Temperatures [°C] and overload images that trip at 1."""

    heat_sink: float
    winding: float
    """Of the motor; the drive has no register for it."""
    drive_overload: float = 0.0
    motor_overload: float = 0.0

    @classmethod
    def settled(cls, loading: Loading) -> "Heat":
        """As after hours of `loading`, nothing overloaded."""
        sink = loading.ambient + sink_rise(loading.drive, on=loading.on)
        return cls(sink, loading.ambient + WINDING_RISE * loading.losses)

    def step(self, loading: Loading, dt: float) -> None:
        """Advance by `dt` [s]."""
        aim, time = loading.ambient + sink_rise(loading.drive, on=loading.on), SINK_TIME
        if loading.fan_lost:
            aim, time = loading.ambient + FAN_LOST_RISE, FAN_LOST_TIME
        self.heat_sink += (aim - self.heat_sink) * dt / time
        warm = loading.ambient + WINDING_RISE * loading.losses
        self.winding += (warm - self.winding) * dt / WINDING_TIME
        self.drive_overload = overload(self.drive_overload, loading.drive, loading.drive_limit, dt)
        self.motor_overload = overload(self.motor_overload, loading.motor, MOTOR_LIMIT, dt)

    def forget_overloads(self) -> None:
        """A power-up: both images are empty."""
        self.drive_overload = self.motor_overload = 0.0


def sink_rise(ratio: float, *, on: bool) -> float:
    """Rise of the heat sink [K] at `ratio` of the drive's rated current."""
    return (2.0 if on else 1.0) + (SINK_RISE - 2.0) * (0.4 * ratio + 0.6 * ratio * ratio)


def overload(image: float, ratio: float, at_limit: float, dt: float) -> float:
    """Inverse-time image: 1 after `OVERLOAD_TIME` at `at_limit` times the rated current, fades below `OVERLOAD_FREE`."""
    free = OVERLOAD_FREE * OVERLOAD_FREE
    image += (ratio * ratio - free) / (at_limit * at_limit - free) * dt / OVERLOAD_TIME
    return min(max(image, 0.0), 1.5)
