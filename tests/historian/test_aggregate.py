"""Numbers between two moments, against adding up every microsecond's worth by hand."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.historian.aggregate import Column, aggregate, first_time
from app.historian.store import GAP_AFTER, HOUR, MINUTE
from app.plant.definitions import Kind
from app.tags.quality import COMM_FAILURE, GOOD, STALE
from tests.historian.brute_force import RawRow
from tests.historian.conftest import fill, point
from tests.historian.test_store import BEGIN, as_rows, fresh, histories, roll_up_all


def by_hand(rows: list[RawRow], begin: int, end: int) -> tuple[float | None, float | None, float | None, int]:
    """Low, high, mean, good time: every sample holds until the next one, and no longer than the gap time."""
    low = high = mean = None
    area, good = 0.0, 0
    for i, (time, value, quality) in enumerate(rows):
        until = min(rows[i + 1][0] if i + 1 < len(rows) else end, time + GAP_AFTER, end)
        held = until - max(time, begin)
        if held <= 0 or value is None or quality & 3 == 2:
            continue
        assert isinstance(value, float)
        low = value if low is None else min(low, value)
        high = value if high is None else max(high, value)
        if quality & 3 == 0:
            area += value * held
            good += held
    mean = area / good if good else None
    return low, high, mean, good


def first_by_hand(rows: list[RawRow], begin: int, end: int, value: float) -> int:
    """When `value` first held."""
    for i, (time, held, quality) in enumerate(rows):
        until = min(rows[i + 1][0] if i + 1 < len(rows) else end, time + GAP_AFTER, end)
        if held == value and quality & 3 != 2 and until > max(time, begin):
            return max(time, begin)
    raise AssertionError(f"{value} never held")


@pytest.mark.sweep(8)
@settings(max_examples=120, deadline=None)
@given(histories(), st.integers(-HOUR, 2 * HOUR), st.one_of(st.integers(1, 3 * HOUR), st.just(100 * HOUR)))
def test_low_high_mean_and_good_time_are_those_of_the_samples(rows: list[RawRow], shift: int, length: int) -> None:
    begin = rows[0][0] + shift
    with fresh() as connection:
        fill(connection, as_rows(rows))
        roll_up_all(connection, rows[-1][0] + 2 * HOUR)
        got = aggregate(connection, 1, begin, begin + length)
        extremes: tuple[tuple[Column, float | None], ...] = (("low", got.low), ("high", got.high))
        at: dict[str, tuple[int, int] | None] = {
            column: first_time(connection, 1, begin, begin + length, value, column)
            for column, value in extremes
            if value is not None
        }
    low, high, mean, good = by_hand(rows, begin, begin + length)
    for column, value in (("low", low), ("high", high)):
        if value is not None:
            assert at[column] == (first_by_hand(rows, begin, begin + length, value),) * 2
    assert (got.low, got.high) == (low, high)
    assert got.good == pytest.approx(good, abs=2)
    assert got.mean == (None if mean is None else pytest.approx(mean, rel=1e-6, abs=1e-6))


def test_uncertain_values_count_as_extremes_and_not_as_good_time() -> None:
    rows: list[RawRow] = [(BEGIN, 10.0, GOOD), (BEGIN + MINUTE, 90.0, STALE), (BEGIN + 2 * MINUTE, None, COMM_FAILURE)]
    with fresh() as connection:
        fill(connection, as_rows(rows))
        got = aggregate(connection, 1, BEGIN, BEGIN + 4 * MINUTE)
    assert (got.low, got.high, got.mean, got.good, got.count) == (10.0, 90.0, 10.0, MINUTE, 3)


def test_a_text_has_good_time_and_no_numbers() -> None:
    with fresh() as connection:
        fill(
            connection, [(1, BEGIN, None, "auto", GOOD), (1, BEGIN + MINUTE, None, "hand", GOOD)], point(kind=Kind.TEXT)
        )
        got = aggregate(connection, 1, BEGIN, BEGIN + 2 * MINUTE)
    assert (got.low, got.high, got.mean, got.good) == (None, None, None, 2 * MINUTE)


def test_nothing_recorded_is_nothing_and_an_empty_range_is_refused() -> None:
    with fresh() as connection:
        fill(connection, [])
        got = aggregate(connection, 1, BEGIN, BEGIN + HOUR)
        assert (got.low, got.mean, got.good, got.count) == (None, None, 0, 0)
        with pytest.raises(ValueError, match="must end after it begins"):
            aggregate(connection, 1, BEGIN, BEGIN)


def test_where_only_roll_ups_are_left_an_extreme_was_within_a_minute() -> None:
    rows: list[RawRow] = [(BEGIN + second * 1_000_000, 1.0, GOOD) for second in range(0, 4 * 3600, 10)]
    rows[70] = (rows[70][0], 9.0, GOOD)
    with fresh() as connection:
        fill(connection, as_rows(rows))
        roll_up_all(connection, rows[-1][0] + 2 * HOUR)
        connection.exec_driver_sql("DELETE FROM sample")
        connection.exec_driver_sql("DELETE FROM block")
        minute = rows[70][0] // MINUTE * MINUTE
        assert first_time(connection, 1, BEGIN, BEGIN + 3 * HOUR, 9.0, "high") == (minute, minute + MINUTE)
        assert first_time(connection, 1, BEGIN, BEGIN + 3 * HOUR, 5.0, "high") is None
