"""Addresses, codes and words of a sequence: what its host reads and writes. The tables are in `program.py`."""

from enum import IntEnum
from math import nan
from struct import Struct, pack

from app.blocks.sequence import ABORT, BITS, SequenceBlock, SequenceSettings
from app.sim.plc import REASON_UNKNOWN, REASON_WRONG_STATE
from app.sim.sequence.forces import ForceRows
from app.sim.sequence.operator import OperatorRequests
from app.sim.sequence.runs import RunCounts

STATUS, CONFIGURATION, SETTINGS_AT, STAGING = 0x0100, 0x0180, 0x0200, 0x0240
STATUS_WORDS, CONFIGURATION_WORDS = 64, 16
STEPS, FALLS, FORCES = 0x0800, 0x3000, 0x4000
STEP_WORDS, FALL_WORDS, FORCE_WORDS = 32, 16, 12
FALL_ROWS, FORCE_ROWS = 16, 32
MOST_STEPS = 200
LONGEST = 36000.0
"""Of a step's times [s]."""
FROZEN = 1
FAULTS = (FROZEN,)
"""Machine faults that the instructor can cause: the inputs stand still."""
NO_BIT = 0xFFFF
RECIPE_VALUES = 4
"""Of a run."""


class SequenceCommand(IntEnum):
    """Command codes."""

    START = 1
    SUSPEND = 2
    RESUME = 3
    ABORT = 4
    ACKNOWLEDGE = 5
    SINGLE_ON, SINGLE_OFF = 6, 7
    ADVANCE = 8
    AUTOMATIC_ON, AUTOMATIC_OFF = 9, 10
    SET_TIMES = 11
    FORCE = 12
    RELEASE = 13
    RELEASE_ALL = 14


class SequenceReason(IntEnum):
    """Why a command is refused; 20–22 come from the base."""

    UNKNOWN = REASON_UNKNOWN
    WRONG_STATE = REASON_WRONG_STATE
    MISSING = 3
    NEEDS_ACKNOWLEDGE = 4
    LOCKED = 5
    NO_SUCH_STEP = 6
    NO_SUCH_BIT = 7
    FORBIDDEN = 8
    DURATION = 9
    NOT_FORCED = 10
    TIMES = 11
    NO_PLACE = 12
    NOT_SUSPENDED = 13
    NOT_SINGLE = 14
    MACHINE = 15
    RECIPE = 16
    OF_RECIPE = 17


class SequenceDeviceEvent(IntEnum):
    """Codes of the ring beside those of the block (`SequenceEvent`)."""

    TIMES_CHANGED = 17
    POWER_UP = 18
    AUTOMATIC_ON, AUTOMATIC_OFF = 19, 20
    SINGLE_ON, SINGLE_OFF = 21, 22
    RECIPE_1, RECIPE_2, RECIPE_3, RECIPE_4 = 24, 25, 26, 27
    """What was given for the values of a run, behind its start."""


def configuration(steps: int, settings: SequenceSettings) -> bytes:
    """The configuration image, generations aside."""
    packed = pack(">HfH", steps, settings.longest_force, settings.keep_forces)
    return packed.ljust(2 * (CONFIGURATION_WORDS - 2), b"\0")


def status(
    run: SequenceBlock,
    words: tuple[int, ...],
    operator: OperatorRequests,
    counts: RunCounts,
    *,
    recipe: tuple[float, ...],
    start_possible: bool,
    machine_manual: bool,
) -> bytes:
    """The status image, generations aside; `words`: the permissive words, abort conditions first."""
    out, running, forced = run.first_out, run.running, run.forces.bits(ABORT)
    bits = (
        run.stalled,
        run.needs_acknowledge,
        operator.single,
        operator.automatic,
        start_possible,
        bool(run.forces),
        running and run.output(run.step),
        machine_manual,
        run.safe,
    )
    return _STATUS.pack(
        run.state,
        run.step,
        sum(1 << n for n, bit in enumerate(bits) if bit),
        len(run.settings.steps),
        words[ABORT] | forced,
        words[ABORT],
        forced,
        len(run.forces),
        run.settings.abort_forceable,
        run.run_time if running else counts.last,
        counts.last,
        counts.done & 0xFFFFFFFF,
        counts.aborted & 0xFFFFFFFF,
        counts.timed_out & 0xFFFFFFFF,
        counts.shortest,
        counts.mean,
        counts.longest,
        counts.last_outcome,
        0,
        out.cause if out else 0,
        out.step if out else 0,
        out.bit if out and out.bit >= 0 else NO_BIT,
        out.at_step if out else 0,
        out.time if out else 0,
        out.value if out else nan,
        out.together if out else 0,
        _snapshot(run, ABORT),
        counts.start,
        len(run.falls),
        len(run.active),
        len(recipe),
        *(*recipe, 0.0, 0.0, 0.0, 0.0)[:RECIPE_VALUES],
    )


def step_row(run: SequenceBlock, number: int, word: int, lost: int, mark: int) -> bytes:
    """Row of step `number` with its permissive `word` and the bits that it `lost` in this run; `mark`: its generation."""
    settings, times = run.settings.step(number), run.times[number - 1]
    forced = run.forces.bits(number)
    return _STEP.pack(
        number,
        mark,
        run.step_state(number),
        word | forced,
        word,
        forced,
        settings.forceable,
        settings.minimum,
        settings.maximum,
        run.elapsed(number),
        settings.loss_aborts | run.output(number) << 1,
        _snapshot(run, number),
        times.runs,
        times.least,
        times.mean,
        times.most,
        times.last,
        lost,
        run.passes(number),
        mark,
    )


def fall_row(run: SequenceBlock, slot: int, mark: int) -> bytes:
    """Row of a fall, empty beyond the last one."""
    if slot >= min(len(run.falls), FALL_ROWS):
        return _FALL.pack(0, mark, 0, 0, 0, 0, 0, mark)
    fall = run.falls[slot]
    return _FALL.pack(slot + 1, mark, 2 if fall.back else 1, fall.step, fall.bit, fall.fell, fall.back, mark)


def force_row(run: SequenceBlock, forces: ForceRows, slot: int, time: int, mark: int) -> bytes:
    """Row of a force at `time` [µs], empty where none has its place."""
    id = forces.ids[slot]
    if not id:
        return _FORCE.pack(0, mark, 0, 0, 0, 0.0, 0, 0, mark)
    step, bit = divmod(id - 1, BITS)
    asked, owner = forces.asked(id)
    return _FORCE.pack(id, mark, 1, step, bit, run.forces.remaining(step, bit, time), asked, owner, mark)


def _snapshot(run: SequenceBlock, number: int) -> int:
    out = run.first_out
    return out.snapshot[number] if out and number < len(out.snapshot) else 0


_STATUS = Struct(">9H2f3I3f2H4HQf2HQ3H4f16x")
_STEP = Struct(">I6H3f2HI4f2H6xH")
_FALL = Struct(">I4HQQ2xH")
_FORCE = Struct(">I4HfIHH")
