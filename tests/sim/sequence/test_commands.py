"""Commands of the virtual sequence, and every reason for which one is refused."""

from dataclasses import replace

import pytest

from app.blocks.sequence import Branch, Cause, Chart, SequenceState
from app.registers import plc_map
from app.registers.plc_map import Answer, real, real_of
from app.sim.coil_car import register_map as coil_car
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.register_map import (
    FORCE_ROWS,
    NO_BIT,
    SequenceCommand,
    SequenceDeviceEvent,
    SequenceReason,
)
from tests.sim.coil_car.line import Line, Talker, teaching
from tests.sim.sequence.stand import (
    DONE,
    REJECTED,
    drop,
    f32,
    flags,
    long,
    number,
    run,
    step_row,
    taught,
    word,
)


def test_suspend_freezes_and_resume_goes_on() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.START)
    run(plc, 0.5)
    assert talker.ask(SequenceCommand.SUSPEND).state == DONE
    assert (word(plc, 1), flags(plc)) == (SequenceState.SUSPENDED, set())
    run(plc, 5)
    assert f32(step_row(plc, 1), 12) == pytest.approx(0.5, abs=0.02) and step_row(plc, 1)[3] == 2
    assert talker.ask(SequenceCommand.RESUME).state == DONE and word(plc, 1) == SequenceState.RUNNING
    run(plc, 3)
    assert word(plc, 1) == SequenceState.DONE and number(plc, 12) == pytest.approx(8.0, abs=0.05)


def test_suspend_is_a_stop_and_is_never_refused() -> None:
    plc, talker = taught()
    assert talker.ask(SequenceCommand.SUSPEND).state == DONE and word(plc, 1) == SequenceState.IDLE
    talker.ask(SequenceCommand.START)
    assert word(plc, 1) == SequenceState.RUNNING, "a suspend before the start is forgotten"


def test_a_suspend_in_the_scan_of_the_start_counts() -> None:
    plc, _ = taught()
    for code in (SequenceCommand.START, SequenceCommand.SUSPEND):
        plc.write(16, plc_map.COMMAND, plc_map.request_words(plc_map.Request(code, id=100 + code)))
    run(plc, 0.05)
    assert word(plc, 1) == SequenceState.SUSPENDED


def test_abort_and_acknowledge() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.START)
    run(plc, 1.2)
    assert talker.ask(SequenceCommand.ABORT).state == DONE
    assert (word(plc, 1), word(plc, 2), long(plc, 16)) == (SequenceState.ABORTED, 2, 1)
    assert [word(plc, at) for at in (28, 29, 30, 31)] == [Cause.OPERATOR, 0, NO_BIT, 2]
    assert talker.ask(SequenceCommand.START).reason == SequenceReason.NEEDS_ACKNOWLEDGE
    assert talker.ask(SequenceCommand.ACKNOWLEDGE).state == DONE
    assert (word(plc, 1), word(plc, 28)) == (SequenceState.IDLE, 0)
    assert talker.ask(SequenceCommand.START).state == DONE


def test_single_step_goes_on_when_told() -> None:
    plc, talker = taught()
    assert talker.ask(SequenceCommand.SINGLE_ON).state == DONE and "single_step" in flags(plc)
    talker.ask(SequenceCommand.START)
    assert talker.ask(SequenceCommand.ADVANCE).reason == SequenceReason.WRONG_STATE, "its minimum is not over"
    run(plc, 3)
    assert word(plc, 2) == 1
    drop(talker, 2, 1 << 9)
    plc.step()
    answer = talker.ask(SequenceCommand.ADVANCE)
    assert (answer.reason, answer.detail) == (SequenceReason.MISSING, 2 * 16 + 9)
    drop(talker, 2, 0)
    plc.step()
    assert talker.ask(SequenceCommand.ADVANCE).state == DONE and word(plc, 2) == 2
    assert talker.ask(SequenceCommand.SINGLE_OFF).state == DONE
    run(plc, 2.5)
    assert word(plc, 1) == SequenceState.DONE
    codes = [code for code, _ in talker.codes()]
    assert SequenceDeviceEvent.SINGLE_ON in codes and SequenceDeviceEvent.SINGLE_OFF in codes


def parallel(*times: tuple[float, float]) -> tuple[VirtualSequence, Talker]:
    """Behind step 1 step 2 and steps 3, 4 side by side; they meet in step 5."""
    chart = Chart((Branch(1, (2, 3), 5, together=True),))
    plc = VirtualSequence(replace(teaching(*times), chart=chart))
    plc.step()
    talker = Talker(plc)
    talker.ask(SequenceCommand.SINGLE_ON)
    talker.ask(SequenceCommand.START)
    assert talker.ask(SequenceCommand.ADVANCE).state == DONE
    assert plc.block.active == (2, 3)
    plc.step()
    return plc, talker


def test_an_advance_that_would_wait_for_the_other_path_is_refused_before() -> None:
    plc, talker = parallel((0.0, 10.0), (0.0, 60.0), (0.0, 60.0), (2.0, 60.0), (0.0, 60.0))
    assert talker.ask(SequenceCommand.ADVANCE).state == DONE
    assert plc.block.active == (2, 4), "the end of a path waits for the other one"
    plc.step()
    refusal = talker.ask(SequenceCommand.ADVANCE)
    assert (refusal.state, refusal.reason) == (REJECTED, SequenceReason.WRONG_STATE), "step 4 has not had its time"
    run(plc, 2.0)
    drop(talker, 5, 1)
    plc.step()
    refusal = talker.ask(SequenceCommand.ADVANCE)
    assert (refusal.state, refusal.reason, refusal.detail) == (REJECTED, SequenceReason.MISSING, 5 * 16)
    drop(talker, 5, 0)
    plc.step()
    assert talker.ask(SequenceCommand.ADVANCE).state == DONE
    assert plc.block.active == (5,)


def test_an_advance_names_what_the_path_lacks_that_could_go_on() -> None:
    plc, talker = parallel((0.0, 10.0), (0.0, 60.0), (0.0, 60.0), (0.0, 60.0), (0.0, 60.0))
    drop(talker, 4, 1 << 3)
    drop(talker, 5, 1)
    plc.step()
    refusal = talker.ask(SequenceCommand.ADVANCE)
    assert (refusal.state, refusal.reason, refusal.detail) == (REJECTED, SequenceReason.MISSING, 4 * 16 + 3)


class Unconfirmed:
    pending, refused = True, 0


def test_an_advance_is_refused_while_a_command_of_the_step_is_not_confirmed() -> None:
    plc, talker = taught()
    talker.ask(SequenceCommand.SINGLE_ON)
    talker.ask(SequenceCommand.START)
    run(plc, 1.2)
    plc.orders._given[1] = Unconfirmed()
    refusal = talker.ask(SequenceCommand.ADVANCE)
    assert (refusal.state, refusal.reason) == (REJECTED, SequenceReason.WRONG_STATE)
    plc.orders._given.clear()
    assert talker.ask(SequenceCommand.ADVANCE).state == DONE


def test_a_start_that_is_refused_says_which_permissive_is_missing() -> None:
    plc, talker = taught()
    drop(talker, 1, 0b100100)
    answer = talker.ask(SequenceCommand.START)
    assert (answer.state, answer.reason, answer.detail) == (REJECTED, SequenceReason.MISSING, 16 + 2)
    drop(talker, 0, 1 << 15)
    answer = talker.ask(SequenceCommand.START)
    assert (answer.reason, answer.detail) == (SequenceReason.MISSING, 15)
    assert word(plc, 1) == SequenceState.IDLE


def refused(talker: Talker, *asked: int) -> Answer:
    answer = talker.ask(*asked)
    assert answer.state == REJECTED
    return answer


def test_every_refusal() -> None:
    _, talker = taught()
    seen = {
        refused(talker, 99).reason,
        refused(talker, SequenceCommand.ABORT).reason,
        refused(talker, SequenceCommand.RESUME).reason,
        refused(talker, SequenceCommand.ADVANCE).reason,
        refused(talker, SequenceCommand.SET_TIMES, 4, real(1.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 0, real(1.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(-1.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(5.0), real(2.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(5.0), real(40000.0)).reason,
        refused(talker, SequenceCommand.SET_TIMES, 1, real(float("nan")), real(2.0)).reason,
        refused(talker, SequenceCommand.FORCE, 4, 0, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 16, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 15, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 0, 0, real(5.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 0, real(0.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 0, real(28801.0)).reason,
        refused(talker, SequenceCommand.FORCE, 1, 0, real(float("nan"))).reason,
        refused(talker, SequenceCommand.RELEASE, 1, 0).reason,
        refused(talker, SequenceCommand.RELEASE, 9, 0).reason,
        refused(talker, SequenceCommand.RELEASE, 1, 16).reason,
    }
    talker.ask(SequenceCommand.START)
    seen |= {
        refused(talker, SequenceCommand.START).reason,
        refused(talker, SequenceCommand.ACKNOWLEDGE).reason,
        refused(talker, SequenceCommand.SET_TIMES, 2, real(1.0), real(2.0)).reason,
    }
    talker.ask(SequenceCommand.ABORT)
    seen |= {refused(talker, SequenceCommand.START).reason}
    talker.ask(SequenceCommand.ACKNOWLEDGE)
    drop(talker, 1, 1)
    seen |= {refused(talker, SequenceCommand.START).reason}
    for place in range(FORCE_ROWS):
        at, which = divmod(place, 14)
        assert talker.ask(SequenceCommand.FORCE, 1 + at, which, real(100.0)).state == DONE
    seen |= {refused(talker, SequenceCommand.FORCE, 3, 14, real(5.0)).reason}
    assert talker.ask(SequenceCommand.FORCE, 1, 0, real(200.0)).state == DONE, "one that is there can be made longer"
    assert seen == set(SequenceReason) - {
        SequenceReason.MACHINE,
        SequenceReason.RECIPE,
        SequenceReason.OF_RECIPE,
    }, "MACHINE: see the coupling below; the others: test_recipe.py"


def test_a_machine_that_is_not_in_automatic_refuses_the_start() -> None:
    line = Line()
    line.machine.ask(coil_car.CoilCarCommand.MANUAL)
    assert "machine_manual" in flags(line.plc) and "start_possible" not in flags(line.plc)
    assert line.sequence.ask(SequenceCommand.START).reason == SequenceReason.MACHINE


def test_times_are_locked_while_it_runs_and_an_override_is_told() -> None:
    plc, talker = taught()
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(2.0), real(4.0)).state == DONE
    two = step_row(plc, 2)
    assert (f32(two, 8), f32(two, 10)) == (2.0, 4.0)
    talker.ask(SequenceCommand.START)
    talker.events()
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(1.0), real(3.0)).reason == SequenceReason.LOCKED
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(1.0), real(3.0), 1).state == DONE
    (event,) = (event for event in talker.events() if event.code == SequenceDeviceEvent.TIMES_CHANGED)
    assert event.source == 2 and event.value == 3.0
    assert real_of(event.snapshot[4] << 16 | event.snapshot[5]) == 1.0
    assert talker.ask(SequenceCommand.SUSPEND).state == DONE
    assert talker.ask(SequenceCommand.SET_TIMES, 2, real(1.0), real(5.0)).reason == SequenceReason.LOCKED


def test_a_bit_that_nobody_names_cannot_be_forced() -> None:
    line = Line()
    assert line.sequence.ask(SequenceCommand.FORCE, 2, 9, real(5.0)).reason == SequenceReason.NO_SUCH_BIT
    assert line.sequence.ask(SequenceCommand.FORCE, 2, 1, real(5.0)).reason == SequenceReason.FORBIDDEN
    assert line.sequence.ask(SequenceCommand.FORCE, 0, 1, real(5.0)).reason == SequenceReason.FORBIDDEN
    assert line.sequence.ask(SequenceCommand.FORCE, 2, 0, real(5.0)).state == DONE
