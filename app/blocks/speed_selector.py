"""Which of five speed setpoints counts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

SELECTIONS = 5


class Selected(NamedTuple):
    """What counts now."""

    value: float
    selection: int
    """1–5; 0 = none, the default counts."""


@dataclass(slots=True)
class SpeedSelector:
    """SEL_5R: five selections, each with a value.

    SEL1 always wins when `first_wins` (SEL1HP). Otherwise the first that became active holds until it is released; of several that
    became active in one cycle the lowest number. None active: the default. A selection that SEL1 overrode holds again afterwards if it
    is still active.

    Source: thesis 003, block SEL_5R; its SelIn 0–4 are selections 1–5 here.
    """

    first_wins: bool = True
    held: int = 0
    """Selection that holds, 0 = none."""

    def step(self, active: Sequence[bool], values: Sequence[float], default: float = 0.0) -> Selected:
        """One cycle.

        Raises:
            ValueError: not five selections or not five values.
        """
        if len(active) != SELECTIONS or len(values) != SELECTIONS:
            raise ValueError(f"{len(active)} selections and {len(values)} values, {SELECTIONS} of each expected")
        if self.held and not active[self.held - 1]:
            self.held = 0
        if not self.held:
            self.held = next((number for number, on in enumerate(active, 1) if on), 0)
        number = 1 if self.first_wins and active[0] else self.held
        return Selected(values[number - 1] if number else default, number)


SEL_5R = SpeedSelector
"""Its name in the thesis."""
