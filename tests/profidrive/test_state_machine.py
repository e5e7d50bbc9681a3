"""S1 to S5: every state under every word, and the stories of starting, stopping and faults."""

from itertools import pairwise, product

import pytest

from app.profidrive.state_machine import STOPPING, Inputs, Reaction, State, StateMachine
from app.profidrive.words import ENABLES, RUN, Control, Status

S1, S2, S3, S4, S5A, S5B = State
IGNORED = RUN & ~Control.BY_PLC
NAMES = {"1": S1, "2": S2, "3": S3, "4": S4, "a": S5A, "b": S5B}

TABLE: tuple[tuple[str, str, str], ...] = (
    ("1", "0 and 1_ and 2_ and fine", "2"),
    ("23", "1 or 2 or stopped", "1"),
    ("2", "0_", "3"),
    ("3", "0", "2"),
    ("3", "3_ and magnetised", "4"),
    ("4ab", "1 or off2", "1"),
    ("ab", "(still or 3) and 0 and 2_ and fine", "2"),
    ("ab", "still or 3", "1"),
    ("4ab", "2 or off3", "b"),
    ("4", "0 or off1", "a"),
    ("4", "3", "3"),
    ("a", "0_ and not off1", "4"),
)
"""From, condition, to; the first that holds. `2` = bit 2 of STW1 is 0, `2_` = it is 1. Section 3 of the sheet."""


def by_the_table(state: State, names: dict[str, bool]) -> State:
    for sources, condition, target in TABLE:
        if state in (NAMES[one] for one in sources):
            words = condition.replace("(", "( ").replace(")", " )").split()
            said = " ".join(w if w in ("and", "or", "not", "(", ")") else str(names[w]) for w in words)
            if eval(said):  # the table above, nothing else
                return NAMES[target]
    return state


BITS = [Control.ON, Control.NO_COAST_STOP, Control.NO_QUICK_STOP, Control.ENABLE_OPERATION]


@pytest.mark.parametrize("state", State)
def test_every_state_under_every_word_and_fault_goes_where_the_table_says(state: State) -> None:
    for b0, b1, b2, b3 in product((False, True), repeat=4):
        for still, magnetised, cause in product((False, True), (False, True), (None, *Reaction)):
            word = Control.BY_PLC | sum(bit for bit, on in zip(BITS, (b0, b1, b2, b3), strict=True) if on)
            reaction = cause or Reaction.NONE
            names = {
                **{str(n): not on for n, on in enumerate((b0, b1, b2, b3))},
                **{f"{n}_": on for n, on in enumerate((b0, b1, b2, b3))},
                "fine": cause is None, "stopped": reaction > Reaction.NONE, "magnetised": magnetised, "still": still,
                "off1": reaction is Reaction.OFF1, "off2": reaction is Reaction.OFF2, "off3": reaction is Reaction.OFF3,
            }  # fmt: skip
            expected = by_the_table(state, names)
            machine = StateMachine(state=state)
            assert machine.step(Inputs(word, still, magnetised, cause)) is expected, (word, still, magnetised, cause)
            assert machine.pulses is (expected in {S4, S5A, S5B})
            assert machine.faulted is (cause is not None)


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("word", [0, IGNORED, 0xFFFF & ~Control.BY_PLC])
def test_word_without_control_by_plc_is_ignored_as_a_whole(state: State, word: int) -> None:
    control = {S1: 0, S2: ENABLES, S5A: ENABLES, S5B: ENABLES & ~Control.NO_QUICK_STOP}.get(state, RUN)
    machine = StateMachine(state=state, control=control)
    for _ in range(5):
        assert machine.step(Inputs(word, standstill=False, magnetised=False)) is state
    assert machine.control == control


@pytest.mark.parametrize(
    ("state", "bits"),
    [(S1, (0, 0, 0, 1)), (S2, (1, 0, 0, 0)), (S3, (1, 1, 0, 0)), (S4, (1, 1, 1, 0)), (S5A, (1, 1, 1, 0)), (S5B, (1, 1, 1, 0))],
)  # fmt: skip
def test_status_word_tells_the_state(state: State, bits: tuple[int, ...]) -> None:
    status = StateMachine(state=state).status
    assert tuple(int(bool(status & 1 << n)) for n in (0, 1, 2, 6)) == bits
    other = StateMachine(enabled_while_stopping=False, state=state).status
    assert bool(other & Status.OPERATION_ENABLED) is (state is S4)


def test_starts_by_the_two_words_and_not_by_one() -> None:
    machine = StateMachine()
    assert {machine.step(Inputs(RUN)) for _ in range(5)} == {S1}
    assert [machine.step(Inputs(word)) for word in (ENABLES, RUN, RUN, RUN)] == [S2, S3, S4, S4]


def test_operation_waits_for_the_flux() -> None:
    machine = StateMachine(state=S2, control=ENABLES)
    assert [machine.step(Inputs(RUN, magnetised=False)) for _ in range(3)] == [S3, S3, S3]
    assert not machine.status & Status.OPERATION_ENABLED
    assert machine.step(Inputs(RUN)) is S4


def test_ramp_stop_can_be_taken_back_and_ends_ready() -> None:
    machine = StateMachine(state=S4, control=RUN)
    assert machine.step(Inputs(ENABLES, standstill=False)) is S5A
    assert machine.step(Inputs(RUN, standstill=False)) is S4
    assert [machine.step(Inputs(ENABLES, still)) for still in (False, False, True)] == [S5A, S5A, S2]


def test_quick_stop_goes_on_to_standstill_whatever_is_asked_for_meanwhile() -> None:
    machine = StateMachine(state=S4, control=RUN)
    assert machine.step(Inputs(RUN & ~Control.NO_QUICK_STOP, standstill=False)) is S5B
    assert not machine.status & Status.NO_QUICK_STOP
    assert {machine.step(Inputs(RUN, standstill=False)) for _ in range(3)} == {S5B}
    assert not machine.status & Status.NO_QUICK_STOP
    assert machine.step(Inputs(RUN)) is S1, "ON is still there: OFF is wanted first"
    assert [machine.step(Inputs(word)) for word in (ENABLES, RUN, RUN)] == [S2, S3, S4]


@pytest.mark.parametrize("state", [S4, S5A, S5B])
def test_coast_stop_takes_the_pulses_at_once(state: State) -> None:
    machine = StateMachine(state=state, control=RUN)
    assert machine.step(Inputs(RUN & ~Control.NO_COAST_STOP & ~Control.NO_QUICK_STOP, standstill=False)) is S1
    assert not machine.pulses and not machine.status & Status.NO_COAST_STOP


@pytest.mark.parametrize("reaction", [Reaction.OFF1, Reaction.OFF3, Reaction.OFF2])
def test_fault_stops_and_needs_cause_gone_acknowledgement_and_off(reaction: Reaction) -> None:
    machine = StateMachine(state=S4, control=RUN)
    after = machine.step(Inputs(RUN, standstill=False, cause=reaction))
    assert after is {Reaction.OFF1: S5A, Reaction.OFF3: S5B, Reaction.OFF2: S1}[reaction]
    assert machine.step(Inputs(RUN, standstill=True)) is S1 and machine.status & Status.FAULT
    assert machine.step(Inputs(ENABLES | Control.ACKNOWLEDGE, cause=reaction)) is S1, "the cause is still there"
    assert machine.step(Inputs(ENABLES | Control.ACKNOWLEDGE)) is S1, "no new edge"
    assert machine.step(Inputs(ENABLES)) is S1
    assert machine.step(Inputs(RUN | Control.ACKNOWLEDGE)) is S1 and not machine.faulted
    assert [machine.step(Inputs(word)) for word in (RUN, ENABLES, RUN)] == [S1, S2, S3]


def test_a_fault_that_only_warns_leaves_the_drive_running() -> None:
    machine = StateMachine(state=S4, control=RUN)
    assert machine.step(Inputs(RUN, False, cause=Reaction.NONE)) is S4
    assert machine.status & Status.FAULT


def test_the_stronger_of_two_faults_stays() -> None:
    machine = StateMachine(state=S4, control=RUN)
    machine.step(Inputs(RUN, False, cause=Reaction.OFF1))
    assert machine.step(Inputs(RUN, False, cause=Reaction.OFF2)) is S1
    machine.step(Inputs(RUN, False, cause=Reaction.OFF1))
    assert machine.reaction is Reaction.OFF2


def test_nothing_but_the_way_over_s2_and_s3_gives_pulses() -> None:
    for words in product((ENABLES, RUN, RUN & ~Control.NO_COAST_STOP, IGNORED, 0), repeat=4):
        machine, road = StateMachine(), [S1]
        for word in words:
            road.append(machine.step(Inputs(word, standstill=False)))
        for before, after in pairwise(road):
            assert after not in {S4, *STOPPING} or before in {S3, S4, *STOPPING}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize(
    ("bit", "name"), [(Control.NO_COAST_STOP, "pulses_released"), (Control.NO_QUICK_STOP, "no_emergency_stop")]
)
def test_a_second_source_stops_like_its_bit_in_the_word_and_the_word_cannot_overrule_it(
    state: State, bit: Control, name: str
) -> None:
    for word, still, cause in product(
        (ENABLES, RUN, RUN & ~Control.ENABLE_OPERATION), (False, True), (None, *Reaction)
    ):
        by_word, by_terminal = StateMachine(state=state), StateMachine(state=state)
        inputs = Inputs(word, still, cause=cause)
        assert by_word.step(inputs._replace(control=word & ~bit)) is by_terminal.step(inputs._replace(**{name: False}))
        assert by_word.status == by_terminal.status and not by_terminal.status & bit << 3


def test_a_second_source_acts_while_the_control_is_elsewhere() -> None:
    machine = StateMachine(state=S4, control=RUN)
    assert machine.step(Inputs(IGNORED, standstill=False, no_emergency_stop=False)) is S5B
    assert machine.step(Inputs(IGNORED, standstill=False, pulses_released=False)) is S1
