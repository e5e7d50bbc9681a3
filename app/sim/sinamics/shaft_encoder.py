"""The absolute encoder on the shaft of a virtual drive that has the basic positioner."""

from dataclasses import dataclass

TURNS = 4096
"""That the encoder tells apart, as multiturn encoders commonly do; assumed."""


@dataclass(slots=True)
class ShaftEncoder:
    """Counts the turns of the shaft; without power, too."""

    turns: float = 1234.5
    """Since the zero of its disc; where it stands when it is built in."""

    def step(self, speed: float, dt: float) -> None:
        """One step of `dt` [s] at `speed` [rpm]; after the last turn the first one comes again."""
        self.turns = (self.turns + speed / 60 * dt) % TURNS

    def position(self, scale: float) -> float:
        """[LU], with `scale` LU per turn."""
        return self.turns * scale
