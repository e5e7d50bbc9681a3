"""Absolute encoder adjustment of a virtual drive: what p2507, p2599 and p2525 do to the position. Pure.

    p2507: 1 not adjusted → 2 started, written by whoever adjusts → 3 adjusted, or 0 error, or 1 again

Numbers and meaning: reference/profidrive.md section 7, reference/theses-facts.md section 4. What no source tells:

| subject | taken here |
| --- | --- |
| waiting time | 0.8 s of standstill without enables |
| the axis moves or has its enables | 2 stays until it stands without them; the waiting time begins then |
| the encoder is not an absolute one | falls back to 1 |
| the encoder has a fault | falls to 0 |
| 1 is written while 2 stands | the adjustment is withdrawn; the offset stays as it was |
| 0 or 3 are written | taken as they are, with the offset that is there |
| p2506 is changed | the adjustment is lost: 1 |
| p2525 | offset that was found, modulo 2³²; position r2521 = encoder + offset |
| without a save (p0971, p0977) | a power-up brings back state and offset as they were saved |
"""

from collections.abc import MutableMapping
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

STATE, COORDINATE, OFFSET, SCALE = "p2507", "p2599", "p2525", "p2506"
DEFAULTS = {STATE: 1.0, COORDINATE: 0.0, OFFSET: 0.0, SCALE: 10_000.0}
"""Of a drive that was never adjusted; lengths [LU]."""
WAITING_TIME = 0.8
"""From the start of the adjustment to its end [s]; assumed."""
MODULO = 1 << 32


class State(IntEnum):
    """p2507."""

    ERROR = 0
    NOT_ADJUSTED = 1
    STARTED = 2
    ADJUSTED = 3


class Encoder(NamedTuple):
    """What the axis tells of its encoder at one moment."""

    position: float
    """As the encoder tells it, without any offset [LU]."""
    still: bool
    """The axis stands and has no enables."""
    healthy: bool = True
    """The encoder has no fault."""
    absolute: bool = True
    """It keeps its position without power."""


@dataclass(slots=True)
class Adjustment:
    """Carries out the adjustment over the parameters of a drive, `values` by code."""

    values: MutableMapping[str, float]
    _waited: float = 0.0
    _scale: float | None = None

    def step(self, encoder: Encoder, dt: float) -> None:
        """One step of `dt` [s]."""
        values = self.values
        if self._scale not in (None, values[SCALE]):
            values[STATE] = State.NOT_ADJUSTED
        self._scale = values[SCALE]
        if values[STATE] != State.STARTED:
            self._waited = 0.0
        elif not encoder.absolute:
            values[STATE] = State.NOT_ADJUSTED
        elif not encoder.healthy:
            values[STATE] = State.ERROR
        elif not encoder.still:
            self._waited = 0.0
        else:
            self._waited += dt
            if self._waited >= WAITING_TIME - dt / 2:
                values[OFFSET] = round(values[COORDINATE] - encoder.position) % MODULO
                values[STATE] = State.ADJUSTED

    def position(self, encoder: Encoder) -> float:
        """Where the axis is for the drive [LU]."""
        return signed((encoder.position + self.values[OFFSET]) % MODULO)

    def power_up(self) -> None:
        """The supply is back: what had been started is not gone on with."""
        self._waited, self._scale = 0.0, None
        if self.values[STATE] == State.STARTED:
            self.values[STATE] = State.NOT_ADJUSTED


def signed(value: float) -> float:
    """A position modulo 2³² with its sign, as an Integer32 holds it [LU]."""
    return value - MODULO if value >= MODULO / 2 else value
