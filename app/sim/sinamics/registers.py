"""Modbus registers of a SINAMICS drive: number, parameter, scale, range and access, written from the maker's map.

Source: reference/sinamics-modbus.md sections 2, 3 and 5. Register 4xxxx is protocol address number − 40001.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

FIRST_NUMBER = 40001
CONTROL, SETPOINT, PROCESS_OUT_END = 40100, 40101, 40110
"""STW1, HSW; up to here are words to the drive."""
STATUS, ACTUAL, PROCESS_IN_END = 40110, 40111, 40120
"""ZSW1, HIW; up to here are words from the drive."""
ACCESS_ERROR = 40499
MAILBOX = range(40601, 40723)
"""The window to all parameters (DS47)."""
G120_WORDS = 2
"""Process data each way of a G120, which has one drive object."""
TYPE_CONTROL_UNIT, TYPE_SERVO = 1, 11
"""p0107; unconfirmed."""
WATCHED = frozenset({CONTROL, SETPOINT, STATUS, ACTUAL})
"""What the monitoring of the process data (p2040) counts."""

READ_ONLY, WRITABLE = False, True


class Register(NamedTuple):
    """One register of the map."""

    parameter: str
    factor: float
    """Raw steps per unit."""
    unit: str
    low: float
    high: float
    """Least and greatest value [unit]; what is read beyond is told as the limit."""
    writable: bool
    certainty: str = "M"

    def encode(self, value: float) -> int:
        """The word of `value`, a negative one as two's complement."""
        return round(min(max(value, self.low), self.high) * self.factor) & 0xFFFF

    def decode(self, word: int) -> float:
        """The value of `word` [unit]."""
        return (word - 0x10000 if self.low < 0 and word >= 0x8000 else word) / self.factor


def _map() -> dict[int, Register]:
    one = {
        40300: Register("r0200", 1, "", 0, 32767, READ_ONLY),
        40301: Register("r0018", 1e-4, "", 0, 327_670_000, READ_ONLY),
        40320: Register("r0206", 100, "kW", 0, 327.67, READ_ONLY),
        40321: Register("p0640", 10, "A", 10, 400, WRITABLE),
        40322: Register("p1120", 100, "s", 0, 650, WRITABLE),
        40323: Register("p1121", 100, "s", 0, 650, WRITABLE),
        40324: Register("p2000", 1, "rpm", 6, 32767, WRITABLE),
        40340: Register("r0020", 1, "rpm", -16250, 16250, READ_ONLY),
        40341: Register("r0022", 1, "rpm", -16250, 16250, READ_ONLY),
        40342: Register("r0024", 100, "Hz", -327.68, 327.67, READ_ONLY),
        40343: Register("r0025", 1, "V", 0, 32767, READ_ONLY),
        40344: Register("r0026", 1, "V", 0, 32767, READ_ONLY),
        40345: Register("r0027", 100, "A", 0, 163.83, READ_ONLY),
        40346: Register("r0031", 100, "Nm", -325, 325, READ_ONLY),
        40347: Register("r0032", 100, "kW", 0, 327.67, READ_ONLY),
        40348: Register("r0039", 1, "kWh", 0, 32767, READ_ONLY),
        40349: Register("r0807", 1, "", 0, 1, READ_ONLY),
        40408: Register("r2110[0]", 1, "", 0, 65535, READ_ONLY),
        40409: Register("r2132", 1, "", 0, 65535, READ_ONLY),
        ACCESS_ERROR: Register("40499", 1, "", 0, 255, READ_ONLY),
        40500: Register("p2200", 1, "", 0, 1, WRITABLE, "G"),
        40501: Register("p2240", 100, "%", -200, 200, WRITABLE, "G"),
        40510: Register("p2265", 100, "s", 0, 60, WRITABLE, "G"),
        40511: Register("p2269", 100, "%", 0, 500, WRITABLE, "G"),
        40512: Register("p2280", 1000, "", 0, 65.535, WRITABLE, "G"),
        40513: Register("p2285", 1, "s", 0, 60, WRITABLE, "G"),
        40514: Register("p2274", 1, "s", 0, 60, WRITABLE),
        40515: Register("p2291", 100, "%", -200, 200, WRITABLE),
        40516: Register("p2292", 100, "%", -200, 200, WRITABLE),
        40520: Register("r2250", 100, "%", -100, 100, READ_ONLY),
        40521: Register("r2266", 100, "%", -100, 100, READ_ONLY),
        40522: Register("r2294", 100, "%", -100, 100, READ_ONLY),
    }
    one |= {40200 + n: Register(f"p073{n}", 1, "", 0, 1, WRITABLE) for n in range(4)}
    one |= {40220 + n: Register(f"r0774[{n}]", 100, "%", -100, 100, READ_ONLY) for n in range(2)}
    one |= {40240 + n: Register(f"r0722.{n}", 1, "", 0, 1, READ_ONLY) for n in range(6)}
    one |= {40260 + n: Register(f"r0755[{n}]", 100, "%", -300, 300, READ_ONLY, "M" if n < 2 else "G") for n in range(4)}
    one |= {40400 + n: Register(f"r0947[{n}]", 1, "", 0, 32767, READ_ONLY) for n in range(8)}
    one |= {40523 + n: Register(f"p0791[{n}]", 100, "%", -199.99, 199.99, WRITABLE) for n in range(2)}
    return dict(sorted(one.items()))


REGISTERS: Mapping[int, Register] = MappingProxyType(_map())
"""Number → register, without the process data."""
ADDRESSES: Mapping[int, int] = MappingProxyType({number - FIRST_NUMBER: number for number in REGISTERS})
"""Protocol address → number."""
