"""A virtual sequence on the table, and its registers in words."""

from app.blocks.sequence import ALL
from app.registers import plc_map
from app.registers.plc_map import AnswerState, real_of
from app.sim.sequence import training as own
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.register_map import (
    STATUS,
    STEPS,
)
from tests.sim.coil_car.line import Talker, teaching

DONE, REJECTED, FAILED = AnswerState.DONE, AnswerState.REJECTED, AnswerState.FAILED


THREE = ((1.0, 10.0), (1.0, 10.0), (1.0, 10.0))


def taught(
    *times: tuple[float, float], loss_aborts: bool = False, keep_forces: bool = False
) -> tuple[VirtualSequence, Talker]:
    plc = VirtualSequence(teaching(*(times or THREE), loss_aborts=loss_aborts, keep_forces=keep_forces))
    plc.step()
    return plc, Talker(plc)


def run(plc: VirtualSequence, seconds: float) -> None:
    for _ in range(round(seconds * 100)):
        plc.step()


def word(plc: VirtualSequence, at: int) -> int:
    return plc.read(3, STATUS + at, 1)[0]


def long(plc: VirtualSequence, at: int) -> int:
    words = plc.read(3, STATUS + at, 2)
    return words[0] << 16 | words[1]


def number(plc: VirtualSequence, at: int) -> float:
    return real_of(long(plc, at))


def flags(plc: VirtualSequence) -> set[str]:
    names = (
        *("stalled", "needs_acknowledge", "single_step", "automatic", "start_possible", "forces_active"),
        *("output", "machine_manual"),
    )
    return {name for n, name in enumerate(names) if word(plc, 3) >> n & 1}


def row(plc: VirtualSequence, table: int, slot: int, size: int) -> list[int]:
    return plc.read(3, table + plc_map.TABLE_HEAD + slot * size, size)


def step_row(plc: VirtualSequence, step: int) -> list[int]:
    return row(plc, STEPS, step - 1, 32)


def f32(words: list[int], at: int) -> float:
    return real_of(words[at] << 16 | words[at + 1])


def drop(talker: Talker, step: int, bits: int) -> None:
    """Let permissives of `step` be missing from the next scan on."""
    talker.train(own.REG_PERMISSIVES + step, ALL & ~bits)
