"""A sequence of steps with permissives, abort conditions, first-out and forces."""

from app.blocks.sequence.block import FALLS_KEPT, SequenceBlock, Values
from app.blocks.sequence.forces import Force, ForceRefused, Forces
from app.blocks.sequence.reports import Fall, FirstOut, Report, StepTimes
from app.blocks.sequence.settings import SequenceSettings, Signals, StepSettings
from app.blocks.sequence.states import ABORT, ALL, BITS, Cause, SequenceEvent, SequenceState, StepState

__all__ = [
    "ABORT",
    "ALL",
    "BITS",
    "FALLS_KEPT",
    "Cause",
    "Fall",
    "FirstOut",
    "Force",
    "ForceRefused",
    "Forces",
    "Report",
    "SequenceBlock",
    "SequenceEvent",
    "SequenceSettings",
    "SequenceState",
    "Signals",
    "StepSettings",
    "StepState",
    "StepTimes",
    "Values",
]
