"""The last start and the last stop of a ramp, as it went: phases of constant jerk, from which speed and acceleration follow exactly."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from app.blocks.s_ramp import SRamp

PHASES = 3
"""That an S-ramp needs from any speed and acceleration to a target: jerk, none, jerk the other way."""
SHORTEST = 1e-6
"""What is shorter is rounding [s]."""


class RampState(IntEnum):
    """How a record stands."""

    NONE = 0
    RUNNING = 1
    COMPLETE = 2
    BROKEN_OFF = 3
    """Another target came before this one was reached."""
    CUT_OFF = 4
    """The supply went, and the speed without a ramp."""
    NOT_WHOLE = 5
    """The limits were changed on the way: the first phases are kept, the rest is not."""


class Phase(NamedTuple):
    """A time of constant jerk."""

    duration: float
    """[s]"""
    jerk: float
    """[U/s²]"""


class Moment(NamedTuple):
    """A point of the curve."""

    time: float
    """Since the ramp began [s]."""
    speed: float
    """[U]"""
    acceleration: float
    """[U/s]"""


@dataclass(slots=True)
class RampRecord:
    """One ramp. U is the unit of the speed (%, mm/s)."""

    began: int
    """Time of the device [µs]."""
    speed: float
    """At the begin [U]."""
    acceleration: float
    """At the begin [U/s]."""
    state: RampState = RampState.RUNNING
    phases: list[Phase] = field(default_factory=list)

    def add(self, duration: float, jerk: float) -> None:
        """It went on for `duration` [s] with `jerk` [U/s²]; one phase too many makes it `NOT_WHOLE`."""
        if duration < SHORTEST or self.state is not RampState.RUNNING:
            return
        if self.phases and self.phases[-1].jerk == jerk:
            self.phases[-1] = Phase(self.phases[-1].duration + duration, jerk)
        elif len(self.phases) < PHASES:
            self.phases.append(Phase(duration, jerk))
        else:
            self.state = RampState.NOT_WHOLE

    def end(self, state: RampState) -> None:
        """It is over, unless it was before."""
        if self.state is RampState.RUNNING:
            self.state = state


class RampRecorder:
    """Looks at a ramp once a cycle and keeps its last start (from a target of 0) and its last stop (to a target of 0)."""

    __slots__ = ("_open", "_target", "start", "stop")

    def __init__(self) -> None:
        self.start: RampRecord | None = None
        self.stop: RampRecord | None = None
        self._open: RampRecord | None = None
        self._target = 0.0

    def begin(self, target: float, ramp: SRamp, now: int) -> None:
        """Before the ramp takes a step to `target` [U] at `now` [µs]."""
        if target == self._target:
            return
        stopped, self._target = self._target == 0.0, target
        if self._open:
            self._open.end(RampState.BROKEN_OFF)
            self._open = None
        if ramp.speed == target and not ramp.acceleration:
            return
        record = RampRecord(now, ramp.speed, ramp.acceleration)
        if target == 0.0:
            self.stop = self._open = record
        elif stopped:
            self.start = self._open = record

    def follow(self, ramp: SRamp) -> None:
        """After the ramp took its step."""
        record = self._open
        if record is None:
            return
        for jerk, duration in ramp.followed:
            record.add(duration, jerk)
        if ramp.speed == self._target and not ramp.acceleration:
            record.end(RampState.COMPLETE)
            self._open = None

    def cut(self, ramp: SRamp, now: int) -> None:
        """The supply went; before the ramp is reset. A standing one has nothing to tell."""
        if self._open:
            self._open.end(RampState.CUT_OFF)
        elif ramp.speed:
            self.stop = RampRecord(now, ramp.speed, ramp.acceleration, RampState.CUT_OFF)
        self._open, self._target = None, 0.0


def curve(speed: float, acceleration: float, phases: Sequence[Phase], each: int = 16) -> Iterator[Moment]:
    """The way of a ramp that begins with `speed` [U] and `acceleration` [U/s]: `each` points per phase and the first one."""
    begun = 0.0
    yield Moment(begun, speed, acceleration)
    for duration, jerk in phases:
        for n in range(1, each + 1):
            t = duration * n / each
            yield Moment(begun + t, speed + t * (acceleration + t * jerk / 2), acceleration + t * jerk)
        begun += duration
        speed += duration * (acceleration + duration * jerk / 2)
        acceleration += duration * jerk


def distance(speed: float, acceleration: float, phases: Sequence[Phase]) -> float:
    """Way of such a ramp [U·s], signed."""
    way = 0.0
    for duration, jerk in phases:
        way += duration * (speed + duration * (acceleration / 2 + duration * jerk / 6))
        speed += duration * (acceleration + duration * jerk / 2)
        acceleration += duration * jerk
    return way
