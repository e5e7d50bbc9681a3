"""The last answers of a PLC: an id that is remembered is known, a command that runs ends once."""

from app.registers import plc_map
from app.registers.plc_map import Answer, AnswerState
from app.sim.plc.answers import Answers
from app.sim.plc.verdict import Verdict, rejected


def read(answers: Answers) -> list[Answer]:
    found = plc_map.answers_of([2, *answers.words, 2])
    assert found is not None
    return found


def test_the_newest_stand_first_and_the_oldest_is_forgotten() -> None:
    answers = Answers()
    for id in range(1, 12):
        assert not answers.knows(id)
        answers.add(id, rejected(id, id + 0x10000) if id % 2 else Verdict(), id * 10)
        known = [one for one in range(1, 12) if answers.knows(one)]
        assert known == list(range(max(1, id - plc_map.ANSWERS_KEPT + 1), id + 1))
    assert [(one.id, one.reason, one.detail) for one in read(answers)] == [
        (id, id * (id % 2), id * (id % 2)) for id in range(11, 3, -1)
    ]
    answers.clear()
    assert read(answers) == []


def test_a_running_command_is_asked_until_it_has_ended() -> None:
    state, asked = [AnswerState.RUNNING], []

    def until() -> AnswerState:
        asked.append(1)
        return state[0]

    answers = Answers()
    answers.add(7, Verdict(AnswerState.RUNNING, until=until), 5)
    answers.watch(10)
    assert [(one.state, one.time) for one in read(answers)] == [(AnswerState.RUNNING, 5)]
    state[0] = AnswerState.DONE
    answers.watch(20)
    answers.watch(30)
    assert [(one.state, one.time) for one in read(answers)] == [(AnswerState.DONE, 20)]
    assert len(asked) == 2


def test_without_supply_what_runs_has_failed_and_what_ended_stays() -> None:
    answers = Answers()
    answers.add(1, Verdict(), 1)
    answers.add(2, Verdict(AnswerState.RUNNING, until=lambda: AnswerState.DONE), 2)
    answers.fail(9)
    answers.watch(10)
    assert [(one.id, one.state, one.time) for one in read(answers)] == [
        (2, AnswerState.FAILED, 9),
        (1, AnswerState.DONE, 1),
    ]
