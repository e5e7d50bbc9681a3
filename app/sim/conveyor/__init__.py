"""A conveyor as a virtual PLC: the line, its program and its registers."""

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.plant.said import not_as, said
from app.sim.conveyor.blades import GatePlan
from app.sim.conveyor.lanes import MergePlan
from app.sim.conveyor.machine import FAULTS, Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.device import VirtualDevice
from app.sim.options import number, table

__all__ = ["FAULTS", "build"]


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A line as the plant file describes it: its measures, and `simulation` = start, arrivals (1 or 0), interval [s], shortest,
    longest [mm], not_read [%], lane_interval [s] and settings by name."""
    simulation = table(item, "simulation")
    start = str(simulation.pop("start", "stopped"))
    if start not in ("automatic", "stopped"):
        raise ConfigurationError(
            not_as(f"simulation.start = {start!r}", said("mistake.or", first="automatic", second="stopped"))
        )
    given = {key: number(f"simulation.{key}", value) for key, value in simulation.items()}
    world = {
        key: given.pop(key) for key in ("interval", "shortest", "longest", "not_read", "lane_interval") if key in given
    }
    arrivals = bool(given.pop("arrivals", 1.0))

    def measure(key: str, default: float = 0.0) -> float:
        return number(key, item.options.get(key, default))

    plain = Geometry()
    belts, sensors = round(measure("belts", plain.belts)), round(measure("sensors", len(plain.sensors)))
    gates = (
        GatePlan(
            measure(f"gate_{n}_at"),
            round(measure(f"gate_{n}_rule")),
            measure(f"gate_{n}_value"),
            measure(f"gate_{n}_time", 1.0),
        )
        for n in range(1, round(measure("gates")) + 1)
    )
    merges = (
        MergePlan(
            measure(f"merge_{n}_at"),
            round(measure(f"merge_{n}_mode")),
            measure(f"merge_{n}_gap", 15.0),
            measure(f"merge_{n}_limit", 60.0),
        )
        for n in range(1, round(measure("merges")) + 1)
    )
    geometry = Geometry(
        (*(measure(f"belt_{n}_end") for n in range(1, belts)), measure("line_length", plain.length)),
        tuple(measure(f"sensor_{n}") for n in range(1, sensors + 1)),
        measure("roller_radius", plain.roller_radius),
        measure("rated_speed", plain.rated_speed),
        round(measure("resolution", float(plain.resolution))),
        bool(measure("intact_is_one", float(plain.intact_is_one))),
        tuple(measure(f"belt_{n}_share", 100.0) for n in range(1, belts + 1)),
        tuple(gates),
        tuple(merges),
    )
    try:
        return VirtualConveyor(
            geometry,
            seed=seed,
            slots=round(measure("product_slots", 20)),
            start=start,
            arrivals=arrivals,
            settings=given,
            scanner=round(measure("scanner")),
            **world,
        )
    except ValueError as error:
        raise ConfigurationError(error.args[0]) from error
