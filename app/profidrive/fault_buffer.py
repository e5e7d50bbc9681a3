"""The fault buffer of a PROFIdrive drive as its parameters hold it: the present fault situation and the acknowledged ones, with times.

r0945 (number), r0948 (received), r0949 (value), r2109 (removed), r2130 and r2136 (days of both) have 8 situations of 8 faults, index 0 the
present situation [M]. Times are milliseconds of the drive's runtime; that p0969 is this runtime now is unconfirmed [G].
"""

from collections.abc import Sequence
from dataclasses import dataclass

SITUATIONS, PLACES = 8, 8

Column = Sequence[float]
"""One parameter, empty when the drive does not have it."""


@dataclass(frozen=True, slots=True)
class Moment:
    """A time as the drive tells it."""

    day: int
    millisecond: int
    """Of the drive's runtime."""
    age: int | None = None
    """Before the runtime was read [ms]; None = it cannot be told, as before a power-up or where the drive counts days."""


@dataclass(frozen=True, slots=True)
class Message:
    """A fault or an alarm."""

    number: int
    """Without its F or A."""
    value: float | None
    received: Moment | None
    removed: Moment | None
    """None = it stands, or the drive does not tell."""


@dataclass(frozen=True, slots=True)
class Columns:
    """What was read, each parameter from its first element on."""

    numbers: Column
    received: Column = ()
    removed: Column = ()
    values: Column = ()
    received_days: Column = ()
    removed_days: Column = ()


def situations(columns: Columns, runtime: int | None) -> list[list[Message]]:
    """The faults of each situation, the present one first; places without a fault are left out.

    `runtime` of the drive now [ms], None = not known. Situations stand from the latest to the oldest: where a time is later than in a newer
    one, the runtime has begun anew in between, so no older time has an age.
    """
    found: list[list[Message]] = []
    latest = runtime
    for begin in range(0, min(len(columns.numbers), SITUATIONS * PLACES), PLACES):
        messages = _messages(columns, range(begin, min(begin + PLACES, len(columns.numbers))), runtime, latest)
        told = [one.received for one in messages if one.received is not None]
        if any(one.age is None for one in told):
            latest = None
        elif told:
            latest = min(one.millisecond for one in told)
        found.append(messages)
    return found


def alarms(columns: Columns, runtime: int | None) -> list[Message]:
    """Those that are there (the first 8 places)."""
    return _messages(columns, range(min(len(columns.numbers), PLACES)), runtime, runtime)


def _messages(columns: Columns, places: range, runtime: int | None, latest: int | None) -> list[Message]:
    found = []
    for place in places:
        if not (number := int(columns.numbers[place])):
            continue
        value = columns.values[place] if place < len(columns.values) else None
        received = _moment(columns.received, columns.received_days, place, runtime, latest)
        known = runtime if received is not None and received.age is not None else None
        removed = _moment(columns.removed, columns.removed_days, place, known, known)
        found.append(Message(number, value, received, removed))
    return found


def _moment(times: Column, days: Column, place: int, runtime: int | None, latest: int | None) -> Moment | None:
    """The time at `place`; None where there is none (0). Its age only up to `latest` [ms]."""
    time = int(times[place]) if place < len(times) else 0
    day = int(days[place]) if place < len(days) else 0
    if not time and not day:
        return None
    known = runtime is not None and latest is not None and not day and time <= latest
    return Moment(day, time, runtime - time if known and runtime is not None else None)
