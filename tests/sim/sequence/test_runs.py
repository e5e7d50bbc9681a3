"""Counts of runs: what each outcome adds to, and which times are of completed runs only."""

import pytest

from app.blocks.sequence import SequenceEvent, SequenceState
from app.sim.sequence.runs import OUTCOMES, RunCounts

DONE, TIMED_OUT, ABORTED = SequenceEvent.DONE, SequenceEvent.TIMED_OUT, SequenceEvent.ABORTED


@pytest.mark.parametrize(
    ("ends", "counts", "times"),
    [
        ([], (0, 0, 0), (0, 0, 0, 0)),
        ([(DONE, 4.0)], (1, 0, 0), (4, 4, 4, 4)),
        ([(DONE, 4.0), (DONE, 2.0), (DONE, 9.0)], (3, 0, 0), (2, 5, 9, 9)),
        ([(ABORTED, 1.0), (DONE, 4.0)], (1, 1, 0), (4, 4, 4, 4)),
        ([(DONE, 4.0), (ABORTED, 1.0), (TIMED_OUT, 60.0)], (1, 1, 1), (4, 4, 4, 60)),
    ],
)
def test_only_completed_runs_have_times(
    ends: list[tuple[SequenceEvent, float]], counts: tuple[int, ...], times: tuple[float, ...]
) -> None:
    runs = RunCounts()
    for event, seconds in ends:
        runs.end(event, seconds)
    assert (runs.done, runs.aborted, runs.timed_out) == counts
    assert (runs.shortest, runs.mean, runs.longest, runs.last) == times
    assert runs.last_outcome == (OUTCOMES[ends[-1][0]] if ends else 0)


def test_an_outcome_is_the_state_that_the_run_ends_in() -> None:
    assert OUTCOMES == {DONE: SequenceState.DONE, TIMED_OUT: SequenceState.TIMED_OUT, ABORTED: SequenceState.ABORTED}


def test_losses_are_kept_by_step_until_the_next_run_begins() -> None:
    runs = RunCounts()
    for step, bit in ((1, 0), (1, 3), (2, 15), (1, 3)):
        runs.lose(step, bit)
    assert runs.lost == {1: 0b1001, 2: 1 << 15}
    runs.begin(77)
    assert (runs.lost, runs.start) == ({}, 77)
