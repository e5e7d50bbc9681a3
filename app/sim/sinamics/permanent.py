"""The ROM of a virtual drive as a memory that outlives the server."""

from collections.abc import Mapping
from typing import Any

from app.sim.sinamics.parameter_model import ParameterModel


class PermanentParameters:
    """What makes a drive with a parameter model `sim.device.Permanent`."""

    model: ParameterModel

    @property
    def written(self) -> int:
        """How often the ROM was written."""
        return self.model.saves

    def memory(self) -> dict[str, Any]:
        """The ROM; empty where nothing was saved yet."""
        return self.model.rom()

    def remember(self, memory: Mapping[str, Any]) -> bool:
        """Power up with the ROM of a former run; false where it does not fit."""
        if not self.model.load(memory):
            return False
        self._power_up()
        self._begin()
        return True

    def _power_up(self) -> None:
        raise NotImplementedError

    def _begin(self) -> None:
        """Run, where the plant file says that it runs since long."""
        raise NotImplementedError
