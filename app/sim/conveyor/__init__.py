"""A conveyor of three belts as a virtual PLC: the line, its program and its registers."""

from app.errors import ConfigurationError
from app.plant.definitions import Equipment
from app.sim.conveyor.machine import FAULTS, Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.device import VirtualDevice
from app.sim.options import number, table

__all__ = ["FAULTS", "build"]


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A line as the plant file describes it: its measures, and `simulation` = start, arrivals (1 or 0), interval [s], shortest,
    longest [mm] and settings by name."""
    simulation = table(item, "simulation")
    start = str(simulation.pop("start", "stopped"))
    if start not in ("automatic", "stopped"):
        raise ConfigurationError(f"simulation.start = {start!r}: expected automatic or stopped")
    given = {key: number(f"simulation.{key}", value) for key, value in simulation.items()}
    world = {key: given.pop(key) for key in ("interval", "shortest", "longest") if key in given}
    arrivals = bool(given.pop("arrivals", 1.0))

    def measure(key: str, default: float) -> float:
        return number(key, item.options.get(key, default))

    plain = Geometry()
    ends = [measure(f"belt_{n}_end", plain.belt_ends[n - 1]) for n in (1, 2)]
    sensors = [measure(f"sensor_{n}", plain.sensors[n - 1]) for n in (1, 2, 3, 4)]
    geometry = Geometry(
        (ends[0], ends[1], measure("line_length", plain.length)),
        (sensors[0], sensors[1], sensors[2], sensors[3]),
        measure("roller_radius", plain.roller_radius),
        measure("rated_speed", plain.rated_speed),
        round(measure("resolution", float(plain.resolution))),
        bool(measure("intact_is_one", float(plain.intact_is_one))),
    )
    try:
        return VirtualConveyor(
            geometry,
            seed=seed,
            slots=round(measure("product_slots", 20)),
            start=start,
            arrivals=arrivals,
            settings=given,
            **world,
        )
    except ValueError as error:
        raise ConfigurationError(str(error)) from error
