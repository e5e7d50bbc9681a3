"""What a unit offers beside plain registers, as `device.toml` says it: a table per service, read by the row of its name."""

from collections.abc import Callable, Mapping

from app.plant.definitions import Device, UnitService
from app.plant.mailbox import read_mailbox
from app.plant.plc import read_plc
from app.plant.register_parameters import read_parameter_map
from app.plant.tables import Table

READERS: Mapping[str, Callable[[Table, Device], UnitService | None]] = {
    "plc": read_plc,
    "mailbox": read_mailbox,
    "parameters": read_parameter_map,
}
"""Name of the table → what reads it."""


def read_services(head: Table, device: Device) -> tuple[UnitService, ...]:
    """The services of a type, in the order of `READERS`; those without a table are not there."""
    found = (read(head, device) for name, read in READERS.items() if head.has(name))
    return tuple(service for service in found if service is not None)
