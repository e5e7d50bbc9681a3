"""The tests of the thesis as its page draws them: curves in panels of one drawing, over the numbers of the thesis."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from math import ceil, floor

from starlette.exceptions import HTTPException

from app.sim.crane.thesis import (
    TARGET,
    TOLERANCE,
    ArcRun,
    PositionerRun,
    SequenceRun,
    run_arc,
    run_positioner,
    run_sequence,
)
from app.web.drawing import Panel


@dataclass(frozen=True, slots=True)
class PositionerDrawing:
    """A positioning: speed and position over the time, and the last of the way larger."""

    run: PositionerRun
    speed = Panel(54, 4, 300, 128, (0, 17.5), (0, 900))
    position = Panel(54, 150, 300, 150, (0, 17.5), (5000, 10500))
    last = Panel(424, 4, 130, 296, (15, 17.5), (9970, 10010))

    @property
    def band(self) -> tuple[float, float]:
        """In which it may stop [mm]."""
        return TARGET - TOLERANCE, TARGET + TOLERANCE

    def curve(self, panel: Panel, *, ours: bool) -> str:
        """One of the two curves in `panel`."""
        moments = self.run.ours if ours else self.run.expected
        return panel.path((m.time, m.speed if panel is self.speed else m.position) for m in moments)

    def number(self, key: str) -> float:
        """What the thesis expects."""
        return next(one.expected for one in self.run.numbers if one.key == key)


@dataclass(frozen=True, slots=True)
class ArcDrawing:
    """A circular lift: way beside the true circle over the angle."""

    run: ArcRun
    beside = Panel(54, 4, 500, 296, (-1, 91), (-4, 10))

    def curve(self, name: str) -> str:
        """One of the curves of the run."""
        return self.beside.path(getattr(self.run, name))


@dataclass(frozen=True, slots=True)
class SequenceDrawing:
    """A cycle: where the three axes are over the time, with the steps that are long enough for their number."""

    run: SequenceRun

    @property
    def panels(self) -> Mapping[str, Panel]:
        """Axis → its panel, one below the other."""
        across = (0.0, self.run.curve[-1].time)
        return {axis: Panel(54, 20 + n * 96, 500, 88, across, self._span(axis)) for n, axis in enumerate(SHOWN_AXES)}

    def curve(self, axis: str) -> str:
        """Of an axis."""
        return self.panels[axis].path((one.time, getattr(one, axis)) for one in self.run.curve)

    @property
    def labels(self) -> list[tuple[int, float]]:
        """(step, place of the middle of its number) of steps that are long enough for it."""
        panel, found, free = self.panels[SHOWN_AXES[0]], list[tuple[int, float]](), 0.0
        for one in self.run.steps:
            middle = panel.x(one.begun + one.seconds / 2)
            if middle - LABEL / 2 >= free and panel.x(one.begun + one.seconds) - panel.x(one.begun) >= LABEL / 2:
                found.append((one.step, middle))
                free = middle + LABEL / 2
        return found

    def _span(self, axis: str) -> tuple[float, float]:
        places = [getattr(one, axis) for one in self.run.curve]
        low = floor(min(places) / GRID) * GRID
        return low, low + max(ceil((max(places) - low) / GRID), 1) * GRID * ROOM

    def grid(self, axis: str) -> list[float]:
        """Values of the lines across the panel of an axis."""
        low, high = self.panels[axis].up
        high = low + (high - low) / ROOM
        return [low, (low + high) / 2, high]


SHOWN_AXES = ("bridge", "trolley", "hoist")
ROOM = 1.3
"""Of a scale for what it may reach, so that there is place for its name above [1 = none]."""
GRID = 2000.0
"""Ends of the scales are multiples of it [mm]."""
LABEL = 36.0
"""Width of the number of a step in the drawing."""
Drawing = PositionerDrawing | ArcDrawing | SequenceDrawing
RUNS: Mapping[str, Callable[[], Drawing]] = {
    "positioner": lambda: PositionerDrawing(run_positioner()),
    "arc": lambda: ArcDrawing(run_arc()),
    "sequence": lambda: SequenceDrawing(run_sequence()),
}
"""By what is asked for with `run`."""


@cache
def drawing(name: str) -> Drawing:
    """Of the run of this name: it comes out the same each time, so one does it for all.

    Raises:
        KeyError: there is none.
    """
    return RUNS[name]()


def _thesis(asked: Mapping[str, str]) -> object | None:
    name = asked.get("run")
    if name is None:
        return None
    if name not in RUNS:
        raise HTTPException(404)
    return drawing(name)


PAGES = {"thesis": ("configure", _thesis)}
