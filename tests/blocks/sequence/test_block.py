"""The sequence block: every behaviour of the reference, every state x event, first-out, forces, restart."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.sequence import (
    ABORT,
    ALL,
    Cause,
    FirstOut,
    Report,
    SequenceBlock,
    SequenceEvent,
    SequenceSettings,
    SequenceState,
    Signals,
    StepSettings,
    StepState,
)
from tests.blocks.sequence.stand import DT, TEN, Bench


def test_it_runs_through_its_steps_and_is_done() -> None:
    bench = Bench()
    bench.start()
    assert bench.block.state is SequenceState.RUNNING and bench.block.step == 1 and bench.block.output(1)
    bench.scan(40)
    assert bench.block.state is SequenceState.DONE and bench.block.step == 0
    assert [bench.block.step_state(n) for n in (1, 2, 3)] == [StepState.DONE] * 3
    assert [bench.block.elapsed(n) for n in (1, 2, 3)] == pytest.approx([0.1] * 3)
    assert bench.block.run_time == pytest.approx(0.3)
    assert not any(bench.block.output(n) for n in (1, 2, 3))


@pytest.mark.parametrize("count", [1, 2, 8, 9, 40])
def test_it_takes_any_number_of_steps(count: int) -> None:
    bench = Bench(*[replace(TEN, minimum=0.02)] * count)
    bench.start()
    bench.scan(count * 3)
    assert bench.block.state is SequenceState.DONE
    assert bench.events.count(SequenceEvent.STEP_ENTERED) == count


def test_the_words_are_as_many_as_the_steps() -> None:
    bench = Bench()
    with pytest.raises(ValueError, match="2 permissive words: expected 3"):
        bench.block.scan(Signals([ALL, ALL]), DT, 0)


def test_a_start_needs_a_rising_edge() -> None:
    bench = Bench(TEN)
    bench.signals.start = True
    bench.scan(30)
    assert bench.block.state is SequenceState.DONE
    assert bench.events.count(SequenceEvent.STARTED) == 1
    bench.press("start")
    bench.signals.start = False
    bench.scan()
    bench.start()
    assert bench.events.count(SequenceEvent.STARTED) == 2


def test_a_start_that_is_held_at_power_up_does_not_start() -> None:
    block = SequenceBlock(SequenceSettings((TEN,)))
    assert block.scan(Signals([ALL], start=True), DT, 10_000) == []


@pytest.mark.parametrize(("step", "bit"), [(1, 0), (1, 15), (ABORT, 3)])
def test_a_start_without_permissives_is_refused_and_says_which(step: int, bit: int) -> None:
    bench = Bench()
    bench.drop(step, bit)
    assert Report(SequenceEvent.START_REFUSED, step, bit) in bench.start()
    assert bench.block.state is SequenceState.IDLE


def test_permissives_of_later_steps_do_not_keep_it_from_starting() -> None:
    bench = Bench()
    bench.drop(2, 4)
    bench.start()
    assert bench.block.step == 1


def test_the_minimum_time_is_waited_for() -> None:
    bench = Bench(replace(TEN, minimum=0.3), TEN)
    bench.signals.start = True
    bench.scan()
    bench.scan(29)
    assert bench.block.step == 1
    bench.scan()
    assert bench.block.step == 2


def test_a_missing_permissive_of_the_next_step_keeps_it_waiting() -> None:
    bench = Bench()
    bench.drop(2, 7)
    bench.start()
    bench.scan(20)
    assert bench.block.step == 1
    bench.give(2, 7)
    bench.scan()
    assert bench.block.step == 2 and not bench.block.output(1)


def test_beyond_the_maximum_it_times_out_and_needs_an_acknowledge() -> None:
    bench = Bench()
    bench.drop(2, 7)
    bench.start()
    bench.scan(60)
    assert bench.block.state is SequenceState.TIMED_OUT and bench.block.step_state(1) is StepState.TIMED_OUT
    assert bench.block.elapsed(1) == pytest.approx(0.51)
    assert bench.block.first_out is not None and bench.block.first_out.cause is Cause.TIME
    assert (bench.block.first_out.step, bench.block.first_out.bit, bench.block.first_out.value) == (2, 7, 207.0)
    bench.give(2, 7)
    bench.start()
    assert bench.block.state is SequenceState.TIMED_OUT
    bench.press("acknowledge")
    assert bench.block.state is SequenceState.IDLE and bench.block.first_out is None
    bench.start()
    assert bench.block.running


def test_maximum_zero_stays_until_one_is_entered() -> None:
    bench = Bench(StepSettings(0.1, 0.0), TEN)
    bench.start()
    bench.scan(1000)
    assert bench.block.step == 1 and not bench.block.stalled
    bench.block.set_times(1, 0.1, 60.0)
    bench.scan()
    assert bench.block.step == 2


def test_a_maximum_entered_below_the_time_that_passed_times_out() -> None:
    bench = Bench(StepSettings(0.1, 0.0), TEN)
    bench.start()
    bench.scan(1000)
    bench.block.set_times(1, 0.1, 5.0)
    bench.scan()
    assert bench.block.state is SequenceState.TIMED_OUT
    assert bench.block.first_out is not None and bench.block.first_out.bit == -1


def test_the_last_step_too_stays_with_maximum_zero() -> None:
    bench = Bench(StepSettings(0.1, 0.0))
    bench.start()
    bench.scan(100)
    assert bench.block.running


def test_an_abort_condition_aborts_at_once_in_any_step() -> None:
    for step in (1, 2, 3):
        bench = Bench()
        bench.start()
        while bench.block.step != step:
            bench.scan()
        bench.drop(ABORT, 5)
        bench.scan()
        assert bench.block.state is SequenceState.ABORTED and bench.block.step == step
        assert bench.block.step_state(step) is StepState.ABORTED and not bench.block.output(step)
        assert bench.block.first_out is not None
        assert (bench.block.first_out.step, bench.block.first_out.bit) == (ABORT, 5)
        assert bench.block.first_out.cause is Cause.ABORT_CONDITION


@pytest.mark.parametrize("aborts", [True, False])
def test_a_lost_permissive_aborts_only_where_the_mask_says_so(aborts: bool) -> None:
    bench = Bench(replace(TEN, loss_aborts=aborts, minimum=0.3), TEN)
    bench.start()
    bench.drop(1, 2)
    bench.scan()
    assert (bench.block.state is SequenceState.ABORTED) is aborts
    assert Report(SequenceEvent.PERMISSIVE_LOST, 1, 2, together=1) in [report for _, report in bench.log]


def test_suspended_time_does_not_count() -> None:
    bench = Bench()
    bench.start()
    bench.signals.suspend = True
    bench.scan(100)
    assert bench.block.state is SequenceState.SUSPENDED and bench.block.step_state(1) is StepState.SUSPENDED
    assert bench.block.elapsed(1) == pytest.approx(0.01)
    assert not bench.block.output(1)
    bench.signals.suspend = False
    bench.scan(9)
    assert bench.block.step == 2


def test_the_output_may_stay_on_while_suspended() -> None:
    bench = Bench(output_while_suspended=True)
    bench.start()
    bench.signals.suspend = True
    bench.scan()
    assert bench.block.output(1)


def test_while_suspended_a_lost_permissive_waits_for_the_resume() -> None:
    bench = Bench(replace(TEN, loss_aborts=True), TEN)
    bench.start()
    bench.signals.suspend = True
    bench.scan()
    bench.drop(1, 2)
    bench.scan(10)
    assert bench.block.state is SequenceState.SUSPENDED
    bench.give(1, 2)
    bench.scan()
    bench.signals.suspend = False
    bench.scan()
    assert bench.block.state is SequenceState.RUNNING
    bench.signals.suspend = True
    bench.drop(1, 2)
    bench.scan()
    bench.signals.suspend = False
    bench.scan()
    assert bench.block.state is SequenceState.ABORTED


def test_an_abort_condition_counts_while_suspended() -> None:
    bench = Bench()
    bench.start()
    bench.signals.suspend = True
    bench.scan()
    bench.drop(ABORT, 0)
    bench.scan()
    assert bench.block.state is SequenceState.ABORTED


def test_a_person_aborts() -> None:
    bench = Bench()
    bench.start()
    bench.press("abort_request")
    assert bench.block.state is SequenceState.ABORTED
    assert bench.block.first_out is not None
    assert (bench.block.first_out.cause, bench.block.first_out.bit) == (Cause.OPERATOR, -1)


def test_single_step_goes_on_only_when_asked() -> None:
    bench = Bench()
    bench.signals.single = True
    bench.start()
    bench.scan(30)
    assert bench.block.step == 1
    bench.press("advance")
    assert bench.block.step == 2
    bench.signals.advance = True
    bench.scan(30)
    assert bench.block.step == 2, "held: no new edge, and the edge came before the minimum was over"


# ---- the whole table: every state x every event ---------------------------------------------------


# ---- first-out ------------------------------------------------------------------------------------


# ---- forces ---------------------------------------------------------------------------------------


# ---- restart and statistics -----------------------------------------------------------------------


def test_a_restart_in_mid_run_aborts_and_needs_an_acknowledge() -> None:
    bench = Bench()
    bench.start()
    bench.scan(15)
    other = Bench()
    other.block.restore(bench.block.retained(), bench.now)
    assert other.block.state is SequenceState.ABORTED and other.block.step == 2
    assert isinstance(other.block.first_out, FirstOut) and other.block.first_out.cause is Cause.POWER_UP
    assert not other.block.output(2)
    other.start()
    assert other.block.state is SequenceState.ABORTED


def test_times_of_another_sequence_are_not_taken() -> None:
    other = Bench(TEN, TEN)
    other.block.restore(Bench().block.retained(), 0)
    assert len(other.block.settings.steps) == 2


# ---- whatever happens -----------------------------------------------------------------------------

ACTIONS = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(["drop", "give"]), st.integers(0, 3), st.integers(0, 2)),
        st.tuples(st.sampled_from(["start", "suspend", "abort_request", "acknowledge"]), st.booleans()),
        st.tuples(st.just("scan"), st.integers(1, 30)),
        st.tuples(st.just("force"), st.integers(0, 3), st.integers(0, 2)),
    ),
    max_size=60,
)


@pytest.mark.sweep(8)
@given(ACTIONS)
def test_whatever_happens_the_block_stays_sane(actions: list[tuple[object, ...]]) -> None:
    bench = Bench(replace(TEN, loss_aborts=True), TEN, TEN, abort_forceable=ALL, stall_after=0.1)
    for action in actions:
        match action:
            case ("drop", int(step), int(bit)):
                bench.drop(step, bit)
            case ("give", int(step), int(bit)):
                bench.give(step, bit)
            case ("scan", int(count)):
                bench.scan(count)
            case ("force", int(step), int(bit)):
                bench.block.force(step, bit, 0.2, bench.now)
            case (str(name), bool(value)):
                setattr(bench.signals, name, value)
        bench.scan()
        block = bench.block
        active = [n for n in (1, 2, 3) if block.output(n)]
        assert active == ([block.step] if block.state is SequenceState.RUNNING else [])
        assert block.running <= (1 <= block.step <= 3)
        if block.state in (SequenceState.ABORTED, SequenceState.TIMED_OUT):
            assert block.first_out is not None and block.needs_acknowledge
        if block.state is SequenceState.RUNNING:
            assert block.ready(ABORT), "a missing abort condition never lets it run on"
            assert block.elapsed(block.step) <= 0.5 + 1e-9
    starts = bench.events.count(SequenceEvent.STARTED)
    ends = sum(bench.events.count(e) for e in (SequenceEvent.DONE, SequenceEvent.ABORTED, SequenceEvent.TIMED_OUT))
    assert starts == ends + bench.block.running


@pytest.mark.parametrize("minimum", [0.1, 0.105, 2.005, 0.0333])
@pytest.mark.parametrize("over", [0.0, 0.001, 0.004, 1.0])
def test_times_that_are_no_multiples_of_the_scan_let_everything_pass_that_can(minimum: float, over: float) -> None:
    bench = Bench(StepSettings(minimum=minimum, maximum=minimum + over), TEN)
    bench.start()
    bench.scan(300)
    assert bench.block.state is SequenceState.DONE and SequenceEvent.TIMED_OUT not in bench.events
    late = Bench(StepSettings(minimum=minimum, maximum=minimum + over), TEN)
    late.drop(2, 5)
    late.start()
    late.scan(400)
    assert late.block.state is SequenceState.TIMED_OUT, "the next step was not possible"
    late.give(2, 5)
    late.scan(10)
    assert late.block.state is SequenceState.TIMED_OUT


def test_a_person_who_aborts_in_the_same_scan_does_not_hide_the_condition() -> None:
    bench = Bench()
    bench.start()
    bench.drop(ABORT, 7)
    bench.press("abort_request")
    out = bench.block.first_out
    assert out is not None and (out.cause, out.step, out.bit) == (Cause.ABORT_CONDITION, ABORT, 7)
