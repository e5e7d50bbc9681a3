"""What becomes of a command that a virtual PLC takes, and the reasons that every one gives. A machine has its own beside them."""

from collections.abc import Callable
from dataclasses import dataclass

from app.registers.plc_map import AnswerState

REASON_UNKNOWN, REASON_WRONG_STATE = 1, 2
REASON_COUNT, REASON_VALUE, REASON_CRC = 20, 21, 22
"""Reasons that the base gives."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What becomes of a command when it is taken."""

    state: AnswerState = AnswerState.DONE
    reason: int = 0
    detail: int = 0
    until: Callable[[], AnswerState] | None = None
    """Of a running command: asked after every scan what has become of it."""


def rejected(reason: int, detail: int = 0) -> Verdict:
    """The command does nothing, because of `reason`."""
    return Verdict(AnswerState.REJECTED, reason, detail)
