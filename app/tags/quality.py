"""Quality of a value, one integer that travels with it.

    bits 0-1   level: good, uncertain, bad
    bits 2-5   reason, 0 = none
    bits 8-11  origin: simulated, forced, substituted, local; it does not lower the level

Named after the OPC UA status codes that they stand for (reference/hmi-design.md section 6).
"""

from collections.abc import Iterable
from enum import IntEnum, IntFlag

GOOD = 0
UNCERTAIN = 1
BAD = 2


class QualityReason(IntEnum):
    """Why a value is not good."""

    NONE = 0
    NO_DATA = 1
    """Never received."""
    COMM_FAILURE = 2
    """The device did not answer."""
    STALE = 3
    """The last value, too old."""
    OUT_OF_RANGE = 4
    """Outside what the device can measure."""
    NOT_CONNECTED = 5
    """The device says: not fitted, or no such register."""
    CONFIGURATION = 6
    """The plant file and the device do not agree."""
    DEVICE = 7
    """The device says itself that the value is wrong."""
    HALTED = 8
    """The device answers, but its program stands still: the last value that it computed."""


class Origin(IntFlag):
    """Where a value comes from; shown beside it."""

    SIMULATED = 0x100
    FORCED = 0x200
    SUBSTITUTED = 0x400
    LOCAL = 0x800


UNSEEN = frozenset({QualityReason.STALE, QualityReason.HALTED})
"""Reasons that mean: the value is the last one known, what is true now nobody has seen."""

NO_DATA = BAD | QualityReason.NO_DATA << 2
COMM_FAILURE = BAD | QualityReason.COMM_FAILURE << 2
STALE = UNCERTAIN | QualityReason.STALE << 2
OUT_OF_RANGE = UNCERTAIN | QualityReason.OUT_OF_RANGE << 2
IMPLAUSIBLE = BAD | QualityReason.OUT_OF_RANGE << 2
NOT_CONNECTED = BAD | QualityReason.NOT_CONNECTED << 2
CONFIGURATION = BAD | QualityReason.CONFIGURATION << 2
DEVICE = BAD | QualityReason.DEVICE << 2
HALTED = UNCERTAIN | QualityReason.HALTED << 2


def level(quality: int) -> int:
    """GOOD, UNCERTAIN or BAD."""
    return quality & 3


def reason(quality: int) -> QualityReason:
    """Why the value is not good."""
    return QualityReason(quality >> 2 & 15)


def origin(quality: int) -> Origin:
    """The origin flags alone."""
    return Origin(quality & 0xF00)


def is_good(quality: int) -> bool:
    """True for good, whatever the origin."""
    return quality & 3 == GOOD


def is_bad(quality: int) -> bool:
    """True when the value must not be shown or used."""
    return quality & 3 == BAD


def is_unseen(quality: int) -> bool:
    """True for the last value known, when nobody sees what is true now."""
    return quality >> 2 & 15 in UNSEEN


def worst(qualities: Iterable[int]) -> int:
    """Quality of something computed: the worst level with its reason, and all origins."""
    result, flags = GOOD, 0
    for quality in qualities:
        flags |= quality & 0xF00
        if quality & 3 > result & 3:
            result = quality & 0xFF
    return result | flags


def name(quality: int) -> str:
    """`good`, `uncertain` or `bad`, with the reason after a colon: for exports and the interface to other programs."""
    text = ("good", "uncertain", "bad", "bad")[quality & 3]
    why = reason(quality)
    return f"{text}:{why.name.lower()}" if why else text
