"""A command of a PLC: taken once, answered and answered again at its end; the events that it causes carry its id."""

from app.registers import plc_map
from app.registers.plc_map import Answer, AnswerState, Request
from app.sim.plc import Verdict
from tests.sim.fake_plc import ADD, FAIL, RUN, SET, FakePlc
from tests.sim.plc.stand import answers, ask, events, go, stage


def test_a_command_is_executed_once_whatever_is_repeated() -> None:
    plc = FakePlc()
    first = ask(plc, SET, 500, id=40)
    assert (first.state, first.reason, first.time) == (AnswerState.DONE, 0, 10_000)
    go(plc, 3)
    assert ask(plc, SET, 9000, id=40) == first
    assert plc.counter == 505
    assert ask(plc, 0x77, id=41) == Answer(41, AnswerState.REJECTED, 1, 0, 60_000)
    assert ask(plc, SET, 3, id=42, expected=2).reason == 2
    assert ask(plc, SET, 3, id=43, expected=1).state is AnswerState.DONE


def test_the_last_eight_answers_are_kept_newest_first() -> None:
    plc = FakePlc()
    for id in range(1, 12):
        plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(SET, id=id)))
    plc.step()
    assert list(answers(plc)) == list(range(11, 3, -1))
    plc.power_cycle()
    assert list(answers(plc)) == list(range(11, 3, -1)), "a host may still ask what became of its command"


def test_a_command_that_runs_is_answered_again_at_its_end() -> None:
    plc = FakePlc()
    assert ask(plc, RUN, id=1).state is AnswerState.RUNNING
    assert ask(plc, FAIL, id=2).state is AnswerState.RUNNING
    go(plc, 9)
    assert (answers(plc)[1].state, answers(plc)[2].state) == (AnswerState.DONE, AnswerState.RUNNING)
    plc.step()
    assert answers(plc)[2].state is AnswerState.FAILED
    assert answers(plc)[2].time > answers(plc)[1].time
    ask(plc, RUN, id=3)
    plc.power_cycle()
    assert answers(plc)[3].state is AnswerState.FAILED


def test_an_event_carries_the_command_that_caused_it_and_no_other() -> None:
    plc = FakePlc(slots=3)
    ask(plc, ADD, 11, id=7)
    plc.event(1)
    plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(ADD, arguments=(12,), id=8)))
    plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(ADD, arguments=(13,), id=9)))
    plc.step()
    ask(plc, plc_map.COMMIT_SETTINGS, *stage(plc, 2.5, 4.0), id=10)
    plc.step()
    plc.event(1)
    assert [event.request for event in events(plc)] == [0, 7, 0, 8, 9, 10, 0]


def test_an_event_of_the_same_scan_that_a_command_names_is_caused_by_it() -> None:
    class Late(FakePlc):
        def _execute(self, request: Request) -> Verdict:
            self.causes(40, 41)
            return Verdict()

        def _scan(self) -> None:
            for code in (40, 42):
                self.event(code)

    plc = Late()
    ask(plc, ADD, 1, id=7)
    plc.step()
    found = [(event.code, event.request) for event in events(plc)[1:]]
    assert found == [(40, 7), (42, 0), (40, 0), (42, 0)], "in the next scan nobody has asked for anything"
