"""States, events and causes of a sequence, and the size of its words."""

from enum import IntEnum

ALL = 0xFFFF
BITS = 16
ABORT = 0
"""Number of the word of abort conditions where a step number is expected."""


class SequenceState(IntEnum):
    """What the whole sequence does."""

    IDLE = 0
    RUNNING = 1
    SUSPENDED = 2
    DONE = 3
    TIMED_OUT = 4
    ABORTED = 5


class StepState(IntEnum):
    """What one step does."""

    IDLE = 0
    ACTIVE = 1
    SUSPENDED = 2
    DONE = 3
    TIMED_OUT = 4
    ABORTED = 5
    STALLED = 6
    """Active, and the next step cannot be entered."""


class SequenceEvent(IntEnum):
    """What a scan reports."""

    STARTED = 1
    START_REFUSED = 2
    STEP_ENTERED = 3
    STEP_ENDED = 4
    """Value: how long it was active [s]."""
    SUSPENDED = 5
    RESUMED = 6
    STALLED = 7
    STALL_OVER = 8
    PERMISSIVE_LOST = 9
    """Of the active step, of the next one or of the abort conditions, while the sequence runs."""
    PERMISSIVE_BACK = 10
    TIMED_OUT = 11
    ABORTED = 12
    DONE = 13
    """Value: how long the sequence ran, suspended time included [s]."""
    ACKNOWLEDGED = 14
    FORCED = 15
    """Value: for how long [s]."""
    RELEASED = 16
    """A force ended; value 1: its time was over, 0: a person released it, 2: the device was started."""
    ABORTING = 23
    """It was stopped as `ABORTED` tells at its end, and does its safe steps before; value: the cause."""


class Cause(IntEnum):
    """Why a sequence stopped before its end."""

    NONE = 0
    ABORT_CONDITION = 1
    PERMISSIVE_LOST = 2
    OPERATOR = 3
    TIME = 4
    STALL = 5
    POWER_UP = 6
    COMMAND = 7
    """A command of the step was refused or not confirmed; the value of the first-out is its number, from 1."""
