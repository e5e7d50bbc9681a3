"""A ladle crane as a virtual PLC: its mechanics, its program and its registers."""

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.sim.crane.configuration import PLACES, Places
from app.sim.crane.program import VirtualCrane
from app.sim.crane.training import FAULTS
from app.sim.device import VirtualDevice
from app.sim.options import number, table

__all__ = ["FAULTS", "build"]


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A crane as the plant file describes it: its places, and `simulation` = start, orders (1 or 0), pause [s], ladle [t], stand and
    settings by name."""
    simulation = table(item, "simulation")
    start = str(simulation.pop("start", "stopped"))
    given = {key: number(f"simulation.{key}", value) for key, value in simulation.items()}
    world = {key: given.pop(key) for key in ("pause", "ladle") if key in given}
    try:
        return VirtualCrane(
            Places(**{key: number(key, item.options[key]) for key in PLACES if key in item.options}),
            start=start,
            orders=bool(given.pop("orders", 0.0)),
            stand=int(given.pop("stand", 1.0)),
            settings=given,
            **world,
        )
    except ValueError as error:
        raise ConfigurationError(error.args[0]) from error
