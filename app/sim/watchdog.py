"""The communication watchdog of a drive: from the first telegram on, silence is counted."""

from dataclasses import dataclass


@dataclass(slots=True)
class Watchdog:
    """Counts time without a telegram."""

    armed: bool = False
    """Whether a telegram was ever heard."""
    _heard: bool = False
    _silent: float = 0.0
    """[s]"""

    def telegram(self) -> None:
        """One was heard; it counts at the next step border."""
        self._heard = True

    def step(self, limit: float, dt: float) -> bool:
        """One step of `dt` [s]; True while it has been silent for longer than `limit` [s], 0 = never."""
        if self._heard:
            self._heard, self.armed, self._silent = False, True, 0.0
            return False
        self._silent += dt
        return self.armed and limit > 0 and self._silent > limit + 1e-6
