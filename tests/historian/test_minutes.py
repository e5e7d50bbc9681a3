"""Minutes that are kept while samples are stored say what a roll-up from samples says."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import Connection, event

from app.historian import store
from app.historian.minutes import SAMPLES, Minutes
from app.historian.store import GAP_AFTER, HOUR, MINUTE, Row
from app.plant.definitions import Kind
from app.tags.quality import COMM_FAILURE, GOOD, STALE
from tests.historian.brute_force import RawRow
from tests.historian.conftest import point
from tests.historian.test_store import BEGIN, as_rows, assert_rolled_up, fresh, histories, roll_up_all, stored


class Told:
    """A history that is written as a recorder does it: in portions, rolled up now and then."""

    def __init__(self, connection: Connection, *names: str) -> None:
        self.connection = connection
        self.minutes = Minutes(GAP_AFTER)
        self.read = 0
        store.register(connection, [point(name) for name in names or ("m1.speed",)])
        event.listen(connection, "before_cursor_execute", self._count)

    def _count(self, connection: Connection, cursor: object, statement: str, *rest: object) -> None:
        self.read += statement == SAMPLES.sql(connection)

    def put(self, rows: list[Row], now: int) -> None:
        store.append(self.connection, rows, BEGIN, now, self.minutes)

    def roll_up(self, now: int) -> None:
        while not store.roll_up(self.connection, now, self.minutes):
            pass


@pytest.mark.sweep(8)
@settings(max_examples=80, deadline=None)
@given(histories(), histories(), st.data())
def test_they_are_what_a_recomputation_over_all_rows_gives(
    one: list[RawRow], two: list[RawRow], data: st.DataObject
) -> None:
    """In portions, some late, rolled up between, forgotten now and then as by a server that was killed."""
    with fresh() as connection:
        told = Told(connection, "m1.speed", "m2.speed")
        left = sorted(as_rows(one) + as_rows(two, 2), key=lambda row: row[1])
        now = left[0][1]
        while left:
            size, late = data.draw(st.integers(1, 12)), data.draw(st.integers(0, 9))
            portion = left[:size]
            if late == 0:
                portion = portion[::2]
            left = [row for row in left if row not in portion]
            now = max(now, portion[-1][1] + data.draw(st.integers(0, 2 * MINUTE)))
            told.put(portion, now)
            if data.draw(st.booleans()):
                told.roll_up(now - data.draw(st.sampled_from([0, store.SETTLED, 3 * MINUTE])))
            if data.draw(st.integers(0, 9)) == 0:
                told.minutes = Minutes(GAP_AFTER)
            if data.draw(st.integers(0, 9)) == 0:  # the same once more
                told.put(portion, now)
        now += 2 * HOUR
        told.roll_up(now)
        assert_rolled_up(connection, one, now, 1)
        assert_rolled_up(connection, two, now, 2)


def test_samples_are_not_read_back_once_the_minutes_are_known() -> None:
    with fresh() as connection:
        told = Told(connection)
        rows = [(BEGIN + i * 1_000_000, float(i % 7), GOOD) for i in range(3600)]
        for index in range(0, len(rows), 30):
            told.put(as_rows(rows[index : index + 30]), rows[index][0] + 30_000_000)
            if index % 60 == 30:
                told.roll_up(rows[index][0] + 30_000_000 - store.SETTLED)
            if index == 300:
                assert told.read
                told.read = 0
        assert told.read == 0
        told.roll_up(BEGIN + HOUR + MINUTE)
        assert told.read == 0
        assert_rolled_up(connection, rows, BEGIN + HOUR + MINUTE)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("late", [1, 30, 119, 3599])
def test_a_late_sample_is_counted_in_its_minute(late: int) -> None:
    """One of a quiet point, of the minute that was written already, is written at once; what is in no order is read back."""
    rows = [(BEGIN + i * 1_000_000, 1.0, GOOD) for i in range(3600)]
    quiet = [(BEGIN + 500_000, 5.0, GOOD), (BEGIN + late * 1_000_000 + 7, 9.0, STALE)]
    with fresh() as connection:
        told = Told(connection, "m1.speed", "m2.speed")
        told.put(as_rows(quiet[:1], 2), quiet[0][0])
        for index in range(0, 3600, 30):
            told.put(as_rows(rows[index : index + 30]), rows[index][0] + 30_000_000)
            told.roll_up(rows[index][0])
        told.put(as_rows(quiet[1:], 2), BEGIN + HOUR)
        told.minutes = Minutes(GAP_AFTER)  # the server is killed
        told.roll_up(BEGIN + 2 * HOUR)
        assert_rolled_up(connection, rows, BEGIN + 2 * HOUR)
        assert_rolled_up(connection, quiet, BEGIN + 2 * HOUR, 2)


def test_samples_of_a_clock_that_was_ahead_are_not_forgotten() -> None:
    rows = [(BEGIN + HOUR + i * 10_000_000, float(i), GOOD) for i in range(30)]
    again = [(BEGIN + MINUTE + i * 10_000_000 + 3, float(i), GOOD) for i in range(600)]
    with fresh() as connection:
        told = Told(connection)
        told.put(as_rows(rows), rows[-1][0])
        told.roll_up(rows[-1][0])
        told.minutes = Minutes(GAP_AFTER)
        for index in range(0, 600, 6):
            told.put(as_rows(again[index : index + 6]), again[index][0])
            told.roll_up(again[index][0] - store.SETTLED)
        told.roll_up(BEGIN + 4 * HOUR)
        assert_rolled_up(connection, sorted(rows + again), BEGIN + 4 * HOUR)


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_a_portion_that_was_not_stored_is_not_counted(lost: int) -> None:
    """The disk was full: the transaction is undone, and its rows come again."""
    rows = [(BEGIN + i * 5_000_000, float(i), COMM_FAILURE if i % 11 == 3 else GOOD) for i in range(240)]
    raw = [(t, None if q & 3 == 2 else v, q) for t, v, q in rows]
    with fresh() as connection:
        told = Told(connection)
        connection.commit()
        for number, index in enumerate(range(0, 240, 24)):
            portion = as_rows(raw[index : index + 24])
            if number % 4 == lost:
                told.put(portion, portion[-1][1])
                connection.rollback()
            told.put(portion, portion[-1][1])
            connection.commit()
            told.roll_up(portion[-1][1] - store.SETTLED)
            connection.commit()
        told.roll_up(BEGIN + 2 * HOUR)
        assert_rolled_up(connection, raw, BEGIN + 2 * HOUR)


def test_text_counts_as_good_time_and_has_no_numbers() -> None:
    texts: list[Row] = [(1, BEGIN + i * 90_000_000, None, "none" if i % 2 else "OC", GOOD) for i in range(50)]
    found = []
    for told in (Minutes(GAP_AFTER), None):
        with fresh() as connection:
            store.register(connection, [point("m1.fault", Kind.TEXT)])
            for row in texts:
                store.append(connection, [row], BEGIN, row[1], told)
                store.roll_up(connection, row[1], told)
            roll_up_all(connection, BEGIN + 3 * HOUR)
            found.append((stored(connection, "minute"), stored(connection, "hour")))
    assert found[0] == found[1]


def test_a_minute_is_rolled_up_where_nobody_rolls_up_for_long() -> None:
    """What waits is bounded: then it is read back."""
    rows = [(BEGIN + i * MINUTE, float(i), GOOD) for i in range(200)]
    with fresh() as connection:
        told = Told(connection)
        for row in as_rows(rows):
            told.put([row], row[1])
        assert len(told.minutes._done) <= 21
        told.roll_up(rows[-1][0] + HOUR)
        assert_rolled_up(connection, rows, rows[-1][0] + HOUR)
