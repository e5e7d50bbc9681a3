"""The error numbers of parameter access, and those of the DS47 mailbox around it.

Their texts are of the product, in every language: `profidrive.error.x6b`, `profidrive.mailbox.x2`.

Source: reference/profidrive.md section 9, reference/sinamics-modbus.md section 5.
"""

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import NamedTuple


class ErrorNumber(IntEnum):
    """What a device says of a parameter that it did not read or write; a device may say a number that is not here."""

    NO_PARAMETER = 0x00
    READ_ONLY = 0x01
    OUT_OF_LIMITS = 0x02
    NO_SUBINDEX = 0x03
    NO_ARRAY = 0x04
    WRONG_TYPE = 0x05
    ONLY_RESET = 0x06
    DESCRIPTION_FIXED = 0x07
    NO_DESCRIPTION = 0x09
    NO_PRIORITY = 0x0B
    NO_KEYWORD = 0x0C
    NO_TEXT = 0x0F
    READ_PROTECTED = 0x10
    NOT_NOW = 0x11
    NOT_PERMITTED = 0x14
    ANSWER_TOO_LONG = 0x15
    ILLEGAL_ADDRESS = 0x16
    ILLEGAL_FORMAT = 0x17
    WRONG_COUNT = 0x18
    NO_DRIVE_OBJECT = 0x19
    TEXT_FIXED = 0x20
    NO_SUCH_REQUEST = 0x21
    DEACTIVATED = 0x65
    CHANNEL_TOO_NARROW = 0x66
    ILLEGAL_VALUE = 0x68
    TASK_NOT_SUPPORTED = 0x6A
    CONTROLLER_ENABLED = 0x6B
    UNKNOWN_UNIT = 0x6C
    ONLY_MOTOR_COMMISSIONING = 0x6E
    ONLY_POWER_UNIT_COMMISSIONING = 0x6F
    ONLY_QUICK_COMMISSIONING = 0x70
    ONLY_READY = 0x71
    ONLY_PARAMETER_RESET = 0x72
    ONLY_SAFETY_COMMISSIONING = 0x73
    ONLY_TECHNOLOGY_COMMISSIONING = 0x74
    ONLY_COMMISSIONING = 0x75
    ONLY_DOWNLOAD = 0x76
    NOT_IN_DOWNLOAD = 0x77
    ONLY_DEVICE_CONFIGURATION = 0x78
    ONLY_DEVICE_TYPE = 0x79
    ONLY_DEVICE_DATA_SETS = 0x7A
    ONLY_DEVICE_BASIC = 0x7B
    ONLY_DEVICE_DOWNLOAD = 0x7C
    ONLY_DEVICE_RESET = 0x7D
    ONLY_DEVICE_READY = 0x7E
    ONLY_DEVICE_COMMISSIONING = 0x7F
    NO_DOWNLOAD_NOW = 0x81
    MASTER_CONTROL_BLOCKED = 0x82
    NO_INTERCONNECTION = 0x83
    CHANGE_INHIBITED = 0x84
    NO_ACCESS_METHOD = 0x85
    ONLY_P0010_15 = 0x86
    WRITE_PROTECTED = 0x87
    NO_TEXT_FOUND = 0x88
    BELOW_PRESENT_LIMIT = 0xC8
    ABOVE_PRESENT_LIMIT = 0xC9
    NO_ACCESS_CODE = 0xCC


class Known(NamedTuple):
    """What is known of one error number."""

    info: str
    """What follows it: `subindex`, or nothing."""
    certainty: str
    """M a manual's page, G unconfirmed, empty = unknown what it means."""


_SUBINDEX = frozenset(
    {
        ErrorNumber.READ_ONLY, ErrorNumber.OUT_OF_LIMITS, ErrorNumber.NO_SUBINDEX, ErrorNumber.ONLY_RESET,
        ErrorNumber.DESCRIPTION_FIXED, ErrorNumber.NOT_PERMITTED,
    }
)  # fmt: skip
_GENERAL = frozenset({0x19, 0x20, 0x21, *range(0x6C, 0x7F)})
KNOWN: Mapping[int, Known] = MappingProxyType(
    {
        number: Known(
            "subindex" if number in _SUBINDEX else "",
            "" if number is ErrorNumber.NO_TEXT_FOUND else "G" if number in _GENERAL else "M",
        )
        for number in ErrorNumber
    }
)
"""Number → what is known of it."""


class MailboxError(IntEnum):
    """What the DS47 mailbox says instead of an answer (40603 with a length of 0)."""

    INVALID_LENGTH = 1
    INVALID_STATE = 2
    """Not in the present state of the drive: it is asked again."""
    INVALID_FUNCTION = 3
    NOT_READY = 4
    """The answer is not there yet."""
    INTERNAL = 5
    UNREACHED = 6
    """Of a PLC between: the drive is not to be reached, it was sent nothing. Ours (blocks/parameter_gateway.py)."""
    UNANSWERED = 7
    """Of a PLC between: the drive was sent the request, and gave no answer. Ours."""


EXCEPTION = 0x10000
"""Added to a Modbus exception code where a parameter is a register and the drive refused the telegram: no error number is that high."""
EXCEPTION_TEXTS = frozenset({1, 2, 3, 4, 5, 6, 7, 8, 10, 11})


def shown(number: int | None) -> str:
    """An error number as people call it: 0x6B, of a Modbus exception 03."""
    if number is None:
        return "–"
    return f"{number - EXCEPTION:02d}" if number >= EXCEPTION else f"0x{number:02X}"


def key_of(number: int | None) -> str:
    """Key of the product text of an error number; of one that nobody knows it takes `number`."""
    if number is not None and number >= EXCEPTION:
        code = number - EXCEPTION
        return f"communication.exception.{code if code in EXCEPTION_TEXTS else 'other'}"
    known = number is not None and number in KNOWN
    return f"profidrive.error.x{number:02x}" if known else "profidrive.error.unknown"


def mailbox_key_of(number: int) -> str:
    """Key of the product text of a mailbox error."""
    return f"profidrive.mailbox.x{number}" if number in tuple(MailboxError) else "profidrive.mailbox.unknown"
