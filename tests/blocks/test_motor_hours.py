"""Running hours with reset, run-on of the fan, choice of two drives by hours."""

import math

import pytest

from app.blocks.drive_selection import DriveSelection, Pair, Selection
from app.blocks.motor_hours import FanRunOn, RunningHours

BOTH = (True, True)


def test_hours_count_while_it_runs_and_a_reset_keeps_what_there_was() -> None:
    hours = RunningHours()
    for n in range(7200):
        hours.step(n % 2 == 0, 1.0)
    assert hours.hours == 1.0
    assert hours.step(False, 1.0, reset=True) == 0.0 and hours.before == 3600.0
    hours.step(True, 1.0, reset=True)
    assert (hours.seconds, hours.before) == (1.0, 3600.0), "held, it resets once"
    still = RunningHours(seconds=5.0)
    assert still.step(False, 1.0, reset=True) == 5 / 3600, "there at the first scan, it is not new"


@pytest.mark.parametrize("dt", [0.01, 0.1, 1.0])
def test_the_fan_runs_with_the_motor_and_on_for_its_time(dt: float) -> None:
    fan = FanRunOn(60.0)
    assert not fan.step(False, dt)
    assert fan.step(True, dt) and fan.left == 60.0
    scans = 0
    while fan.step(False, dt):
        scans += 1
    assert scans * dt == pytest.approx(60.0, abs=1.5 * dt)
    assert FanRunOn(0.0).step(True, dt) and not FanRunOn(0.0).step(False, dt)


@pytest.mark.parametrize(
    ("selection", "available", "active", "permissive"),
    [
        (Selection.NONE, BOTH, (False, False), False),
        (Selection.FIRST, BOTH, (True, False), True),
        (Selection.SECOND, BOTH, (False, True), True),
        (Selection.BOTH, BOTH, (True, True), True),
        (Selection.FIRST, (False, True), (True, False), False),
        (Selection.SECOND, (False, True), (False, True), True),
        (Selection.BOTH, (False, True), (True, True), False),
        (Selection.BY_HOURS, (False, True), (False, True), True),
        (Selection.BY_HOURS, (True, False), (True, False), True),
        (Selection.BY_HOURS, (False, False), (True, False), False),
    ],
)
def test_selection_and_what_it_needs(selection: Selection, available: Pair, active: Pair, permissive: bool) -> None:
    selected = DriveSelection().step(selection, (5.0, 5.0), available)
    assert (selected.active, selected.permissive) == (active, permissive)


def test_by_hours_both_motors_age_alike_and_change_seldom() -> None:
    block, hours, changes, before = DriveSelection(balance=10.0), [100.0, 0.0], 0, (True, False)
    for move in range(4000):
        moving = move % 2 == 1
        active = block.step(Selection.BY_HOURS, (hours[0], hours[1]), BOTH, moving=moving).active
        if active != before:
            assert not moving
            changes, before = changes + 1, active
        if moving:
            hours[active.index(True)] += 0.5
    assert abs(hours[0] - hours[1]) <= 10.5 and 20 < changes < 120


def test_nothing_changes_while_it_moves() -> None:
    block = DriveSelection()
    block.step(Selection.FIRST, (0.0, 0.0), BOTH)
    for selection in Selection:
        assert block.step(selection, (99.0, 0.0), (False, True), moving=True).active == (True, False)
    assert not block.step(Selection.SECOND, (0.0, 0.0), (False, True), moving=True).permissive, "its drive is gone"
    assert block.step(Selection.SECOND, (0.0, 0.0), BOTH).active == (False, True)


def test_two_drives_on_one_drum_share_the_load_by_droop() -> None:
    block, torques = DriveSelection(), [0.9, 0.3]
    for _ in range(2000):
        trims = block.step(Selection.BOTH, (0.0, 0.0), BOTH, (torques[0], torques[1])).trims
        assert trims[0] == -trims[1] and abs(trims[0]) <= 0.02
        for n in (0, 1):
            # torque of a drive follows its speed against the common drum's
            torques[n] += trims[n] * 5.0 * 0.01
    assert torques[0] == pytest.approx(torques[1], abs=0.3) and torques[0] < 0.9
    assert block.step(Selection.FIRST, (0.0, 0.0), BOTH, (0.9, 0.3)).trims == (0.0, 0.0)


def test_what_is_no_number_is_refused() -> None:
    for bad in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="run_on"):
            FanRunOn(bad)
        with pytest.raises(ValueError, match="balance"):
            DriveSelection(balance=bad)
    with pytest.raises(ValueError, match="finite"):
        DriveSelection().step(Selection.BOTH, (math.nan, 0.0), BOTH)
