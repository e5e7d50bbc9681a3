"""A positioning axis as a virtual device: a SINAMICS servo drive with the basic positioner on telegram 111, over Modbus registers."""

from collections.abc import Sequence

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.plant.said import not_as, said
from app.sim.device import VirtualDevice
from app.sim.epos.drive import VirtualPositioningAxis
from app.sim.epos.messages import ALARMS
from app.sim.epos.messages import FAULTS as TRIPS
from app.sim.options import number, table

__all__ = ["FAULTS", "build"]

FAULTS = (*TRIPS, *ALARMS)
"""What an instructor may cause: fault and alarm numbers, of which none is both."""
LU_PER_MM = 1000


def build(item: Equipment, seed: int) -> VirtualDevice:
    """An axis as the plant file describes it: its travel, and `simulation` = start, adjusted, gateway and parameters."""
    simulation = table(item, "simulation")
    start = str(simulation.pop("start", "stopped"))
    pause = number("simulation.pause", simulation.pop("pause", 2.0))
    adjusted = number("simulation.adjusted", simulation.pop("adjusted", 1.0))
    gateway = number("simulation.gateway", simulation.pop("gateway", 0))
    low, high = (
        number(key, item.options.get(key, default)) for key, default in (("travel_low", 0), ("travel_high", 800))
    )
    parameters = {"p2580": low * LU_PER_MM, "p2581": high * LU_PER_MM}
    parameters["p2040"] = number("monitoring", item.options.get("monitoring", 1000))
    parameters |= {code: number(f"simulation.{code}", value) for code, value in simulation.items()}
    return VirtualPositioningAxis(
        seed=seed,
        start="" if start == "stopped" else start,
        adjusted=bool(adjusted),
        blocks=_blocks(low, high),
        pause=pause,
        parameters=parameters,
        behind_mailbox=item.type.drive_parameters,
        gateway=gateway == 1,
    )


def _blocks(low: float, high: float) -> Sequence[float]:
    """Traversing blocks over the travel [LU]."""
    if not low < high:
        raise ConfigurationError(
            not_as(f"travel_low = {low:g}", said("mistake.less_than_key", key="travel_high", value=f"{high:g}"))
        )
    return [(low + share * (high - low)) * LU_PER_MM for share in (0.125, 0.875, 0.5)]
