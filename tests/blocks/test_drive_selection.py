"""Which of two hoist drives works, and how two share the load."""

from itertools import product
from math import nan

import pytest

from app.blocks.drive_selection import DriveSelection, Selection

BOTH_THERE, EVEN = (True, True), (100.0, 100.0)
PAIRS = list(product((False, True), repeat=2))
FIXED = {
    Selection.NONE: (False, False),
    Selection.FIRST: (True, False),
    Selection.SECOND: (False, True),
    Selection.BOTH: (True, True),
}


@pytest.mark.parametrize("available", PAIRS)
@pytest.mark.parametrize("selection", FIXED)
def test_what_is_selected_works_and_may_move_when_all_of_it_is_there(
    selection: Selection, available: tuple[bool, bool]
) -> None:
    selected = DriveSelection().step(selection, EVEN, available)
    active = FIXED[selection]
    assert selected.active == active
    assert selected.permissive is (any(active) and all(a <= b for a, b in zip(active, available, strict=True)))


@pytest.mark.parametrize("selection", Selection)
def test_it_is_chosen_at_standstill_only(selection: Selection) -> None:
    choice = DriveSelection()
    choice.step(Selection.FIRST, EVEN, BOTH_THERE)
    assert choice.step(selection, EVEN, BOTH_THERE, moving=True).active == (True, False)
    assert choice.step(selection, EVEN, BOTH_THERE).active == FIXED.get(selection, (True, False))


@pytest.mark.parametrize(
    ("hours", "available", "second"),
    [
        ((100, 100), BOTH_THERE, False),
        ((109.9, 100), BOTH_THERE, False),
        ((110.1, 100), BOTH_THERE, True),
        ((100, 200), BOTH_THERE, False),
        ((200, 100), (True, False), False),
        ((100, 100), (False, True), True),
    ],
)
def test_by_hours_the_younger_one_works_unless_it_is_not_there(
    hours: tuple[float, float], available: tuple[bool, bool], second: bool
) -> None:
    selected = DriveSelection(balance=10).step(Selection.BY_HOURS, hours, available)
    assert selected.active == (not second, second)


def test_by_hours_it_does_not_change_at_every_move() -> None:
    choice, hours, changes, before = DriveSelection(balance=10), [0.0, 0.0], 0, (True, False)
    for _ in range(1000):
        active = choice.step(Selection.BY_HOURS, (hours[0], hours[1]), BOTH_THERE).active
        changes += active != before
        before = active
        hours[active.index(True)] += 0.5
    assert abs(hours[0] - hours[1]) <= 11 and changes < 60


@pytest.mark.parametrize(
    ("torques", "trim"), [((1.0, 1.0), 0.0), ((1.0, 0.0), 0.01), ((0.0, 1.0), -0.01), ((9.0, -9.0), 0.02)]
)
def test_who_takes_more_is_slowed_down_and_the_other_speeded_up(torques: tuple[float, float], trim: float) -> None:
    choice = DriveSelection(droop=0.02)
    assert choice.step(Selection.BOTH, EVEN, BOTH_THERE, torques).trims == pytest.approx((-trim, trim))
    assert choice.step(Selection.FIRST, EVEN, BOTH_THERE, torques).trims == (0, 0)


@pytest.mark.parametrize("bad", [{"balance": -1.0}, {"droop": nan}, {"balance": float("inf")}])
def test_limits_must_be_numbers(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="a finite number of at least 0 expected"):
        DriveSelection(**bad)


def test_inputs_must_be_finite() -> None:
    with pytest.raises(ValueError, match="finite numbers expected"):
        DriveSelection().step(Selection.FIRST, (nan, 0.0), BOTH_THERE)
