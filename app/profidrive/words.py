"""Control word 1 and status word 1 of standard telegram 1, bit by bit.

Source: reference/profidrive.md sections 1 and 2; the parameters are those of a SINAMICS S120.
"""

from enum import IntEnum
from typing import NamedTuple


class Control(IntEnum):
    """STW1: what the control tells the drive; a word is an `int`."""

    ON = 1 << 0
    """0 = OFF1: down the ramp, then pulses off."""
    NO_COAST_STOP = 1 << 1
    """0 = OFF2: pulses off at once."""
    NO_QUICK_STOP = 1 << 2
    """0 = OFF3."""
    ENABLE_OPERATION = 1 << 3
    ENABLE_RAMP = 1 << 4
    """0 = output of the ramp generator is 0."""
    CONTINUE_RAMP = 1 << 5
    """0 = ramp generator frozen."""
    ENABLE_SETPOINT = 1 << 6
    ACKNOWLEDGE = 1 << 7
    """Counts when it comes (edge)."""
    JOG_1 = 1 << 8
    JOG_2 = 1 << 9
    BY_PLC = 1 << 10
    """0 = the drive ignores the whole process data."""
    INVERT = 1 << 11
    OPEN_BRAKE = 1 << 12
    MOTOR_POTENTIOMETER_UP = 1 << 13
    MOTOR_POTENTIOMETER_DOWN = 1 << 14
    DATA_SET = 1 << 15


class Status(IntEnum):
    """ZSW1: what the drive tells."""

    READY_TO_SWITCH_ON = 1 << 0
    READY = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    NO_COAST_STOP = 1 << 4
    NO_QUICK_STOP = 1 << 5
    SWITCHING_ON_INHIBITED = 1 << 6
    ALARM = 1 << 7
    SPEED_WITHIN_TOLERANCE = 1 << 8
    CONTROL_REQUESTED = 1 << 9
    COMPARISON_REACHED = 1 << 10
    """Frequency or speed has reached the comparison value."""
    LIMIT_NOT_REACHED = 1 << 11
    """Current, torque and power below their limits."""
    BRAKE_OPEN = 1 << 12
    NO_MOTOR_OVERTEMPERATURE = 1 << 13
    FORWARD = 1 << 14
    NO_POWER_UNIT_OVERLOAD = 1 << 15


class Bit(NamedTuple):
    """One bit as a page shows it."""

    number: int
    key: str
    """Of its text: `stw1.on`."""
    parameter: str
    """Of an S120, where it comes from or goes to; empty = none."""
    good: bool | None
    """How it stands in a drive that runs undisturbed; None where both are usual."""


def _bits(word: str, names: type[Control] | type[Status], rows: tuple[tuple[str, bool | None], ...]) -> tuple[Bit, ...]:
    return tuple(
        Bit(number, f"{word}.{names(1 << number).name}".lower(), parameter, good)
        for number, (parameter, good) in enumerate(rows)
    )


CONTROL_BITS = _bits(
    "stw1",
    Control,
    (
        *(("p840", True), ("p844", True), ("p848", True), ("p852", True), ("p1140", True), ("p1141", True)),
        *(("p1142", True), ("p2103", False), ("", False), ("", False), ("p854", True), ("p1113", None)),
        *(("", False), ("p1035", False), ("p1036", False), ("", False)),
    ),
)
"""STW1 by bit number."""
STATUS_BITS = _bits(
    "zsw1",
    Status,
    (
        *(("r899.0", True), ("r899.1", True), ("r899.2", True), ("r2139.3", False), ("r899.4", True)),
        *(("r899.5", True), ("r899.6", False), ("r2139.7", False), ("r2197.7", True), ("r899.9", True)),
        *(("r2199.1", None), ("r1407.7", True), ("r899.12", True), ("r2135.14", True), ("r2197.3", None)),
        ("r2135.15", True),
    ),
)
"""ZSW1 by bit number."""

ENABLES = (
    Control.NO_COAST_STOP
    | Control.NO_QUICK_STOP
    | Control.ENABLE_OPERATION
    | Control.ENABLE_RAMP
    | Control.CONTINUE_RAMP
    | Control.ENABLE_SETPOINT
    | Control.BY_PLC
)
"""0x047E: everything enabled, OFF1. A drive that was just powered up wants to see it before ON."""
RUN = ENABLES | Control.ON
"""0x047F"""
