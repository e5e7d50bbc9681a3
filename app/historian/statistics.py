"""Numbers of points between two moments, as the table below a trend shows them."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from app.historian import query
from app.historian.aggregate import Aggregate, Column, aggregate, first_time
from app.historian.store import GAP_AFTER

RECORDER_SILENT = 15_000_000
"""The recorder tells that it lives more often than so [µs]."""

Held = tuple[float | str | None, int]
"""A value and its quality level: 0 good, 1 uncertain, 2 bad."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """One point in a range; what nobody knows is None."""

    tag: str
    low: float | None
    high: float | None
    low_at: tuple[int, int] | None
    """When the value was first that low, from and to [µs UTC]: the same where a sample tells."""
    high_at: tuple[int, int] | None
    mean: float | None
    """Weighted by time, of what was good."""
    good: float
    """Share of the past part of the range with a good value, 0 to 1."""
    lacking: int
    """Time of it without one [µs]; what the recorder did not see, also when it has stopped since, but not what is still to come."""
    held: tuple[Held | None, ...]
    """What the curve says at each of the moments that were asked for: what held, on a ramp the line; None when nothing was recorded."""


def statistics(
    connection: Connection, names: Sequence[str], begin: int, end: int, now: int, moments: Sequence[int] = ()
) -> list[Numbers]:
    """The numbers of each of `names` from `begin` to `end`, and what held at `moments` [µs UTC]."""
    alive = query.alive(connection)
    # a clock that was ahead had more written, which is still to come
    known = min(end, alive if begin > now else min(alive, now))
    seen = known if now - alive < RECORDER_SILENT else min(end, now)
    length = max(0, seen - begin)
    return [_numbers(connection, name, (begin, known), length, alive, moments) for name in names]


def _numbers(
    connection: Connection, name: str, part: tuple[int, int], length: int, alive: int, moments: Sequence[int]
) -> Numbers:
    """Of the part of the range that is known; `length` of the range is past [µs]. The recorder lived until `alive`."""
    found, numbers = query.find(connection, name), Aggregate()
    begin, known = part
    if found is not None and known > begin:
        numbers = aggregate(connection, found.number, begin, known)

    def first(value: float | None, column: Column) -> tuple[int, int] | None:
        if found is None or value is None:
            return None
        return first_time(connection, found.number, begin, known, value, column)

    good = min(numbers.good, length)
    return Numbers(
        tag=name,
        low=numbers.low,
        high=numbers.high,
        low_at=first(numbers.low, "low"),
        high_at=first(numbers.high, "high"),
        mean=numbers.mean,
        good=good / length if length else 0.0,
        lacking=length - good,
        held=tuple(_held(connection, found.number, at, alive) if found else None for at in moments),
    )


def _held(connection: Connection, number: int, time: int, alive: int) -> Held | None:
    found = query.line_at(connection, number, time)
    if found is None or time - found[0] > GAP_AFTER or time > alive + RECORDER_SILENT:
        return None
    return found[1], found[2] & 3
