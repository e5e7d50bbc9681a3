"""Registers of the virtual positioning axis: telegram 111 on the process data of an S120, the diagnosis registers, the mailbox.

An S110 has no Modbus: it is simulated with the map of an S120 on Modbus TCP. Telegram 111 has twelve words each way and the map ten, so
that the last ones stand beside it in 40120 to 40123, **an extension of this simulator** that no maker has.

| register | to the drive | register | from the drive |
| --- | --- | --- | --- |
| 40100 | STW1 | 40110 | ZSW1 |
| 40101 | POS_STW1 | 40111 | POS_ZSW1 |
| 40102 | POS_STW2 | 40112 | POS_ZSW2 |
| 40103 | STW2 | 40113 | ZSW2 |
| 40104 | OVERRIDE | 40114 | MELDW |
| 40105, 40106 | MDI_TARPOS [LU] | 40115, 40116 | XIST_A [LU] |
| 40107, 40108 | MDI_VELOCITY [1000 LU/min] | 40117, 40118 | NIST_B |
| 40109 | MDI_ACC | 40119 | FAULT_CODE |
| 40120 | MDI_DEC | 40122 | WARN_CODE |

Source: reference/sinamics-modbus.md sections 1 to 3, reference/profidrive.md section 6. Double words are sent high word first.
"""

from collections.abc import Mapping
from types import MappingProxyType

from app.sim.sinamics import registers as sinamics
from app.sim.sinamics.registers import READ_ONLY, WRITABLE, Register

WORDS = 10
"""Process data each way of an S120."""
FULL = 0x4000
"""100 % of OVERRIDE, MDI_ACC and MDI_DEC."""
FULL_SPEED = 0x4000_0000
"""100 % of NIST_B."""
STW1, POS_STW1, POS_STW2, STW2, OVERRIDE, TARGET, VELOCITY, ACCELERATION = 0, 1, 2, 3, 4, 5, 7, 9
"""Places of the words to the drive; TARGET and VELOCITY are two words long."""
DECELERATION = 40120
SHARED = (
    *("r0200", "r0018", "r0206", "r0020", "r0022", "r0026", "r0027", "r0031", "r0032", "r0039", "r0807"),
    *("r2110[0]", "r2132", "40499"),
)
"""Diagnosis registers that a servo on an S120 has as the other drives do."""


def _map() -> dict[int, Register]:
    one = {
        number: register
        for number, register in sinamics.REGISTERS.items()
        if register.parameter in SHARED or register.parameter.startswith("r0947[")
    }
    one[DECELERATION] = Register("MDI_DEC", FULL / 100, "%", 0, 100, WRITABLE, "G")
    one[40121] = Register("free", 1, "", 0, 0xFFFF, WRITABLE, "G")
    one[40122] = Register("WARN_CODE", 1, "", 0, 0xFFFF, READ_ONLY, "G")
    one[40123] = Register("free", 1, "", 0, 0xFFFF, READ_ONLY, "G")
    return dict(sorted(one.items()))


REGISTERS: Mapping[int, Register] = MappingProxyType(_map())
"""Number → register, without the process data and the mailbox."""
