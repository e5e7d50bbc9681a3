"""Forces: how long they hold, who may have them, and what ends them."""

from dataclasses import replace

import pytest

from app.blocks.sequence import (
    ABORT,
    ALL,
    ForceRefused,
    Report,
    SequenceEvent,
    SequenceState,
)
from tests.blocks.sequence.stand import TEN, Bench


def test_a_force_replaces_a_permissive_until_its_time_is_over() -> None:
    bench = Bench(replace(TEN, maximum=60), replace(TEN, maximum=60))
    bench.drop(2, 5)
    bench.block.force(2, 5, 1.0, bench.now)
    assert bench.block.forces.bits(2) == 1 << 5 and bench.block.ready(2)
    bench.start()
    bench.scan(11)
    assert bench.block.step == 2
    reports = bench.scan(100)
    assert Report(SequenceEvent.RELEASED, 2, 5, 1.0) in reports
    assert not bench.block.forces and not bench.block.ready(2)


def test_the_remaining_time_of_a_force_can_be_read() -> None:
    bench = Bench()
    bench.block.force(1, 0, 60.0, bench.now)
    bench.scan(100)
    assert bench.block.forces.remaining(1, 0, bench.now) == pytest.approx(59.0)
    assert bench.block.forces.remaining(1, 1, bench.now) == 0.0


def test_a_force_that_ends_may_abort_what_it_kept_alive() -> None:
    bench = Bench(replace(TEN, loss_aborts=True, minimum=3, maximum=60))
    bench.block.force(1, 5, 1.0, bench.now)
    bench.drop(1, 5)
    bench.start()
    bench.scan(120)
    assert bench.block.state is SequenceState.ABORTED
    assert bench.block.first_out is not None and bench.block.first_out.bit == 5


@pytest.mark.parametrize(
    ("step", "bit", "seconds", "reason"),
    [
        (1, 3, 10, "forbidden"),
        (ABORT, 0, 10, "forbidden"),
        (4, 0, 10, "unknown"),
        (1, 16, 10, "unknown"),
        (1, 0, 0, "duration"),
        (1, 0, 8 * 3600 + 1, "duration"),
    ],
)
def test_a_force_that_may_not_be_is_refused(step: int, bit: int, seconds: float, reason: str) -> None:
    bench = Bench(replace(TEN, forceable=ALL & ~(1 << 3)), TEN, TEN)
    with pytest.raises(ForceRefused) as refused:
        bench.block.force(step, bit, seconds, bench.now)
    assert refused.value.reason == reason and not bench.block.forces


def test_a_force_is_released_by_hand_once() -> None:
    bench = Bench()
    bench.block.force(1, 0, 60.0, bench.now)
    assert bench.block.forces.release(1, 0) == Report(SequenceEvent.RELEASED, 1, 0, 0.0)
    assert bench.block.forces.release(1, 0) is None


@pytest.mark.parametrize("keep", [True, False])
def test_after_a_restart_forces_are_gone_or_shown(keep: bool) -> None:
    bench = Bench(keep_forces=keep)
    bench.block.force(1, 2, 60.0, bench.now)
    other = Bench(keep_forces=keep)
    reports = other.block.restore(bench.block.retained(), bench.now)
    assert bool(other.block.forces) is keep
    assert (Report(SequenceEvent.RELEASED, 1, 2, 2.0) in reports) is not keep


def test_a_force_whose_time_ended_while_the_device_was_off_is_gone() -> None:
    bench = Bench(keep_forces=True)
    bench.block.force(1, 2, 60.0, bench.now)
    other = Bench(keep_forces=True)
    other.block.restore(bench.block.retained(), bench.now + 61_000_000)
    assert not other.block.forces


@pytest.mark.parametrize(("fallen", "forced", "together"), [(2, 1, 1), (3, 1, 2), (2, 0, 2), (3, 2, 1), (1, 0, 1)])
def test_what_is_forced_is_not_counted_among_those_that_fell_together(fallen: int, forced: int, together: int) -> None:
    bench = Bench(abort_forceable=ALL)
    for bit in range(fallen - forced, fallen):
        bench.block.force(ABORT, bit, 60.0, bench.now)
    bench.start()
    for bit in range(fallen):
        bench.drop(ABORT, bit)
    bench.scan()
    assert bench.block.first_out is not None
    assert (bench.block.first_out.bit, bench.block.first_out.together) == (0, together)
