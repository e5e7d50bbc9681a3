"""A sequence of steps with permissives, abort conditions, first-out and forces."""

from app.blocks.sequence.block import SequenceBlock, awaited
from app.blocks.sequence.chart import Branch, Chart, Loop
from app.blocks.sequence.forces import Force, ForceRefused, Forces
from app.blocks.sequence.reports import Fall, FirstOut, Report, StepTimes
from app.blocks.sequence.settings import SequenceSettings, Signals, StepSettings
from app.blocks.sequence.states import ABORT, ALL, BITS, Cause, SequenceEvent, SequenceState, StepState
from app.blocks.sequence.watch import FALLS_KEPT, Values

__all__ = [
    "ABORT",
    "ALL",
    "BITS",
    "FALLS_KEPT",
    "Branch",
    "Cause",
    "Chart",
    "Fall",
    "FirstOut",
    "Force",
    "ForceRefused",
    "Forces",
    "Loop",
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
    "awaited",
]
