"""The map of our virtual PLCs: header, images, commands, hold-to-run, setpoints, events, tables, power."""

from collections.abc import Sequence

from app.registers import plc_map
from app.registers.plc_map import AnswerState, Request, real, time_of
from app.sim.plc import EVENT_CAPACITY
from tests.sim.fake_plc import ADD, REMOVE, SET, SETTINGS, STAGING, STATUS, TABLE, FakePlc
from tests.sim.plc.stand import ask, events, go, refused, settings, stage


def test_a_write_acts_with_the_next_scan_and_a_read_sees_one_scan() -> None:
    plc = FakePlc()
    go(plc, 5)
    before = plc.read(3, STATUS, 10)
    plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(SET, arguments=(1000,), id=1)))
    assert plc.read(3, STATUS, 10) == before
    plc.step()
    after = plc.read(3, STATUS, 10)
    assert plc_map.is_whole(before) and plc_map.is_whole(after) and before[0] != after[0]
    assert after[1] << 16 | after[2] == 1001
    assert plc.read(23, STATUS + 1, 2) == after[1:3]


def test_bad_requests_are_refused_by_code_and_do_nothing() -> None:
    plc = FakePlc()
    for function, address, count, code in (
        (4, 0, 1, 1),
        (3, 0, 0, 3),
        (3, 0, 126, 3),
        (3, 32, 1, 2),
        (3, 31, 2, 2),
        (3, 0x00FF, 2, 2),
        (3, 0xDFFF, 1, 2),
        (3, STATUS, 11, 2),
    ):
        assert refused(plc.read, function, address, count) == code
    command = plc_map.request_words(Request(SET, id=3))
    for function, address, words, code in (
        (5, 9, [1], 1),
        (6, 8, [1], 2),
        (6, STATUS, [1], 2),
        (16, 9, [1, 2], 2),
        (6, 9, [65536], 3),
        (6, 9, [1, 2], 3),
        (16, 9, [], 3),
        (16, plc_map.COMMAND, command[:15], 3),
        (16, plc_map.COMMAND + 1, command[1:], 3),
        (16, plc_map.COMMAND, [*command[:15], 0], 3),
        (6, plc_map.HOLD, [1], 3),
        (16, plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, [0, 9], 3),
        (6, plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, [0], 3),
        (16, STAGING + 3, [0, 0], 2),
        (16, SETTINGS + 2, [0, 0], 2),
    ):
        assert refused(plc.write, function, address, words) == code, (function, hex(address))
    before = plc.read(3, plc_map.ANSWERS, 66)[1:-1]
    plc.step()
    assert plc.read(3, plc_map.ANSWERS, 66)[1:-1] == before


def test_hold_to_run_ends_500_ms_after_the_counter_stood_still() -> None:
    plc = FakePlc()
    for count in range(20):
        plc.write(16, plc_map.HOLD, [5, count, *plc_map.long_words(real(12.5))])
        go(plc, 10)
    assert (plc.hold, plc.hold_argument, plc.held) == (5, 12.5, 200)
    for _ in range(8):
        plc.write(16, plc_map.HOLD, [5, 19, 0, 0])
        go(plc, 10)
    assert (plc.hold, plc.held) == (0, 241)
    plc.write(16, plc_map.HOLD, [5, 20, 0, 0])
    plc.step()
    assert plc.hold == 5
    plc.write(16, plc_map.HOLD, [0, 21, 0, 0])
    plc.step()
    assert plc.hold == 0
    assert plc.read(3, plc_map.HOLD, 4) == [0, 21, 0, 0]


def test_setpoints_are_taken_all_or_none() -> None:
    plc = FakePlc()
    assert settings(plc) == [1.0, 0.0]
    count, check = stage(plc, 2.5, 4.0)
    generation = plc.read(3, SETTINGS, 1)
    assert ask(plc, plc_map.COMMIT_SETTINGS, count - 2, check, id=1).reason == 20
    assert ask(plc, plc_map.COMMIT_SETTINGS, count, check ^ 1, id=2).reason == 22
    assert settings(plc) == [1.0, 0.0]
    refusal = ask(plc, plc_map.COMMIT_SETTINGS, *stage(plc, 2.5, 61.0), id=4)
    assert (refusal.state, refusal.reason, refusal.detail) == (AnswerState.REJECTED, 21, 2)
    assert ask(plc, plc_map.COMMIT_SETTINGS, *stage(plc, float("nan"), 1.0), id=5).detail == 1
    assert settings(plc) == [1.0, 0.0] and plc.read(3, SETTINGS, 1) == generation
    assert ask(plc, plc_map.COMMIT_SETTINGS, *stage(plc, 2.5, 4.0), id=6).state is AnswerState.DONE
    assert settings(plc) == [2.5, 4.0] and plc.read(3, SETTINGS, 1) != generation
    plc.power_cycle()
    assert settings(plc) == [2.5, 4.0]
    assert [event.code for event in events(plc)] == [34, 38, 34]


def test_the_ring_keeps_order_and_time_and_shows_a_loss() -> None:
    plc = FakePlc(slots=100)
    for id in range(1, 41):
        plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(ADD, arguments=(id,), id=id)))
        if id % 2 == 0:
            plc.step()
    seen = events(plc)
    assert [event.sequence for event in seen] == list(range(1, 42))
    assert [event.value for event in seen[1:]] == list(range(1, 41))
    assert [event.time for event in seen[1:]] == [10_000 * (1 + n // 2) for n in range(40)], "two a scan, same time"
    plc.write(16, plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, [0, 41])
    plc.step()
    for id in range(41, 111):
        plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(ADD, arguments=(id,), id=id)))
    plc.step()
    head = plc.read(3, plc_map.EVENTS, 10)
    assert head[1:3] == [EVENT_CAPACITY, plc_map.EVENT_WORDS]
    assert head[3:9] == [0, 101 - EVENT_CAPACITY + 1, 0, 101, 0, 41]
    assert [event.sequence for event in events(plc)] == list(range(101 - EVENT_CAPACITY + 1, 102))


def test_a_row_keeps_its_slot_and_the_lowest_free_one_is_taken_next() -> None:
    plc = FakePlc()
    for id in (11, 12, 13):
        ask(plc, ADD, id, id=id)
    structure = plc.read(3, TABLE, 1)
    ask(plc, REMOVE, 0, id=14)
    assert plc.read(3, TABLE, 1) != structure
    assert plc.read(3, TABLE, 4)[1:] == [7, 3, 8]
    assert [plc.read(3, TABLE + 4 + 8 * slot + 1, 1)[0] for slot in range(4)] == [0, 12, 13, 0]
    assert ask(plc, ADD, 15, id=15).detail == 0
    whole = plc.read(3, TABLE, 60)
    assert whole[4:12] == plc.read(3, TABLE + 4, 8)
    assert whole[7:30] == plc.read(3, TABLE + 7, 23), "a telegram may begin anywhere"
    assert all(plc_map.is_whole(whole[at + 2 : at + 8]) for at in range(4, 28, 8))
    for id in range(16, 20):
        ask(plc, ADD, id, id=id)
    assert ask(plc, ADD, 20, id=20).reason == 10


def test_a_power_cycle_keeps_what_is_retained_and_a_reset_does_not() -> None:
    plc = FakePlc()
    ask(plc, ADD, 11)
    plc.write(6, 9, [4])
    go(plc, 10)
    plc.write(6, 0xE031, [1])
    plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(SET, arguments=(77,), id=9)))
    plc.step()
    header = plc.read(3, 0, 32)
    assert header[7:10] == [2, 0, 0]
    assert time_of(header[11:15]) == 120_000
    assert plc.table.ids[0] == 11
    assert [(event.code, event.value) for event in events(plc)] == [(34, 1), (8, 11), (34, 2)]
    plc.write(6, 0xE030, [1])
    plc.step()
    fresh = FakePlc()
    fresh.step()
    for address, count in ((0, 32), (STATUS, 10), (plc_map.EVENTS, 10), (TABLE, 60), (plc_map.ANSWERS, 66)):
        assert plc.read(3, address, count) == fresh.read(3, address, count)


def test_the_scan_time_is_measured_from_outside_and_changes_nothing() -> None:
    ticks: Sequence[float] = [0.0, 0.0005, 1.0, 1.012, 2.0, 2.0001]
    plc, other = FakePlc(), FakePlc()
    plc.scan_time.stopwatch = iter(ticks).__next__
    go(plc, 3)
    go(other, 3)
    assert plc.read(3, 16, 3) == [100, 12000, 1]
    assert other.read(3, 16, 3) == [0, 0, 0]
    assert plc.read(3, STATUS, 10) == other.read(3, STATUS, 10)


def test_a_silent_host_is_noticed_only_when_it_is_watched() -> None:
    plc = FakePlc()
    go(plc, 300)
    assert not plc.host_silent
    ask(plc, plc_map.COMMIT_SETTINGS, *stage(plc, 1.0, 1.0))
    assert plc.read(3, 10, 1) == [1000]
    for beat in range(5):
        plc.write(6, 9, [beat + 1])
        go(plc, 90)
        assert not plc.host_silent
    assert plc.read(3, 9, 1) == [5]
    plc.write(6, 9, [5])
    go(plc, 15)
    assert plc.host_silent


def test_identity_and_line_fault_are_in_the_training_registers() -> None:
    plc = FakePlc()
    assert plc.read(3, 0xE000, 4) == [0x5047, 1, 1, 99]
    plc.write(6, 0xE011, [3])
    plc.step()
    assert plc.line_fault.mode == 3
    assert refused(plc.write, 6, 0xE020, [3]) == 2
    assert refused(plc.write, 6, 0xE010, [2]) == 3
