"""Where the values of a virtual PLC lie in its map."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from app.registers import plc_map


@dataclass(frozen=True, slots=True)
class RegisterPlace:
    """Where a value lies and how its words become a number."""

    address: int
    type: str = "u16"
    """u16, u32, i32, f32 or u64."""
    shift: int = 0
    mask: int = 0
    """After the shift; 0 = the whole word."""


HEADER_PLACES: Mapping[str, RegisterPlace] = MappingProxyType(
    {
        "config_crc": RegisterPlace(plc_map.AT_CRC, "u32"),
        "boots": RegisterPlace(plc_map.AT_BOOTS),
        "scan_time": RegisterPlace(plc_map.AT_SCAN),
        "scan_time_max": RegisterPlace(plc_map.AT_SCAN_MAX),
        "overruns": RegisterPlace(plc_map.AT_OVERRUNS),
    }
)
"""Values of the header that every type shows, by name."""
