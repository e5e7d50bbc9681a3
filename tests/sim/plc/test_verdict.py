"""What becomes of a command, as the answers tell it."""

import pytest

from app.registers.plc_map import AnswerState
from app.sim.plc.answers import Answers
from app.sim.plc.verdict import Verdict, rejected


@pytest.mark.parametrize(
    ("verdict", "told"),
    [
        (Verdict(), (AnswerState.DONE, 0, 0)),
        (Verdict(detail=7), (AnswerState.DONE, 0, 7)),
        (rejected(3), (AnswerState.REJECTED, 3, 0)),
        (rejected(3, 65), (AnswerState.REJECTED, 3, 65)),
    ],
)
def test_it_stands_in_the_newest_answer(verdict: Verdict, told: tuple[AnswerState, int, int]) -> None:
    answers = Answers()
    answers.add(9, verdict, 1000)
    assert answers.words[0] == 9
    assert (AnswerState(answers.words[1]), answers.words[2], answers.words[3]) == told


def test_one_that_runs_is_asked_after_every_scan_until_it_is_over() -> None:
    states = [AnswerState.RUNNING, AnswerState.RUNNING, AnswerState.FAILED, AnswerState.DONE]
    asked = iter(states)
    answers = Answers()
    answers.add(9, Verdict(AnswerState.RUNNING, until=lambda: next(asked)), 0)
    seen = []
    for scan in range(4):
        answers.watch(scan)
        seen.append(AnswerState(answers.words[1]))
    assert seen == [AnswerState.RUNNING, AnswerState.RUNNING, AnswerState.FAILED, AnswerState.FAILED]
