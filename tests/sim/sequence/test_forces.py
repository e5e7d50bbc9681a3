"""Forces of the virtual sequence: rows, places, and how they end."""

import pytest

from app.blocks.sequence import ALL, SequenceEvent
from app.registers.plc_map import real
from app.sim import training
from app.sim.sequence.register_map import (
    FORCES,
    SequenceCommand,
)
from tests.sim.sequence.stand import DONE, drop, f32, flags, row, run, step_row, taught, word


def test_a_force_lets_the_sequence_go_on_and_ends_by_itself() -> None:
    plc, talker = taught()
    drop(talker, 1, 1 << 3)
    plc.step()
    assert talker.ask(SequenceCommand.FORCE, 1, 3, real(2.0), owner=7).state == DONE
    assert word(plc, 8) == 1 and {"forces_active", "start_possible"} <= flags(plc)
    one = step_row(plc, 1)
    assert (one[4], one[5], one[6], one[7]) == (ALL, ALL & ~8, 8, 0x7FFF)
    words = row(plc, FORCES, 0, 12)
    assert (words[0] << 16 | words[1], words[3], words[4], words[5]) == (16 + 3 + 1, 1, 1, 3)
    assert f32(words, 6) == pytest.approx(2.0, abs=0.02) and (words[8] << 16 | words[9], words[10]) == (2, 7)
    talker.events()
    run(plc, 1.0)
    assert f32(row(plc, FORCES, 0, 12), 6) == pytest.approx(1.0, abs=0.02)
    run(plc, 1.0)
    assert word(plc, 8) == 0 and flags(plc) == set() and row(plc, FORCES, 0, 12)[:2] == [0, 0]
    (event,) = talker.events()
    assert (event.code, event.source, event.snapshot[0], event.value) == (SequenceEvent.RELEASED, 1, 3, 1.0)


def test_the_device_releases_a_force_while_nobody_asks_it_anything() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.FORCE, 1, 3, real(28800.0))
    for _ in range(100 * 60):
        plc.step()
    assert plc.block.forces
    talker.ask(SequenceCommand.FORCE, 1, 3, real(10.0))
    for _ in range(999):
        plc.step()
    assert plc.block.forces
    plc.step()
    assert not plc.block.forces


def test_a_force_is_released_by_hand_one_by_one_or_all() -> None:
    plc, talker = taught()
    for place in (1, 2, 3):
        talker.ask(SequenceCommand.FORCE, 2, place, real(60.0))
    talker.events()
    assert talker.ask(SequenceCommand.RELEASE, 2, 2).state == DONE and word(plc, 8) == 2
    answer = talker.ask(SequenceCommand.RELEASE_ALL)
    assert (answer.state, answer.detail, word(plc, 8)) == (DONE, 2, 0)
    assert talker.ask(SequenceCommand.RELEASE_ALL).state == DONE
    released = [event for event in talker.events() if event.code == SequenceEvent.RELEASED]
    assert [(event.snapshot[0], event.value) for event in released] == [(2, 0.0), (1, 0.0), (3, 0.0)]


def test_a_force_keeps_its_row_as_long_as_it_is_there() -> None:
    plc, talker = taught()
    for place in (1, 2, 3):
        talker.ask(SequenceCommand.FORCE, 2, place, real(60.0))
    generation = plc.read(3, FORCES, 1)[0]
    talker.ask(SequenceCommand.RELEASE, 2, 1)
    assert row(plc, FORCES, 1, 12)[5] == 2 and plc.read(3, FORCES, 1)[0] != generation
    talker.ask(SequenceCommand.FORCE, 3, 9, real(60.0))
    assert row(plc, FORCES, 0, 12)[5] == 9


def test_forces_outlive_a_restart_when_the_definition_says_so() -> None:
    plc, talker = taught(keep_forces=True)
    talker.ask(SequenceCommand.FORCE, 1, 1, real(10.0), owner=3)
    run(plc, 4)
    talker.train(training.REG_POWER, 1)
    run(plc, 1)
    words = row(plc, FORCES, 0, 12)
    assert words[3:6] == [1, 1, 1] and words[8:11] == [0, 10, 3] and f32(words, 6) == pytest.approx(5.0, abs=0.05)
    run(plc, 6)
    assert word(plc, 8) == 0
