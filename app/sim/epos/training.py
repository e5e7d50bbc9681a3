"""Training registers of the positioning axis (app/sim/training.py tells those that all devices have).

| address | access | content |
| --- | --- | --- |
| 0xE020 | rw | load: more friction [% of rated torque] |
| 0xE021 | rw | slide: 1 = jammed |
| 0xE022 | rw | adjustment of the encoder: 0 works, 1 is refused (p2507 = 1), 2 fails (p2507 = 0), 3 never ends |
| 0xE023 | rw | ambient temperature [°C] |
| 0xE025 | rw | run interlock: 1 = terminal of the pulse enable open |
| 0xE026 | rw | emergency stop: 1 = pressed |
| 0xE027 | rw | local control: 1 = the operator panel at the drive has it |
| 0xE028 | rw | parameter mailbox, as of the other drives (sim/sinamics/training.py) |
| 0xE031 | w | 1 = power off and on: parameters as they were saved |
"""

from collections.abc import Mapping
from enum import IntEnum

from app.sim.sinamics.mailbox import MailboxFault
from app.sim.training import COMMON_LIMITS, REG_POWER

TYPE_CODE = 3
"""0xE003"""
REG_LOAD = 0xE020
REG_JAMMED = 0xE021
REG_ADJUSTMENT = 0xE022
REG_AMBIENT = 0xE023
REG_INTERLOCK = 0xE025
REG_EMERGENCY = 0xE026
REG_LOCAL = 0xE027
REG_MAILBOX = 0xE028


class Trouble(IntEnum):
    """What the instructor has done to the adjustment (0xE022)."""

    NONE = 0
    REFUSED = 1
    """The encoder is none that could be adjusted."""
    FAILS = 2
    NEVER_ENDS = 3


LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_LOAD: (0, 500),
    REG_JAMMED: (0, 1),
    REG_ADJUSTMENT: (0, max(Trouble)),
    REG_AMBIENT: (0, 60),
    REG_INTERLOCK: (0, 1),
    REG_EMERGENCY: (0, 1),
    REG_LOCAL: (0, 1),
    REG_MAILBOX: (0, max(MailboxFault)),
    REG_POWER: (1, 1),
}
"""Lowest and highest word per register."""
