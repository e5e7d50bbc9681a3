"""What may be done with the alarms of a class: how long one is shelved, whether it goes out of service, whether a reason is asked for.

The values here hold unless `[alarm_classes.<class>]` of the plant file says otherwise. Source: reference/alarms.md section 4; the limits
are decisions of ours, not figures of the standard.
"""

from collections.abc import Mapping
from dataclasses import dataclass

HOUR = 3600.0
"""[s]"""


@dataclass(frozen=True, slots=True)
class AlarmClass:
    """What is allowed with alarms of one class."""

    longest: float = 12 * HOUR
    """One is shelved no longer than this [s]; 0 = it is never shelved."""
    out_of_service: bool = True
    """Whether an engineer may take one out of service."""
    reason: bool = True
    """Whether whoever puts one aside must say why."""


USUAL = AlarmClass()
NEVER = AlarmClass(longest=0.0)
CLASSES: Mapping[str, AlarmClass] = {
    "process": USUAL,
    "drive": USUAL,
    "system": USUAL,
    "comm": AlarmClass(longest=4 * HOUR),
    "command": NEVER,
    "crane-safety-related": NEVER,
    "highly-managed": NEVER,
}
"""The classes that there are without any alarm of theirs."""


def usual(name: str) -> AlarmClass:
    """What holds for the class `name` where no plant file says anything."""
    return CLASSES.get(name, USUAL)
