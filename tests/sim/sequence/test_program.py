"""A sequence by its registers: runs, every command and refusal, forces, first-out, restart, and the coupling with its machine."""

import pytest

from app.blocks.sequence import ALL, Cause, SequenceEvent, SequenceState
from app.errors import ConfigurationError
from app.plant.sequences import checksum
from app.registers import plc_map
from app.registers.plc_map import DeviceEvent, real, real_of, time_of
from app.sim import training
from app.sim.coil_car import register_map as coil_car
from app.sim.plc import EVENT_CAPACITY
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.register_map import (
    FALLS,
    FORCES,
    NO_BIT,
    STAGING,
    STATUS,
    STEPS,
    SequenceCommand,
    SequenceDeviceEvent,
    SequenceReason,
)
from tests.sim.coil_car.line import Line, Talker, teaching
from tests.sim.sequence.stand import (
    DONE,
    drop,
    f32,
    flags,
    long,
    number,
    row,
    run,
    step_row,
    taught,
    word,
)


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


def test_an_output_while_suspended_is_a_setting() -> None:
    plc, talker = taught()
    assert talker.commit({"output_while_suspended": 1.0}, STAGING).state == DONE
    talker.ask(SequenceCommand.START)
    talker.ask(SequenceCommand.SUSPEND)
    assert flags(plc) == {"output"} and step_row(plc, 1)[14] & 2
    answer = talker.commit({"stall_after": 0.0}, STAGING)
    assert (answer.reason, answer.detail) == (21, 1)


# ---- times


# ---- forces


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


@pytest.mark.sweep(8)
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
    line.until(lambda: line.plc.runs.done == 1, 90)


# ---- with its machine


@pytest.mark.sweep(8)
def test_a_coil_goes_from_the_mandrel_to_a_saddle_and_the_next_follows_by_itself() -> None:
    line = Line()
    line.sequence.ask(SequenceCommand.AUTOMATIC_ON)
    line.until(lambda: line.plc.runs.done == 3, 260)
    assert line.car.machine.saddles == pytest.approx([1300.0] * 3, abs=0.5)
    line.run(30)
    assert line.plc.block.state is SequenceState.DONE and line.car.signal("target_free") == 0
    assert line.sequence.ask(SequenceCommand.START).reason == SequenceReason.MISSING
    line.machine.ask(coil_car.CoilCarCommand.REMOVED, 3)
    line.machine.ask(coil_car.CoilCarCommand.REMOVED, 2)
    line.until(lambda: line.plc.runs.done == 4, 90)
    assert line.car.machine.saddles[1] and not line.car.machine.saddles[2]
    assert line.car.signal("collision") == 0


@pytest.mark.sweep(8)
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
    line.until(lambda: line.plc.runs.done == 1, 60)
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


@pytest.mark.sweep(8)
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
