"""The faults of an EURA E800 by their status codes."""

from collections.abc import Mapping
from types import MappingProxyType

FAULTS: Mapping[int, tuple[str, str]] = MappingProxyType(
    {
        0x04: ("OC", "over-current"),
        0x05: ("OE", "DC over-voltage"),
        0x06: ("PF1", "input phase loss"),
        0x07: ("OL1", "inverter overload"),
        0x08: ("LU", "under-voltage"),
        0x09: ("OH", "overheat"),
        0x0A: ("OL2", "motor overload"),
        0x0B: ("Err", "interference"),
        0x0C: ("LL", "LL (no text in any source)"),
        0x0D: ("ESP", "external fault"),
        0x0E: ("Err1", "password wrong"),
        0x0F: ("Err2", "parameter tuning failed"),
        0x10: ("Err3", "current fault before running"),
        0x11: ("Err4", "current zero drift"),
        0x12: ("OC1", "hardware over-current"),
        0x13: ("PF0", "output phase loss"),
        0x14: ("AErr", "analog line disconnected"),
        0x15: ("EP3", "under-load (EP3)"),
        0x16: ("EP", "under-load protection"),
        0x17: ("PP", "PP (no text in any source)"),
        0x18: ("nP", "pressure-control protection"),
        0x19: ("Err5", "PID parameters set wrongly"),
        0x1A: ("CE", "communication time-out; code assumed"),
    }
)
"""Status code → keypad text, meaning. Section 4 of the sheet; from 0x12 on by order only."""

OC, OE, OL1, LU, OH, OL2, CE = 0x04, 0x05, 0x07, 0x08, 0x09, 0x0A, 0x1A

PATIENCE: Mapping[int, float] = {OC: 2.0, OE: 2.0, OL1: 20.0, LU: 2.0, OH: 60.0, OL2: 20.0}
"""Injected faults with a physical cause: how long that may take to trip the drive before it trips regardless [s]."""
