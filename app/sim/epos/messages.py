"""Faults and alarms of the virtual axis: those of the other drives that a servo can have, and what only a positioning axis has.

F07452 is printed in a source (reference/sinamics-modbus.md section 6), F01910 with its reaction, too; the other numbers are remembered from
the makers' list manuals and unconfirmed. A real drive's numbers come as they are, known here or not.
"""

from collections.abc import Mapping
from types import MappingProxyType

from app.profidrive.state_machine import Reaction
from app.sim.epos.positioner import ABOVE, BELOW, NOT_ADJUSTED
from app.sim.sinamics import messages as sinamics
from app.sim.sinamics.messages import ENCODER, Fault

TIMEOUT, MOTOR_HOT, FOLLOWING, BEYOND_LOW, BEYOND_HIGH = 1910, 7011, 7452, 7481, 7482
MOTOR_WARM = 7910

__all__ = [
    "ALARMS",
    "BEYOND_HIGH",
    "BEYOND_LOW",
    "ENCODER",
    "FAULTS",
    "FOLLOWING",
    "MOTOR_HOT",
    "MOTOR_WARM",
    "TIMEOUT",
]

FAULTS: Mapping[int, Fault] = MappingProxyType(
    {
        **{number: fault for number, fault in sinamics.FAULTS.items() if number not in (7861, 7902, 30011)},
        BEYOND_LOW: Fault("EPOS: axis below the lower software limit", Reaction.OFF3),
        BEYOND_HIGH: Fault("EPOS: axis above the upper software limit", Reaction.OFF3),
    }
)
"""Number without the F → what the drive does."""
ALARMS: Mapping[int, str] = MappingProxyType(
    {
        7850: "external alarm 1",
        MOTOR_WARM: "motor over-temperature",
        NOT_ADJUSTED: "EPOS: reference point not set",
        BELOW: "EPOS: target below the lower software limit",
        ABOVE: "EPOS: target above the upper software limit",
    }
)
"""Number without the A → what it warns of."""
