"""The clock of a virtual PLC: its scans while they are done in real time; paused, or done faster, it goes on as the real one does."""

from app.sim.device import DT
from app.sim.plc.register_map import RegisterMap


class RealTime:
    """What a virtual PLC knows of the time outside."""

    dt: float = DT
    tempo: float = 1.0
    """Simulated time per real time; hosts and hold-to-run are waited for in real time."""
    steps: int
    """Scans since the device was first switched on."""
    _beside: float
    """What real time went on beside them [µs]."""
    _map: RegisterMap

    @property
    def time(self) -> int:
        """Device time [µs]: scans since the device was first switched on, and what real time went on beside them."""
        return round(self.steps * self.dt * 1_000_000) + round(self._beside)

    def stood(self, seconds: float) -> None:
        """So much real time passed without a scan: its clock goes on."""
        self._beside += seconds * 1_000_000
        self._map.forget()

    def _scanned(self) -> float:
        """One scan more; the real time that it stands for [s]."""
        self.steps += 1
        self._beside += (1 / self.tempo - 1) * self.dt * 1_000_000
        return self.dt / self.tempo
