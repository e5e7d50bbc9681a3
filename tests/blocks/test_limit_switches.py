"""Limit switches: slow-down, stop, switches that do not answer, acknowledgement only after moving away."""

import math
from itertools import product

import pytest

from app.blocks.limit_switches import Allowed, End, LimitAlarm, LimitSwitches, Switches, SwitchPlaces

PLACES = SwitchPlaces(0.0, 1000.0, 9000.0, 10000.0, 100.0, 20.0)
OFF = Switches()
FREE = Allowed(math.inf, math.inf, True)


def at(block: LimitSwitches, end: End, hit: Switches, position: float | None, acknowledge: bool = False) -> Allowed:
    """One scan with the other end free; positions counted as at the high end."""
    if position is not None and end is End.LOW:
        position = 10000.0 - position
    low, high = (hit, OFF) if end is End.LOW else (OFF, hit)
    return block.step(low, high, position, acknowledge=acknowledge)


def towards(end: End, allowed: Allowed) -> tuple[float, float]:
    """Allowed (towards this end, away from it)."""
    return (allowed.high, allowed.low) if end is End.HIGH else (allowed.low, allowed.high)


CASES = [
    (OFF, 5000.0, math.inf, set()),
    (OFF, 9000.0, math.inf, set()),
    (OFF, 9100.0, math.inf, set()),
    (OFF, 9100.1, 0.0, {LimitAlarm.SLOW_FAILED}),
    (Switches(slow=True), 9000.0, 20.0, set()),
    (Switches(slow=True), 10100.0, 20.0, set()),
    (Switches(slow=True), 10100.1, 0.0, {LimitAlarm.STOP_FAILED}),
    (OFF, 10100.1, 0.0, {LimitAlarm.SLOW_FAILED, LimitAlarm.STOP_FAILED}),
    (Switches(slow=True, stop=True), 10000.0, 0.0, {LimitAlarm.STOP_HIT}),
    (Switches(slow=False, stop=True), 10000.0, 0.0, {LimitAlarm.STOP_HIT, LimitAlarm.SLOW_FAILED}),
    (Switches(slow=True), 8900.0, 20.0, set()),
    (Switches(slow=True), 8899.0, 20.0, {LimitAlarm.SWITCH_STUCK}),
    (Switches(stop=True), 5000.0, 0.0, {LimitAlarm.STOP_HIT, LimitAlarm.SWITCH_STUCK}),
    (OFF, None, 20.0, set()),
    (OFF, math.nan, 20.0, set()),
    (Switches(slow=True), None, 20.0, set()),
    (Switches(slow=True, stop=True), None, 0.0, {LimitAlarm.STOP_HIT}),
]


@pytest.mark.parametrize("end", End)
@pytest.mark.parametrize(("hit", "position", "speed", "alarms"), CASES)
def test_what_is_allowed_towards_an_end_and_never_less_away_from_it(
    end: End, hit: Switches, position: float | None, speed: float, alarms: set[LimitAlarm]
) -> None:
    block = LimitSwitches(PLACES)
    toward, away = towards(end, at(block, end, hit, position))
    assert toward == speed
    assert away == (20.0 if position is None or math.isnan(position) else math.inf)
    assert block.alarms[end] == alarms and not block.alarms[End(-end)]
    assert {alarm for _, alarm in block.active} == alarms


@pytest.mark.parametrize("end", End)
@pytest.mark.parametrize(("hit", "position"), [(case[0], case[1]) for case in CASES if case[3] and case[1] is not None])
def test_an_alarm_is_acknowledged_only_after_moving_away(end: End, hit: Switches, position: float) -> None:
    block = LimitSwitches(PLACES)
    at(block, end, hit, position)
    standing = set(block.alarms[end])
    for _ in range(3):
        at(block, end, hit, position, acknowledge=True)
        assert block.alarms[end] == standing, "still there"
    toward, away = towards(end, at(block, end, OFF, 5000.0))
    assert toward == (20.0 if standing == {LimitAlarm.SWITCH_STUCK} else 0.0) and away == math.inf, (
        "away, not acknowledged"
    )
    assert at(block, end, OFF, 5000.0, acknowledge=True) == FREE
    assert not block.active


def test_an_acknowledgement_that_is_held_while_moving_away_does_not_count() -> None:
    block = LimitSwitches(PLACES)
    for position in (10000.0, 9500.0, 5000.0, 5000.0):
        at(block, End.HIGH, Switches(position > 9000, position >= 10000), position, acknowledge=True)
    assert block.active
    at(block, End.HIGH, OFF, 5000.0)
    at(block, End.HIGH, OFF, 5000.0, acknowledge=True)
    assert not block.active


def test_speed_is_cut_towards_the_end_only() -> None:
    allowed = Allowed(low=20.0, high=0.0, healthy=True)
    assert [allowed.limit(speed) for speed in (-100.0, -5.0, 0.0, 5.0)] == [-20.0, -5.0, 0.0, 0.0]


@pytest.mark.parametrize(("low", "high"), list(product([OFF, Switches(True, True)], repeat=2)))
def test_both_ends_are_watched_at_once(low: Switches, high: Switches) -> None:
    allowed = LimitSwitches(PLACES).step(low, high, 5000.0)
    assert (allowed.low == 0.0, allowed.high == 0.0) == (low.stop, high.stop)


@pytest.mark.parametrize(
    "bad",
    [
        (1000.0, 0.0, 2.0, 3.0, 1.0, 1.0),
        (0.0, 1.0, 2.0, math.nan, 1.0, 1.0),
        (0.0, 1.0, 2.0, 3.0, 0.0, 1.0),
        (0.0, 1.0, 2.0, 3.0, 1.0, -1.0),
    ],
)
def test_places_must_rise_and_be_numbers(bad: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="expected"):
        SwitchPlaces(*bad)
