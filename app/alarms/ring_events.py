"""What devices tell: their events raise and end alarms, each once, in the order of the ring and with the events' own times.

Source: reference/alarms.md section 11.
"""

from collections.abc import Sequence
from dataclasses import replace

from app.alarms.conditions import EVENT_LATE, ByEvent
from app.alarms.evaluation import Evaluation
from app.alarms.index import AlarmIndex
from app.alarms.journal_queue import JournalQueue
from app.alarms.lifecycle import AlarmEvent
from app.alarms.states import AlarmStates
from app.alarms.system_alarms import SystemAlarms
from app.alarms.watch import Watch, explain
from app.clock import Clock
from app.plant.events import RingEvent, begins_again, is_new, position_of

LATEST_SCAN = 10_000_000
"""A value shows what an event says at most this much later [µs]."""
LONG_AGO = 60_000_000
"""Events that happened this long before a machine was first met raise nothing [µs]."""


class RingEvents:
    """Takes the events of every machine's ring; how far each was taken is kept by the journal queue."""

    def __init__(
        self,
        index: AlarmIndex,
        states: AlarmStates,
        evaluation: Evaluation,
        system: SystemAlarms,
        journal: JournalQueue,
        clock: Clock,
    ) -> None:
        self._index = index
        self._states = states
        self._evaluation = evaluation
        self._system = system
        self._journal = journal
        self._clock = clock
        self._met: dict[str, int] = {}
        self._lost: dict[str, int] = {}

    def take(self, equipment: str, events: Sequence[RingEvent], lost: int = 0) -> None:
        """Raise and end what the events of a machine say.

        Events that were taken before change nothing, whatever delivers them again; `lost` are missing before the first of these.
        """
        wall = self._clock.micros()
        position = self._journal.last_event(equipment)
        if position is None:
            self._met.setdefault(equipment, wall)
        elif events and is_new(events[0], position) and not begins_again(events[0], position):
            lost = min(lost, (events[0].sequence - position.sequence) % 2**32 - 1)
        since = self._met.get(equipment, 0) - LONG_AGO
        if lost > 0 and (not events or is_new(events[0], position)):
            self._lose(equipment, lost)
        taken = 0
        for event in events:
            if not is_new(event, position):
                continue
            position = position_of(event)
            taken += 1
            if event.time >= since:
                self._tell(equipment, event, wall)
        if taken and position is not None:
            self._journal.reached(equipment, position, taken)
        elif events and position is not None:
            self._journal.met(equipment, replace(position, ring=events[-1].ring))

    def _tell(self, equipment: str, event: RingEvent, wall: int) -> None:
        for watch in self._index.of_event(equipment, event.code):
            if watch.alarm.source is not None and watch.alarm.source != event.source:
                continue
            if event.code == watch.alarm.event:
                self._raise(watch, event, wall)
            else:
                self._end(watch, event, wall)

    def _raise(self, watch: Watch, event: RingEvent, wall: int) -> None:
        now, condition, at = self._clock.monotonic(), watch.condition, min(event.time, wall)
        assert isinstance(condition, ByEvent)
        by_value = not watch.event and watch.first_true > 0 and at - watch.first_true < round(EVENT_LATE * 1e6)
        if by_value and (watch.delay.active or watch.first_true - LATEST_SCAN <= at <= watch.returned):
            # its sentence was quicker: the same occurrence, of which more is known now
            condition.begin(now)
            condition.raised, condition.proved = watch.delay.active, True
            watch.first_true = min(watch.first_true, at)
            explain(watch, event)
            self._states.changed(watch)
            return
        root = self._index.root(watch.equipment)
        if watch.life.suppressed and root is not None:  # a device whose events arrive does answer
            self._evaluation.free(watch, root)
        if watch.delay.active:
            self._evaluation.force(watch, False)
            self._evaluation.turn(watch, False, event, at)
        watch.first_true, watch.annunciated = at, wall
        condition.begin(now + EVENT_LATE)
        self._evaluation.force(watch, True)
        self._evaluation.turn(watch, True, event, at)
        if condition.momentary:
            self._evaluation.force(watch, False)
            self._evaluation.turn(watch, False, event, at)

    def _end(self, watch: Watch, event: RingEvent, wall: int) -> None:
        condition = watch.condition
        assert isinstance(condition, ByEvent)
        condition.raised = False
        stood = watch.delay.active
        self._evaluation.force(watch, False)
        if stood:
            self._evaluation.turn(watch, False, event, max(watch.first_true, min(event.time, wall)))

    def _lose(self, equipment: str, lost: int) -> None:
        """Events are missing: of what only an event could end it is not known whether it still stands."""
        waits = self._system.is_raised("events_lost", equipment)
        self._lost[equipment] = lost + (self._lost.get(equipment, 0) if waits else 0)
        self._system.report("events_lost", equipment, params={"count": self._lost[equipment]})
        for one in self._index.members(equipment):
            condition = one.condition
            if isinstance(condition, ByEvent) and condition.sentence is None and condition.raised and one.known:
                one.known = False
                self._states.apply(one, AlarmEvent.QUALITY, detail="unknown")
