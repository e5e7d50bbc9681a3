"""The life of a command, and what its feedback makes of it."""

import itertools

import pytest

from app.commands.lifecycle import NEXT, Facts, Progress, ProgressState, advance, judge

ASKED = Progress("1", "m1", "forward", "command.forward", "Ana", ProgressState.REQUESTED, 10)


def test_a_command_goes_from_asked_to_accepted_to_confirmed_with_its_times() -> None:
    accepted = advance(ASKED, ProgressState.ACCEPTED, 20)
    confirmed = advance(accepted, ProgressState.CONFIRMED, 30)
    assert (accepted.accepted, accepted.over) == (20, False)
    assert (confirmed.requested, confirmed.accepted, confirmed.ended, confirmed.text) == (10, 20, 30, "fb.confirmed")


@pytest.mark.parametrize(("first", "then"), list(itertools.product(ProgressState, ProgressState)))
def test_only_what_the_table_names_may_follow(first: ProgressState, then: ProgressState) -> None:
    standing = Progress("1", "m1", "forward", "", "Ana", first, 10)
    if then in NEXT.get(first, ()):
        assert advance(standing, then, 20).state is then
    else:
        with pytest.raises(ValueError, match="does not become"):
            advance(standing, then, 20)


def test_what_is_over_stays_as_it_is() -> None:
    over = advance(ASKED, ProgressState.UNKNOWN, 20, end=True)
    with pytest.raises(ValueError, match="over"):
        advance(over, ProgressState.CONFIRMED, 30)


@pytest.mark.parametrize(
    ("facts", "verdict"),
    [
        (Facts(ProgressState.ACCEPTED, 1, 5, True), ProgressState.CONFIRMED),
        (Facts(ProgressState.ACCEPTED, 1, 5, None), None),
        (Facts(ProgressState.ACCEPTED, 1, 5, False), None),
        (Facts(ProgressState.ACCEPTED, 5, 5, False), ProgressState.UNCONFIRMED),
        (Facts(ProgressState.ACCEPTED, 5, 5, None), ProgressState.UNCONFIRMED),
        (Facts(ProgressState.ACCEPTED, 1, 5, False, fault=True), ProgressState.FAILED),
        (Facts(ProgressState.ACCEPTED, 9, 5, True), ProgressState.CONFIRMED),
        (Facts(ProgressState.UNKNOWN, 1, 5, True, before=False), ProgressState.CONFIRMED),
        (Facts(ProgressState.UNKNOWN, 1, 5, True, before=True), None),
        (Facts(ProgressState.UNKNOWN, 1, 5, True, before=None), None),
        (Facts(ProgressState.UNKNOWN, 5, 5, True, before=True), ProgressState.UNKNOWN),
        (Facts(ProgressState.UNKNOWN, 5, 5, None), ProgressState.UNKNOWN),
        (Facts(ProgressState.UNKNOWN, 5, 5, False), ProgressState.UNCONFIRMED),
    ],
)
def test_the_verdict(facts: Facts, verdict: ProgressState | None) -> None:
    assert judge(facts) is verdict


def test_nothing_but_feedback_ever_confirms() -> None:
    for state, waited, feedback, before, fault in itertools.product(
        (ProgressState.ACCEPTED, ProgressState.UNKNOWN),
        (0, 4.9, 5, 99),
        (False, None),
        (True, False, None),
        (True, False),
    ):
        assert judge(Facts(state, waited, 5, feedback, before, fault)) is not ProgressState.CONFIRMED
