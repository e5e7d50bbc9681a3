"""A virtual Pogon PLC: `plc` serves the map around a program that a machine adds; the other modules hold one part of it each."""

from app.sim.plc.areas import Image, Table
from app.sim.plc.plc import VirtualPlc
from app.sim.plc.register_place import HEADER_PLACES, RegisterPlace
from app.sim.plc.ring import EVENT_CAPACITY
from app.sim.plc.settings import Setting, check_given
from app.sim.plc.verdict import (
    REASON_COUNT,
    REASON_CRC,
    REASON_UNKNOWN,
    REASON_VALUE,
    REASON_WRONG_STATE,
    Verdict,
    rejected,
)

__all__ = [
    "EVENT_CAPACITY",
    "HEADER_PLACES",
    "REASON_COUNT",
    "REASON_CRC",
    "REASON_UNKNOWN",
    "REASON_VALUE",
    "REASON_WRONG_STATE",
    "Image",
    "RegisterPlace",
    "Setting",
    "Table",
    "Verdict",
    "VirtualPlc",
    "check_given",
    "rejected",
]
