"""A SINAMICS drive as a virtual device: its motor, its load, PROFIdrive's state machine, faults and alarms, over its Modbus registers."""

from app.plant.definitions import Equipment
from app.sim.device import VirtualDevice
from app.sim.options import number, table
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.messages import ALARMS
from app.sim.sinamics.messages import FAULTS as TRIPS

__all__ = ["FAULTS", "build"]

FAULTS = (*TRIPS, *ALARMS)
"""What an instructor may cause: fault and alarm numbers, of which none is both."""


def build(item: Equipment, seed: int) -> VirtualDevice:
    """A drive as the plant file describes it: its motor, and `simulation` = start, setpoint, positioning, gateway and parameters."""
    simulation = table(item, "simulation")
    start = str(simulation.pop("start", ""))
    setpoint = number("simulation.setpoint", simulation.pop("setpoint", 0.0))
    words = number("simulation.process_words", simulation.pop("process_words", 10))
    positioning = number("simulation.positioning", simulation.pop("positioning", 0))
    gateway = number("simulation.gateway", simulation.pop("gateway", 0))
    parameters = {"p2000": number("rated_speed", item.options.get("rated_speed", 1500))}
    parameters |= {code: number(f"simulation.{code}", value) for code, value in simulation.items()}
    return VirtualSinamics(
        seed=seed,
        rated_current=number("rated_current", item.options.get("rated_current", 15.0)),
        start="" if start == "stopped" else start,
        setpoint=setpoint,
        process_words=round(words),
        parameters=parameters,
        behind_mailbox=item.type.drive_parameters,
        positioning=positioning == 1,
        gateway=gateway == 1,
    )
