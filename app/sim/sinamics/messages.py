"""Faults and alarms of the virtual drive: number, what it is, what the drive does.

A fault shown as F07900 is stored as 7900. What is printed in a source: F01910 with its reaction, the numbers F07452 and F30021
(reference/sinamics-modbus.md sections 4 and 6), F07900 (public articles). Everything else is remembered from the makers' list manuals and
unconfirmed; the numbers of a real drive come as they are, known here or not.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from app.profidrive.state_machine import Reaction


class Fault(NamedTuple):
    """A fault as the drive knows it."""

    meaning: str
    reaction: Reaction


FAULTS: Mapping[int, Fault] = MappingProxyType(
    {
        1910: Fault("fieldbus: setpoint time-out", Reaction.OFF3),
        7011: Fault("motor over-temperature", Reaction.OFF2),
        7452: Fault("following error too high", Reaction.OFF1),
        7801: Fault("motor over-current", Reaction.OFF2),
        7802: Fault("infeed or power unit not ready", Reaction.OFF2),
        7860: Fault("external fault 1", Reaction.OFF2),
        7861: Fault("external fault 2", Reaction.OFF2),
        7900: Fault("motor blocked", Reaction.OFF2),
        7901: Fault("motor over-speed", Reaction.OFF2),
        7902: Fault("motor stalled", Reaction.OFF2),
        30001: Fault("power unit: over-current", Reaction.OFF2),
        30002: Fault("DC link: over-voltage", Reaction.OFF2),
        30003: Fault("DC link: under-voltage", Reaction.OFF2),
        30004: Fault("power unit: heat sink over-temperature", Reaction.OFF2),
        30005: Fault("power unit: overload I²t", Reaction.OFF2),
        30011: Fault("line phase failure", Reaction.OFF2),
        30021: Fault("earth fault", Reaction.OFF2),
        31111: Fault("encoder 1: absolute encoder, internal fault", Reaction.OFF2),
    }
)
"""Number without the F → what the drive does."""
TIMEOUT, MOTOR_HOT, BLOCKED, OVERSPEED = 1910, 7011, 7900, 7901
OVERVOLTAGE, UNDERVOLTAGE, SINK_HOT, OVERLOAD = 30002, 30003, 30004, 30005
ENCODER = 31111

ALARMS: Mapping[int, str] = MappingProxyType(
    {
        5000: "power unit: heat sink over-temperature",
        7805: "power unit: overload I²t",
        7850: "external alarm 1",
        7903: "motor speed deviation",
        7910: "motor over-temperature",
    }
)
"""Number without the A → what it warns of; it goes when its cause goes."""
SINK_WARM, NEAR_OVERLOAD, DEVIATION, MOTOR_WARM = 5000, 7805, 7903, 7910
