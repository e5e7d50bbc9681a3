"""Rows and shifts by the clock on the wall, over both nights on which it changes, in several time zones."""

from datetime import datetime
from itertools import pairwise
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.clock import to_datetime, to_micros
from app.historian.calendar import Shifts, intervals, number, shifts, utc

HOUR = 3_600_000_000
THREE = (360, 840, 1320)
ZAGREB, NEW_YORK, LORD_HOWE = "Europe/Zagreb", "America/New_York", "Australia/Lord_Howe"
NIGHTS = [
    (ZAGREB, datetime(2026, 3, 29), 23),
    (ZAGREB, datetime(2026, 10, 25), 25),
    (NEW_YORK, datetime(2026, 3, 8), 23),
    (NEW_YORK, datetime(2026, 11, 1), 25),
    (LORD_HOWE, datetime(2026, 10, 4), 23.5),
    (LORD_HOWE, datetime(2026, 4, 5), 24.5),
]


def test_a_day_that_a_zone_left_out_has_no_row() -> None:
    """Samoa went from 29 to 31 December 2011."""
    apia = ZoneInfo("Pacific/Apia")
    begin, end = (to_micros(datetime(2011, 12, day, tzinfo=apia)) for day in (28, 31))
    end += 24 * HOUR
    for seconds in (86_400, 21_600, 3600):
        spans = list(intervals(begin, end, seconds, apia))
        assert all(first < last for first, last in spans) and sum(lengths(spans)) == 72
    assert all(first < last for first, last in shifts(begin, end, THREE, apia))


def day_of(zone: str, day: datetime) -> tuple[int, int]:
    """The local day."""
    begin = to_micros(day.replace(tzinfo=ZoneInfo(zone)))
    return begin, to_micros(day.replace(day=day.day + 1, tzinfo=ZoneInfo(zone)))


def told(spans: list[tuple[int, int]], zone: str) -> list[str]:
    return [f"{to_datetime(begin).astimezone(ZoneInfo(zone)):%H:%M%z}" for begin, _ in spans]


def lengths(spans: list[tuple[int, int]]) -> list[float]:
    return [(end - begin) / HOUR for begin, end in spans]


@pytest.mark.parametrize(("zone", "day", "hours"), NIGHTS)
@pytest.mark.parametrize("step", [2, 3, 4, 6, 8, 12, 24])
def test_long_rows_begin_at_their_times_of_the_day_and_one_of_them_is_longer_or_shorter(
    zone: str, day: datetime, hours: float, step: int
) -> None:
    begin, end = day_of(zone, day)
    spans = list(intervals(begin, end, step * 3600, ZoneInfo(zone)))
    assert sum(lengths(spans)) == hours
    jump = lengths(spans)
    odd = [length for length in jump if length != step]
    assert len(odd) == 1 and odd[0] == step + hours - 24
    assert all(a[1] == b[0] for a, b in pairwise(spans))
    if step >= 4:
        assert [one[:5] for one in told(spans, zone)] == [f"{hour:02d}:00" for hour in range(0, 24, step)]


@pytest.mark.parametrize(("zone", "day", "hours"), NIGHTS[:4])
@pytest.mark.parametrize("seconds", [900, 1800, 3600])
def test_the_hour_that_comes_twice_has_its_rows_twice_and_the_one_left_out_has_none(
    zone: str, day: datetime, hours: int, seconds: int
) -> None:
    begin, end = day_of(zone, day)
    spans = list(intervals(begin, end, seconds, ZoneInfo(zone)))
    assert len(spans) == hours * 3600 // seconds == len(set(told(spans, zone)))
    assert set(lengths(spans)) == {seconds / 3600}


@pytest.mark.parametrize(
    ("zone", "day", "night", "names"),
    [
        (ZAGREB, datetime(2026, 3, 28), 7, ["22:00+0100", "06:00+0200", "14:00+0200"]),
        (ZAGREB, datetime(2026, 10, 24), 9, ["22:00+0200", "06:00+0100", "14:00+0100"]),
        (NEW_YORK, datetime(2026, 3, 7), 7, ["22:00-0500", "06:00-0400", "14:00-0400"]),
        (NEW_YORK, datetime(2026, 10, 31), 9, ["22:00-0400", "06:00-0500", "14:00-0500"]),
    ],
)
def test_the_night_shift_is_an_hour_shorter_or_longer_and_the_next_begins_on_time(
    zone: str, day: datetime, night: int, names: list[str]
) -> None:
    begin = to_micros(day.replace(hour=22, tzinfo=ZoneInfo(zone)))
    spans = list(shifts(begin, begin + (night + 16) * HOUR, THREE, ZoneInfo(zone)))
    assert lengths(spans) == [night, 8, 8]
    assert told(spans, zone) == names
    assert [number(one, THREE, ZoneInfo(zone)) for one, _ in spans] == [3, 1, 2]


def test_any_times_can_be_said_and_the_first_is_shift_1() -> None:
    zone = ZoneInfo(ZAGREB)
    begin = to_micros(datetime(2026, 6, 1, tzinfo=zone))
    twelve = list(shifts(begin, begin + 24 * HOUR, (1110, 390), zone))
    assert told(twelve, ZAGREB) == ["00:00+0200", "06:30+0200", "18:30+0200"]
    assert [number(one, (1110, 390), zone) for one, _ in twelve] == [1, 2, 1]
    assert lengths(list(shifts(begin, begin + 48 * HOUR, (360,), zone))) == [6, 24, 18]


def test_a_shift_that_would_begin_in_the_hour_left_out_begins_when_the_clock_jumps() -> None:
    zone = ZoneInfo(ZAGREB)
    assert to_datetime(utc(datetime(2026, 3, 29, 2, 30), zone)).isoformat() == "2026-03-29T01:00:00+00:00"
    begin = to_micros(datetime(2026, 3, 29, tzinfo=zone))
    spans = list(shifts(begin, begin + 6 * HOUR, (150, 180), zone))
    assert told(spans, ZAGREB) == ["00:00+0100", "03:00+0200"]
    assert number(spans[1][0], (150, 180), zone) == 2


@given(
    st.sampled_from([ZAGREB, NEW_YORK, LORD_HOWE, "UTC", "Asia/Kathmandu"]),
    st.integers(0, 400 * 24 * 60),
    st.lists(st.integers(0, 1439), min_size=1, max_size=6, unique=True),
)
def test_every_moment_is_in_one_shift(zone: str, minutes: int, begins: list[int]) -> None:
    time = to_micros(datetime(2026, 1, 1, tzinfo=ZoneInfo("UTC"))) + minutes * 60_000_000
    spans = list(shifts(time, time + 50 * HOUR, begins, ZoneInfo(zone)))
    assert spans[0][0] == time and spans[-1][1] == time + 50 * HOUR
    assert all(a[1] == b[0] for a, b in pairwise(spans))
    of = Shifts(begins, ZoneInfo(zone))
    assert of.of(time) <= time
    for begin, _ in spans[1:]:
        assert of.of(begin) == begin
        assert 1 <= number(begin, begins, ZoneInfo(zone)) <= len(begins)
