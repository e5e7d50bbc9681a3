"""Roll-ups, runs, cutting, and the schema."""

import math
import sqlite3
from bisect import bisect_left
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import Connection, create_engine
from sqlalchemy.dialects import sqlite
from sqlalchemy.schema import CreateTable

from app.historian import store, tables
from app.historian.store import DAY, HOUR, MINUTE, Row
from app.plant.definitions import Kind
from app.tags.quality import COMM_FAILURE, GOOD, NO_DATA, STALE
from tests.historian.brute_force import GAP, RawRow, bucket
from tests.historian.conftest import fill, point

BEGIN = 1_773_036_000_000_000
"""A whole hour [µs UTC]."""

SCHEMA = ";".join(
    str(CreateTable(table).compile(dialect=sqlite.dialect())) for table in tables.point.metadata.sorted_tables
)

values = st.floats(-1e6, 1e6, allow_nan=False).map(lambda v: round(v, 3))
steps = st.one_of(
    st.integers(1, 2_000_000),
    st.integers(1, 3 * MINUTE),
    st.integers(MINUTE, 25 * MINUTE),
    st.sampled_from([MINUTE, HOUR, 630_000_000, 630_000_001]),
)
states = st.sampled_from([GOOD, GOOD, GOOD, STALE, COMM_FAILURE])


@st.composite
def histories(draw: st.DrawFn, longest: int = 40) -> list[RawRow]:
    """Samples from BEGIN on, in order."""
    rows: list[RawRow] = []
    time = BEGIN + draw(st.integers(0, HOUR))
    for step, value, quality in draw(st.lists(st.tuples(steps, values, states), min_size=1, max_size=longest)):
        time += step
        rows.append((time, None if quality & 3 == 2 else value, quality))
    return rows


@contextmanager
def fresh() -> Iterator[Connection]:
    """An empty history in memory."""
    engine = create_engine("sqlite://")
    try:
        with engine.connect() as connection:
            raw = connection.connection.dbapi_connection
            assert isinstance(raw, sqlite3.Connection)
            raw.executescript(SCHEMA)
            yield connection
    finally:
        engine.dispose()


def as_rows(rows: list[RawRow], number: int = 1) -> list[Row]:
    return [(number, t, v, None, q) for t, v, q in rows]


def roll_up_all(connection: Connection, now: int) -> None:
    while not store.roll_up(connection, now):
        pass


def stored(connection: Connection, table: str, number: int = 1) -> dict[int, tuple[object, ...]]:
    return {
        row[0]: tuple(row[1:])
        for row in connection.exec_driver_sql(
            "SELECT t, low, high, first_t, first, last_t, last, last_q, mean, good, held, count, level"
            f" FROM {table} WHERE point = ? ORDER BY t",
            (number,),
        )
    }


def assert_rolled_up(connection: Connection, rows: list[RawRow], now: int, number: int = 1) -> None:
    times = [time for time, _, _ in rows]  # what is older than GAP holds no more
    for table, width in (("minute", MINUTE), ("hour", HOUR)):
        got = stored(connection, table, number)
        begin = rows[0][0] // width * width
        expected = {}
        for start in sorted({row[0] // width * width for row in rows}):
            if start + width <= now // width * width:
                near = slice(bisect_left(times, start - GAP), bisect_left(times, start + width) + 1)
                expected[start] = bucket(rows[near], start, start + width)
        assert got.keys() == expected.keys(), (table, begin)
        for start, want in expected.items():
            assert want is not None
            *exact, mean, good, held, count, level = got[start]
            assert exact == [want.low, want.high, want.first_t, want.first, want.last_t, want.last, want.last_q]
            assert (good, held, count, level) == (want.good, want.held, want.count, want.level), (table, start)
            if want.mean is None:
                assert mean is None
            else:
                assert isinstance(mean, float)
                assert math.isclose(mean, want.mean, rel_tol=1e-9, abs_tol=1e-3)


@pytest.mark.sweep(8)
@settings(max_examples=60, deadline=None)
@given(histories(), histories(), st.integers(0, 3 * HOUR))
def test_roll_ups_are_what_a_recomputation_over_all_rows_gives(
    one: list[RawRow], two: list[RawRow], later: int
) -> None:
    with fresh() as connection:
        fill(connection, as_rows(one) + as_rows(two, 2), point("m1.speed"), point("m2.speed"))
        now = max(one[-1][0], two[-1][0]) + later
        roll_up_all(connection, now)
        assert_rolled_up(connection, one, now, 1)
        assert_rolled_up(connection, two, now, 2)


@pytest.mark.sweep(8)
@settings(max_examples=60, deadline=None)
@given(histories(), st.data())
def test_roll_ups_are_the_same_however_the_rows_came(rows: list[RawRow], data: st.DataObject) -> None:
    """In portions, some late, with roll-ups between, as after an interruption or while the disk was full."""
    with fresh() as connection:
        store.register(connection, [point()])
        left = as_rows(rows)
        now = rows[0][0]
        while left:
            portion = data.draw(st.lists(st.sampled_from(left), min_size=1, unique=True))
            left = [row for row in left if row not in portion]
            now = max(now, *(row[1] for row in portion))
            store.append(connection, sorted(portion), rows[0][0], now)
            store.roll_up(connection, now)
        now += 2 * HOUR
        roll_up_all(connection, now)
        assert_rolled_up(connection, rows, now)


def test_catching_up_is_done_in_bounded_steps() -> None:
    with fresh() as connection:
        rows = [(BEGIN + i * MINUTE, float(i), GOOD) for i in range(3 * 24 * 60)]
        fill(connection, as_rows(rows))
        now = rows[-1][0] + HOUR
        calls = 1
        while not store.roll_up(connection, now):
            calls += 1
        assert calls >= 12
        assert_rolled_up(connection, rows, now)


def test_text_counts_as_good_time_and_has_no_numbers() -> None:
    with fresh() as connection:
        store.register(connection, [point("m1.fault", Kind.TEXT)])
        store.append(
            connection, [(1, BEGIN, None, "none", GOOD), (1, BEGIN + 90_000_000, None, "OC", GOOD)], BEGIN, BEGIN
        )
        roll_up_all(connection, BEGIN + 2 * HOUR)
        (hour,) = stored(connection, "hour").values()
        assert hour[0] is None
        assert hour[7:10] == (None, 90_000_000 + 630_000_000, 90_000_000 + 630_000_000)


def test_a_new_run_closes_what_a_killed_one_left_open() -> None:
    with fresh() as connection:
        fill(
            connection,
            [(1, BEGIN, 5.0, None, GOOD), (2, BEGIN, None, None, COMM_FAILURE)],
            point("m1.speed"),
            point("m1.current"),
            alive=BEGIN + 40_000_000,
        )
        assert store.begin_run(connection, BEGIN + HOUR) == store.Closed(1, ())
        assert store.begin_run(connection, BEGIN + 2 * HOUR) == store.Closed(0, ())
        last = connection.exec_driver_sql("SELECT t, v, q FROM sample WHERE point = 1 ORDER BY t DESC").first()
        assert last is not None
        assert tuple(last) == (BEGIN + 40_000_001, None, NO_DATA)


def test_after_a_clock_that_was_set_back_what_a_killed_run_left_open_is_closed_where_it_ended() -> None:
    """Else its values hold over the time without a server, up to samples of before the clock was set."""
    with fresh() as connection:
        later = BEGIN + HOUR
        fill(connection, [(1, later, 5.0, None, GOOD)], point("m1.speed"), point("m1.current"), alive=later + 2_000_000)
        store.begin_run(connection, BEGIN)  # an hour back
        store.append(connection, [(1, BEGIN, 6.0, None, GOOD), (2, BEGIN, 7.0, None, GOOD)], BEGIN, BEGIN + 9_000_000)
        assert store.begin_run(connection, BEGIN + 60_000_000) == store.Closed(2, (later + 2_000_001,))
        found = connection.exec_driver_sql("SELECT point, t, q FROM sample ORDER BY point, t").all()
        assert [tuple(row) for row in found] == [
            (1, BEGIN, GOOD),
            (1, BEGIN + 9_000_001, NO_DATA),
            (1, later, GOOD),
            (1, later + 2_000_001, NO_DATA),
            (2, BEGIN, GOOD),
            (2, BEGIN + 9_000_001, NO_DATA),
        ]


def test_cutting_removes_whole_hours_and_nothing_younger() -> None:
    with fresh() as connection:
        rows = [(BEGIN + i * 10_000_000, float(i), GOOD) for i in range(3 * 360)]
        fill(connection, as_rows(rows))
        roll_up_all(connection, rows[-1][0] + HOUR)
        removed, done = store.cut(connection, BEGIN + HOUR + HOUR // 2, at_once=100)
        assert (removed, done) == (100, False)
        while not done:
            count, done = store.cut(connection, BEGIN + HOUR + HOUR // 2, at_once=100)
            removed += count
        assert removed == 360
        assert connection.exec_driver_sql("SELECT min(t) FROM sample").scalar() == BEGIN + HOUR
        for table in ("minute", "hour"):
            assert connection.exec_driver_sql(f"SELECT min(t) FROM {table}").scalar() == BEGIN + HOUR


def test_size_knows_the_rate_of_a_day(tmp_path: Path) -> None:
    with fresh() as connection:
        fill(connection, as_rows([(BEGIN, 1.0, GOOD), (BEGIN + HOUR, 2.0, GOOD)]))
        store.note_growth(connection, BEGIN + HOUR, 4096)
        store.note_growth(connection, BEGIN + 2 * HOUR, 8192)
        size = store.size(connection, tmp_path / "history.db", BEGIN + 2 * HOUR)
        assert (size.oldest, size.rows_today, size.grown_today, size.since) == (BEGIN, 2, 12288, BEGIN + HOUR)
        assert size.used > 0
        assert size.free > 0
        assert store.size(connection, tmp_path / "history.db", BEGIN + 3 * DAY).rows_today == 0


@pytest.mark.parametrize("at_once", [1, 3, 1000])
def test_roll_ups_of_many_points_are_each_their_own(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "POINTS_AT_ONCE", at_once)
    rows = {
        number: [(BEGIN + number * 1_000_000 + i * 7_000_000, float(i % (number + 1)), GOOD) for i in range(40)]
        for number in (1, 2, 3, 5, 8, 9, 10)  # numbers have gaps when points were removed
    }
    now = BEGIN + 2 * HOUR
    with fresh() as connection:
        store.register(connection, [point(f"m1.p{number}") for number in range(1, 11)])
        for number in (4, 6, 7):
            connection.exec_driver_sql("DELETE FROM point WHERE id = ?", (number,))
        for number, series in rows.items():
            store.append(connection, as_rows(series, number), BEGIN, now)
        roll_up_all(connection, now)
        for number, series in rows.items():
            assert_rolled_up(connection, series, now, number)
