"""The sequence block: every behaviour of the reference, every state x event, first-out, forces, restart."""

from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.sequence import (
    ABORT,
    ALL,
    Cause,
    FirstOut,
    ForceRefused,
    Report,
    SequenceBlock,
    SequenceEvent,
    SequenceSettings,
    SequenceState,
    Signals,
    StepSettings,
    StepState,
)

DT = 0.01
TEN = StepSettings(minimum=0.1, maximum=0.5)


class Bench:
    """A block with its signals, scanned every 10 ms."""

    def __init__(self, *steps: StepSettings, **settings: object) -> None:
        self.block = SequenceBlock(
            SequenceSettings(steps or (TEN, TEN, TEN), **settings),  # type: ignore[arg-type]
            values=lambda step, bit: 100.0 * step + bit,
        )
        self.signals = Signals([ALL] * len(self.block.settings.steps))
        self.now = 0
        self.log: list[tuple[int, Report]] = []
        self.scan()

    def scan(self, count: int = 1) -> list[Report]:
        fresh = []
        for _ in range(count):
            self.now += 10_000
            fresh += self.block.scan(self.signals, DT, self.now)
        self.log += [(self.now, report) for report in fresh]
        return fresh

    def start(self) -> list[Report]:
        return self.press("start")

    def press(self, name: str) -> list[Report]:
        setattr(self.signals, name, True)
        reports = self.scan()
        setattr(self.signals, name, False)
        return reports + self.scan()

    def drop(self, step: int, bit: int) -> None:
        self._set(step, lambda word: word & ~(1 << bit))

    def give(self, step: int, bit: int) -> None:
        self._set(step, lambda word: word | 1 << bit)

    def _set(self, step: int, change) -> None:  # type: ignore[no-untyped-def]
        if step == ABORT:
            self.signals.abort = change(self.signals.abort)
        else:
            words = list(self.signals.permissives)
            words[step - 1] = change(words[step - 1])
            self.signals.permissives = words

    @property
    def events(self) -> list[SequenceEvent]:
        return [report.event for _, report in self.log]


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


def test_no_step_is_no_sequence() -> None:
    with pytest.raises(ValueError, match="steps = 0"):
        SequenceSettings(())


@pytest.mark.parametrize("value", [-0.1, float("inf"), float("nan")])
def test_a_time_that_is_none_is_named(value: float) -> None:
    with pytest.raises(ValueError, match="minimum ="):
        StepSettings(minimum=value)


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


@pytest.mark.parametrize("number", [0, 4])
def test_times_of_a_step_that_is_not_there(number: int) -> None:
    with pytest.raises(ValueError, match="expected 1 to 3"):
        Bench().block.set_times(number, 1, 2)


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


def _bench_in(state: SequenceState) -> Bench:
    bench = Bench(*[replace(TEN, loss_aborts=True)] * 3)
    if state is not SequenceState.IDLE:
        bench.start()
    if state is SequenceState.SUSPENDED:
        bench.signals.suspend = True
        bench.scan()
    elif state is SequenceState.DONE:
        bench.scan(40)
    elif state is SequenceState.TIMED_OUT:
        bench.drop(2, 0)
        bench.scan(60)
        bench.give(2, 0)
        bench.scan()
    elif state is SequenceState.ABORTED:
        bench.press("abort_request")
    assert bench.block.state is state
    return bench


S = SequenceState
TABLE: dict[str, dict[SequenceState, SequenceState]] = {
    "start": {S.IDLE: S.RUNNING, S.DONE: S.RUNNING},
    "acknowledge": {S.TIMED_OUT: S.IDLE, S.ABORTED: S.IDLE},
    "abort_request": {S.RUNNING: S.ABORTED, S.SUSPENDED: S.ABORTED},
    "abort condition": {S.RUNNING: S.ABORTED, S.SUSPENDED: S.ABORTED},
    "permissive lost": {S.RUNNING: S.ABORTED},
    "suspend": {S.RUNNING: S.SUSPENDED},
    "resume": {S.SUSPENDED: S.RUNNING},
    "advance": {},
    "time": {S.RUNNING: S.DONE},
}


@pytest.mark.parametrize("event", TABLE)
@pytest.mark.parametrize("state", list(SequenceState))
def test_every_state_meets_every_event(state: SequenceState, event: str) -> None:
    bench = _bench_in(state)
    if event == "abort condition":
        bench.drop(ABORT, 1)
        bench.scan()
    elif event == "permissive lost":
        bench.drop(1, 1)
        bench.scan()
    elif event == "suspend":
        bench.signals.suspend = True
        bench.scan()
    elif event == "resume":
        bench.signals.suspend = False
        bench.scan()
    elif event == "time":
        bench.scan(100)
    else:
        setattr(bench.signals, event, True)
        bench.scan()
    assert bench.block.state is TABLE[event].get(state, state)


# ---- first-out ------------------------------------------------------------------------------------


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


# ---- forces ---------------------------------------------------------------------------------------


def test_a_force_replaces_a_permissive_until_its_time_is_over() -> None:
    bench = Bench(replace(TEN, maximum=60), replace(TEN, maximum=60))
    bench.drop(2, 5)
    bench.block.force(2, 5, 1.0, bench.now)
    assert bench.block.forced(2) == 1 << 5 and bench.block.ready(2)
    bench.start()
    bench.scan(11)
    assert bench.block.step == 2
    reports = bench.scan(100)
    assert Report(SequenceEvent.RELEASED, 2, 5, 1.0) in reports
    assert bench.block.forces == {} and not bench.block.ready(2)


def test_the_remaining_time_of_a_force_can_be_read() -> None:
    bench = Bench()
    bench.block.force(1, 0, 60.0, bench.now)
    bench.scan(100)
    assert bench.block.remaining(1, 0, bench.now) == pytest.approx(59.0)
    assert bench.block.remaining(1, 1, bench.now) == 0.0


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
    assert bench.block.release(1, 0) == Report(SequenceEvent.RELEASED, 1, 0, 0.0)
    assert bench.block.release(1, 0) is None


# ---- restart and statistics -----------------------------------------------------------------------


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
    assert other.block.forces == {}


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


def test_a_person_who_aborts_in_the_same_scan_does_not_hide_the_condition() -> None:
    bench = Bench()
    bench.start()
    bench.drop(ABORT, 7)
    bench.press("abort_request")
    out = bench.block.first_out
    assert out is not None and (out.cause, out.step, out.bit) == (Cause.ABORT_CONDITION, ABORT, 7)
