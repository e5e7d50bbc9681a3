"""Conditions in numbers: dead-bands, delays, deviation, rate, and what is not known."""

import pytest

from app.alarms.conditions import BadQuality, Delay, Deviation, Discrete, High, Low, Rate, Reported, condition, inputs
from app.plant.definitions import Alarm
from app.plant.expression import Look, parse
from app.tags.batch import Value
from app.tags.quality import COMM_FAILURE, GOOD, STALE


def look(quality: int = GOOD, **values: Value) -> Look:
    return lambda key: (values.get(key), quality)


def run(condition: High | Low | Deviation, values: list[float]) -> list[bool | None]:
    held: bool = False
    result: list[bool | None] = []
    for value in values:
        truth = condition.holds(look(t=value, r=50.0), held, 0.0)
        held = bool(truth)
        result.append(truth)
    return result


def test_a_high_alarm_raises_at_the_limit_and_returns_below_the_dead_band() -> None:
    assert run(High("t", 70, 1), [69.9, 70.0, 69.5, 69.0, 68.9]) == [False, True, True, True, False]


def test_a_low_alarm_is_its_mirror_image() -> None:
    assert run(Low("t", 70, 1), [70.1, 70.0, 70.5, 71.0, 71.1]) == [False, True, True, True, False]


def test_a_deviation_counts_in_both_directions() -> None:
    assert run(Deviation("t", "r", 5, 1), [54.9, 55, 54.5, 54, 53.9, 45]) == [False, True, True, True, False, True]


def test_a_rate_needs_its_whole_window_before_it_says_anything() -> None:
    rate = Rate("t", 2.0, 1.0)
    assert [rate.holds(look(t=value), False, now) for now, value in enumerate([0.0, 1.0, 4.0, 1.5])] == [
        None,
        False,
        True,
        True,
    ]
    assert rate.holds(look(COMM_FAILURE, t=0.0), False, 4.0) is None
    assert rate.holds(look(t=9.0), False, 5.0) is None, "the jump over the gap is not a rate"


@pytest.mark.parametrize("period", [0.1, 0.25, 1.0])
def test_a_rate_does_not_depend_on_how_often_it_is_asked(period: float) -> None:
    rate = Rate("t", 2.0, 1.0)
    times = [index * period for index in range(int(4 / period))]
    truths = [rate.holds(look(t=2.5 * now), False, now) for now in times]
    assert [truth for now, truth in zip(times, truths, strict=True) if now >= 1.0 + period / 2] == [True] * sum(
        now >= 1.0 + period / 2 for now in times
    )


def test_a_sentence_may_say_in_other_words_when_it_is_over() -> None:
    current = Discrete(parse("current >= 2.5"), parse("current < 2.4"))
    assert [
        current.holds(look(current=value), held, 0)
        for value, held in ((2.5, False), (2.45, True), (2.45, False), (2.3, True))
    ] == [
        True,
        True,
        False,
        False,
    ]


@pytest.mark.parametrize("held", [False, True])
def test_nothing_is_known_of_values_that_are_bad(held: bool) -> None:
    gone = look(COMM_FAILURE, t=99.0, r=0.0)
    for one in (High("t", 70), Low("t", 100), Deviation("t", "r", 1), Discrete(parse("t > 1"), parse("t < 1"))):
        assert one.holds(gone, held, 0.0) is None
    assert High("t", 70).holds(look(t=float("nan")), held, 0.0) is None
    assert High("t", 70).holds(look(STALE, t=99.0), held, 0.0) is True, "an old value is still a value"


def test_bad_quality_is_a_condition_that_is_always_known() -> None:
    assert BadQuality("t").holds(look(COMM_FAILURE, t=1.0), False, 0) is True
    assert BadQuality("t").holds(look(t=1.0), True, 0) is False


def test_what_was_told_stands_until_it_is_over() -> None:
    told = Reported(True, parse("status == 0"))
    assert told.holds(look(status=1.0), True, 0) is True
    assert told.holds(look(COMM_FAILURE, status=0.0), True, 0) is True
    assert told.holds(look(status=0.0), True, 0) is False
    assert told.holds(look(status=1.0), False, 0) is False


def test_a_delay_counts_from_when_it_first_was_true() -> None:
    delay = Delay(on=3.0, off=2.0)
    assert delay.step(True, 10.0, 1_000) is None
    assert delay.due == 13.0
    assert delay.step(True, 12.9, 2_000) is None
    change = delay.step(True, 13.0, 3_000)
    assert change is not None
    assert (change.active, change.since, change.at) == (True, 10.0, 1_000)


def test_shorter_than_the_on_delay_is_no_alarm_and_shorter_than_the_off_delay_no_return() -> None:
    delay = Delay(on=3.0, off=2.0)
    assert [delay.step(truth, now, 0) for now, truth in ((0, True), (2.9, False), (3.1, True), (6.0, True))] == [
        None
    ] * 4
    assert delay.step(True, 6.1, 0) is not None
    assert [delay.step(truth, now, 0) for now, truth in ((7, False), (8.9, True), (9, False), (10.9, False))] == [
        None
    ] * 4
    assert delay.step(False, 11.0, 0) is not None


def test_what_is_not_known_ends_a_pending_raise_and_a_pending_return() -> None:
    delay = Delay(on=1.0, off=1.0)
    assert [delay.step(truth, now, 0) for now, truth in ((0, True), (0.5, None), (1.0, True), (1.9, True))] == [
        None
    ] * 4
    assert delay.step(True, 2.0, 0) is not None
    assert [delay.step(truth, now, 0) for now, truth in ((3, False), (3.5, None), (9, None), (9.5, False))] == [
        None
    ] * 4
    assert delay.active


def test_a_row_becomes_the_condition_of_its_kind() -> None:
    high = Alarm("hot", "l", "", 3, kind="high", value="t", limit=70.0, dead_band=1.0)
    assert condition(high) == High("t", 70.0, 1.0)
    assert inputs(high) == {"t"}
    away = Alarm("away", "l", "", 3, kind="deviation", value="t", reference="r", limit=2.0)
    assert condition(away) == Deviation("t", "r", 2.0, 0.0)
    assert inputs(away) == {"t", "r"}
    assert inputs(Alarm("x", "l", "a > b", 3, clear="c < 1")) == {"a", "b", "c"}
    assert isinstance(condition(Alarm("x", "l", "", 3, kind="bad_quality", value="t")), BadQuality)
