"""Time: exact conversions, and a manual clock that tells both of its hands apart."""

from datetime import UTC, datetime, timedelta, timezone

import pytest

from app.clock import ManualClock, SystemClock, to_datetime, to_micros

MOMENTS = [
    datetime(1970, 1, 1, tzinfo=UTC),
    datetime(1969, 12, 31, 23, 59, 59, 999999, tzinfo=UTC),
    datetime(2026, 3, 29, 1, 0, 0, 1, tzinfo=UTC),
    datetime(9999, 12, 31, 23, 59, 59, 999999, tzinfo=UTC),
    datetime(2026, 7, 1, 12, tzinfo=timezone(timedelta(hours=-9, minutes=-30))),
]


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_time_goes_there_and_back_to_the_microsecond(moment: datetime) -> None:
    assert to_datetime(to_micros(moment)) == moment
    assert to_datetime(to_micros(moment)).tzinfo is UTC


def test_a_time_without_a_zone_is_none() -> None:
    with pytest.raises(ValueError, match="needs a zone"):
        to_micros(datetime(2026, 1, 1))


def test_many_small_advances_add_up_on_both_hands() -> None:
    clock = ManualClock()
    wall, since = clock.micros(), clock.monotonic()
    for _ in range(10_000):
        clock.advance(0.0001)
    assert (clock.micros() - wall, clock.monotonic() - since) == (1_000_000, 1.0)


@pytest.mark.parametrize("seconds", [-3600.0, 0.000001, 86400.0])
def test_setting_the_wall_clock_is_not_seen_by_the_other_hand(seconds: float) -> None:
    clock = ManualClock()
    wall, since = clock.micros(), clock.monotonic()
    clock.step_wall(seconds)
    assert clock.micros() - wall == round(seconds * 1e6) and clock.monotonic() == since


def test_the_clock_of_the_machine_tells_its_time() -> None:
    clock = SystemClock()
    assert to_datetime(clock.micros()) > datetime(2026, 1, 1, tzinfo=UTC)
    first, second = clock.monotonic(), clock.monotonic()
    assert first <= second
