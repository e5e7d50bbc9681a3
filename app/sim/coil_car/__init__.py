"""A coil car under a recoiler as a virtual PLC: the line, its program and its registers."""

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.sim.coil_car.machine import FAULTS, MEASURES, Geometry
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.device import VirtualDevice
from app.sim.options import number, table

__all__ = ["FAULTS", "build"]


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A coil-car line as the plant file describes it: its measures, and `simulation` = start, coil (1 or 0), growth [mm/s], crane [s] and
    settings by name."""
    simulation = table(item, "simulation")
    start = str(simulation.pop("start", "stopped"))
    given = {key: number(f"simulation.{key}", value) for key, value in simulation.items()}
    world = {key: given.pop(key) for key in ("growth", "crane") if key in given}
    measures = {key: number(key, item.options[key]) for key in MEASURES if key in item.options}
    try:
        return VirtualCoilCar(
            Geometry(**measures),
            start=start,
            coil=bool(given.pop("coil", 0.0)),
            settings=given,
            **world,
        )
    except ValueError as error:
        raise ConfigurationError(error.args[0]) from error
