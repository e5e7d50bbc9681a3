"""The register map of an EURA E800, written from the maker's map (reference/eura-e800.md), never from the equipment type's points."""

from collections.abc import Mapping
from types import MappingProxyType

REGISTERS: Mapping[int, tuple[str, float, str]] = MappingProxyType(
    {
        0x1000: ("output frequency", 0.01, "Hz"),
        0x1001: ("output voltage", 1.0, "V"),
        0x1002: ("output current", 0.01, "A"),
        0x1003: ("poles and control mode", 1.0, ""),
        0x1004: ("DC-bus voltage", 1.0, "V"),
        0x1005: ("drive ratio and status", 1.0, ""),
        0x1006: ("output torque", 1.0, "%"),
        0x1007: ("heat-sink temperature", 1.0, "°C"),
        0x1008: ("PID set value", 1.0, "%"),
        0x1009: ("PID feedback", 1.0, "%"),
        0x100A: ("integer power", 1.0, "kW"),
        0x100B: ("DI terminal status", 1.0, ""),
        0x100C: ("output terminal status", 1.0, ""),
        0x100D: ("AI1", 1.0, ""),
        0x100E: ("AI2", 1.0, ""),
        0x100F: ("AI3", 1.0, ""),
        0x1010: ("reserved", 1.0, ""),
        0x1011: ("pulse input", 0.01, "%"),
        0x1012: ("pulse output", 0.01, "%"),
        0x1013: ("present stage speed", 1.0, ""),
        0x1014: ("external count value", 1.0, ""),
        0x1015: ("AO1 monitor", 0.01, "%"),
        0x1016: ("AO2 monitor", 0.01, "%"),
        0x1017: ("current speed", 1.0, "rpm"),
        0x1018: ("accurate power", 0.1, "kW"),
    }
)
"""Read-only registers: address → (name, scale [unit per raw step], unit). Section 2 of the sheet."""

FIRST, LAST = 0x1000, 0x1018
COMMAND, LOCK, AO1, AO2, DO1, DO2, RELAY = 0x2000, 0x2001, 0x2002, 0x2003, 0x2005, 0x2006, 0x2007
