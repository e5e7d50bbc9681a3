"""Runs of a sequence: why one ended, what fell first and when, and whose an event is that is not what it seems."""

import pytest

from app.equipment.sequence.records import CAUSES, POWER_UP, force_number, run_belongs, run_detail
from app.plant import types
from app.records import fold
from app.records.fold import Machine
from app.records.kind import Belongs
from app.records.record import Reading, Record
from tests.records.shelf import MemoryShelf

SEQUENCE = types.read_type("sequence", [])[0].type
RUN, FORCE = SEQUENCE.records["run"], SEQUENCE.records["force"]
CODES = {key: code for code, key in SEQUENCE.events.items()}
SECOND = 1_000_000
Told = tuple[str, int, float, int | None]
"""Key, source, value, bit."""


def reading(number: int, told: Told) -> Reading:
    key, source, value, bit = told
    return Reading(
        1, number, number * SECOND, CODES[key], key, source, value, {"bit": bit, "signal": 75.0, "together": 1}
    )


def run(*told: Told) -> Record:
    """The one run of these events, a second apart."""
    shelf = MemoryShelf()
    for number, one in enumerate((("started", 0, 1.0, None), *told), 1):
        fold.take(Machine((RUN,)), shelf, reading(number, one))
    (found,) = shelf.records
    return found


@pytest.mark.parametrize("cause", range(1, len(CAUSES)))
def test_an_abort_says_why(cause: int) -> None:
    assert run(("aborted", 2, float(cause), None)).fields["cause"] == CAUSES[cause]


@pytest.mark.parametrize("cause", [-1.0, 0.0, float(len(CAUSES))])
def test_a_cause_that_nobody_knows_is_none(cause: float) -> None:
    assert run(("aborted", 2, cause, None)).fields["cause"] is None


@pytest.mark.parametrize(
    ("told", "fell"),
    [
        ([("permissive_lost", 2, 75.0, 3)], 2 * SECOND),
        (
            [("permissive_lost", 2, 75.0, 3), ("permissive_back", 2, 80.0, 3), ("permissive_lost", 2, 75.0, 3)],
            4 * SECOND,
        ),
        ([("permissive_lost", 2, 75.0, 3), ("permissive_back", 2, 80.0, 3)], None),
        ([("permissive_lost", 2, 75.0, 4)], None),
        ([("permissive_lost", 1, 75.0, 3)], None),
    ],
)
def test_what_fell_first_is_what_the_end_names_and_has_the_time_of_its_last_fall(
    told: list[Told], fell: int | None
) -> None:
    found = run(*told, ("aborted", 2, 2.0, 3)).fields
    assert (found["first_step"], found["first_bit"], found["first_time"]) == (2, 3, fell)


def test_a_power_up_names_nothing_that_fell() -> None:
    found = run(("permissive_lost", 2, 75.0, 3), ("aborted", 2, float(POWER_UP), 3)).fields
    assert found["cause"] == "power_up" and found.get("first_bit") is None


@pytest.mark.parametrize(
    ("outcome", "cause", "acknowledged", "event", "belongs"),
    [
        ("aborted", "operator", None, ("acknowledged", 0, 0.0, None), Belongs.HERE),
        ("timed_out", "time", None, ("acknowledged", 0, 0.0, None), Belongs.HERE),
        ("aborted", "operator", 5, ("acknowledged", 0, 0.0, None), None),
        ("done", None, None, ("acknowledged", 0, 0.0, None), None),
        ("aborted", "power_up", None, ("aborted", 2, float(POWER_UP), None), Belongs.HERE),
        ("aborted", "operator", None, ("aborted", 2, float(POWER_UP), None), None),
    ],
)
def test_after_its_end_a_run_takes_only_what_is_its_own(
    outcome: str, cause: str | None, acknowledged: int | None, event: Told, belongs: Belongs | None
) -> None:
    latest = run(("aborted", 2, 3.0, None))
    latest.outcome = outcome
    latest.fields |= {"cause": cause, "acknowledged": acknowledged}
    assert run_belongs(latest, reading(9, event)) is belongs
    assert run_belongs(None, reading(9, event)) is None


@pytest.mark.parametrize(
    ("missed", "step", "belongs"), [(0, 2, None), (3, 2, Belongs.UNSEEN), (3, 3, Belongs.UNSEEN), (3, 4, None)]
)
def test_a_step_that_lies_behind_is_of_another_run_only_when_events_were_lost(
    missed: int, step: int, belongs: Belongs | None
) -> None:
    latest = run(("step_entered", 3, 0.0, None))
    latest.missed = missed
    latest.fields["step"] = 3
    assert run_belongs(latest, reading(9, ("step_entered", step, 0.0, None))) is belongs


def test_a_force_has_the_number_of_its_permissive() -> None:
    assert force_number(reading(1, ("forced", 3, 30.0, 5))) == 3 * 16 + 5
    assert force_number(reading(1, ("forced", 3, 30.0, None))) is None
    assert FORCE.hooks.number is force_number


def test_what_fell_is_told_in_order_with_how_long_it_was_away() -> None:
    told: list[Told] = [
        ("permissive_lost", 2, 75.0, 3), ("permissive_lost", 2, 1.0, 4), ("permissive_back", 2, 90.0, 3),
        ("suspended", 2, 0.0, None), ("resumed", 2, 0.0, None), ("aborted", 2, 2.0, 4),
    ]  # fmt: skip
    events = [reading(number, one) for number, one in enumerate(told, 2)]
    found = run_detail(run(*told), events)
    assert [(one["order"], one["bit"], one["away"], one["first"]) for one in found["falls"]] == [
        (1, 3, 2.0, False),
        (2, 4, None, True),
    ]
    assert [(one["time"] // SECOND, one["length"]) for one in found["breaks"]] == [(5, 1.0)]
