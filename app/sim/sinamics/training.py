"""Training registers of the drive (app/sim/training.py tells those that all devices have).

| address | access | content |
| --- | --- | --- |
| 0xE020 | rw | load, constant part [% of rated torque] |
| 0xE021 | rw | load, part that grows with the square of speed [% of rated torque at rated speed] |
| 0xE022 | rw | disturbance of the load [% of rated torque] |
| 0xE023 | rw | ambient temperature [°C] |
| 0xE024 | rw | supply voltage, line to line [V rms] |
| 0xE025 | rw | run interlock: 1 = terminal of the pulse enable open (second source of the coast stop) |
| 0xE026 | rw | emergency stop: 1 = pressed (second source of the quick stop) |
| 0xE027 | rw | local control: 1 = the operator panel at the drive has it |
| 0xE028 | rw | parameter mailbox: a `MailboxFault`, 0 right |
| 0xE031 | w | 1 = power off and on: parameters as they were saved |
"""

from collections.abc import Mapping

from app.sim.sinamics.mailbox import MailboxFault
from app.sim.training import COMMON_LIMITS, REG_POWER

TYPE_CODE = 2
"""0xE003"""
REG_LOAD = 0xE020
REG_LOAD_QUADRATIC = 0xE021
REG_DISTURBANCE = 0xE022
REG_AMBIENT = 0xE023
REG_SUPPLY = 0xE024
REG_INTERLOCK = 0xE025
REG_EMERGENCY = 0xE026
REG_LOCAL = 0xE027
REG_MAILBOX = 0xE028

LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_LOAD: (0, 500),
    REG_LOAD_QUADRATIC: (0, 500),
    REG_DISTURBANCE: (0, 100),
    REG_AMBIENT: (0, 60),
    REG_SUPPLY: (0, 500),
    REG_INTERLOCK: (0, 1),
    REG_EMERGENCY: (0, 1),
    REG_LOCAL: (0, 1),
    REG_MAILBOX: (0, max(MailboxFault)),
    REG_POWER: (1, 1),
}
"""Lowest and highest word per register."""
