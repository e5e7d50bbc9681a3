"""Puts alarms aside and brings them back: shelving that ends by itself, and service that ends only by hand.

What is put aside goes on being evaluated and is written down silently (lifecycle, rows S1 to S3). Times are those of the wall clock, so
a shelf ends when it said it would, also when the server was off in between. Source: reference/alarms.md sections 1.2 and 4.
"""

from collections.abc import Mapping
from dataclasses import replace

from app.access.roles import Person
from app.alarms.index import AlarmIndex
from app.alarms.lifecycle import AlarmEvent
from app.alarms.shelf import MOST_SHELVED, OPERATORS, SHORTEST_REASON, Service, Shelf
from app.alarms.states import AlarmStates
from app.alarms.system_alarms import SystemAlarms
from app.alarms.watch import Watch
from app.clock import Clock
from app.errors import Refused
from app.plant.alarm_class import AlarmClass, usual

BY_TIME, BY_HAND = "timer", "by hand"
"""What the journal says ended a shelf; the third is `states.ONE_SHOT`."""


class Hiding:
    """What people put aside."""

    def __init__(self, index: AlarmIndex, states: AlarmStates, system: SystemAlarms, clock: Clock) -> None:
        self._index = index
        self._states = states
        self._system = system
        self._clock = clock
        self.classes: Mapping[str, AlarmClass] = {}
        """What the plant file says of classes of alarms."""

    def allowed(self, alarm_class: str) -> AlarmClass:
        """What may be done with alarms of this class."""
        return self.classes.get(alarm_class) or usual(alarm_class)

    def shelve(self, id: str, person: Person, seconds: float, reason: str, *, once: bool = False) -> Watch:
        """Shelve the alarm `id` for `seconds`; with `once` it comes back with its return to normal, if that is earlier.

        Raises:
            Refused: 404 no such alarm; 403 its priority asks for an engineer; 409 its class is never shelved, it is shelved, or its area
                has as many as it may; 422 a time or a reason that is none.
        """
        watch = self._find(id)
        allowed = self.allowed(watch.alarm.alarm_class)
        if not allowed.longest:
            raise Refused("alarm.why.never_shelved", 409)
        if watch.alarm.priority not in OPERATORS and not person.may("configure"):
            raise Refused("alarm.why.priority_engineer", 403, priority=watch.alarm.priority)
        if not 60 <= seconds <= allowed.longest:
            raise Refused("alarm.why.shelve_time", 422, most=_span(allowed.longest))
        reason = _reason(reason, needed=allowed.reason)
        if watch.life.shelved:
            raise Refused("alarm.why.already_shelved", 409)
        others = sum(one.life.shelved and one.area == watch.area for one in self._index)
        if others >= MOST_SHELVED:
            raise Refused("alarm.why.too_many_shelved", 409, most=MOST_SHELVED)
        now = self._clock.micros()
        watch.shelf = Shelf(now, now + round(seconds * 1e6), person.display or person.name, reason, once)
        detail = f"{round(seconds / 60)} min{' one-shot' if once else ''}"
        self._states.apply(watch, AlarmEvent.SHELVE, person=person, comment=reason, detail=detail)
        return watch

    def unshelve(self, id: str, person: Person) -> Watch:
        """End the shelf of the alarm `id`; one that is active asks for attention anew.

        Raises:
            Refused: 404 no such alarm; 409 it is not shelved.
        """
        watch = self._find(id)
        if not watch.life.shelved:
            raise Refused("alarm.why.not_shelved", 409)
        self._states.apply(watch, AlarmEvent.UNSHELVE, person=person, detail=BY_HAND)
        return watch

    def take_out(self, id: str, person: Person, reason: str, permit: str = "") -> Watch:
        """Take the alarm `id` out of service, until somebody puts it back.

        Raises:
            Refused: 404 no such alarm; 409 it is out of service, or its class never is; 422 a reason that is none.
        """
        watch = self._find(id)
        allowed = self.allowed(watch.alarm.alarm_class)
        if not allowed.out_of_service:
            raise Refused("alarm.why.never_out", 409)
        reason = _reason(reason, needed=allowed.reason)
        if watch.life.out_of_service:
            raise Refused("alarm.why.already_out", 409)
        permit = permit.strip()
        watch.service = Service(self._clock.micros(), person.display or person.name, reason, permit)
        self._states.apply(watch, AlarmEvent.TAKE_OUT, person=person, comment=reason, detail=permit)
        return watch

    def put_back(self, id: str, person: Person) -> Watch:
        """Put the alarm `id` back into service.

        Raises:
            Refused: 404 no such alarm; 409 it is in service.
        """
        watch = self._find(id, out=True)
        self._states.apply(watch, AlarmEvent.PUT_BACK, person=person)
        self._remind()
        return watch

    def review(self, id: str) -> Watch:
        """The alarm `id` stays out of service: somebody has looked, and is not reminded for a week.

        Raises:
            Refused: 404 no such alarm; 409 it is in service.
        """
        watch = self._find(id, out=True)
        assert watch.service is not None
        watch.service = replace(watch.service, reviewed=self._clock.micros())
        self._states.changed(watch)
        self._remind()
        return watch

    def tick(self) -> None:
        """End the shelves whose time is over, and remind of what has been out of service for a week."""
        now = self._clock.micros()
        for watch in list(self._index):
            if watch.shelf is not None and watch.shelf.over(now):
                self._states.apply(watch, AlarmEvent.UNSHELVE, detail=BY_TIME)
        self._remind()

    def _remind(self) -> None:
        now = self._clock.micros()
        due = any(one.service is not None and one.service.review_due(now) for one in self._index)
        self._system.report("service_review", active=due)

    def _find(self, id: str, *, out: bool = False) -> Watch:
        watch = self._index.get(id)
        if watch is None:
            raise Refused("alarm.why.no_such_alarm", 404)
        if out and not watch.life.out_of_service:
            raise Refused("alarm.why.not_out", 409)
        return watch


def _span(seconds: float) -> str:
    """Limit of a time as it is read: `4 h`, `90 min`."""
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes % 60 else f"{minutes // 60} h"


def _reason(text: str, *, needed: bool) -> str:
    """`text` without the blanks around it; where none is needed it may say anything.

    Raises:
        Refused: 422, it says nothing.
    """
    found = " ".join(text.split())
    if needed and len(found) < SHORTEST_REASON:
        raise Refused("alarm.why.reason", 422, least=SHORTEST_REASON)
    return found
