"""A step sequence as a virtual PLC: it runs the definition of a plant file, on a machine or on words of its own."""

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.plant.said import not_as, said
from app.sim.device import VirtualDevice
from app.sim.options import table
from app.sim.sequence.program import FAULTS, VirtualSequence

__all__ = ["FAULTS", "build"]


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A sequence by its definition, and `simulation` = start (automatic or idle)."""
    simulation = table(item, "simulation")
    start = simulation.pop("start", "idle")
    if start not in ("automatic", "idle"):
        raise ConfigurationError(
            not_as(f"simulation.start = {start!r}", said("mistake.or", first="automatic", second="idle"))
        )
    for key in simulation:
        raise ConfigurationError(not_as(f"simulation.{key}", "start"))
    if item.sequence is None:
        raise ConfigurationError(not_as(said("mistake.no_definition"), said("mistake.a_definition"), "but_expected"))
    return VirtualSequence(item.sequence, automatic=start == "automatic")
