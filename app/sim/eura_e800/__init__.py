"""An EURA E800 drive as a virtual device: its motor, its load and the drive's own state machine, faults and parameters."""

from app.plant.definitions import Equipment
from app.sim.device import VirtualDevice
from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import FAULTS
from app.sim.options import number, table

__all__ = ["FAULTS", "build"]


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A drive as the plant file describes it: its motor, its jog frequency, and `simulation` = start and parameters."""
    simulation = table(item, "simulation")
    start = str(simulation.pop("start", ""))
    parameters = (
        {"F124": number("jog_frequency", item.options["jog_frequency"])} if "jog_frequency" in item.options else {}
    )
    parameters |= {code: number(f"simulation.{code}", value) for code, value in simulation.items()}
    return VirtualE800(
        seed=seed,
        rated_current=number("rated_current", item.options.get("rated_current", 4.5)),
        rated_voltage=number("rated_voltage", item.options.get("rated_voltage", 230.0)),
        drive_current=number("drive_current", item.options["drive_current"])
        if "drive_current" in item.options
        else None,
        pole_pairs=int(number("pole_pairs", item.options.get("pole_pairs", 2))),
        rated_frequency=number("rated_frequency", item.options.get("rated_frequency", 50.0)),
        start="" if start == "stopped" else start,
        parameters=parameters,
    )
