"""The recoiler of the coil car's line by itself: it expands its mandrel and winds."""

from app.sim.coil_car.interlock import InterlockedCar
from app.sim.coil_car.register_map import EXPAND, WIND, Block, Mode


class Recoiler:
    """Winds when it is told to, and in automatic by itself."""

    def __init__(self, car: InterlockedCar) -> None:
        self._car = car
        self.wind = False
        """It was told to begin."""
        self.inhibited = False
        """It was told to stop, and waits for automatic or for being told to begin."""

    def step(self) -> int:
        """One scan in which nobody else moves the mandrel; what it does with it: 1 expands."""
        car, machine, interlock = self._car, self._car.machine, self._car.interlock
        if self.wind and interlock.block(WIND) is Block.FREE:
            self._begin()
        self.wind = False
        if car.mode is not Mode.AUTOMATIC or not machine.strip or car.values["automatic_winding"] < 0.5:
            return 0
        if machine.finished or machine.winding or self.inhibited or car.stopping:
            return 0
        if machine.coil:
            if interlock.block(WIND) is Block.FREE:
                self._begin()
            return 0
        if interlock.in_zone:
            return 0
        if machine.expansion < 1.0:
            return 1 if interlock.block(EXPAND) is Block.FREE else 0
        if interlock.block(WIND) is Block.FREE:
            self._begin()
        return 0

    def _begin(self) -> None:
        car = self._car
        car.machine.coil = car.machine.coil or car.geometry.coil_smallest
        car.machine.winding = True
        car.interlock.renew()
