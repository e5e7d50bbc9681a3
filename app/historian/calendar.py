"""Rows of a roll-up and shifts, by the clock of the plant. Pure.

Both nights on which the clock changes count: what spans one is an hour shorter or longer, and everything after it begins when the clock on
the wall says so.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from zoneinfo import ZoneInfo

from app.clock import to_datetime, to_micros

DAY = 86_400
"""[s]"""
HOUR = 3600
MINUTES = 1440
"""Of a day on the wall."""


def intervals(begin: int, end: int, seconds: int, zone: ZoneInfo) -> Iterator[tuple[int, int]]:
    """The intervals from `begin` to `end` [µs UTC], the first and the last cut to the range.

    What divides a day, or is a number of days, begins at its times of the local day: rows of 6 h at 0, 6, 12 and 18 o'clock. One that
    spans a clock change is so much shorter or longer, and of rows up to an hour there are more or fewer. Anything else counts from `begin`.
    """
    return _cut(begin, end, _borders(begin, seconds, zone))


def shifts(begin: int, end: int, begins: Sequence[int], zone: ZoneInfo) -> Iterator[tuple[int, int]]:
    """The shifts from `begin` to `end` [µs UTC], the first and the last cut to the range; `begins` are minutes of the local day."""
    return _cut(begin, end, _shifts(begin, begins, zone))


class Shifts:
    """In which shift a time lies."""

    def __init__(self, begins: Sequence[int], zone: ZoneInfo) -> None:
        """`begins` are minutes of the local day, at least one."""
        self._begins, self._zone = begins, zone
        self._span = (0, 0)

    def of(self, time: int) -> int:
        """When the shift of `time` began [µs UTC]; the last one is remembered."""
        if not self._span[0] <= time < self._span[1]:
            self._span = next(span for span in _shifts(time, self._begins, self._zone) if span[1] > time)
        return self._span[0]


def number(begin: int, begins: Sequence[int], zone: ZoneInfo) -> int:
    """Which shift of the day one is that begins at, or lasts at, `begin` [µs UTC]: 1 is the first that `begins` names."""
    start = to_datetime(Shifts(begins, zone).of(begin)).astimezone(zone)
    said = sorted(begins)
    place = (
        bisect_right(said, start.hour * 60 + start.minute) - 1
    )  # later than said where the clock skipped its beginning
    return begins.index(said[place]) + 1


def days_before(time: int, days: int, zone: ZoneInfo) -> int:
    """When the clock on the wall said the same so many days before `time`, or, where it skipped that, jumped over it [µs UTC]."""
    local = to_datetime(time).astimezone(zone).replace(tzinfo=None, fold=0)
    return utc(local - timedelta(days=days), zone)


def _cut(begin: int, end: int, spans: Iterator[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    for start, stop in spans:
        if start >= end:
            return
        if stop > max(start, begin):
            yield max(start, begin), min(stop, end)


def _shifts(begin: int, begins: Sequence[int], zone: ZoneInfo) -> Iterator[tuple[int, int]]:
    """Shifts without end, from one that began before `begin`."""
    day = _midnight(begin, zone) - timedelta(days=2)
    last: int | None = None
    while True:
        for minute in sorted(begins):
            start = utc(day + timedelta(minutes=minute), zone)
            if last is not None and start > last:  # a shift may lie in the hour that is left out: there is none
                yield last, start
            last = start
        day += timedelta(days=1)


def _borders(begin: int, seconds: int, zone: ZoneInfo) -> Iterator[tuple[int, int]]:
    step = seconds * 1_000_000
    if DAY % seconds and seconds % DAY:
        while True:
            yield begin, begin + step
            begin += step
    day = _midnight(begin, zone)
    while True:
        following = day + timedelta(days=max(1, seconds // DAY))
        start, midnight = utc(day, zone), utc(following, zone)
        if seconds >= DAY:
            yield start, midnight
        elif midnight - start == DAY * 1_000_000:
            while start < midnight:
                yield start, start + step
                start += step
        else:
            local = [day + timedelta(seconds=at) for at in range(0, DAY, seconds)]
            found = {utc(one, zone) for one in local}
            if seconds <= HOUR:  # the hour that comes twice has its rows twice
                found |= {
                    second for one in local if (second := to_micros(one.replace(tzinfo=zone, fold=1))) > utc(one, zone)
                }
            ordered = [*sorted(time for time in found if time < midnight), midnight]
            yield from pairwise(ordered)
        day = following


def _midnight(time: int, zone: ZoneInfo) -> datetime:
    return to_datetime(time).astimezone(zone).replace(hour=0, minute=0, second=0, microsecond=0, tzinfo=None, fold=0)


def utc(local: datetime, zone: ZoneInfo) -> int:
    """When the clock on the wall first says `local` or, where it skips that, when it jumps over it [µs UTC]."""
    first = to_micros(local.replace(tzinfo=zone, fold=0))
    second = to_micros(local.replace(tzinfo=zone, fold=1))
    if second >= first:
        return first
    low, high = second // 1_000_000, first // 1_000_000  # it jumps between the two
    before = _offset(low, zone)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if _offset(middle, zone) == before else (low, middle)
    return high * 1_000_000


def _offset(seconds: int, zone: ZoneInfo) -> timedelta | None:
    return to_datetime(seconds * 1_000_000).astimezone(zone).utcoffset()
