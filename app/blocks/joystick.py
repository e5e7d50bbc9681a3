"""Manual driving: four speed steps, one axis at a time, hold-to-run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

STEPS = 4
RELEASED = 0.5
"""A counter that stands still so long means that nobody holds any more [s]. Source: reference/register-map.md, hold-to-run."""
PAUSE = 0.3
"""Released for at least so long before the other direction [s]. Source: reference/hmi-design.md section 12.2."""


class Lever(NamedTuple):
    """What is asked of one axis."""

    direction: int = 0
    """+1, -1; 0 = released."""
    step: int = 1
    """1 to 4."""


class Moved(NamedTuple):
    """What a scan gives."""

    axis: str
    """That moves; empty = none."""
    speed: float
    """[mm/s], signed."""


@dataclass(slots=True)
class Joystick:
    """Levers of several axes of which one moves: the first that is held, until it is released.

    A second lever held beside it stops everything, and so does a counter that stands still; then all have to be released before one counts
    again. The other direction of the same axis wants a release of `PAUSE`. A step outside 1 to 4 counts as the nearest.

    Source: thesis 002, INVERTER_SPD_SEL_MAN and "only one axis at a time in manual"; the release after any interruption, the counter and
    the pause are ours (hmi-design section 12).

    Raises:
        ValueError: an axis has not four steps, rising and above 0.
    """

    steps: Mapping[str, Sequence[float]]
    """Speeds of each axis [mm/s]."""
    axis: str = ""
    """That is held."""
    ready: bool = False
    """Everything was seen released, so a lever counts."""
    _last: tuple[str, int] = ("", 0)
    """What moved last, and which way."""
    _counter: int | None = None
    _silent: float = 0.0
    _pause: float = PAUSE
    """Since then, released [s]."""

    def __post_init__(self) -> None:
        for axis, steps in self.steps.items():
            rising = len(steps) == STEPS and all(a < b for a, b in zip((0.0, *steps), steps, strict=False))
            if not rising:
                raise ValueError(f"steps of {axis} are {tuple(steps)}, four rising speeds above 0 expected")

    def step(self, levers: Mapping[str, Lever], counter: int, dt: float, *, allowed: bool = True) -> Moved:
        """One scan of `dt` [s]; `counter` changes at least every `RELEASED` while somebody holds, `allowed` = manual mode, no stop.

        Raises:
            KeyError: a lever of an axis that is not there.
        """
        self._silent = 0.0 if counter != self._counter else self._silent + dt
        first, self._counter = self._counter is None, counter
        held = [axis for axis, lever in levers.items() if lever.direction]
        for axis in held:
            self.steps[axis]
        if not held:
            self._pause += dt
            self.ready, self.axis = allowed and not first, ""
            return Moved("", 0.0)
        axis = held[0]
        direction = 1 if levers[axis].direction > 0 else -1
        turned = self._last == (axis, -direction) and self._pause < PAUSE - dt / 2
        other = bool(self.axis) and axis != self.axis
        if len(held) > 1 or not allowed or self._silent >= RELEASED or turned or other:
            self.ready = False
        if not self.ready:
            self.axis = ""
            return Moved("", 0.0)
        self.axis, self._last, self._pause = axis, (axis, direction), 0.0
        number = min(max(levers[axis].step, 1), STEPS)
        return Moved(axis, direction * self.steps[axis][number - 1])
