"""Which of two hoist drives works, and how two share the load."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from math import isfinite
from typing import NamedTuple

Pair = tuple[bool, bool]


class Selection(Enum):
    """What is asked for."""

    NONE = "none"
    FIRST = "first"
    SECOND = "second"
    BOTH = "both"
    BY_HOURS = "by_hours"
    """The one with fewer running hours."""


ACTIVE: Mapping[Selection, Pair] = {
    Selection.NONE: (False, False),
    Selection.FIRST: (True, False),
    Selection.SECOND: (False, True),
    Selection.BOTH: (True, True),
}
"""Drives that work by a choice that does not depend on hours."""


class Selected(NamedTuple):
    """What holds."""

    active: Pair
    permissive: bool
    """Every selected drive is available: the hoist may move."""
    trims: tuple[float, float]
    """Correction of each drive's speed [part of the greatest speed]."""


@dataclass(slots=True)
class DriveSelection:
    """Choice of the hoist's drives, taken at standstill only.

    By hours the drive with fewer of them is taken, and changed when it is more than `balance` ahead or not available; so the two motors age
    alike without changing at every move. With both drives, what one takes more of the torque than the other is taken off its speed
    (`droop`), so that motors on one drum share the load.

    Source: thesis 002, "drive 1 or 2 selected", hours used to balance the two hoist motors. Droop and dead-band are ours, figures assumed.

    Raises:
        ValueError: balance or droop is not a finite number of at least 0.
    """

    balance: float = 10.0
    """[h]"""
    droop: float = 0.02
    """Speed at a difference of the whole torque [part of the greatest speed]."""
    chosen: Selection = Selection.NONE
    _by_hours: int = 0

    def __post_init__(self) -> None:
        for name in ("balance", "droop"):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value}, a finite number of at least 0 expected")

    def step(
        self,
        selection: Selection,
        hours: tuple[float, float],
        available: Pair,
        torques: tuple[float, float] = (0.0, 0.0),
        *,
        moving: bool = False,
    ) -> Selected:
        """One scan; `torques` as parts of the rated one, signed; `moving` = energised, brakes open or under way.

        Raises:
            ValueError: hours or torques are not finite.
        """
        if not all(map(isfinite, (*hours, *torques))):
            raise ValueError(f"hours {hours} and torques {torques}, finite numbers expected")
        if not moving:
            self.chosen = selection
            if selection is Selection.BY_HOURS:
                self._by_hours = self._younger(hours, available)
        active = ACTIVE.get(self.chosen) or (self._by_hours == 0, self._by_hours == 1)
        permissive = any(active) and all(there or not used for there, used in zip(available, active, strict=True))
        trim = self.droop * (torques[0] - torques[1]) / 2 if active == (True, True) else 0.0
        limit = self.droop
        trim = min(max(trim, -limit), limit)
        return Selected(active, permissive, (-trim, trim))

    def _younger(self, hours: tuple[float, float], available: Pair) -> int:
        mine, other = self._by_hours, 1 - self._by_hours
        if available[other] and (not available[mine] or hours[mine] > hours[other] + self.balance):
            return other
        return mine
