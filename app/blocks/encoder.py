"""Incremental encoder on a belt roller: speed in, whole pulses out, pulses to millimetres."""

from dataclasses import dataclass
from math import floor, isfinite, pi

_SPAN = 1 << 32


def wrapped(pulses: int) -> int:
    """What a signed 32-bit counter shows after so many pulses."""
    return (pulses + (_SPAN >> 1)) % _SPAN - (_SPAN >> 1)


def pulses_between(before: int, now: int) -> int:
    """Pulses counted from one reading of a signed 32-bit counter to the next, also across its wrap.

    True while less than 2³¹ pulses lie between them.
    """
    return wrapped(now - before)


@dataclass(slots=True)
class Encoder:
    """Counts what a roller turns: v [%] → rpm × resolution × dt, accumulated; the fraction of a pulse is kept, so no scan period loses any.

    Source: thesis 003, block Encoder; 1024 pulses and 60 rpm (simulation), 1650 and 40 rpm (model), roller radius 15 mm.

    Raises:
        ValueError: resolution, rated_speed or radius is not finite or not above 0.
    """

    resolution: float
    """Pulses per revolution of the roller."""
    rated_speed: float
    """Of the roller at 100 % [rpm]."""
    radius: float
    """Of the roller [mm]."""
    pulses: int = 0
    """Accumulated, signed 32 bit: after 2³¹ − 1 follows −2³¹."""
    fraction: float = 0.0
    """Of a pulse, 0 to 1."""

    def __post_init__(self) -> None:
        for name in ("resolution", "rated_speed", "radius"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")
        self.pulses = wrapped(self.pulses)

    @property
    def mm_per_pulse(self) -> float:
        """2π·radius / resolution [mm]."""
        return 2 * pi * self.radius / self.resolution

    @property
    def full_speed(self) -> float:
        """Belt speed at 100 % [mm/s]."""
        return 2 * pi * self.radius * self.rated_speed / 60

    def step(self, speed: float, dt: float) -> int:
        """Pulses of a cycle of `dt` [s] at `speed` [%], signed; adds them to `pulses`.

        Raises:
            ValueError: speed is not finite, dt not finite or below 0.
        """
        if not isfinite(speed):
            raise ValueError(f"speed is {speed}, a finite number expected")
        if not (isfinite(dt) and dt >= 0):
            raise ValueError(f"dt is {dt}, a finite number of at least 0 expected")
        turned = self.fraction + speed / 100 * self.rated_speed / 60 * self.resolution * dt
        whole = floor(turned)
        self.fraction = turned - whole
        self.pulses = wrapped(self.pulses + whole)
        return whole

    def distance(self, pulses: int) -> float:
        """Millimetres of so many pulses, signed."""
        return pulses * self.mm_per_pulse
