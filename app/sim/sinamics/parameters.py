"""The parameters of a SINAMICS drive that a plant file may set, and how a drive is commissioned."""

from collections.abc import Mapping
from types import MappingProxyType

from app.sim.options import check_parameters
from app.sim.sinamics.registers import REGISTERS

DEFAULTS: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "p0346": (0.4, 0, 20),
        "p0347": (0.6, 0, 20),
        "p1082": (1500, 0, 16250),
        "p1120": (5, 0, 650),
        "p1121": (5, 0, 650),
        "p1135": (1, 0, 600),
        "p1226": (20, 0, 16250),
        "p2040": (1000, 0, 1999999),
        "p2155": (900, 0, 16250),
        "p2163": (90, 0, 16250),
        "p2000": (1500, 6, 32767),
    }
)
"""Parameters that a plant file may set → default, least, greatest; times [s], speeds [rpm], p2040 [ms]. Numbers and defaults other than of
p1120, p1121, p2000 and p2040 are unconfirmed."""


def commissioned(rated_current: float, given: Mapping[str, float]) -> dict[str, float]:
    """The parameters of a drive set up for a motor of `rated_current` [A], with the values `given` by code; p1082 follows p2000.

    Raises:
        ConfigurationError: an unknown code, or a value out of its range.
    """
    values = {code: default for code, (default, _, _) in DEFAULTS.items()}
    values |= {one.parameter: 0.0 for one in REGISTERS.values() if one.writable and one.parameter not in values}
    values |= {"p2291": 100.0, "p2269": 100.0, "p2280": 1.0, "p2285": 30.0}
    current = REGISTERS[40321]
    values["p0640"] = min(max(round(1.5 * rated_current, 1), current.low), current.high)
    limits = {code: limit[1:] for code, limit in DEFAULTS.items()} | {"p0640": (current.low, current.high)}
    check_parameters(given, limits)
    values |= given
    if "p1082" not in given:
        values["p1082"] = values["p2000"]
    return values
