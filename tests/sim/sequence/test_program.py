"""A sequence by its registers: runs, every command and refusal, forces, first-out, restart, and the coupling with its machine."""

from dataclasses import replace

import pytest

from app.blocks.sequence import ALL, Cause, SequenceEvent, SequenceState
from app.errors import ConfigurationError, DeviceException
from app.plant.definitions import SequenceDefinition
from app.plant.sequences import checksum
from app.registers import plc_map
from app.registers.plc_map import Answer, AnswerState, DeviceEvent, real, real_of, time_of
from app.sim import training
from app.sim.coil_car import register_map as coil_car
from app.sim.plc import EVENT_CAPACITY
from app.sim.sequence import training as own
from app.sim.sequence.program import (
    FALLS,
    FORCE_ROWS,
    FORCES,
    NO_BIT,
    STAGING,
    STATUS,
    STEPS,
    SequenceCommand,
    SequenceDeviceEvent,
    SequenceReason,
    VirtualSequence,
)
from tests.sim.coil_car.line import TRANSPORT, Line, Talker, bit, step, teaching

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


def of(events: list[DeviceEvent], *codes: int) -> list[tuple[int, int, int]]:
    """(code, step, bit) of those with one of `codes`."""
    return [(event.code, event.source, event.snapshot[0]) for event in events if event.code in codes]


# ---- a run


def test_a_run_goes_through_its_steps_and_is_counted() -> None:
    plc, talker = taught()
    assert flags(plc) == {"start_possible"} and word(plc, 4) == 3
    began = plc.time + 10_000
    assert talker.ask(SequenceCommand.START).state == DONE
    assert (word(plc, 1), word(plc, 2), flags(plc)) == (SequenceState.RUNNING, 1, {"output"})
    assert time_of(plc.read(3, STATUS + 40, 4)) == began
    run(plc, 1.5)
    assert word(plc, 2) == 2 and number(plc, 10) == pytest.approx(1.5)
    assert step_row(plc, 1)[3] == 3 and step_row(plc, 2)[3] == 1 and step_row(plc, 3)[3] == 0
    assert f32(step_row(plc, 2), 12) == pytest.approx(0.5)
    run(plc, 2)
    assert (word(plc, 1), word(plc, 2), word(plc, 26)) == (SequenceState.DONE, 0, 3)
    assert long(plc, 14) == 1 and number(plc, 12) == pytest.approx(3.0) and number(plc, 10) == pytest.approx(3.0)
    assert [number(plc, at) for at in (20, 22, 24)] == pytest.approx([3.0] * 3)
    one = step_row(plc, 1)
    assert (one[16] << 16 | one[17]) == 1 and [f32(one, at) for at in (18, 20, 22, 24)] == pytest.approx([1.0] * 4)
    assert [code for code, _ in talker.codes()] == [1, 3, 4, 3, 4, 3, 4, 13]


def test_the_words_of_all_200_steps_are_taught_by_registers() -> None:
    plc, talker = taught(*[(0.01, 5.0)] * 200)
    for place in (0, 1, 14, 15, 100, 200):
        assert plc.read(3, own.REG_WORDS + place, 1) == [ALL]
        talker.train(own.REG_WORDS + place, ALL & ~(1 << place % 16))
    plc.step()
    assert word(plc, 6) == ALL & ~1 and step_row(plc, 200)[5] == ALL & ~(1 << 8) and step_row(plc, 99)[5] == ALL
    assert plc.read(3, own.REG_PERMISSIVES, 15) == plc.read(3, own.REG_WORDS, 15), "the first also stand there"
    drop(talker, 2, 0b10)
    plc.preset({"word_3": 5})
    plc.step()
    assert plc.read(3, own.REG_WORDS + 2, 2) == [ALL & ~0b10, 5] and step_row(plc, 2)[5] == ALL & ~0b10
    talker.train(training.REG_RESET, 1)
    plc.step()
    assert plc.read(3, own.REG_WORDS + 100, 101) == [ALL] * 101 and step_row(plc, 200)[5] == ALL


def test_a_word_that_no_step_has_is_refused() -> None:
    plc, _ = taught()
    assert plc.read(3, own.REG_WORDS, 4) == [ALL] * 4
    for ask in (
        lambda: plc.read(3, own.REG_WORDS, 5),
        lambda: plc.write(6, own.REG_WORDS + 4, [0]),
        lambda: plc.write(16, own.REG_WORDS + 3, [0, 0]),
    ):
        with pytest.raises(DeviceException) as error:
            ask()
        assert error.value.code == 2


def test_the_events_of_one_scan_stand_in_their_order_with_the_time_of_the_scan() -> None:
    plc, talker = taught((0.5, 5.0), (0.5, 5.0))
    talker.ask(SequenceCommand.START)
    talker.events()
    run(plc, 0.5)
    ended, entered = talker.events()
    assert (ended.code, ended.source, entered.code, entered.source) == (4, 1, 3, 2)
    assert ended.time == entered.time == plc.time and ended.value == pytest.approx(0.5)


def test_the_map_is_whole_and_names_its_definition() -> None:
    plc, _ = taught()
    for address, words in ((0x100, 64), (0x180, 16), (0x200, 8)):
        assert plc_map.is_whole(plc.read(3, address, words))
    assert plc.read(3, plc_map.AT_TYPE, 1) == [20]
    assert plc.read(3, plc_map.AT_CAPACITIES, 5) == [3, 16, EVENT_CAPACITY, 16, 32]
    crc = plc.read(3, plc_map.AT_CRC, 2)
    assert crc[0] << 16 | crc[1] == checksum(plc.definition)
    assert plc.read(3, 0x181, 1) == [3] and real_of(0x46E10000) == plc.definition.longest_force
    assert plc.read(3, 0x182, 2) == [0x46E1, 0x0000]
    for table, size, capacity, rows in ((STEPS, 32, 3, 3), (FALLS, 16, 16, 0), (FORCES, 12, 32, 0)):
        head = plc.read(3, table, plc_map.TABLE_HEAD)
        assert head[1:] == [capacity, rows, size]
        first = row(plc, table, 0, size)
        assert first[2] == first[-1] and first[2] % 2 == 0


def test_a_sequence_of_two_hundred_steps_has_a_row_for_each() -> None:
    plc = VirtualSequence(teaching(*((0.01, 5.0),) * 200))
    talker = Talker(plc)
    plc.step()
    talker.ask(SequenceCommand.START)
    run(plc, 2.5)
    assert word(plc, 1) == SequenceState.DONE and step_row(plc, 200)[1] == 200
    with pytest.raises(ConfigurationError, match="1 to 200"):
        VirtualSequence(teaching(*((0.01, 5.0),) * 201))
    with pytest.raises(ConfigurationError, match="1 to 200"):
        VirtualSequence(teaching())


def test_a_maximum_of_nothing_stays_until_one_is_entered() -> None:
    plc, talker = taught((1.0, 0.0), (1.0, 5.0))
    talker.ask(SequenceCommand.START)
    run(plc, 20)
    assert word(plc, 2) == 1
    assert talker.ask(SequenceCommand.SET_TIMES, 1, real(1.0), real(30.0), 1).state == DONE
    plc.step()
    assert word(plc, 2) == 2


def test_a_time_out_tells_what_was_missing() -> None:
    plc, talker = taught((1.0, 3.0), (1.0, 5.0))
    drop(talker, 2, 1 << 4)
    talker.ask(SequenceCommand.START)
    run(plc, 3.1)
    assert (word(plc, 1), word(plc, 26), long(plc, 18)) == (SequenceState.TIMED_OUT, 4, 1)
    assert [word(plc, at) for at in (28, 29, 30, 31)] == [Cause.TIME, 2, 4, 1]
    assert step_row(plc, 1)[3] == 4 and "needs_acknowledge" in flags(plc)


def test_a_stall_is_shown_and_passes() -> None:
    plc, talker = taught()
    drop(talker, 2, 1 << 7)
    talker.ask(SequenceCommand.START)
    run(plc, 2.1)
    assert "stalled" in flags(plc) and step_row(plc, 1)[3] == 6
    assert [word(plc, at) for at in (28, 29, 30)] == [Cause.STALL, 2, 7]
    drop(talker, 2, 0)
    run(plc, 0.1)
    assert "stalled" not in flags(plc) and word(plc, 2) == 2 and word(plc, 28) == Cause.NONE
    assert of(talker.events(), 7, 8) == [(7, 2, 7), (8, 1, NO_BIT)]


# ---- commands


def test_suspend_freezes_and_resume_goes_on() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.START)
    run(plc, 0.5)
    assert talker.ask(SequenceCommand.SUSPEND).state == DONE
    assert (word(plc, 1), flags(plc)) == (SequenceState.SUSPENDED, set())
    run(plc, 5)
    assert f32(step_row(plc, 1), 12) == pytest.approx(0.5, abs=0.02) and step_row(plc, 1)[3] == 2
    assert talker.ask(SequenceCommand.RESUME).state == DONE and word(plc, 1) == SequenceState.RUNNING
    run(plc, 3)
    assert word(plc, 1) == SequenceState.DONE and number(plc, 12) == pytest.approx(8.0, abs=0.05)


def test_suspend_is_a_stop_and_is_never_refused() -> None:
    plc, talker = taught()
    assert talker.ask(SequenceCommand.SUSPEND).state == DONE and word(plc, 1) == SequenceState.IDLE
    talker.ask(SequenceCommand.START)
    assert word(plc, 1) == SequenceState.RUNNING, "a suspend before the start is forgotten"


def test_a_suspend_in_the_scan_of_the_start_counts() -> None:
    plc, _ = taught()
    for code in (SequenceCommand.START, SequenceCommand.SUSPEND):
        plc.write(16, plc_map.COMMAND, plc_map.request_words(plc_map.Request(code, id=100 + code)))
    run(plc, 0.05)
    assert word(plc, 1) == SequenceState.SUSPENDED


def test_an_output_while_suspended_is_a_setting() -> None:
    plc, talker = taught()
    assert talker.commit({"output_while_suspended": 1.0}, STAGING).state == DONE
    talker.ask(SequenceCommand.START)
    talker.ask(SequenceCommand.SUSPEND)
    assert flags(plc) == {"output"} and step_row(plc, 1)[14] & 2
    answer = talker.commit({"stall_after": 0.0}, STAGING)
    assert (answer.reason, answer.detail) == (21, 1)


def test_abort_and_acknowledge() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.START)
    run(plc, 1.2)
    assert talker.ask(SequenceCommand.ABORT).state == DONE
    assert (word(plc, 1), word(plc, 2), long(plc, 16)) == (SequenceState.ABORTED, 2, 1)
    assert [word(plc, at) for at in (28, 29, 30, 31)] == [Cause.OPERATOR, 0, NO_BIT, 2]
    assert talker.ask(SequenceCommand.START).reason == SequenceReason.NEEDS_ACKNOWLEDGE
    assert talker.ask(SequenceCommand.ACKNOWLEDGE).state == DONE
    assert (word(plc, 1), word(plc, 28)) == (SequenceState.IDLE, 0)
    assert talker.ask(SequenceCommand.START).state == DONE


def test_single_step_goes_on_when_told() -> None:
    plc, talker = taught()
    assert talker.ask(SequenceCommand.SINGLE_ON).state == DONE and "single_step" in flags(plc)
    talker.ask(SequenceCommand.START)
    assert talker.ask(SequenceCommand.ADVANCE).reason == SequenceReason.WRONG_STATE, "its minimum is not over"
    run(plc, 3)
    assert word(plc, 2) == 1
    drop(talker, 2, 1 << 9)
    plc.step()
    answer = talker.ask(SequenceCommand.ADVANCE)
    assert (answer.reason, answer.detail) == (SequenceReason.MISSING, 2 * 16 + 9)
    drop(talker, 2, 0)
    plc.step()
    assert talker.ask(SequenceCommand.ADVANCE).state == DONE and word(plc, 2) == 2
    assert talker.ask(SequenceCommand.SINGLE_OFF).state == DONE
    run(plc, 2.5)
    assert word(plc, 1) == SequenceState.DONE
    codes = [code for code, _ in talker.codes()]
    assert SequenceDeviceEvent.SINGLE_ON in codes and SequenceDeviceEvent.SINGLE_OFF in codes


def test_automatic_starts_again_whenever_it_can() -> None:
    plc, talker = taught((0.5, 5.0), (0.5, 5.0))
    talker.ask(SequenceCommand.AUTOMATIC_ON)
    run(plc, 3.5)
    assert long(plc, 14) == 3 and "automatic" in flags(plc)
    drop(talker, 1, 1)
    run(plc, 3)
    done = long(plc, 14)
    run(plc, 3)
    assert long(plc, 14) == done and word(plc, 1) == SequenceState.DONE
    drop(talker, 1, 0)
    run(plc, 0.3)
    assert word(plc, 1) == SequenceState.RUNNING
    talker.ask(SequenceCommand.AUTOMATIC_OFF)
    run(plc, 5)
    assert word(plc, 1) == SequenceState.DONE


def test_automatic_does_not_start_what_needs_an_acknowledge() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.AUTOMATIC_ON)
    run(plc, 0.5)
    talker.ask(SequenceCommand.ABORT)
    run(plc, 2)
    assert word(plc, 1) == SequenceState.ABORTED
    talker.ask(SequenceCommand.ACKNOWLEDGE)
    run(plc, 0.1)
    assert word(plc, 1) == SequenceState.RUNNING


def test_a_start_that_is_refused_says_which_permissive_is_missing() -> None:
    plc, talker = taught()
    drop(talker, 1, 0b100100)
    answer = talker.ask(SequenceCommand.START)
    assert (answer.state, answer.reason, answer.detail) == (REJECTED, SequenceReason.MISSING, 16 + 2)
    drop(talker, 0, 1 << 15)
    answer = talker.ask(SequenceCommand.START)
    assert (answer.reason, answer.detail) == (SequenceReason.MISSING, 15)
    assert word(plc, 1) == SequenceState.IDLE


def refused(talker: Talker, *asked: int) -> Answer:
    answer = talker.ask(*asked)
    assert answer.state == REJECTED
    return answer


def test_every_refusal() -> None:
    _, talker = taught()
    seen = {
        refused(talker, 99).reason,
        refused(talker, SequenceCommand.ABORT).reason,
        refused(talker, SequenceCommand.RESUME).reason,
        refused(talker, SequenceCommand.ADVANCE).reason,
        refused(talker, SequenceCommand.SET_TIMES, 4, real(1.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 0, real(1.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(-1.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(5.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(5.0), real(40000.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(float("nan")), real(2.0)).reason,
        refused(talker, SequenceCommand.FORCE, 4, 0, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 16, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 15, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 0, 0, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 0, real(0.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 0, real(28801.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 0, real(float("nan"))).reason,
        refused(talker, SequenceCommand.RELEASE, 1, 0).reason,
        refused(talker, SequenceCommand.RELEASE, 9, 0).reason,
        refused(talker, SequenceCommand.RELEASE, 1, 16).reason,
    }
    talker.ask(SequenceCommand.START)
    seen |= {
        refused(talker, SequenceCommand.START).reason,
        refused(talker, SequenceCommand.ACKNOWLEDGE).reason,
        refused(talker, SequenceCommand.SET_TIMES, 2, real(1.0), real(2.0)).reason,
    }
    talker.ask(SequenceCommand.ABORT)
    seen |= {refused(talker, SequenceCommand.START).reason}
    talker.ask(SequenceCommand.ACKNOWLEDGE)
    drop(talker, 1, 1)
    seen |= {refused(talker, SequenceCommand.START).reason}
    for place in range(FORCE_ROWS):
        at, which = divmod(place, 14)
        assert talker.ask(SequenceCommand.FORCE, 1 + at, which, real(100.0)).state == DONE
    seen |= {refused(talker, SequenceCommand.FORCE, 3, 14, real(5.0)).reason}
    assert talker.ask(SequenceCommand.FORCE, 1, 0, real(200.0)).state == DONE, "one that is there can be made longer"
    assert seen == set(SequenceReason) - {SequenceReason.MACHINE}, "MACHINE: see the coupling below"


def test_a_machine_that_is_not_in_automatic_refuses_the_start() -> None:
    line = Line()
    line.machine.ask(coil_car.CoilCarCommand.MANUAL)
    assert "machine_manual" in flags(line.plc) and "start_possible" not in flags(line.plc)
    assert line.sequence.ask(SequenceCommand.START).reason == SequenceReason.MACHINE


# ---- times


def test_times_are_locked_while_it_runs_and_an_override_is_told() -> None:
    plc, talker = taught()
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(2.0), real(4.0)).state == DONE
    two = step_row(plc, 2)
    assert (f32(two, 8), f32(two, 10)) == (2.0, 4.0)
    talker.ask(SequenceCommand.START)
    talker.events()
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(1.0), real(3.0)).reason == SequenceReason.LOCKED
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(1.0), real(3.0), 1).state == DONE
    (event,) = (event for event in talker.events() if event.code == SequenceDeviceEvent.TIMES_CHANGED)
    assert event.source == 2 and event.value == 3.0
    assert real_of(event.snapshot[4] << 16 | event.snapshot[5]) == 1.0
    assert talker.ask(SequenceCommand.SUSPEND).state == DONE
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(1.0), real(5.0)).reason == SequenceReason.LOCKED


# ---- forces


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


def test_a_bit_that_nobody_names_cannot_be_forced() -> None:
    line = Line()
    assert line.sequence.ask(SequenceCommand.FORCE, 2, 9, real(5.0)).reason == SequenceReason.NO_SUCH_BIT
    assert line.sequence.ask(SequenceCommand.FORCE, 2, 1, real(5.0)).reason == SequenceReason.FORBIDDEN
    assert line.sequence.ask(SequenceCommand.FORCE, 0, 1, real(5.0)).reason == SequenceReason.FORBIDDEN
    assert line.sequence.ask(SequenceCommand.FORCE, 2, 0, real(5.0)).state == DONE


# ---- what fell


def test_losses_that_came_back_are_rows_and_bits() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.START)
    run(plc, 0.3)
    drop(talker, 1, 1 << 6)
    run(plc, 0.05)
    drop(talker, 1, 0)
    run(plc, 0.05)
    drop(talker, 2, 1 << 2)
    run(plc, 0.05)
    assert word(plc, 44) == 2 and plc.read(3, FALLS, 4)[2] == 2
    first, second = row(plc, FALLS, 0, 16), row(plc, FALLS, 1, 16)
    assert (first[1], first[3], first[4], first[5]) == (1, 2, 1, 6)
    assert time_of(first[10:14]) - time_of(first[6:10]) == 50_000
    assert (second[1], second[3], second[4], second[5]) == (2, 1, 2, 2) and time_of(second[10:14]) == 0
    assert step_row(plc, 1)[26] == 1 << 6 and step_row(plc, 2)[26] == 1 << 2
    drop(talker, 2, 0)
    run(plc, 2)
    assert word(plc, 44) == 0 and row(plc, FALLS, 0, 16)[:2] == [0, 0] and step_row(plc, 1)[26] == 1 << 6
    assert of(talker.events(), 9, 10) == [(9, 1, 6), (10, 1, 6), (9, 2, 2), (10, 2, 2)]


def test_more_losses_than_rows_leave_the_first_ones() -> None:
    plc, talker = taught((60.0, 100.0), (1.0, 10.0))
    talker.ask(SequenceCommand.START)
    for _ in range(20):
        drop(talker, 1, 1)
        plc.step()
        drop(talker, 1, 0)
        plc.step()
    assert word(plc, 44) == 20 and plc.read(3, FALLS, 4)[2] == 16


def test_an_abort_keeps_the_first_out_with_value_time_and_snapshot() -> None:
    line = Line()
    line.start()
    line.to_step(3)
    line.run(1)
    line.sequence.events()
    line.car.preset({"pressure": 42.0})
    line.until(lambda: line.plc.block.state is SequenceState.ABORTED, 1)
    plc = line.plc
    assert [word(plc, at) for at in (28, 29, 30, 31)] == [Cause.PERMISSIVE_LOST, 3, 0, 3]
    assert number(plc, 36) == 42.0 and word(plc, 38) == 1
    lost = next(event for event in line.sequence.events() if event.code == SequenceEvent.PERMISSIVE_LOST)
    assert time_of(plc.read(3, STATUS + 32, 4)) == lost.time
    assert real_of(lost.snapshot[4] << 16 | lost.snapshot[5]) == 42.0
    assert step_row(plc, 3)[15] == step_row(plc, 3)[5] and not step_row(plc, 3)[15] & 1
    assert word(plc, 39) == ALL


def test_an_abort_condition_of_the_machine_stops_everything() -> None:
    line = Line()
    line.start()
    line.to_step(2)
    line.run(2)
    line.machine.fault(50)
    line.run(1)
    assert [word(line.plc, at) for at in (1, 28, 29)] == [SequenceState.ABORTED, Cause.ABORT_CONDITION, 0]
    assert line.car.machine.speed_x == 0
    line.machine.fault(0)
    line.tick()
    assert line.machine.ask(coil_car.CoilCarCommand.RESET).state == DONE
    assert line.machine.ask(coil_car.CoilCarCommand.AUTOMATIC).state == DONE
    assert line.sequence.ask(SequenceCommand.ACKNOWLEDGE).state == DONE
    line.start()
    line.until(lambda: line.plc.runs_done == 1, 90)


# ---- with its machine


def test_a_coil_goes_from_the_mandrel_to_a_saddle_and_the_next_follows_by_itself() -> None:
    line = Line()
    line.sequence.ask(SequenceCommand.AUTOMATIC_ON)
    line.until(lambda: line.plc.runs_done == 3, 260)
    assert line.car.machine.saddles == pytest.approx([1300.0] * 3, abs=0.5)
    line.run(30)
    assert line.plc.block.state is SequenceState.DONE and line.car.signal("target_free") == 0
    assert line.sequence.ask(SequenceCommand.START).reason == SequenceReason.MISSING
    line.machine.ask(coil_car.CoilCarCommand.REMOVED, 3)
    line.machine.ask(coil_car.CoilCarCommand.REMOVED, 2)
    line.until(lambda: line.plc.runs_done == 4, 90)
    assert line.car.machine.saddles[1] and not line.car.machine.saddles[2]
    assert line.car.signal("collision") == 0


def test_a_suspended_transport_stands_and_goes_on() -> None:
    line = Line()
    line.start()
    line.to_step(7)
    line.run(4)
    assert line.car.machine.speed_x > 300
    line.sequence.ask(SequenceCommand.SUSPEND)
    line.run(4)
    where = line.car.machine.x
    line.run(5)
    assert not line.car.moving and line.car.machine.x == where
    line.sequence.ask(SequenceCommand.RESUME)
    line.until(lambda: line.plc.runs_done == 1, 60)
    assert line.car.machine.saddles[0]


def test_no_step_moves_anything_without_its_sequence() -> None:
    line = Line()
    line.start()
    line.to_step(2)
    line.run(3)
    line.sequence.ask(SequenceCommand.ABORT)
    line.run(4)
    assert not line.car.moving
    where = line.car.machine.x
    line.run(3)
    assert line.car.machine.x == where


def test_the_machine_stops_when_the_device_of_the_sequence_is_gone() -> None:
    line = Line()
    line.start()
    line.to_step(2)
    line.run(3)
    for _ in range(500):
        line.car.step()
    assert not line.car.moving


def test_frozen_inputs_are_a_fault_of_the_instructor() -> None:
    line = Line()
    line.start()
    line.to_step(2)
    line.sequence.fault(1)
    line.tick()
    line.car.preset({"pressure": 10})
    line.run(1)
    assert word(line.plc, 1) == SequenceState.RUNNING
    line.sequence.fault(0)
    line.run(0.1)
    assert word(line.plc, 1) == SequenceState.ABORTED


@pytest.mark.parametrize(
    ("definition", "said"),
    [
        (replace(TRANSPORT, steps=(step("a", bit(5, "x", "speed > 1")),)), "speed"),
        (replace(TRANSPORT, steps=(step("a", action="fly"),)), "fly"),
        (replace(TRANSPORT, steps=(step("a", bit(5, "x", "")),)), "x has no sentence"),
        (replace(TRANSPORT, steps=(step("a", bit(5, "x", "mode == 1", "speed")),)), "value speed"),
    ],
)
def test_a_definition_that_does_not_fit_the_machine_says_why(definition: SequenceDefinition, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        Line(definition)


def test_a_sentence_that_cannot_be_decided_is_missing() -> None:
    definition = replace(TRANSPORT, steps=(step("a", bit(5, "near", "contact_height < 900")),))
    line = Line(definition, coil=False, settings={"automatic_winding": 0.0})
    assert line.sequence.ask(SequenceCommand.START).detail == 16 + 5
    line.car.preset({"coil": 1})
    assert line.sequence.ask(SequenceCommand.START).state == DONE


# ---- restart


def test_a_power_cycle_aborts_the_run_and_keeps_what_is_retained() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.SET_TIMES, 2, real(2.0), real(9.0))
    talker.ask(SequenceCommand.START)
    run(plc, 5)
    talker.commit({"stall_after": 3.0}, STAGING)
    talker.ask(SequenceCommand.FORCE, 1, 1, real(600.0))
    talker.ask(SequenceCommand.SINGLE_ON)
    talker.ask(SequenceCommand.AUTOMATIC_ON)
    talker.ask(SequenceCommand.SINGLE_OFF)
    run(plc, 1)
    newest = plc.newest
    talker.events()
    talker.train(training.REG_POWER, 1)
    plc.step()
    assert plc.boots == 2 and plc.newest > newest
    assert (word(plc, 1), word(plc, 28), word(plc, 8)) == (SequenceState.ABORTED, Cause.POWER_UP, 0)
    assert long(plc, 14) == 1 and long(plc, 16) == 1 and flags(plc) == {"needs_acknowledge"}
    two = step_row(plc, 2)
    assert (f32(two, 8), f32(two, 10)) == (2.0, 9.0) and (two[16] << 16 | two[17]) == 1
    assert plc.settings["stall_after"] == 3.0
    told = [(event.code, event.value) for event in talker.events()]
    assert told[:1] == [(SequenceDeviceEvent.POWER_UP, 2.0)] and (SequenceEvent.RELEASED, 2.0) in told
    assert (SequenceEvent.ABORTED, float(Cause.POWER_UP)) in told
    run(plc, 2)
    assert word(plc, 1) == SequenceState.ABORTED, "it does not start again by itself"
    talker.ask(SequenceCommand.ACKNOWLEDGE)
    assert talker.ask(SequenceCommand.START).state == DONE


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


def test_a_first_out_outlives_a_restart() -> None:
    plc, talker = taught(loss_aborts=True)
    talker.ask(SequenceCommand.START)
    run(plc, 0.5)
    drop(talker, 1, 1 << 11)
    run(plc, 0.5)
    before = plc.read(3, STATUS + 28, 12)
    assert before[0] == Cause.PERMISSIVE_LOST
    talker.train(training.REG_POWER, 1)
    plc.step()
    assert plc.read(3, STATUS + 28, 12) == before and "needs_acknowledge" in flags(plc)


def test_the_initial_state_forgets_everything() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.START)
    run(plc, 10)
    talker.ask(SequenceCommand.SET_TIMES, 2, real(2.0), real(9.0))
    talker.train(training.REG_RESET, 1)
    plc.step()
    assert (long(plc, 14), plc.boots, f32(step_row(plc, 2), 8), word(plc, 1)) == (0, 1, 1.0, 0)


def test_the_same_writes_give_the_same_run() -> None:
    def once() -> list[list[int]]:
        line = Line()
        line.sequence.ask(SequenceCommand.AUTOMATIC_ON)
        line.run(70)
        line.machine.fault(31)
        line.run(20)
        return [
            line.plc.read(3, STATUS, 64),
            line.plc.read(3, STEPS, 100),
            line.plc.read(3, plc_map.EVENT_ROWS, 120),
            line.car.read(3, 0x100, 64),
        ]

    assert once() == once()


def test_without_a_machine_words_beyond_the_training_registers_are_presets() -> None:
    plc = VirtualSequence(teaching(*((0.5, 5.0),) * 20))
    plc.preset({"word_20": 0xFFFE, "word_0": 0xFFFF})
    plc.step()
    assert step_row(plc, 20)[5] == 0xFFFE and step_row(plc, 19)[5] == ALL
    for values in ({"word_21": 1.0}, {"word_1": 70000.0}, {"pressure": 1.0}, {"word_1": 0.5}):
        with pytest.raises(ValueError, match="expected"):
            plc.preset(values)
