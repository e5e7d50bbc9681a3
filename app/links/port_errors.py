"""What the kernel counts at a serial port: characters whose parity or stop bit was wrong.

Counted by the driver whether the program asks to see them or not (TIOCGICOUNT, `struct serial_icounter_struct` of linux/serial.h); a
pseudo-terminal and some adapters count nothing.
"""

import fcntl
import struct
from dataclasses import dataclass
from typing import Any

TIOCGICOUNT = 0x545D
LAYOUT = struct.Struct("20i")
"""cts, dsr, rng, dcd, rx, tx, frame, overrun, parity, brk, buf_overrun, nine that are reserved."""
FRAME, PARITY = 6, 8


@dataclass(frozen=True, slots=True)
class PortErrors:
    """Characters that did not arrive as they should."""

    parity: int = 0
    framing: int = 0
    """No stop bit where one had to be: another speed, most of the time."""

    def since(self, before: "PortErrors") -> "PortErrors":
        """What has been counted since `before`; drivers begin anew when a port is opened again."""
        return PortErrors(max(0, self.parity - before.parity), max(0, self.framing - before.framing))


def port_errors(port: Any) -> PortErrors | None:
    """What the driver of `port` has counted; None when it counts nothing."""
    try:
        numbers = LAYOUT.unpack(fcntl.ioctl(port.fileno(), TIOCGICOUNT, bytes(LAYOUT.size)))
    except (OSError, ValueError):
        return None
    return PortErrors(numbers[PARITY], numbers[FRAME])
