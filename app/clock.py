"""Time: a monotonic clock for delays and leases, integer µs UTC for records."""

import time
from datetime import UTC, datetime, timedelta
from typing import Protocol
from zoneinfo import ZoneInfo

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
FIRST, LAST = -62_135_510_400_000_000, 253_402_128_000_000_000
"""The years 1 to 9999 without a day at both ends, so that every zone has them: 0001-01-02, 9999-12-30 [µs UTC]."""


class Clock(Protocol):
    """What code asks for the time."""

    def micros(self) -> int:
        """Wall clock [µs since 1970 UTC], for records."""
        ...

    def monotonic(self) -> float:
        """Never steps back [s, arbitrary zero], for delays, ages and leases."""
        ...


class SystemClock:
    """The clock of this machine."""

    def micros(self) -> int:
        """Wall clock [µs since 1970 UTC]."""
        return time.time_ns() // 1000

    def monotonic(self) -> float:
        """Seconds that never step back."""
        return time.monotonic()


class ManualClock:
    """A clock that stands still until a test moves it."""

    def __init__(self, start: datetime = datetime(2026, 3, 9, 6, 5, tzinfo=UTC)) -> None:
        self._micros = to_micros(start)
        self._elapsed = 1_000_000_000
        """Monotonic [µs]: whole ones, so that many small advances add up exactly."""

    def micros(self) -> int:
        """Wall clock [µs since 1970 UTC]."""
        return self._micros

    def monotonic(self) -> float:
        """Seconds that never step back."""
        return self._elapsed / 1e6

    def advance(self, seconds: float) -> None:
        """Let `seconds` pass on both clocks, to the µs."""
        passed = round(seconds * 1e6)
        self._micros += passed
        self._elapsed += passed

    def step_wall(self, seconds: float) -> None:
        """Set the wall clock forward or back, as time synchronisation does; the monotonic clock does not see it."""
        self._micros += round(seconds * 1e6)


def to_micros(moment: datetime) -> int:
    """`moment` (aware) as µs since 1970 UTC, exact.

    Raises:
        ValueError: `moment` has no time zone.
    """
    if moment.tzinfo is None:
        raise ValueError(f"a time needs a zone, {moment!r} has none")
    return (moment - EPOCH) // timedelta(microseconds=1)


def is_moment(micros: int) -> bool:
    """Whether `micros` [since 1970 UTC] is a time that a calendar has in every zone; what a device says need not be one."""
    return FIRST <= micros < LAST


def to_datetime(micros: int) -> datetime:
    """µs since 1970 UTC as an aware UTC datetime, exact."""
    return EPOCH + timedelta(microseconds=micros)


def local_day(micros: int, zone: ZoneInfo) -> tuple[int, int]:
    """Beginning and end of the day of `micros` in `zone` [µs UTC]: midnight to midnight, 23 to 25 hours."""
    date = to_datetime(micros).astimezone(zone).date()
    begin, end = (datetime(day.year, day.month, day.day, tzinfo=zone) for day in (date, date + timedelta(days=1)))
    return to_micros(begin), to_micros(end)
