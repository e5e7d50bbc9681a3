"""The life of a command, and what its feedback makes of it."""

import itertools

import pytest

from app.commands.lifecycle import NEXT, Facts, Progress, State, advance, judge

ASKED = Progress("1", "m1", "forward", "command.forward", "Ana", State.REQUESTED, 10)


def test_a_command_goes_from_asked_to_accepted_to_confirmed_with_its_times() -> None:
    accepted = advance(ASKED, State.ACCEPTED, 20)
    confirmed = advance(accepted, State.CONFIRMED, 30)
    assert (accepted.accepted, accepted.over) == (20, False)
    assert (confirmed.requested, confirmed.accepted, confirmed.ended, confirmed.text) == (10, 20, 30, "fb.confirmed")


@pytest.mark.parametrize(("first", "then"), list(itertools.product(State, State)))
def test_only_what_the_table_names_may_follow(first: State, then: State) -> None:
    standing = Progress("1", "m1", "forward", "", "Ana", first, 10)
    if then in NEXT.get(first, ()):
        assert advance(standing, then, 20).state is then
    else:
        with pytest.raises(ValueError, match="does not become"):
            advance(standing, then, 20)


def test_what_is_over_stays_as_it_is() -> None:
    over = advance(ASKED, State.UNKNOWN, 20, end=True)
    with pytest.raises(ValueError, match="over"):
        advance(over, State.CONFIRMED, 30)


@pytest.mark.parametrize(
    ("facts", "verdict"),
    [
        (Facts(State.ACCEPTED, 1, 5, True), State.CONFIRMED),
        (Facts(State.ACCEPTED, 1, 5, None), None),
        (Facts(State.ACCEPTED, 1, 5, False), None),
        (Facts(State.ACCEPTED, 5, 5, False), State.UNCONFIRMED),
        (Facts(State.ACCEPTED, 5, 5, None), State.UNCONFIRMED),
        (Facts(State.ACCEPTED, 1, 5, False, fault=True), State.FAILED),
        (Facts(State.ACCEPTED, 9, 5, True), State.CONFIRMED),
        (Facts(State.UNKNOWN, 1, 5, True, before=False), State.CONFIRMED),
        (Facts(State.UNKNOWN, 1, 5, True, before=True), None),
        (Facts(State.UNKNOWN, 1, 5, True, before=None), None),
        (Facts(State.UNKNOWN, 5, 5, True, before=True), State.UNKNOWN),
        (Facts(State.UNKNOWN, 5, 5, None), State.UNKNOWN),
        (Facts(State.UNKNOWN, 5, 5, False), State.UNCONFIRMED),
    ],
)
def test_the_verdict(facts: Facts, verdict: State | None) -> None:
    assert judge(facts) is verdict


def test_nothing_but_feedback_ever_confirms() -> None:
    for state, waited, feedback, before, fault in itertools.product(
        (State.ACCEPTED, State.UNKNOWN), (0, 4.9, 5, 99), (False, None), (True, False, None), (True, False)
    ):
        assert judge(Facts(state, waited, 5, feedback, before, fault)) is not State.CONFIRMED
