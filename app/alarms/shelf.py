"""Who put an alarm aside, why and until when: shelves and service. Pure.

Source: reference/alarms.md section 4. The limits are decisions of ours, not figures of the standard.
"""

import json
from dataclasses import asdict, dataclass

DAY = 86_400.0
"""[s]"""
MOST_SHELVED = 20
"""Shelved at once in one area."""
OPERATORS = frozenset({3, 4})
"""Priorities that an operator may shelve; the others ask for an engineer."""
REVIEW = 7 * DAY
"""An alarm that has been out of service for so long is to be looked at again [s]."""
SHORTEST_REASON = 5
"""Letters that a reason has at least."""


@dataclass(frozen=True, slots=True)
class Shelf:
    """An alarm that somebody put aside for a time."""

    since: int
    """[µs UTC]"""
    until: int
    by: str
    reason: str
    once: bool = False
    """It also ends when the alarm returns to normal."""

    def over(self, now: int) -> bool:
        """Whether it has ended at `now` [µs UTC]; by a clock set back it lasts once more as long at most, not until that comes again."""
        return abs(now - self.since) >= self.until - self.since


@dataclass(frozen=True, slots=True)
class Service:
    """An alarm that somebody took out of service."""

    since: int
    """[µs UTC]"""
    by: str
    reason: str
    permit: str = ""
    """Number of the work permit; empty = none was given."""
    reviewed: int = 0
    """When an engineer last confirmed that it stays out [µs UTC]; 0 = never."""

    def review_due(self, now: int) -> bool:
        """Whether somebody is to look at it again at `now` [µs UTC]; also when the clock was set back for longer than that."""
        return abs(now - max(self.since, self.reviewed)) >= REVIEW * 1e6


def packed(shelf: Shelf | None, service: Service | None) -> str:
    """Both as the database keeps them: a JSON object."""
    found = {
        name: asdict(one) for name, one in (("shelf", shelf), ("service", service)) if isinstance(one, Shelf | Service)
    }
    return json.dumps(found, ensure_ascii=False, sort_keys=True)


def unpacked(text: str) -> tuple[Shelf | None, Service | None]:
    """What `packed` made."""
    found = json.loads(text)
    return (
        Shelf(**found["shelf"]) if "shelf" in found else None,
        Service(**found["service"]) if "service" in found else None,
    )
