"""What a sequence tells of falls, first-out and times."""

from dataclasses import replace
from random import Random

import pytest

from app.blocks.sequence import (
    ABORT,
    ALL,
    Cause,
    SequenceBlock,
    SequenceEvent,
    SequenceSettings,
    Signals,
    StepState,
)
from tests.blocks.sequence.stand import DT, TEN, Bench


def test_a_stall_names_the_permissive_that_fell_first() -> None:
    bench = Bench(replace(TEN, maximum=60), TEN)
    bench.start()
    bench.drop(2, 9)
    bench.scan(2)
    fell = bench.now - 10_000
    bench.drop(2, 3)
    bench.scan(200)
    assert bench.block.stalled and bench.block.step_state(1) is StepState.STALLED
    out = bench.block.first_out
    assert out is not None and (out.cause, out.step, out.bit, out.time) == (Cause.STALL, 2, 9, fell)
    assert out.value == 209.0
    assert out.snapshot == (ALL, ALL, ALL & ~(1 << 9)), "as all were when it fell"
    bench.give(2, 9)
    bench.give(2, 3)
    assert SequenceEvent.STALL_OVER in [report.event for report in bench.scan()]
    assert bench.block.step == 2 and bench.block.first_out is None


@pytest.mark.sweep(8)
def test_two_that_fall_20_ms_apart_are_told_apart_a_thousand_times() -> None:
    random = Random(4)
    for _ in range(1000):
        one, other = random.sample(range(16), 2)
        bench = Bench(replace(TEN, loss_aborts=random.random() < 0.5), TEN)
        word = random.choice([ABORT, 2])
        bench.start()
        bench.scan(random.randrange(5))
        bench.drop(word, one)
        bench.scan(2)
        bench.drop(word, other)
        bench.scan(80)
        assert bench.block.first_out is not None
        assert (bench.block.first_out.step, bench.block.first_out.bit) == (word, one)
        assert bench.block.first_out.together == 1


def test_two_in_one_scan_are_said_to_be_two() -> None:
    bench = Bench()
    bench.start()
    bench.drop(ABORT, 9)
    bench.drop(ABORT, 4)
    bench.scan()
    assert bench.block.first_out is not None
    assert (bench.block.first_out.bit, bench.block.first_out.together) == (4, 2)


def test_what_was_lost_and_came_back_while_the_step_was_active_is_kept() -> None:
    bench = Bench(replace(TEN, minimum=0.4), TEN)
    bench.start()
    bench.drop(1, 6)
    bench.scan()
    fell = bench.now
    bench.give(1, 6)
    bench.scan(3)
    assert [(fall.step, fall.bit, fall.fell, fall.back) for fall in bench.block.falls] == [(1, 6, fell, fell + 10_000)]


def test_what_came_back_before_the_stall_is_not_its_first_out() -> None:
    bench = Bench(replace(TEN, minimum=0.4, maximum=60), TEN)
    bench.start()
    bench.drop(2, 1)
    bench.scan(3)
    bench.drop(2, 8)
    bench.scan(3)
    bench.give(2, 1)
    bench.scan(300)
    assert bench.block.first_out is not None and bench.block.first_out.bit == 8


def test_one_never_seen_fulfilled_fell_before_all_others() -> None:
    block = SequenceBlock(SequenceSettings((TEN, TEN)))
    now = 0
    for word in [ALL & ~4] * 5 + [ALL & ~5] * 100:
        now += 10_000
        block.scan(Signals([ALL, word], start=now > 20_000), DT, now)
    assert block.first_out is not None and (block.first_out.bit, block.first_out.time) == (2, 10_000)


def test_statistics_count_passages_and_survive_a_restart() -> None:
    bench = Bench(replace(TEN, maximum=10), TEN)
    for wait in (0, 20, 40):
        bench.drop(2, 0)
        bench.start()
        bench.scan(wait)
        bench.give(2, 0)
        bench.scan(60)
    one = bench.block.times[0]
    assert one.runs == 3 and one.least == pytest.approx(0.1)
    assert one.least <= one.mean <= one.most and one.last == one.most > 0.3
    other = Bench(replace(TEN, maximum=10), TEN)
    other.block.restore(bench.block.retained(), bench.now)
    assert other.block.times == bench.block.times
