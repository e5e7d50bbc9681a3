"""What operators ask of the virtual sequence reaches its block once."""

import pytest

from app.blocks.sequence import SequenceState
from app.sim.sequence.operator import OperatorRequests
from app.sim.sequence.register_map import (
    SequenceCommand,
)
from tests.sim.sequence.stand import drop, flags, long, run, taught, word


def test_automatic_starts_again_whenever_it_can() -> None:
    plc, talker = taught((0.5, 5.0), (0.5, 5.0))
    talker.ask(SequenceCommand.AUTOMATIC_ON)
    run(plc, 3.5)
    assert long(plc, 14) == 3 and "automatic" in flags(plc)
    drop(talker, 1, 1)
    run(plc, 3)
    done = long(plc, 14)
    run(plc, 3)
    assert long(plc, 14) == done and word(plc, 1) == SequenceState.DONE
    drop(talker, 1, 0)
    run(plc, 0.3)
    assert word(plc, 1) == SequenceState.RUNNING
    talker.ask(SequenceCommand.AUTOMATIC_OFF)
    run(plc, 5)
    assert word(plc, 1) == SequenceState.DONE


def test_automatic_does_not_start_what_needs_an_acknowledge() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.AUTOMATIC_ON)
    run(plc, 0.5)
    talker.ask(SequenceCommand.ABORT)
    run(plc, 2)
    assert word(plc, 1) == SequenceState.ABORTED
    talker.ask(SequenceCommand.ACKNOWLEDGE)
    run(plc, 0.1)
    assert word(plc, 1) == SequenceState.RUNNING


@pytest.mark.parametrize("request_", ["start", "abort", "acknowledge", "advance"])
def test_a_request_is_seen_in_one_scan_and_then_gone(request_: str) -> None:
    operator, words = OperatorRequests(single=True), (1, 2, 3)
    operator.ask(request_)
    first, second = operator.signals(words), operator.signals(words)
    assert (first.abort, first.permissives, first.single) == (1, (2, 3), True)
    field = {"abort": "abort_request"}.get(request_, request_)
    assert getattr(first, field) and not getattr(second, field)
    assert sum(map(bool, (first.start, first.abort_request, first.acknowledge, first.advance))) == 1


def test_automatic_asks_in_every_other_scan_only() -> None:
    operator, seen = OperatorRequests(automatic=True), []
    for _ in range(6):
        operator.start_automatically()
        seen.append(operator.signals((0,)).start)
    assert seen == [True, False] * 3
