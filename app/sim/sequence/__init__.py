"""A step sequence as a virtual PLC: it runs the definition of a plant file, on a machine or on words of its own."""

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.sim.device import VirtualDevice
from app.sim.options import table
from app.sim.sequence.program import FAULTS, VirtualSequence

__all__ = ["FAULTS", "build"]


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A sequence by its definition, and `simulation` = start (automatic or idle)."""
    simulation = table(item, "simulation")
    start = simulation.pop("start", "idle")
    if start not in ("automatic", "idle"):
        raise ConfigurationError(f"simulation.start = {start!r}: expected automatic or idle")
    for key in simulation:
        raise ConfigurationError(f"simulation.{key}: expected start")
    if item.sequence is None:
        raise ConfigurationError("no sequence, expected a definition")
    return VirtualSequence(item.sequence, automatic=start == "automatic")
