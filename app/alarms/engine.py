"""All alarms of a plant at work: wires what follows the tags, knows how every alarm stands, tells it and writes the journal.

A batch of values goes to `evaluation`, the events of a machine to `ring`, what other parts of the server say to `system`; each leads its
alarms through `states`, and from there into `journal`, `list` and `annunciations`. What happened is in memory at once, on the screens
within a quarter of a second (`counts`), and in the database as soon as it takes it; an alarm never waits for a disk.
"""

import asyncio
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from app.access.roles import Person
from app.alarms.alarm_list import AlarmList
from app.alarms.annunciations import Annunciations
from app.alarms.conditions import Reported
from app.alarms.counts import AlarmCounts
from app.alarms.definitions import SYSTEM_ALARMS
from app.alarms.evaluation import Evaluation
from app.alarms.hiding import Hiding
from app.alarms.index import AlarmIndex
from app.alarms.journal import Stored, journal_key
from app.alarms.journal_queue import JournalQueue
from app.alarms.lifecycle import HIDDEN, AlarmEvent
from app.alarms.occurrences import Occurrences
from app.alarms.ring_events import RingEvents
from app.alarms.states import AlarmStates
from app.alarms.stored_state import orphan, put_back
from app.alarms.system_alarms import SystemAlarms
from app.alarms.watch import Answer, ListedAlarm, Watch, carry
from app.clock import Clock
from app.db import Database
from app.errors import Refused
from app.plant.alarm_class import AlarmClass
from app.plant.definitions import Alarm, Plant
from app.plant.texts import Texts
from app.tags.database import TagDatabase

PORTION = 500
"""So many alarms are looked at in one turn of the loop."""
IDLE = 0.5
"""What depends on time alone is looked at this often [s]."""


@dataclass(frozen=True, slots=True)
class NextAlarms:
    """The alarms of a plant, before they are taken."""

    texts: Texts | None
    config: str
    """Digest of their definitions."""
    index: AlarmIndex
    classes: Mapping[str, AlarmClass]
    """What the plant file says of classes of alarms."""


class AlarmEngine:
    """Every alarm of the plant and of the system."""

    def __init__(self, tags: TagDatabase, clock: Clock, database: Database, texts: Texts, audit_key: bytes) -> None:
        self._wake = asyncio.Event()
        self._index = AlarmIndex(tags)
        self._occurrences = Occurrences()
        self.journal = JournalQueue(database, clock, journal_key(audit_key))
        self.annunciations = Annunciations(clock)
        self.list = AlarmList(self._index, clock, self._wake)
        self.counts = AlarmCounts(self.list, self.annunciations, self._index, tags, clock)
        self._states = AlarmStates(clock, texts, self.journal, self.list, self.annunciations, self._occurrences)
        self.evaluation = Evaluation(self._index, self._states, self._occurrences, tags, clock, self._wake)
        self.system = SystemAlarms(self._index, self._states, self.evaluation)
        self.hiding = Hiding(self._index, self._states, self.system, clock)
        self.ring = RingEvents(self._index, self._states, self.evaluation, self.system, self.journal, clock)
        self.journal.on_health = lambda healthy: self.system.report("journal_waiting", active=not healthy)
        self._tags = tags
        self._clock = clock
        self._texts = texts
        self._restored: Sequence[Stored] = ()
        self._unsubscribe = tags.subscribe(self.evaluation.take)
        tags.on_standstill(self.evaluation.put_off)

    # ---- what there is --------------------------------------------------------------------------------

    async def load(self) -> None:
        """Read how the alarms stood when the server last ran. Call it before `configure`."""
        self._restored, newest, times = await self.journal.load()
        self._occurrences.restore(newest)
        self.annunciations.restore(times)

    def configure(self, plant: Plant | None, texts: Texts | None = None, person: Person | None = None) -> None:
        """Take the alarms of a plant that nobody has looked at yet, and look at them all. The tag database was configured before."""
        self.take(self.prepare(plant, texts, self._tags.handles), person)
        self.look()

    def prepare(self, plant: Plant | None, texts: Texts | None, handles: Mapping[str, int]) -> NextAlarms:
        """The alarms of `plant`, whose points will have these `handles`; with some thousand of them this takes a while.

        Nothing of what runs is touched: this may be done in a thread.
        """
        equipment = plant.equipment if plant else {}
        rows = [alarm for item in equipment.values() for alarm in item.alarms]
        index = AlarmIndex(self._tags, handles)
        if plant:
            index.fill(equipment)
        return NextAlarms(
            texts, hashlib.sha256(repr(rows).encode()).hexdigest()[:12], index, plant.alarm_classes if plant else {}
        )

    def take(self, new: NextAlarms, person: Person | None = None) -> None:
        """Take the alarms of a plant; those that stand stay by their id, those whose definition is gone are closed.

        Call it after the tag database took the handles that `new` was made with, and one of the looks afterwards. `person` is who had the
        plant read anew.
        """
        self._texts = new.texts or self._texts
        self.hiding.classes = new.classes
        self._states.configure(self._texts, new.config)
        self._occurrences.clear()
        self.evaluation.clear()
        old = self._index.take(new.index)
        equipment = self._index.equipment
        changed: list[tuple[Watch, Alarm]] = []
        for watch in self._index:
            before = old.pop(watch.id, None)
            if before is not None:
                carry(before, watch)
                if before.alarm != watch.alarm:
                    changed.append((watch, before.alarm))
            self.evaluation.begin(watch)
        for watch in list(old.values()):
            self._index.look_anew(watch)
            if isinstance(watch.condition, Reported) and (not watch.equipment or watch.equipment in equipment):
                self.evaluation.enrol(old.pop(watch.id))
        for watch in old.values():
            self._states.remove(watch, person)
        self._restore()
        for watch, previous in changed:
            self._states.redefined(watch, previous, person)
        self.list.touch()

    def look(self) -> None:
        """Look at all alarms."""
        self.evaluation.evaluate(list(self._index))

    async def look_in_turns(self) -> None:
        """As `look`, some hundred at a time: nobody waits for the rest."""
        watches = list(self._index)
        for begin in range(0, len(watches), PORTION):
            self.evaluation.evaluate(
                [watch for watch in watches[begin : begin + PORTION] if self._index.get(watch.id) is watch]
            )
            await asyncio.sleep(0)

    def _restore(self) -> None:
        """Put back how the alarms stood; nothing of it asks for attention anew."""
        restored, self._restored = self._restored, ()
        for one in restored:
            watch = self._index.get(one.alarm)
            if watch is None and one.key in SYSTEM_ALARMS and one.equipment in ("", *self._index.equipment):
                watch = self._index.of_system(one.alarm, one.key, one.equipment)
                self.evaluation.enrol(watch)
            if watch is None:
                self._states.remove(orphan(one))
                continue
            put_back(watch, one)
            self._occurrences.keep(watch)
            if one.acked_by:
                self._occurrences.acknowledged(watch)
            self._states.arm(watch)
            self._states.apply(watch, AlarmEvent.RESTART)

    def definition(self, id: str) -> Alarm | None:
        """The row of the alarm `id`."""
        watch = self._index.get(id)
        return watch.alarm if watch else None

    def labels(self) -> Iterable[tuple[str, str, str, Mapping[str, object]]]:
        """Id, equipment type, text key and parameters of every alarm, for searching in a reader's language."""
        return [(watch.id, watch.type, watch.alarm.label, watch.params) for watch in self._index]

    def find(self, occurrence: int) -> ListedAlarm | None:
        """The alarm whose present occurrence this is; None when it is over."""
        watch = self._occurrences.present(occurrence)
        return self.list.of(watch) if watch else None

    def acknowledged(self, id: str) -> int:
        """When the last occurrence of the alarm `id` was acknowledged [µs UTC], also one that is over; 0 = it was not."""
        watch = self._index.get(id)
        return watch.acked_at if watch else 0

    # ---- what people do -------------------------------------------------------------------------------

    async def acknowledge(self, occurrences: Iterable[int], person: Person, comment: str = "") -> list[Answer]:
        """Acknowledge these occurrences; each has its answer. A late one for an occurrence that is over never meets the next one.

        Returns when it is in the journal, or when the database has not taken it for 2 s: it is acknowledged all the same, not `stored`.
        """
        answers = [self._acknowledge(occurrence, person, comment) for occurrence in dict.fromkeys(occurrences)]
        stored = await self.journal.settle()
        return [replace(one, stored=stored) if one.outcome in ("done", "already") else one for one in answers]

    def _acknowledge(self, occurrence: int, person: Person, comment: str) -> Answer:
        watch = self._occurrences.present(occurrence)
        if watch is None:
            return self._occurrences.answer(occurrence)
        result = self._states.apply(watch, AlarmEvent.ACKNOWLEDGE, person=person, comment=comment)
        if result.entry is None:
            hidden = watch.life.state in HIDDEN
            return Answer(occurrence, "hidden", watch.id) if hidden else self._occurrences.answer(occurrence)
        self.system.seen(watch)
        return Answer(occurrence, "done", watch.id, watch.acked_by, watch.acked_at)

    async def reset(self, occurrence: int, person: Person, comment: str = "") -> bool:
        """Release a latched alarm whose condition is over and which is acknowledged; whether it is in the journal already.

        Raises:
            Refused: 409 with the reason; 404 for an occurrence that is not there.
        """
        watch = self._occurrences.find(occurrence)
        if watch is None:
            raise Refused("alarm.answer.gone", 404)
        result = self._states.apply(watch, AlarmEvent.RESET, person=person, comment=comment)
        if result.entry is None:
            raise Refused(result.refused or "alarm.why.not_latched", 409)
        return await self.journal.settle()

    # ---- what runs ------------------------------------------------------------------------------------

    def tick(self) -> None:
        """Look at everything that time alone decides: delays, ages, rates, re-alarms, the end of a flood."""
        self._tags.wake()
        self.evaluation.tick()
        self._states.tick()
        self.hiding.tick()
        if self.annunciations.judge():
            self.list.touch()

    async def run(self) -> None:
        """Look at delays when they are due and publish the counts, for ever."""
        while True:
            self.tick()
            due = self.evaluation.due
            wait = IDLE if due is None else max(0.0, min(IDLE, due - self._clock.monotonic()))
            pause = self.counts.wait
            if pause is not None and pause <= 0:
                self.counts.publish()
                self.journal.wake()
            elif pause is not None:
                await asyncio.sleep(min(wait, pause))
                continue
            self._wake.clear()
            try:
                async with asyncio.timeout(wait):
                    await self._wake.wait()
            except TimeoutError:
                pass

    async def close(self) -> None:
        """Stop following the tags and write what waits."""
        self._unsubscribe()
        await self.journal.close()
