"""Where a drive has its mailbox for parameter requests: `[mailbox]` of device.toml.

[mailbox]
address = 0x0258        first of its 122 registers
error = 0x01F2          register that tells why a telegram was refused with exception 04; 0 = none
timeout = 5             longest time for an answer [s]
"""

from app.plant.definitions import Device, MailboxMap
from app.plant.said import said
from app.plant.tables import Table
from app.profidrive.parameter_access.mailbox import WORDS

WRITE_SEVERAL = 16
"""Function code that a request is sent with, all of it in one telegram."""


def read_mailbox(head: Table, device: Device) -> MailboxMap | None:
    """`[mailbox]` of device.toml; None when there is none."""
    if not head.has("mailbox"):
        return None
    table = head.table("mailbox")
    found = MailboxMap(
        address=table.whole("address", high=0x10000 - WORDS),
        error=table.whole("error", 0),
        timeout=table.number("timeout", 5.0, 0.1, 60.0),
    )
    if min(device.max_write, device.max_read) < WORDS or WRITE_SEVERAL not in device.write_functions:
        table.note(
            "",
            "max_read / max_write / write_functions",
            said("mistake.at_once", words=WORDS),
        )
    table.done()
    return found
