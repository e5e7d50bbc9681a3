"""The figures against days that are counted by hand, and the floods against the engine that tells them live."""

import random
from collections import Counter

import pytest

from app.alarms.annunciations import Annunciations
from app.alarms.statistics import BUCKET, DAY, HOUR, MINUTE, SECOND, Figures, Step, figures, floods, measures, top_share
from app.clock import ManualClock

BEGIN = 1_760_000_000 * SECOND


def raised(at: float, alarm: str = "m1.hot", occurrence: int = 1, priority: int = 4) -> Step:
    """`at` [s] after the beginning."""
    return Step(BEGIN + round(at * SECOND), "RAISED", alarm, occurrence, priority, "B", True)


def then(at: float, event: str, after: str, alarm: str = "m1.hot", occurrence: int = 1) -> Step:
    return Step(BEGIN + round(at * SECOND), event, alarm, occurrence, 4, after, asks=False)


def day(*steps: Step, positions: int = 1, days: int = 1) -> Figures:
    return figures(steps, {}, BEGIN, BEGIN + days * DAY, positions)


def judged(found: Figures) -> dict[str, tuple[float | None, str]]:
    return {one.key: (None if one.value is None else round(one.value, 2), one.verdict) for one in measures(found)}


def test_an_even_day_of_150_alarms_is_just_above_its_target() -> None:
    found = day(*(raised(at * 576.0, f"m1.a{at}", at) for at in range(150)))
    said = judged(found)
    assert (found.total, said["ten"], said["hour"]) == (150, (1.04, "manageable"), (6.25, "manageable"))
    assert (said["busy"], said["flooded"], found.floods) == ((0.0, "good"), (0.0, "good"), [])


def test_thirty_in_one_bucket_are_one_flood_and_one_bucket_of_144() -> None:
    found = day(*(raised(3600 + at * 10.0, f"m1.a{at}", at) for at in range(30)))
    assert judged(found)["busy"] == (0.69, "good")
    (flood,) = found.floods
    assert (flood.begin, flood.alarms, flood.peak, flood.goes_on) == (BEGIN + 3690 * SECOND, 30, 30, False)
    assert flood.end == BEGIN + (3600 + 250 + 600) * SECOND, "the fifth newest leaves the last 10 min"
    assert judged(found)["peak_ten"] == (30.0, "action") and judged(found)["peak_minute"] == (6.0, "action")


def test_three_people_answer_three_times_as_many() -> None:
    alarms = [raised(at * 10.0, f"m1.a{at}", at) for at in range(29)]
    assert day(*alarms).floods and not day(*alarms, positions=3).floods
    assert judged(day(*alarms, positions=3))["peak_ten"] == (9.67, "good")


@pytest.mark.parametrize("seed", range(5))
def test_floods_are_those_that_the_engine_tells_while_they_come(seed: int) -> None:
    chance = random.Random(seed)
    clock = ManualClock()
    live = Annunciations(clock)
    begin, at = clock.micros(), 0
    times, told = [], []
    for second in range(4 * 3600):
        if chance.random() < (0.05 if second // 1800 % 2 else 0.004):
            times.append(begin + at * SECOND)
            live.add()
            told.append(live.flood)
        clock.advance(1.0)
        at += 1
        live.judge()
    found = floods(times, begin + at * SECOND)
    assert any(told) and not all(told)
    for time, flood in zip(times, told, strict=True):
        assert flood is any(one.begin <= time <= one.end for one in found), time - begin


def test_a_flood_that_goes_on_ends_with_the_period() -> None:
    times = [BEGIN + at * SECOND for at in range(12)]
    (flood,) = floods(times, BEGIN + MINUTE)
    assert (flood.end, flood.goes_on) == (BEGIN + MINUTE, True)


def test_the_top_ten_are_those_that_counting_finds() -> None:
    chance = random.Random(7)
    names = [f"m1.a{chance.randrange(40)}" for _ in range(500)]
    found = day(*(raised(at * 60.0, name, at) for at, name in enumerate(names)))
    best = Counter(names)
    assert dict(found.by_alarm) == best
    assert top_share(found) == pytest.approx(100 * sum(n for _, n in best.most_common(10)) / 500)


def test_the_top_ten_are_judged_only_where_they_could_be_good() -> None:
    few = day(*(raised(at * 60.0, f"m1.a{at % 12}", at) for at in range(240)))
    many = day(*(raised(at * 60.0, f"m1.a{at % 240}", at) for at in range(480)))
    assert judged(few)["top"] == (83.33, "none")
    assert judged(many)["top"] == (4.17, "manageable")


def test_chattering_is_three_in_a_minute_and_each_counts_once() -> None:
    steps = []
    for at in (0, 20, 40, 59, 200, 300, 400, 460, 519):
        steps += [raised(at, occurrence=at), then(at + 1, "ACK", "C", occurrence=at), then(at + 2, "RTN", "A")]
    assert day(*steps).chattering == {"m1.hot": 4}
    assert day(*steps[9:]).chattering == {}, "two in a minute are not"
    assert judged(day(*steps))["chattering"] == (1.0, "action")


def test_fleeting_cleared_at_once_and_nobody_did_anything() -> None:
    quick = [raised(0), then(9.9, "RTN", "D")]
    assert day(*quick).fleeting == {"m1.hot": 1}
    assert day(raised(0), then(3, "ACK", "C"), then(5, "RTN", "A")).fleeting == {}
    assert day(raised(0), then(10, "RTN", "D")).fleeting == {}


def test_standing_is_longer_than_a_day_also_from_before_and_shelving_ends_it() -> None:
    end = BEGIN + 7 * DAY
    old = {"m1.old": BEGIN - DAY, "m1.gone": BEGIN - HOUR}
    steps = [
        then(60, "RTN", "A", "m1.gone"),
        raised(0, "m1.exact", 2), then(86_400, "RTN", "D", "m1.exact", 2), then(86_401, "ACK", "A", "m1.exact", 2),
        raised(3600, "m1.aside", 3), then(4000, "SHELVED", "G", "m1.aside", 3),
    ]  # fmt: skip
    found = figures(steps, old, BEGIN, end)
    assert [(run.alarm, run.end - run.begin, run.goes_on) for run in found.standing] == [
        ("m1.old", 8 * DAY, True),
        ("m1.exact", DAY + SECOND, False),
    ]
    assert found.most_standing == 2 and judged(found)["standing"] == (2.0, "good")


def test_five_that_stand_at_once_are_too_many() -> None:
    found = figures([], {f"m1.a{n}": BEGIN - 2 * DAY for n in range(5)}, BEGIN, BEGIN + HOUR)
    assert judged(found)["standing"] == (5.0, "action")


def test_time_to_acknowledge_by_priority_and_what_nobody_acknowledged() -> None:
    steps = [raised(at, f"m1.a{at}", at, 1) for at in (0, 100, 200, 300)]
    steps += [then(at + wait, "ACK", "C", f"m1.a{at}", at) for at, wait in ((0, 10), (100, 61), (200, 90))]
    found = day(*sorted(steps))
    assert (found.delays[1].asked, found.delays[1].acknowledged) == (4, 3)
    assert found.delays[1].median == 61 and found.delays[1].ninth == pytest.approx(84.2)
    assert judged(found)["acknowledge"] == (61.0, "action")
    assert found.delays[2].median is None


def test_the_distribution_of_priorities_is_judged_from_medium_upwards() -> None:
    priorities = [4] * 80 + [3] * 15 + [2] * 4 + [1] * 1
    found = day(*(raised(at * 600.0, f"m1.a{at}", at, one) for at, one in enumerate(priorities)))
    said = judged(found)
    assert [said[f"share_{one}"] for one in (3, 2, 1)] == [(15.0, "good"), (4.0, "good"), (1.0, "good")]
    worse = day(*(raised(at * 600.0, f"m1.a{at}", at, 2) for at in range(10)))
    assert judged(worse)["share_2"] == (100.0, "action")


def test_a_calm_time_has_figures_and_what_cannot_be_measured_is_not_judged() -> None:
    said = judged(day())
    assert said["hour"] == (0.0, "good") and said["top"] == said["acknowledge"] == said["share_1"] == (None, "none")


def test_buckets_hold_every_alarm_and_the_last_may_be_short() -> None:
    end = BEGIN + 2 * BUCKET + MINUTE
    found = figures([raised(0), raised(599.9), raised(600), raised(1259)], {}, BEGIN, end)
    assert found.buckets == [2, 1, 1]


@pytest.mark.parametrize(("end", "positions"), [(BEGIN, 1), (BEGIN - 1, 1), (BEGIN + DAY, 0)])
def test_no_time_and_nobody_are_refused(end: int, positions: int) -> None:
    with pytest.raises(ValueError, match="statistics take a time"):
        figures([], {}, BEGIN, end, positions)


def test_a_clock_that_is_set_back_makes_no_alarm_chatter_nor_fleeting() -> None:
    """Raised at 2:00, the clock goes back by an hour, then twice within 50 min; what chatters after it still does."""
    steps = [raised(7200), then(3605, "RTN", "D"), raised(4800), raised(6600)]
    assert day(*steps).chattering == {} and day(*steps).fleeting == {}
    bursts = [raised(at) for at in (7200, 7210, 7220, 3700, 3710, 3720)]
    assert day(*bursts).chattering == {"m1.hot": 6}


def test_an_acknowledgement_after_a_clock_was_set_back_was_not_at_once() -> None:
    steps = [raised(7200, priority=1), then(3660, "ACK", "C")]
    found = day(*steps).delays[1]
    assert (found.asked, found.acknowledged, found.median) == (1, 1, None)
    steps += [raised(3700, "m1.b", 2, 1), then(3740, "ACK", "C", "m1.b", 2)]
    found = day(*steps).delays[1]
    assert (found.asked, found.acknowledged, found.median) == (2, 2, 40.0)
