"""What is stored is rolled up, packed, and cut by age and quota."""

from app.db import Database
from app.historian import store
from app.historian.store import DAY, HOUR
from tests.historian.conftest import point
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
