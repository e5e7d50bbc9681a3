"""Whether samples are sealed or not, every question has the same answer."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import Connection

from app.historian import query, sealed, store
from app.historian.aggregate import Aggregate, aggregate
from app.historian.minutes import Minutes
from app.historian.query import Columns
from app.historian.store import DAY, GAP_AFTER, HOUR, MINUTE, Row
from app.plant.definitions import Kind
from app.tags.quality import GOOD, NO_DATA
from tests.historian.brute_force import RawRow
from tests.historian.conftest import fill, point
from tests.historian.test_store import BEGIN, as_rows, assert_rolled_up, fresh, histories, roll_up_all


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of a few samples."""
    monkeypatch.setattr(sealed, "LEAST", 1)
    monkeypatch.setattr(sealed, "MOST", 7)
    monkeypatch.setattr(sealed, "AT_ONCE", 11)


def seal_all(connection: Connection, before: int) -> None:
    at: int | None = 0
    while at is not None:
        at = sealed.seal(connection, before, at)


def samples(connection: Connection, table: str = "sample") -> int:
    of = "count(*)" if table == "sample" else "coalesce(sum(count), 0)"
    return int(connection.exec_driver_sql(f"SELECT {of} FROM {table}").scalar_one())


def answers(connection: Connection, number: int, begin: int, end: int, width: int) -> list[object]:
    """All that one can ask for."""
    return [
        query.columns(connection, number, begin, end, width),
        list(query.raw(connection, number, begin, end, 5)),
        query.page(connection, number, begin, end, 3),
        query.texts(connection, number, begin, end),
        [query.at(connection, number, time) for time in (begin - 1, begin, (begin + end) // 2, end)],
    ]


def close(one: Aggregate, two: Aggregate) -> bool:
    same = (one.low, one.high, one.good, one.count) == (two.low, two.high, two.good, two.count)
    return same and (one.mean or 0.0) == pytest.approx(two.mean or 0.0, rel=1e-9, abs=1e-3)


@pytest.mark.sweep(8)
@settings(max_examples=100, deadline=None)
@given(histories(), histories(), st.data())
def test_every_question_has_the_answer_that_it_had_before(
    rows: list[RawRow], other: list[RawRow], data: st.DataObject
) -> None:
    late = data.draw(st.lists(st.sampled_from(rows), max_size=4, unique=True))
    span = rows[-1][0] - rows[0][0]
    begin = data.draw(st.integers(rows[0][0] - HOUR, rows[-1][0] + HOUR))
    end = begin + data.draw(st.one_of(st.integers(1, span + 2 * HOUR), st.sampled_from([MINUTE, HOUR, 100 * HOUR])))
    width, before = (
        data.draw(st.sampled_from([1, 2, 7, 100, 4000])),
        data.draw(st.integers(rows[0][0], rows[-1][0] + 3 * HOUR)),
    )
    rolled = data.draw(st.sampled_from([rows[0][0], rows[-1][0], rows[-1][0] + 2 * HOUR]))
    found = []
    for packed in (False, True):
        with fresh() as connection:
            early = [row for row in rows if row not in late]
            fill(
                connection, as_rows(early) + as_rows(other, 2), point("m1.speed"), point("m2.speed"), alive=rows[-1][0]
            )
            roll_up_all(connection, rolled)
            if packed:
                seal_all(connection, before)
                assert samples(connection) + samples(connection, "block") == len(early) + len(other)
            store.append(connection, as_rows(late), BEGIN, rows[-1][0])
            if packed and data.draw(st.booleans()):
                seal_all(connection, before)
            if data.draw(st.booleans()) if not found else found[0][2]:
                roll_up_all(connection, rolled)
                again = True
            else:
                again = False
            one = answers(connection, 1, begin, end, width)
            two = [aggregate(connection, number, begin, end) for number in (1, 2)]
            found.append((one, two, again))
            assert query.count(connection, 1, begin, end) == sum(begin <= row[0] < end for row in rows)
            roll_up_all(connection, rows[-1][0] + 2 * HOUR)
            assert_rolled_up(connection, rows, rows[-1][0] + 2 * HOUR)
    assert found[0][0] == found[1][0]
    assert all(close(one, two) for one, two in zip(found[0][1], found[1][1], strict=True))


def test_texts_and_breaks_are_sealed_too() -> None:
    rows: list[Row] = [
        (1, BEGIN + i * MINUTE, None, *((None, NO_DATA) if i % 7 == 3 else (f"stav {i % 5} č", GOOD)))
        for i in range(200)
    ]
    found = []
    for packed in (False, True):
        with fresh() as connection:
            store.register(connection, [point("m1.fault", Kind.TEXT)])
            store.append(connection, rows, BEGIN, rows[-1][1])
            roll_up_all(connection, rows[-1][1])
            if packed:
                seal_all(connection, BEGIN + 3 * HOUR)
                assert samples(connection) == 20
            found.append(
                [
                    answers(connection, 1, begin, begin + 40 * MINUTE, 10)
                    for begin in range(BEGIN, BEGIN + 3 * HOUR, 17 * MINUTE)
                ]
            )
    assert found[0] == found[1]


def test_a_later_sample_of_the_same_time_wins() -> None:
    with fresh() as connection:
        fill(connection, [(1, BEGIN + i * MINUTE, float(i), None, GOOD) for i in range(120)])
        seal_all(connection, BEGIN + 2 * HOUR)
        store.append(connection, [(1, BEGIN + 30 * MINUTE, 77.0, None, GOOD)], BEGIN, BEGIN)
        for _ in range(2):
            assert query.at(connection, 1, BEGIN + 30 * MINUTE) == (BEGIN + 30 * MINUTE, 77.0, GOOD)
            assert [v for _, v, _ in query.raw(connection, 1, BEGIN + 29 * MINUTE, BEGIN + 32 * MINUTE)] == [
                29.0,
                77.0,
                31.0,
            ]
            seal_all(connection, BEGIN + 2 * HOUR)
            assert samples(connection) == 0
        assert samples(connection, "block") == 120


def test_blocks_never_overlap_however_late_samples_come() -> None:
    with fresh() as connection:
        fill(connection, [(1, BEGIN + i * MINUTE, float(i), None, GOOD) for i in range(0, 600, 3)])
        seal_all(connection, BEGIN + 10 * HOUR)
        for first in (1, 2):
            store.append(
                connection, [(1, BEGIN + i * MINUTE, float(i), None, GOOD) for i in range(first, 600, 3)], BEGIN, BEGIN
            )
            seal_all(connection, BEGIN + 10 * HOUR)
        spans = sealed.spans(connection, 1, 0, 2**62)
        assert all(one[0] <= one[1] < two[0] for one, two in pairwise(spans))
        assert [v for _, v, _ in query.raw(connection, 1, 0, 2**62, 50)] == [float(i) for i in range(600)]


def test_few_samples_wait_for_more_but_no_longer_than_a_day(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sealed, "LEAST", 500)
    monkeypatch.setattr(sealed, "MOST", 8000)
    with fresh() as connection:
        fill(connection, [(1, BEGIN + i * 10 * MINUTE, 1.0, None, GOOD) for i in range(300)])
        seal_all(connection, BEGIN + DAY)
        assert samples(connection) == 300
        seal_all(connection, BEGIN + DAY + HOUR)
        assert (samples(connection), samples(connection, "block")) == (150, 150)


def test_cutting_removes_whole_hours_of_what_is_sealed() -> None:
    rows = [(BEGIN + i * 10_000_000, float(i), GOOD) for i in range(3 * 360)]
    with fresh() as connection:
        fill(connection, as_rows(rows))
        roll_up_all(connection, rows[-1][0] + HOUR)
        seal_all(connection, BEGIN + 2 * HOUR)
        removed, done, steps = 0, False, 0
        while not done:
            count, done = store.cut(connection, BEGIN + HOUR + HOUR // 2, at_once=100)
            removed, steps = removed + count, steps + 1
            assert count < 110
        assert (removed, steps) == (360, 4)
        assert query.page(connection, 1, 0, 2**62, 1) == [(BEGIN + HOUR, 360.0, GOOD)]
        assert query.count(connection, 1, 0, 2**62) == 2 * 360
        for table in ("minute", "hour"):
            assert connection.exec_driver_sql(f"SELECT min(t) FROM {table}").scalar() == BEGIN + HOUR


def test_the_oldest_is_found_where_all_is_sealed(tmp_path: object) -> None:
    with fresh() as connection:
        fill(connection, [(1, BEGIN + i * MINUTE, 1.0, None, GOOD) for i in range(50)])
        seal_all(connection, BEGIN + HOUR)
        assert samples(connection) == 0
        assert store._first(connection) == BEGIN


def test_minutes_of_a_clock_that_was_hours_ahead_are_not_written_over() -> None:
    ahead = [(BEGIN + 5 * HOUR + i * 10_000_000, 100.0 + i, GOOD) for i in range(60)]
    again = [(BEGIN + HOUR + i * 30_000_000 + 3, float(i), GOOD) for i in range(600)]
    with fresh() as connection:
        fill(connection, as_rows(ahead))
        roll_up_all(connection, BEGIN + 8 * HOUR)
        seal_all(connection, BEGIN + 8 * HOUR)
        minutes = Minutes(GAP_AFTER)
        for number, row in enumerate(as_rows(again)):
            store.append(connection, [row], BEGIN, row[1], minutes)
            if number % 3 == 0:
                while not store.roll_up(connection, row[1] - store.SETTLED, minutes):
                    pass
        while not store.roll_up(connection, BEGIN + 9 * HOUR, minutes):
            pass
        assert_rolled_up(connection, sorted(ahead + again), BEGIN + 9 * HOUR)


def test_all_can_be_made_rows_again() -> None:
    rows = [(BEGIN + i * MINUTE, float(i), GOOD) for i in range(100)]
    with fresh() as connection:
        fill(connection, as_rows(rows))
        seal_all(connection, BEGIN + 9 * HOUR)
        sealed.unseal_all(connection)
        assert (samples(connection), samples(connection, "block"), sealed.reached(connection)) == (100, 0, 0)


def test_columns_of_what_is_sealed_are_those_of_rows() -> None:
    """With gaps, bad ones and uncertain ones, at every width."""
    rows: list[Row] = [
        (
            1,
            BEGIN + i * 700_000 + (i > 500) * HOUR,
            None if i % 91 == 5 else i % 37 / 10,
            None,
            NO_DATA if i % 91 == 5 else i % 13 == 0,
        )
        for i in range(3000)
    ]
    found: list[list[Columns]] = []
    for packed in (False, True):
        with fresh() as connection:
            fill(connection, rows)
            if packed:
                seal_all(connection, BEGIN + HOUR)
            found.append(
                [query.columns(connection, 1, BEGIN - 5, BEGIN + 2 * HOUR, width) for width in (1, 3, 50, 999, 4000)]
            )
    assert found[0] == found[1]
