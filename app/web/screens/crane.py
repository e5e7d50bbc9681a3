"""The tests of the thesis as its page draws them: curves in panels of one drawing, over the numbers of the thesis."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from starlette.exceptions import HTTPException

from app.sim.crane.thesis import TARGET, TOLERANCE, ArcRun, PositionerRun, run_arc, run_positioner


@dataclass(frozen=True, slots=True)
class Panel:
    """A rectangle of a drawing with its scales; places in the drawing's units, to a tenth."""

    left: float
    top: float
    width: float
    height: float
    across: tuple[float, float]
    """Ends of the horizontal scale [EU]."""
    up: tuple[float, float]
    """Ends of the vertical scale, lower one first [EU]."""

    @property
    def right(self) -> float:
        """Right border."""
        return self.left + self.width

    @property
    def bottom(self) -> float:
        """Lower border."""
        return self.top + self.height

    def x(self, value: float) -> float:
        """Place of a value of the horizontal scale."""
        low, high = self.across
        return round(self.left + (value - low) / (high - low) * self.width, 1)

    def y(self, value: float) -> float:
        """Place of a value of the vertical scale."""
        low, high = self.up
        return round(self.bottom - (value - low) / (high - low) * self.height, 1)

    def path(self, points: Iterable[tuple[float, float]]) -> str:
        """The line through `points` that are inside, as SVG writes it; empty when there is none."""
        (left, right), (low, high) = self.across, self.up
        inside = [(x, y) for x, y in points if left <= x <= right and low <= y <= high]
        return "M" + "L".join(f"{self.x(x)} {self.y(y)}" for x, y in inside) if inside else ""


@dataclass(frozen=True, slots=True)
class PositionerDrawing:
    """A positioning: speed and position over the time, and the last of the way larger."""

    run: PositionerRun
    speed = Panel(52, 4, 430, 136, (0, 17.5), (0, 750))
    position = Panel(52, 160, 430, 160, (0, 17.5), (5000, 10500))
    last = Panel(540, 4, 236, 316, (15, 17.5), (9970, 10010))

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
    beside = Panel(52, 4, 720, 316, (-1, 91), (-4, 10))

    def curve(self, name: str) -> str:
        """One of the curves of the run."""
        return self.beside.path(getattr(self.run, name))


RUNS: Mapping[str, Callable[[], PositionerDrawing | ArcDrawing]] = {
    "positioner": lambda: PositionerDrawing(run_positioner()),
    "arc": lambda: ArcDrawing(run_arc()),
}
"""By what is asked for with `run`."""


def _thesis(asked: Mapping[str, str]) -> object | None:
    name = asked.get("run")
    if name is None:
        return None
    if name not in RUNS:
        raise HTTPException(404)
    return RUNS[name]()


PAGES = {"thesis": ("configure", _thesis)}
