"""Leads every alarm through the table of its life, writes each transition down and tells who is to know."""

from app.access.roles import Person
from app.alarms.alarm_list import AlarmList
from app.alarms.annunciations import Annunciations
from app.alarms.event_params import completed
from app.alarms.journal_queue import JournalQueue
from app.alarms.lifecycle import AUDIBLE, AlarmEvent, AlarmState, Step, step
from app.alarms.occurrences import Occurrences
from app.alarms.watch import Watch, record, spoken, written
from app.clock import Clock
from app.plant.definitions import Alarm
from app.plant.texts import Texts

REDEFINED = (
    "limit", "expression", "clear", "kind", "dead_band", "reference", "window", "on_delay", "off_delay", "latching",
)  # fmt: skip
"""What the journal names when a definition is read anew, besides the priority."""

ONE_SHOT = "one-shot"
"""What the journal says ended a shelf that was there for one return to normal."""


class AlarmStates:
    """The only one that changes the life of an alarm."""

    def __init__(
        self,
        clock: Clock,
        texts: Texts,
        journal: JournalQueue,
        shown: AlarmList,
        annunciations: Annunciations,
        occurrences: Occurrences,
    ) -> None:
        self._clock = clock
        self._texts = texts
        self._config = ""
        self._journal = journal
        self._list = shown
        self._annunciations = annunciations
        self._occurrences = occurrences
        self._realarms: dict[str, Watch] = {}

    def configure(self, texts: Texts, config: str) -> None:
        """Write with these texts, and with the digest `config` of the definitions; no re-alarm runs till `arm`."""
        self._texts, self._config = texts, config
        self._realarms = {}

    def apply(
        self,
        watch: Watch,
        event: AlarmEvent,
        *,
        person: Person | None = None,
        comment: str = "",
        detail: str = "",
        at: int | None = None,
    ) -> Step:
        """Lead `watch` through the table; `at` is when it happened [µs UTC], None = now. Without an entry nothing happened."""
        result = step(watch.life, event, watch.traits)
        if result.entry is None:
            return result
        at = self._clock.micros() if at is None else at
        watch.life = result.life
        if event is AlarmEvent.ACKNOWLEDGE and person is not None:
            watch.acked_at, watch.acked_by = at, person.display or person.name
            self._occurrences.acknowledged(watch)
        elif event is AlarmEvent.RETURN:
            watch.returned = at
        elif event in (AlarmEvent.REALARM, AlarmEvent.UNSHELVE, AlarmEvent.PUT_BACK) and not watch.life.acked:
            watch.acked_at, watch.acked_by = 0, ""
        if not watch.life.shelved:
            watch.shelf = None
        if not watch.life.out_of_service:
            watch.service = None
        if result.annunciates:
            self._annunciations.add()
        lang = self._texts.default
        params = spoken(self._texts, lang, watch.type, completed(watch.layout, written(watch)))
        text = self._texts.of_type(lang, watch.type, watch.alarm.label, **params)
        self._journal.add(record(watch, result, at, person, comment, detail, text, self._config))
        self.changed(watch)
        self.arm(watch)
        if event is AlarmEvent.RETURN and watch.shelf is not None and watch.shelf.once:
            self.apply(watch, AlarmEvent.UNSHELVE, detail=ONE_SHOT, at=at)
        return result

    def changed(self, watch: Watch) -> None:
        """More is known of `watch`, without a transition."""
        self._journal.changed(watch)
        self._list.changed(watch)

    def remove(self, watch: Watch, person: Person | None = None) -> None:
        """Close an alarm whose definition is gone."""
        self.apply(watch, AlarmEvent.REMOVE, person=person)
        self._journal.removed(watch.id)

    def redefined(self, watch: Watch, before: Alarm, person: Person | None) -> None:
        """Write down what is other than `before` in the definition of `watch`; one that became louder sounds anew."""
        after = watch.alarm
        if before.priority != after.priority:
            louder = after.priority < before.priority and watch.life.state in AUDIBLE
            self.apply(watch, AlarmEvent.PRIORITY, person=person, detail=f"{before.priority} → {after.priority}")
            if louder:
                self._annunciations.sound_again()
        pairs = [(name, getattr(before, name), getattr(after, name)) for name in REDEFINED]
        changes = [f"{name}: {old} → {new}" for name, old, new in pairs if old != new]
        if changes:
            self.apply(watch, AlarmEvent.LIMIT, person=person, detail="; ".join(changes)[:200])

    def arm(self, watch: Watch) -> None:
        """Let an acknowledged alarm that asks for it come back after its time."""
        if watch.alarm.realarm and watch.life.state is AlarmState.ACKNOWLEDGED:
            self._realarms[watch.id] = watch
        else:
            self._realarms.pop(watch.id, None)

    def tick(self) -> None:
        """Let those come back whose time is over."""
        at = self._clock.micros()
        for watch in list(self._realarms.values()):
            if abs(at - watch.acked_at) >= watch.alarm.realarm * 1e6:  # it may be ahead of a clock that was set back
                self.apply(watch, AlarmEvent.REALARM)
