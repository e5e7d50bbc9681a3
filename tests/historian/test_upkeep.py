"""What is stored is rolled up, packed, and cut by age and quota."""

import logging

import pytest

from app.db import Database
from app.historian import store
from app.historian.age import Age
from app.historian.recorder import Recorder
from app.historian.store import DAY, HOUR
from tests.historian.conftest import Source, point
from tests.historian.recording import recording, rows_of


async def test_roll_ups_are_made_while_it_runs(history: Database) -> None:
    source, made = await recording(history, point())
    for second in range(600):
        source.publish(m1_speed=second)
        source.clock.advance(1)
    await made.flush()
    await made.upkeep.look_after()
    assert history.run(lambda c: c.exec_driver_sql("SELECT sum(count) FROM minute").scalar()) >= 540
    assert made.upkeep.size is not None
    assert made.upkeep.size.rows_today == len(rows_of(history))


@pytest.mark.sweep(8)
async def test_hours_that_are_over_are_packed_and_say_what_they_said(history: Database) -> None:
    source, made = await recording(history, point())
    for second in range(5 * 3600):
        source.publish(m1_speed=second * 7919 % 1000)
        source.clock.advance(1)
        if second % 600 == 599:
            await made.flush()
    before, used = rows_of(history), history.run(store.used)
    await made.upkeep.look_after()
    await made.upkeep.look_after()
    assert rows_of(history) == before
    stored = history.run(lambda connection: connection.exec_driver_sql("SELECT count(*), min(t) FROM sample").one())
    assert stored[0] < 0.65 * len(before)
    assert stored[1] > source.clock.micros() - 3 * HOUR
    assert history.run(store.used) < 0.7 * used
    assert made.upkeep.growth is None or made.upkeep.growth < 0.7 * 24 / 5 * used


@pytest.mark.sweep(8)
async def test_history_above_its_quota_is_cut_oldest_first(history: Database) -> None:
    source, made = await recording(history, point())
    made.upkeep.quota = 400_000
    for second in range(30_000):
        source.publish(m1_speed=second)
        source.clock.advance(1)
    await made.flush()
    newest = rows_of(history)[-1]
    await made.upkeep.look_after()
    await made.upkeep.look_after()
    rows = rows_of(history)
    assert made.upkeep.size is not None
    assert made.upkeep.size.used <= made.upkeep.quota
    assert rows[-1] == newest
    assert 5_000 < len(rows) < 30_000


async def test_history_older_than_it_is_kept_is_cut(history: Database) -> None:
    source, made = await recording(history, point())
    made.upkeep.keep_days = 2
    for hour in range(24 * 4):
        source.publish(m1_speed=hour)
        source.clock.advance(3600)
    await made.flush()
    await made.upkeep.look_after()
    age = source.clock.micros() - rows_of(history)[0][0]
    assert 2 * DAY <= age < 2 * DAY + store.HOUR * 2


# ---- a clock that leapt ----------------------------------------------------------------------------------

YEAR = 365 * 86_400


async def four_days(history: Database) -> tuple[Source, Recorder]:
    """A history of four days, as long as it is kept, looked after once."""
    source, made = await recording(history, point())
    made.upkeep.keep_days = 4
    for hour in range(24 * 4):
        source.publish(m1_speed=hour)
        source.clock.advance(3600)
    await made.flush()
    await made.upkeep.look_after()
    return source, made


async def minutes(source: Source, made: Recorder, count: int) -> None:
    for _ in range(count):
        source.publish(m1_speed=source.clock.micros() % 1000)
        source.clock.advance(60)
        await made.flush()
        await made.upkeep.look_after()


@pytest.mark.sweep(8)
async def test_a_clock_that_leaps_by_years_and_is_set_right_costs_no_history(
    history: Database, caplog: pytest.LogCaptureFixture
) -> None:
    source, made = await four_days(history)
    before = rows_of(history)
    source.clock.step_wall(YEAR)
    with caplog.at_level(logging.ERROR):
        await minutes(source, made, 3)
    assert [record.message for record in caplog.records] == [
        "history not cut by this clock: it leapt days=365; it is believed when it runs so for a day"
    ]
    assert made.upkeep.clock_leapt
    source.clock.step_wall(-YEAR)
    await minutes(source, made, 3)
    assert set(before) <= set(rows_of(history))
    assert not made.upkeep.clock_leapt


@pytest.mark.sweep(8)
async def test_a_clock_that_comes_up_years_behind_and_is_set_right_after_a_restart_is_no_leap(
    history: Database,
) -> None:
    source, made = await four_days(history)
    before = rows_of(history)
    source.clock.step_wall(-10 * YEAR)
    await made.close()
    for _ in range(2):
        made = Recorder(source.tags, history, source.clock, keep_days=4, quota=1 << 30)
        await made.configure(source.points)
        await minutes(source, made, 3)
        assert not made.upkeep.clock_leapt
        source.clock.step_wall(10 * YEAR)
        await minutes(source, made, 3)
        assert not made.upkeep.clock_leapt
        source.clock.step_wall(-10 * YEAR)
        await made.close()
    assert set(before) <= set(rows_of(history))


@pytest.mark.sweep(8)
async def test_a_leap_is_no_truer_after_a_restart_nor_takes_the_quota_more_than_it_needs(history: Database) -> None:
    source, made = await four_days(history)
    before = rows_of(history)
    source.clock.step_wall(YEAR)
    await made.close()
    for _ in range(2):
        made = Recorder(source.tags, history, source.clock, keep_days=4, quota=1 << 30)
        await made.configure(source.points)
        await minutes(source, made, 2)
        await made.close()
    assert set(before) <= set(rows_of(history))
    made.upkeep.quota = round(history.run(store.used) * 0.97)
    await made.upkeep.look_after()
    assert len(set(before) & set(rows_of(history))) > 0.6 * len(before)


@pytest.mark.parametrize(
    ("age", "passed", "now", "expected"),
    [
        (Age(0), 60, 60, Age(60)),
        (Age(0), 60, -600, Age(-600, 0, 60)),  # set back
        (Age(-600, 0, 60), 60, -500, Age(-500, 0, 120, 60)),  # and so for a while
        (Age(-500, 0, 120, 60), 60, 180 + 40, Age(220)),  # and set right
        (Age(-500, 0, 120, 60), 60, 180 + 41, Age(-440, 60, 180, 120)),  # or further
        (Age(-500, 0, 120, 86_340), 60, 180, Age(-440, 60)),  # after a day that is a leap
        (Age(0), 60, 60 + 40, Age(100)),  # a tenth of what is kept
        (Age(0), 60, 60 + 41, Age(60, 60)),
        (Age(60, 60), 60, 160, Age(160)),  # set right
        (Age(60, 60), 60, 9999, Age(120, 120)),
        (Age(0, 86_340), 60, 9999, Age(9999)),  # a day over
    ],
)
def test_by_which_time_it_ages(age: Age, passed: int, now: int, expected: Age) -> None:
    second = 1_000_000
    keep = 400 / 86_400
    age, expected = (
        Age(one.time * second, one.leapt * second, one.before * second, one.since * second) for one in (age, expected)
    )
    assert age.after(passed * second, now * second, keep) == expected
