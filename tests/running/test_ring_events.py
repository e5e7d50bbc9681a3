"""The way of an event: to the alarms at once, then to the history; the ring may forget what both have."""

from types import SimpleNamespace
from typing import Any

import pytest

from app.errors import StorageError
from app.plant.events import RingPosition
from app.running.ring_events import RingEvents

ITEM: Any = SimpleNamespace(id="c1", alarms=(), type=SimpleNamespace(events={}))


def mark(sequence: int) -> RingPosition:
    return RingPosition(1, sequence, sequence)


class Parts:
    """Alarms and history that note the order in which they are told."""

    def __init__(
        self, journal: RingPosition | None = None, stored: RingPosition | None = None, error: Exception | None = None
    ) -> None:
        self.heard: list[str] = []
        self.error = error
        alarms: Any = SimpleNamespace(
            ring=SimpleNamespace(take=lambda *_: self.heard.append("alarms")),
            journal=SimpleNamespace(
                waiting=False, last_event=lambda _: journal, stored_event=lambda _: journal, settle=None
            ),
        )
        history: Any = SimpleNamespace(take=self._take, last=lambda _: stored)
        self.ring = RingEvents(alarms, history)

    async def _take(self, *_: object) -> None:
        self.heard.append("history")
        if self.error:
            raise self.error


async def test_alarms_hear_of_it_before_anything_is_stored() -> None:
    parts = Parts()
    await parts.ring.take(ITEM, [], 0)
    assert parts.heard == ["alarms", "history"] and not parts.ring.storing


async def test_a_history_that_takes_nothing_does_not_hold_the_events_up() -> None:
    parts = Parts(error=StorageError("full"))
    await parts.ring.take(ITEM, [], 3)
    assert parts.heard == ["alarms", "history"]


@pytest.mark.parametrize(
    ("journal", "stored", "up_to"),
    [(None, None, None), (5, None, None), (None, 5, None), (5, 9, 5), (9, 5, 5), (7, 7, 7)],
)
def test_the_ring_may_forget_what_both_have(journal: int | None, stored: int | None, up_to: int | None) -> None:
    ring = Parts(mark(journal) if journal else None, mark(stored) if stored else None).ring
    found = ring.stored_up_to(ITEM)
    assert (found.sequence if found else None) == up_to
    seen = [one.sequence if one else None for one in ring.last_seen(ITEM)]
    assert seen == [journal, stored], "what one of them has not seen is read again"
