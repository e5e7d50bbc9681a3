"""The way of an event of a machine's ring: to the alarms at once, then to the history, and back to the ring when both have it."""

import asyncio
import logging
from collections.abc import Sequence
from contextlib import suppress

from app.alarms.engine import AlarmEngine
from app.errors import StorageError
from app.historian.events import Events
from app.links.register_link import RegisterLink
from app.plant.definitions import Equipment
from app.plant.events import RingEvent, RingPosition, earlier

log = logging.getLogger(__name__)

STORE_LIMIT = 2.0
"""Events of a machine wait this long for the history, then in memory [s]: alarms and communication wait for no disk."""


class RingEvents:
    """Takes what links read from event rings; says how far a ring may forget."""

    def __init__(self, alarms: AlarmEngine, history: Events) -> None:
        self.storing: set[asyncio.Task[None]] = set()
        """Deliveries that the history has not taken yet."""
        self._alarms = alarms
        self._history = history

    def follow(self, link: RegisterLink) -> RegisterLink:
        """`link`, whose rings are taken from now on."""
        link.events.take, link.events.last_seen, link.events.stored_up_to = self.take, self.last_seen, self.stored_up_to
        return link

    async def take(self, item: Equipment, events: Sequence[RingEvent], lost: int) -> None:
        """Alarms at once, then what is kept.

        A history that takes nothing, or for long, holds nothing up: the events wait in memory. The device is told only of what is stored
        (`stored_up_to`), so that they are in its ring still when this server is killed.
        """
        _log_events(item, events, lost)
        self._alarms.ring.take(item.id, events, lost)
        task = asyncio.create_task(self._store(item.id, events, lost))
        self.storing.add(task)
        task.add_done_callback(self.storing.discard)
        await asyncio.wait([task], timeout=STORE_LIMIT)
        if self._alarms.journal.waiting:
            await self._alarms.journal.settle()

    def last_seen(self, item: Equipment) -> Sequence[RingPosition | None]:
        """What the alarms and the history have of the ring of a machine."""
        return self._alarms.journal.last_event(item.id), self._history.last(item.id)

    def stored_up_to(self, item: Equipment) -> RingPosition | None:
        """The last event of a machine that is in the journal of the alarms and in the history."""
        alarms, stored = self._alarms.journal.stored_event(item.id), self._history.last(item.id)
        return None if alarms is None or stored is None else earlier(alarms, stored)

    async def _store(self, equipment: str, events: Sequence[RingEvent], lost: int) -> None:
        with suppress(StorageError):  # told by the history, which tries again
            await self._history.take(equipment, events, lost)


def _log_events(item: Equipment, events: Sequence[RingEvent], lost: int) -> None:
    if lost:
        log.warning("events lost machine=%s count=%d", item.id, lost)
    alarming = {code for alarm in item.alarms for code in (alarm.event, alarm.event_clear) if code}
    for event in events:
        log.log(
            logging.INFO if event.code in alarming else logging.DEBUG,
            "event machine=%s sequence=%d time=%d event=%s source=%d value=%g",
            item.id,
            event.sequence,
            event.time,
            item.type.events.get(event.code, str(event.code)),
            event.source,
            event.value,
        )
