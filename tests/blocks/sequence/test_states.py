"""Every state of a sequence meets every event."""

from dataclasses import replace

import pytest

from app.blocks.sequence import (
    ABORT,
    SequenceState,
)
from tests.blocks.sequence.stand import TEN, Bench


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
