"""Branches, loops and safe steps of the block, scan by scan."""

from collections.abc import Mapping

import pytest

from app.blocks.sequence import (
    ALL,
    Branch,
    Cause,
    Chart,
    Loop,
    SequenceBlock,
    SequenceEvent,
    SequenceSettings,
    SequenceState,
    Signals,
    StepSettings,
    StepState,
    awaited,
)

DT = 0.1


class Course:
    """A block with its inputs."""

    def __init__(
        self, steps: int, chart: Chart, maximum: float = 5.0, times: Mapping[int, float] | None = None
    ) -> None:
        minimum = times or {}
        settings = tuple(StepSettings(minimum.get(n, 0.2), maximum) for n in range(1, steps + 1))
        self.block = SequenceBlock(SequenceSettings(settings, chart=chart, stall_after=0.5))
        self.words = [ALL] * (steps + 1)
        self.now = 0
        self.log: list[tuple[str, int]] = []
        self.scan()

    def scan(self, **given: object) -> None:
        self.now += 100_000
        signals = Signals(self.words[1:], self.words[0], **given)  # type: ignore[arg-type]
        for report in self.block.scan(signals, DT, self.now):
            self.log.append((report.event.name, report.step))

    def start(self) -> "Course":
        self.scan(start=True)
        return self

    def run(self, seconds: float, **given: object) -> "Course":
        for _ in range(round(seconds / DT)):
            self.scan(**given)
        return self

    @property
    def entered(self) -> list[int]:
        return [step for event, step in self.log if event == "STEP_ENTERED"]


FIRST = Chart((Branch(1, (2, 3), 4),))
ALL_AT_ONCE = Chart((Branch(1, (2, 4), 5, together=True),))


@pytest.mark.parametrize(("two", "three", "way"), [(ALL, ALL, 2), (0, ALL, 3), (ALL, 0, 2)])
def test_the_first_path_that_can_be_entered_is_taken(two: int, three: int, way: int) -> None:
    course = Course(4, FIRST)
    course.words[2:4] = two, three
    course.start().run(2)
    assert (course.entered, course.block.state) == ([1, way, 4], SequenceState.DONE)


def test_of_two_paths_that_stall_the_first_keeps_its_first_out_until_it_is_left() -> None:
    course = Course(7, Chart((Branch(1, (2, 4), 6, together=True),)), times={4: 1.0}).start()
    course.words[3], course.words[5] = ALL & ~2, ALL & ~8
    course.run(1.2)
    assert _first_out(course) == (3, 1, 2)
    course.run(1.5)
    assert [entry for entry in course.log if entry[0] == "STALLED"] == [("STALLED", 3), ("STALLED", 5)]
    assert _first_out(course) == (3, 1, 2), "the second stall does not replace it"
    course.words[3] = ALL
    course.scan()
    assert 3 in course.block.active
    assert _first_out(course) == (5, 3, 4), "the first is left; the other stands as before"
    course.words[5] = ALL
    course.scan()
    assert course.block.first_out is None
    assert [entry for entry in course.log if entry[0] == "STALL_OVER"] == [("STALL_OVER", 2), ("STALL_OVER", 4)]


def _first_out(course: Course) -> tuple[int, int, int]:
    out = course.block.first_out
    assert out and out.cause is Cause.STALL
    return out.step, out.bit, out.at_step


def test_a_safe_step_that_stalls_tells_neither_the_stall_nor_its_end() -> None:
    course = Course(4, Chart(safe=3)).start()
    course.words[4] = ALL & ~1
    course.run(0.1, abort_request=True).run(1.5)
    assert course.block.safe and course.block.step_state(3) is StepState.STALLED
    course.words[4] = ALL
    course.run(1)
    assert course.block.state is SequenceState.ABORTED
    assert not [event for event, _ in course.log if event.startswith("STALL")]
    assert course.block.first_out and course.block.first_out.cause is Cause.OPERATOR


def test_no_path_stalls_and_the_one_that_fell_first_of_all_is_named() -> None:
    course = Course(4, FIRST).start()
    course.words[3] = ALL & ~4
    course.scan()
    course.words[2] = ALL & ~2
    course.run(1.5)
    out = course.block.first_out
    assert out and (out.cause, out.step, out.bit, out.at_step) == (Cause.STALL, 3, 2, 1)
    assert ("STALLED", 3) in course.log
    course.words[2] = ALL
    course.run(2)
    assert (course.entered, course.block.state, course.block.first_out) == ([1, 2, 4], SequenceState.DONE, None)


def test_paths_run_side_by_side_and_meet() -> None:
    course = Course(5, ALL_AT_ONCE, times={2: 1.0, 3: 1.0, 4: 0.3}).start().run(0.3)
    assert course.block.active == (2, 4)
    course.run(1.5)
    assert course.block.active == (3, 4), "the short one waits"
    assert course.block.elapsed(4) == pytest.approx(0.3), "its time stands still"
    course.run(1.2)
    assert course.entered == [1, 2, 4, 3, 5]
    course.run(1)
    assert course.block.state is SequenceState.DONE
    assert [event for event, _ in course.log].count("DONE") == 1


def test_all_paths_begin_only_when_all_can() -> None:
    course = Course(5, ALL_AT_ONCE)
    course.words[4] = 0
    course.start().run(1)
    assert course.block.active == (1,)
    course.words[4] = ALL
    course.run(0.1)
    assert course.block.active == (2, 4)


def test_waiting_for_the_others_never_times_out_and_then_the_meeting_step_is_waited_for_by_all() -> None:
    course = Course(5, ALL_AT_ONCE, maximum=1.5, times={2: 1.2, 3: 1.2}).start()
    course.words[5] = ALL & ~8
    course.run(2.6)
    assert course.block.state is SequenceState.RUNNING and course.block.active == (3, 4)
    course.run(2)
    out = course.block.first_out
    assert out and (course.block.state, out.cause, out.step, out.bit) == (SequenceState.TIMED_OUT, Cause.TIME, 5, 3)


def test_what_happens_in_one_path_stops_all_and_names_its_step() -> None:
    course = Course(5, ALL_AT_ONCE, times={2: 9, 4: 9}, maximum=20).start().run(0.5)
    course.scan(refused={4: 2})
    out = course.block.first_out
    assert out and (out.cause, out.at_step, out.value, course.block.active) == (Cause.COMMAND, 4, 2, ())
    assert course.block.step_state(2) is StepState.ABORTED and course.block.step_state(4) is StepState.ABORTED


def test_one_path_times_out_by_its_own_maximum() -> None:
    course = Course(5, ALL_AT_ONCE, maximum=1.0, times={2: 0.2})
    course.words[3] = 0
    course.start().run(2)
    out = course.block.first_out
    assert out and (out.cause, out.at_step, out.step) == (Cause.TIME, 2, 3)
    assert course.block.step_state(2) is StepState.TIMED_OUT


def test_suspended_all_paths_stand_still_and_go_on() -> None:
    course = Course(5, ALL_AT_ONCE, times={2: 1, 4: 1}).start().run(0.6)
    before = [course.block.elapsed(step) for step in (2, 4)]
    course.run(5, suspend=True)
    assert [course.block.elapsed(step) for step in (2, 4)] == before
    assert not course.block.output(2) and not course.block.output(4)
    course.run(3)
    assert course.block.state is SequenceState.DONE


def test_in_single_step_one_advance_lets_every_path_go_on_once() -> None:
    course = Course(5, ALL_AT_ONCE, times={2: 0.1, 3: 0.1, 4: 0.1}, maximum=50).start()
    course.run(1, single=True).scan(single=True, advance=True)
    assert course.block.active == (2, 4)
    course.run(1, single=True).scan(single=True, advance=True)
    assert course.block.active == (3, 4)


def test_commands_that_are_not_confirmed_hold_their_own_path_alone() -> None:
    course = Course(5, ALL_AT_ONCE, times={2: 0.1, 4: 0.1}, maximum=50).start().run(0.3)
    course.run(1, pending=(4,))
    assert course.block.active == (3, 4) and course.block.state is SequenceState.RUNNING
    course.run(1)
    assert course.block.state is SequenceState.DONE


@pytest.mark.parametrize("times", [2, 5])
def test_a_loop_is_passed_so_often_also_within_another(times: int) -> None:
    course = Course(4, Chart(loops=(Loop(2, 2, times), Loop(1, 3, 2)))).start().run(30)
    assert course.entered == [*([1, *[2] * times, 3] * 2), 4]
    assert course.block.state is SequenceState.DONE and course.block.times[1].runs == 2 * times


def test_a_loop_may_hold_a_branch_and_a_path_a_loop() -> None:
    chart = Chart((Branch(1, (2, 4), 5, together=True),), (Loop(2, 3, 2), Loop(1, 5, 2)))
    course = Course(6, chart).start().run(30)
    assert course.block.state is SequenceState.DONE
    assert {step: course.entered.count(step) for step in range(1, 7)} == {1: 2, 2: 4, 3: 4, 4: 2, 5: 2, 6: 1}


def test_a_branch_in_a_path_meets_within_it() -> None:
    chart = Chart((Branch(1, (2, 6), 7, together=True), Branch(2, (3, 4), 5)))
    course = Course(7, chart, times={6: 5}, maximum=20)
    course.words[3] = 0
    course.start().run(10)
    assert course.entered == [1, 2, 6, 4, 5, 7]


SAFE = Chart(safe=3)


def test_a_run_that_nothing_stops_does_no_safe_step() -> None:
    course = Course(4, SAFE).start().run(3)
    assert (course.entered, course.block.state) == ([1, 2], SequenceState.DONE)


def test_what_stops_a_run_leads_to_its_safe_steps_and_the_run_ends_as_that_says() -> None:
    course = Course(4, SAFE, times={1: 3}).start().run(0.5)
    course.words[0] = ALL & ~1
    course.run(3)
    out = course.block.first_out
    assert course.entered == [1, 3, 4] and course.block.state is SequenceState.ABORTED
    assert out and (out.cause, out.step, out.bit, out.at_step) == (Cause.ABORT_CONDITION, 0, 0, 1)
    ends = [event for event, _ in course.log if event in ("ABORTING", "ABORTED", "DONE", "TIMED_OUT")]
    assert ends == ["ABORTING", "ABORTED"] and course.block.needs_acknowledge


def test_a_time_out_ends_as_such_behind_its_safe_steps() -> None:
    course = Course(4, SAFE, maximum=1)
    course.words[2] = 0
    course.start().run(4)
    assert (course.entered, course.block.state) == ([1, 3, 4], SequenceState.TIMED_OUT)
    assert course.block.step_state(1) is StepState.TIMED_OUT


def test_what_stops_the_safe_steps_stops_for_good_and_the_first_cause_counts() -> None:
    course = Course(4, SAFE, times={1: 3, 3: 3}).start().run(0.5)
    course.scan(abort_request=True)
    assert course.block.safe and course.block.active == (3,)
    course.scan()
    course.scan(refused={3: 1})
    out = course.block.first_out
    assert course.block.state is SequenceState.ABORTED and out and (out.cause, out.at_step) == (Cause.OPERATOR, 1)


def test_suspended_the_safe_steps_wait_for_the_resume() -> None:
    course = Course(4, SAFE, times={1: 3}).start().run(0.5)
    course.run(0.5, suspend=True)
    course.words[0] = 0
    course.run(2, suspend=True)
    assert course.block.safe and course.block.state is SequenceState.SUSPENDED and not course.block.output(3)
    course.run(2)
    assert (course.entered, course.block.state) == ([1, 3, 4], SequenceState.ABORTED)


def test_safe_steps_that_cannot_be_entered_are_left_out() -> None:
    course = Course(4, SAFE, times={1: 3})
    course.words[3] = 0
    course.start().run(0.5)
    course.scan(abort_request=True)
    assert course.block.state is SequenceState.ABORTED and course.entered == [1]


def test_after_a_restart_a_run_in_two_paths_is_aborted_and_does_no_safe_step() -> None:
    chart = Chart((Branch(1, (2, 3), 4, together=True),), safe=5)
    course = Course(6, chart, times={2: 9, 3: 9}, maximum=20).start().run(0.5)
    again = SequenceBlock(course.block.settings)
    reports = again.restore(course.block.retained(), course.now)
    assert [report.event for report in reports] == [SequenceEvent.ABORTED]
    assert again.state is SequenceState.ABORTED and not again.safe and again.active == ()
    assert [again.step_state(step) for step in (2, 3)] == [StepState.ABORTED] * 2


def test_in_a_branch_it_lacks_what_the_chart_says_follows() -> None:
    """Step 1 leads to 2 and 3 side by side, both to 4: of the path that waits nothing is missing, of the other what follows it."""
    chart = Chart((Branch(1, (2, 3), 5, together=True),), loops=(Loop(1, 5, 2),))
    steps = tuple(StepSettings(0.1, 100.0) for _ in range(6))
    block = SequenceBlock(SequenceSettings(steps, chart=chart))
    words = [ALL] * 6
    words[3] = ALL & ~1
    now = 0
    for _ in range(100):
        now += 100_000
        block.scan(Signals(words, start=now == 200_000), 0.1, now)
    assert (block.active, awaited(block)) == ((2, 3), (4,)), "the end of a path that waits for the other lacks nothing"
    words[3], words[0] = ALL, ALL & ~1
    for _ in range(100):
        now += 100_000
        block.scan(Signals(words), 0.1, now)
    assert (block.active, awaited(block)) == ((5,), (1,)), "its loop leads back"
    assert awaited(SequenceBlock(SequenceSettings(steps, chart=chart))) == (1,)
    assert awaited(SequenceBlock(SequenceSettings(steps, chart=chart)), 1) == (2, 3)
