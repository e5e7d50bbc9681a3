"""All alarms of a plant at work: follows the tags, keeps how every alarm stands, tells, writes the journal.

A batch evaluates only the alarms whose inputs it changed, in the order of the plant file; delays are looked at when they are due. Then
come suppression (while a device does not answer, its other alarms are hidden: the lost communication is the root), first-out, and
annunciation. What happened is in memory at once, on the screens within a quarter of a second, and in the database as soon as it takes it;
an alarm never waits for a disk. Sources: reference/alarms.md sections 1, 5, 6 and 11.
"""

import asyncio
import hashlib
import json
import logging
import math
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable, Mapping, Sequence

from sqlalchemy import Connection

from app.access.audit import Verdict
from app.access.roles import Person
from app.alarms import journal
from app.alarms.conditions import EVENT_LATE, Delay, Happened, Told, Truth, condition, delay, inputs, needs_time
from app.alarms.definitions import PREFIX, PRIORITIES, SYSTEM_ALARMS
from app.alarms.event_params import completed, of_event, untold
from app.alarms.journal import Record, Stored
from app.alarms.lifecycle import ANNUNCIATED, AUDIBLE, HIDDEN, Event, Life, State, Step, step
from app.alarms.watch import (
    CHATTER_WINDOW,
    Answer,
    Standing,
    Watch,
    carry,
    number,
    record,
    spoken,
    standing,
    stored,
    written,
)
from app.clock import Clock
from app.db import Database
from app.errors import Refused, StorageError
from app.plant import expression
from app.plant.definitions import Alarm, Equipment, Kind, Plant
from app.plant.events import Mark, RingEvent, is_new, mark_of
from app.plant.system import SYSTEM
from app.plant.texts import Texts
from app.tags import quality
from app.tags.batch import Batch, Value
from app.tags.database import Standstill, TagDatabase
from app.tags.quality import NO_DATA

log = logging.getLogger(__name__)

BLOCK = 2
"""Number of the block of our points within those of the system."""
PUBLISH_PERIOD = 0.25
"""Least time between two changes of the counts [s]."""
IDLE = 0.5
"""What depends on time alone is looked at this often [s]."""
RETRY_PERIOD = 5.0
"""A database that did not take the journal is asked again after this [s]."""
FLOOD_WINDOW = 600.0
FLOOD_BEGINS, FLOOD_ENDS = 10, 5
"""Annunciations within the window [s] that begin a flood, and below which it is over."""
REMEMBERED = 10_000
"""Acknowledged occurrences whose acknowledger is known."""
COMM = "comm"
"""Class of the alarm that says that a device does not answer."""
TRIP = "drive"
"""Class whose alarms of one equipment are a first-out group, together with those that its events raise."""
STOP_SPAN = 60_000_000
"""An alarm of an event that is over still belongs to the stop for this long [µs]."""
LATEST_SCAN = 10_000_000
"""A value shows what an event says at most this much later [µs]."""
LONG_AGO = 60_000_000
"""Events that happened this long before a machine was first met raise nothing [µs]."""
MARK_PERIOD = 10.0
MARK_EVERY = 30
"""How often it is written down how far events without any effect were taken [s], and after how many [events]: a ring holds 59."""


class AlarmEngine:
    """Every alarm of the plant and of the system."""

    def __init__(self, tags: TagDatabase, clock: Clock, database: Database, texts: Texts, audit_key: bytes) -> None:
        self.revision = 0
        """Number of the last change of anything that a list shows."""
        self.flood = False
        self.healthy = True
        """False while the journal waits for its database."""
        self.config = ""
        self._tags = tags
        self._clock = clock
        self._db = database
        self._texts = texts
        self._key = journal.journal_key(audit_key)
        self._watches: dict[str, Watch] = {}
        self._readers: dict[int, list[Watch]] = {}
        self._timed: list[Watch] = []
        self._pending: dict[str, Watch] = {}
        self._realarms: dict[str, Watch] = {}
        self._roots: dict[str, Watch] = {}
        self._members: dict[str, list[Watch]] = {}
        self._restored: dict[str, Stored] = {}
        self._by_event: dict[str, dict[int, list[Watch]]] = {}
        self._settling: dict[str, Watch] = {}
        self._marks: dict[str, Mark] = {}
        self._new_marks: dict[str, Mark] = {}
        self._safe: Mapping[str, Mark] = {}
        self._unmarked = 0
        self._marked_at = 0.0
        self._met: dict[str, int] = {}
        self._lost: dict[str, int] = {}
        self._by_occurrence: dict[int, Watch] = {}
        self._acknowledged: OrderedDict[int, tuple[str, str, int]] = OrderedDict()
        self._next_occurrence = 1
        self._news = 0
        self._told: deque[int] = deque()
        self._flood_times: deque[float] = deque()
        self._records: list[Record] = []
        self._dirty: dict[str, Watch | None] = {}
        self._plant: Plant | None = None
        self._equipment: Mapping[str, Equipment] = {}
        self._list: tuple[int, list[Standing]] = (-1, [])
        self._sent_at = -PUBLISH_PERIOD
        self._sent_revision = -1
        self._wake = asyncio.Event()
        self._written = asyncio.Event()
        self._lock = asyncio.Lock()
        self._retry = 0.0
        self._unsubscribe = tags.subscribe(self.take)
        tags.on_standstill(self.put_off)

    # ---- what there is --------------------------------------------------------------------------------

    async def load(self) -> None:
        """Read how the alarms stood when the server last ran. Call it before `configure`."""

        def work(connection: Connection) -> tuple[list[Stored], int, list[int], dict[str, Mark]]:
            since = self._clock.micros() - journal.DAY
            return (
                journal.stored(connection),
                journal.newest_occurrence(connection),
                journal.annunciations(connection, since),
                journal.event_marks(connection),
            )

        stored, newest, times, self._marks = await self._db.read(work)
        self._safe = dict(self._marks)
        self._restored = {one.alarm: one for one in stored}
        self._next_occurrence = newest + 1
        self._told.extend(times)

    def configure(self, plant: Plant | None, texts: Texts | None = None, person: Person | None = None) -> None:
        """Take the alarms of `plant`; those that stand stay by their id, those whose definition is gone are closed.

        Call it after the tag database was configured: handles are looked up again. `person` is who had the plant read anew.
        """
        self._texts = texts or self._texts
        self._plant = plant
        self._equipment = plant.equipment if plant else {}
        old, self._watches = self._watches, {}
        self._readers, self._timed, self._roots, self._members = {}, [], {}, {}
        self._pending, self._realarms, self._by_occurrence = {}, {}, {}
        self._by_event, self._settling = {}, {}
        rows = [alarm for item in self._equipment.values() for alarm in item.alarms]
        self.config = hashlib.sha256(repr(rows).encode()).hexdigest()[:12]
        changed: list[tuple[Watch, Alarm]] = []
        for item in self._equipment.values():
            for alarm in item.alarms:
                watch = self._watch(item, alarm)
                before = old.pop(watch.id, None)
                if before is not None:
                    carry(before, watch)
                    if before.alarm != alarm:
                        changed.append((watch, before.alarm))
                self._add(watch)
        for watch in list(old.values()):
            if isinstance(watch.condition, Told) and (not watch.equipment or watch.equipment in self._equipment):
                self._add(old.pop(watch.id))
        for watch in old.values():
            self._apply(watch, Event.REMOVE, person=person)
            self._dirty[watch.id] = None
        self._restore()
        for watch, previous in changed:
            self._redefined(watch, previous, person)
        now, at = self._clock.monotonic(), self._clock.micros()
        self._evaluate(list(self._watches.values()), now, at)
        self._touch()

    def _watch(self, item: Equipment, alarm: Alarm) -> Watch:
        names = {key: point.name for key, point in item.points.items()}
        point = item.points.get(alarm.value)
        numeric = point is not None and point.kind not in (Kind.ENUM, Kind.TEXT, Kind.BOOL) and not point.texts
        return Watch(
            id=f"{item.id}.{alarm.key}",
            index=len(self._watches),
            equipment=item.id,
            area=item.area,
            type=item.type.name,
            alarm=alarm,
            condition=condition(alarm),
            delay=delay(alarm),
            look=self._look(names),
            age=self._age(names),
            handles=frozenset(self._handles(names, inputs(alarm))),
            unit=point.unit if point and numeric else "",
            decimals=point.decimals if point else 1 if alarm.event else 0,
            params=untold(item.type.snapshot) if alarm.event else {},
            layout=item.type.snapshot,
        )

    def _handles(self, names: Mapping[str, str], keys: Iterable[str]) -> list[int]:
        known = self._tags.handles
        return [known[names[key]] for key in keys if names.get(key) in known]

    def _look(self, names: Mapping[str, str]) -> Callable[[str], tuple[Value, int]]:
        known, tags = self._tags.handles, self._tags
        handles = {key: known[name] for key, name in names.items() if name in known}

        def look(key: str) -> tuple[Value, int]:
            handle = handles.get(key)
            return (None, NO_DATA) if handle is None else (tags.value(handle), tags.quality(handle))

        return look

    def _age(self, names: Mapping[str, str]) -> Callable[[str], float | None]:
        known, tags = self._tags.handles, self._tags

        def age(key: str) -> float | None:
            handle = known.get(names.get(key, ""))
            return None if handle is None else tags.age(handle)

        return age

    def _add(self, watch: Watch) -> None:
        watch.index = len(self._watches)
        watch.standing = None
        self._watches[watch.id] = watch
        self._members.setdefault(watch.equipment, []).append(watch)
        for handle in watch.handles:
            self._readers.setdefault(handle, []).append(watch)
        if needs_time(watch.alarm):
            self._timed.append(watch)
        for code in (watch.alarm.event, watch.alarm.event_clear):
            if code:
                self._by_event.setdefault(watch.equipment, {}).setdefault(code, []).append(watch)
        if isinstance(watch.condition, Happened) and watch.condition.settling:
            self._settling[watch.id] = watch
        if watch.equipment and watch.alarm.alarm_class == COMM and not isinstance(watch.condition, Told):
            self._roots[watch.equipment] = watch
        if watch.occurrence:
            self._by_occurrence[watch.occurrence] = watch
        if watch.delay.since is not None:
            self._pending[watch.id] = watch
        self._arm(watch)

    def _restore(self) -> None:
        """Put back how the alarms stood; nothing of it asks for attention anew."""
        restored, self._restored = self._restored, {}
        for one in restored.values():
            watch = self._watches.get(one.alarm)
            if watch is None and one.key in SYSTEM_ALARMS and (not one.equipment or one.equipment in self._equipment):
                watch = self._system_watch(one.alarm, one.key, one.equipment)
                self._add(watch)
            if watch is None:
                orphan = self._orphan(one)
                self._apply(orphan, Event.REMOVE)
                self._dirty[one.alarm] = None
                continue
            watch.life, watch.occurrence, watch.known = one.life, one.occurrence, one.known
            watch.first_true, watch.annunciated, watch.returned = one.first_true, one.annunciated, one.returned
            watch.acked_at, watch.acked_by, watch.count = one.acked_at, one.acked_by, one.count
            watch.ordinal, watch.uncertain = one.ordinal, one.uncertain
            watch.value, watch.limit = one.value, one.limit
            watch.params = json.loads(one.params)
            watch.delay.restart(one.active)
            if isinstance(watch.condition, Told):
                watch.condition.active = one.active
            elif isinstance(watch.condition, Happened):
                watch.event = int(str(watch.params.get("event", 0)))
                watch.condition.standing = one.active and watch.event > 0
            self._by_occurrence[watch.occurrence] = watch
            if one.acked_by:
                self._remember(one.occurrence, watch.id, one.acked_by, one.acked_at)
            self._arm(watch)
            self._apply(watch, Event.RESTART)

    def _orphan(self, one: Stored) -> Watch:
        row = Alarm(one.key, f"alarm.{one.key}.label", "", 4)
        watch = Watch(
            one.alarm,
            0,
            one.equipment,
            "",
            "",
            row,
            Told(),
            Delay(0, 0),
            lambda key: (None, NO_DATA),
            lambda key: None,
            frozenset(),
        )
        watch.life, watch.occurrence, watch.first_true = one.life, one.occurrence, one.first_true
        return watch

    def _redefined(self, watch: Watch, before: Alarm, person: Person | None) -> None:
        after = watch.alarm
        if before.priority != after.priority:
            louder = after.priority < before.priority and watch.life.state in AUDIBLE
            self._apply(watch, Event.PRIORITY, person=person, detail=f"{before.priority} → {after.priority}")
            self._news += louder
        names = (
            "limit",
            "expression",
            "clear",
            "kind",
            "dead_band",
            "reference",
            "window",
            "on_delay",
            "off_delay",
            "latching",
        )
        changes = [
            f"{name}: {getattr(before, name)} → {getattr(after, name)}"
            for name in names
            if getattr(before, name) != getattr(after, name)
        ]
        if changes:
            self._apply(watch, Event.LIMIT, person=person, detail="; ".join(changes)[:200])

    # ---- what happens ---------------------------------------------------------------------------------

    def take(self, batch: Batch) -> None:
        """Evaluate the alarms whose inputs the batch changed."""
        readers = self._readers
        if not readers or not batch.handles:
            return
        found: dict[int, Watch] = {}
        for handle in batch.handles:
            for watch in readers.get(handle, ()):
                found[watch.index] = watch
        if found:
            self._evaluate([found[index] for index in sorted(found)], self._clock.monotonic(), batch.time)

    def tick(self) -> None:
        """Look at everything that time alone decides: delays, ages, rates, re-alarms, the end of a flood."""
        self._tags.wake()
        now, at = self._clock.monotonic(), self._clock.micros()
        due = {watch.index: watch for watch in self._pending.values() if (watch.delay.due or 0.0) <= now}
        due |= {watch.index: watch for watch in (*self._timed, *self._settling.values())}
        if due:
            self._evaluate([due[index] for index in sorted(due)], now, at)
        for watch in list(self._settling.values()):
            if isinstance(watch.condition, Happened) and not watch.condition.settling:
                del self._settling[watch.id]
        for watch in list(self._realarms.values()):
            if at - watch.acked_at >= watch.alarm.realarm * 1e6:
                self._apply(watch, Event.REALARM)
        self._judge_flood(now)

    def put_off(self, still: Standstill) -> None:
        """Nobody saw anything for a while: that time does not count for any delay."""
        for watch in self._pending.values():
            if watch.delay.since is not None:
                watch.delay.since += still.seconds

    @property
    def due(self) -> float | None:
        """When the next delay ends [s, monotonic]; None while none runs."""
        return min((watch.delay.due or 0.0 for watch in self._pending.values()), default=None)

    def _evaluate(self, watches: Sequence[Watch], now: float, at: int) -> None:
        roots: list[tuple[Watch, bool]] = []
        others: list[tuple[Watch, bool]] = []
        for watch in watches:
            delay = watch.delay
            truth = watch.condition.holds(watch.look, delay.active, now, watch.age)
            if truth is None or not watch.known:
                self._judge_quality(watch, truth)
            change = delay.step(truth, now, at)
            if delay.since is not None:
                if watch.id not in self._pending:
                    self._pending[watch.id] = watch
                    self._wake.set()
            else:
                self._pending.pop(watch.id, None)
            if change is None:
                continue
            if change.active:
                watch.first_true = change.at
                watch.annunciated = change.at + round(delay.on * 1e6)
                told = watch.condition
                if isinstance(told, Happened) and not told.standing:  # its sentence says so alone: the event was lost
                    watch.event, watch.params = 0, untold(watch.layout)
            is_root = self._roots.get(watch.equipment) is watch
            (roots if is_root else others).append((watch, change.active))
        for watch, active in roots:
            self._changed(watch, active, now, at)
            self._suppress(watch, active, now, at)
        for watch, active in others:
            root = self._roots.get(watch.equipment)
            if active and root is not None and root.life.active and not watch.life.suppressed:
                self._apply(watch, Event.SUPPRESS, detail=root.alarm.key)
            self._changed(watch, active, now, at)

    def _changed(self, watch: Watch, active: bool, now: float, at: int, event: RingEvent | None = None) -> None:
        """The condition has come or gone; `at` [µs UTC] is when the `event` of the device happened that says so."""
        when = None if event is None else at
        if not active:
            self._apply(watch, Event.RETURN, at=when)
            return
        calm = watch.life.state is State.NORMAL and now - (watch.raises[-1] if watch.raises else -1e9) > CHATTER_WINDOW
        watch.count = 1 if calm else watch.count + 1
        watch.raises.append(now)
        self._by_occurrence.pop(watch.occurrence, None)
        watch.occurrence = self._next_occurrence
        self._next_occurrence += 1
        self._by_occurrence[watch.occurrence] = watch
        watch.returned, watch.acked_at, watch.acked_by = 0, 0, ""
        watch.value, watch.limit = number(watch.look(watch.alarm.value)), watch.alarm.limit
        if event is not None:
            self._explain(watch, event)
        self._place(watch)
        self._apply(watch, Event.RAISE, at=when)

    # ---- what devices tell ----------------------------------------------------------------------------

    def last_event(self, equipment: str) -> Mark | None:
        """The last event of a machine that was taken; None = none ever was."""
        return self._marks.get(equipment)

    def stored_event(self, equipment: str) -> Mark | None:
        """The last event of a machine of which everything that follows is in the journal; None = none is."""
        waits = self._records or self._dirty or self._lock.locked()
        return (self._safe if waits else self._marks).get(equipment)

    def take_events(self, equipment: str, events: Sequence[RingEvent], lost: int = 0) -> None:
        """Raise and end what the events of a machine say, in the order of its ring and with the events' own times.

        Events that were taken before change nothing, whatever delivers them again; `lost` are missing before the first of these.
        """
        now, wall = self._clock.monotonic(), self._clock.micros()
        mark = self._marks.get(equipment)
        if mark is None:
            self._met.setdefault(equipment, wall)
        elif events and is_new(events[0], mark) and events[0].sequence > mark.sequence:
            lost = min(lost, events[0].sequence - mark.sequence - 1)
        since = self._met.get(equipment, 0) - LONG_AGO
        taken = 0
        if lost > 0 and (not events or is_new(events[0], mark)):
            self._lose(equipment, lost)
        watches = self._by_event.get(equipment, {})
        for event in events:
            if not is_new(event, mark):
                continue
            mark = mark_of(event)
            taken += 1
            for watch in watches.get(event.code, ()) if event.time >= since else ():
                if watch.alarm.source is not None and watch.alarm.source != event.source:
                    continue
                if event.code == watch.alarm.event:
                    self._happened(watch, event, now, wall)
                else:
                    self._over(watch, event, now, wall)
        if taken and mark is not None:
            self._marks[equipment] = self._new_marks[equipment] = mark
            self._unmarked += taken

    def _happened(self, watch: Watch, event: RingEvent, now: float, wall: int) -> None:
        told, at = watch.condition, min(event.time, wall)
        assert isinstance(told, Happened)
        by_value = not watch.event and watch.first_true > 0 and at - watch.first_true < round(EVENT_LATE * 1e6)
        if by_value and (watch.delay.active or watch.first_true - LATEST_SCAN <= at <= watch.returned):
            # its sentence was quicker: the same occurrence, of which more is known now
            told.begin(now)
            told.standing, told.proved = watch.delay.active, True
            watch.first_true = min(watch.first_true, at)
            self._explain(watch, event)
            self._mark(watch)
            return
        self._answers(watch)
        if watch.delay.active:
            watch.delay.restart()
            self._changed(watch, False, now, at, event)
        watch.delay.restart(active=True)
        self._pending.pop(watch.id, None)
        watch.first_true, watch.annunciated, watch.known = at, wall, True
        told.begin(now + EVENT_LATE)
        self._changed(watch, True, now, at, event)
        if told.momentary:
            watch.delay.restart()
            self._changed(watch, False, now, at, event)
        elif told.settling:
            self._settling[watch.id] = watch

    def _over(self, watch: Watch, event: RingEvent, now: float, wall: int) -> None:
        told = watch.condition
        assert isinstance(told, Happened)
        told.standing, watch.known = False, True
        stood = watch.delay.active
        watch.delay.restart()
        self._pending.pop(watch.id, None)
        if stood:
            self._changed(watch, False, now, max(watch.first_true, min(event.time, wall)), event)

    def _explain(self, watch: Watch, event: RingEvent) -> None:
        watch.event = event.sequence
        watch.value = event.value if math.isfinite(event.value) else watch.value
        watch.params = of_event(watch.layout, event, {} if watch.life.acked else watch.params)

    def _answers(self, watch: Watch) -> None:
        """A device whose events arrive does answer: what it says now is not hidden by the lost communication."""
        root = self._roots.get(watch.equipment)
        if watch.life.suppressed and root is not None:
            self._apply(watch, Event.UNSUPPRESS, detail=root.alarm.key)
            if not watch.life.hidden:
                watch.delay.restart()

    def _lose(self, equipment: str, lost: int) -> None:
        """Events are missing: of what only an event could end it is not known whether it still stands."""
        watch = self._watches.get(f"{SYSTEM}.events_lost.{equipment}")
        waits = watch is not None and watch.life.state is not State.NORMAL
        self._lost[equipment] = lost + (self._lost.get(equipment, 0) if waits else 0)
        self.raise_system("events_lost", equipment, params={"count": self._lost[equipment]})
        for one in self._members.get(equipment, ()):
            told = one.condition
            if isinstance(told, Happened) and told.sentence is None and told.standing and one.known:
                one.known = False
                self._apply(one, Event.QUALITY, detail="unknown")

    def _place(self, watch: Watch) -> None:
        """First-out: which one of its group came first. A group is armed again when none of its alarms stands any more."""
        watch.ordinal, watch.uncertain = 0, False
        if watch.alarm.alarm_class != TRIP and not watch.alarm.event:
            return
        group = [one for one in self._members[watch.equipment] if one is not watch and _in_stop(one, watch.first_true)]
        watch.ordinal = max((one.ordinal for one in group), default=0) + 1
        if group and watch.alarm.event and not watch.event:  # raised by its value: when, only the lost event could say
            watch.uncertain = True
        for one in group:
            if one.first_true == watch.first_true and not (one.event and watch.event):
                one.uncertain = watch.uncertain = True
                self._mark(one)

    def _suppress(self, root: Watch, active: bool, now: float, at: int) -> None:
        freed = []
        for watch in self._members[root.equipment]:
            told = watch.condition
            if watch is root or isinstance(told, Told) or (isinstance(told, Happened) and told.sentence is None):
                continue  # no value of the device decides it
            if active and watch.life.state is not State.NORMAL:
                self._apply(watch, Event.SUPPRESS, detail=root.alarm.key)
            elif not active and watch.life.suppressed:
                self._apply(watch, Event.UNSUPPRESS, detail=root.alarm.key)
                if not watch.life.hidden:
                    watch.delay.restart()
                    freed.append(watch)
        if freed:
            self._evaluate(freed, now, at)

    def _judge_quality(self, watch: Watch, truth: Truth) -> None:
        if isinstance(watch.condition, Happened) and watch.condition.sentence is None:
            return
        known = truth is not None or all(self._tags.quality(handle) & 0xFF == NO_DATA for handle in watch.handles)
        if known is watch.known or (watch.life.state is State.NORMAL and known is False):
            return
        watch.known = known
        self._apply(watch, Event.QUALITY, detail="known" if known else "unknown")

    def _judge_flood(self, now: float) -> None:
        times = self._flood_times
        while times and now - times[0] > FLOOD_WINDOW:
            times.popleft()
        flood = len(times) >= (FLOOD_ENDS if self.flood else FLOOD_BEGINS)
        if flood is not self.flood:
            self.flood = flood
            self._touch()

    def _apply(
        self,
        watch: Watch,
        event: Event,
        *,
        person: Person | None = None,
        comment: str = "",
        detail: str = "",
        at: int | None = None,
    ) -> Step:
        """Lead the alarm through the table; `at` is when it happened [µs UTC], None = now."""
        result = step(watch.life, event, watch.traits)
        if result.entry is None:
            return result
        told = self._clock.micros()
        at = told if at is None else at
        watch.life = result.life
        if event is Event.ACKNOWLEDGE and person is not None:
            watch.acked_at, watch.acked_by = at, person.display or person.name
            self._remember(watch.occurrence, watch.id, watch.acked_by, at)
        elif event is Event.RETURN:
            watch.returned = at
        elif event in (Event.REALARM, Event.UNSHELVE, Event.PUT_BACK) and not watch.life.acked:
            watch.acked_at, watch.acked_by = 0, ""
        if result.annunciates:
            now = self._clock.monotonic()
            self._news += 1
            self._told.append(told)
            self._flood_times.append(now)
            self._judge_flood(now)
        lang = self._texts.default
        params = spoken(self._texts, lang, watch.type, completed(watch.layout, written(watch)))
        text = self._texts.of_type(lang, watch.type, watch.alarm.label, **params)
        self._records.append(record(watch, result, at, person, comment, detail, text, self.config))
        self._mark(watch)
        self._arm(watch)
        return result

    def _mark(self, watch: Watch) -> None:
        watch.standing = None
        self._dirty[watch.id] = watch
        self._touch()

    def _touch(self) -> None:
        self.revision += 1
        self._wake.set()

    def _arm(self, watch: Watch) -> None:
        if watch.alarm.realarm and watch.life.state is State.ACKNOWLEDGED:
            self._realarms[watch.id] = watch
        else:
            self._realarms.pop(watch.id, None)

    def _remember(self, occurrence: int, alarm: str, by: str, at: int) -> None:
        self._acknowledged[occurrence] = (alarm, by, at)
        while len(self._acknowledged) > REMEMBERED:
            self._acknowledged.popitem(last=False)

    # ---- what the system tells ------------------------------------------------------------------------

    def raise_system(
        self,
        key: str,
        equipment: str | None = None,
        active: bool = True,
        params: Mapping[str, object] | None = None,
        *,
        until: str = "",
    ) -> None:
        """Tell an alarm of `SYSTEM_ALARMS`, of a machine or of the server, or that it is over. Telling it again changes nothing.

        A parameter named after what it is about (`link`, `task`, `file`) makes an alarm of its own. `until` is a sentence over the
        machine's points that ends it.

        Raises:
            KeyError: no such alarm.
        """
        SYSTEM_ALARMS[key]
        given = dict(params or {})
        about = equipment or next((str(given[name]) for name in ("link", "task", "file") if name in given), "")
        id = ".".join(part for part in (SYSTEM, key, about) if part)
        watch = self._watches.get(id)
        if watch is None:
            if not active:
                return
            watch = self._system_watch(id, key, equipment or "")
            self._add(watch)
        told = watch.condition
        assert isinstance(told, Told)
        if told.active is active and (not active or dict(watch.params) == given) and watch.delay.active is active:
            return
        told.active = active
        if active:
            if dict(watch.params) != given and watch.life.active:
                self._mark(watch)
            watch.params = given
            if until and equipment in self._equipment:
                self._listen(watch, until)
        self._evaluate([watch], self._clock.monotonic(), self._clock.micros())

    def stop_unconfirmed(self, equipment: str) -> None:
        """A Stop was not read back in time. The alarm is over when the machine's Stop is seen to have worked."""
        item = self._equipment.get(equipment)
        stop = next((command for command in item.type.commands.values() if command.stop), None) if item else None
        until = stop.feedback if stop and not expression.parse(stop.feedback or "1").needs_argument else ""
        self.raise_system("stop_unconfirmed", equipment, True, until=until)

    def _system_watch(self, id: str, key: str, equipment: str) -> Watch:
        told = SYSTEM_ALARMS[key]
        row = told.row(key)
        item = self._equipment.get(equipment)
        names = {name: point.name for name, point in item.points.items()} if item else {}
        return Watch(
            id=id,
            index=0,
            equipment=equipment,
            area=item.area if item else SYSTEM,
            type=item.type.name if item else "",
            alarm=row,
            condition=Told(),
            delay=Delay(row.on_delay, row.off_delay),
            look=self._look(names),
            age=self._age(names),
            handles=frozenset(),
            once=told.once,
        )

    def _listen(self, watch: Watch, until: str) -> None:
        assert isinstance(watch.condition, Told)
        watch.condition.until = expression.parse(until)
        item = self._equipment[watch.equipment]
        names = {name: point.name for name, point in item.points.items()}
        for handle in self._handles(names, watch.condition.until.names):
            readers = self._readers.setdefault(handle, [])
            if watch not in readers:
                readers.append(watch)

    # ---- what people do -------------------------------------------------------------------------------

    async def acknowledge(self, occurrences: Iterable[int], person: Person, comment: str = "") -> list[Answer]:
        """Acknowledge these occurrences; each has its answer. A late one for an occurrence that is over never meets the next one.

        Returns when it is in the journal, or when the database has not taken it for 2 s: it is acknowledged all the same.
        """
        answers = [self._acknowledge(occurrence, person, comment) for occurrence in dict.fromkeys(occurrences)]
        await self._settle()
        return answers

    def _acknowledge(self, occurrence: int, person: Person, comment: str) -> Answer:
        watch = self._by_occurrence.get(occurrence)
        if watch is None or watch.life.state is State.NORMAL:
            return self._answered(occurrence)
        result = self._apply(watch, Event.ACKNOWLEDGE, person=person, comment=comment)
        if result.entry is None:
            if watch.life.state in HIDDEN:
                return Answer(occurrence, "hidden", watch.id)
            return self._answered(occurrence)
        if watch.once and isinstance(watch.condition, Told) and watch.condition.until is None:
            watch.condition.active = False
            self._evaluate([watch], self._clock.monotonic(), self._clock.micros())
        return Answer(occurrence, "done", watch.id, watch.acked_by, watch.acked_at)

    def _answered(self, occurrence: int) -> Answer:
        alarm, by, at = self._acknowledged.get(occurrence, ("", "", 0))
        return Answer(occurrence, "already" if by else "gone", alarm, by, at)

    async def reset(self, occurrence: int, person: Person, comment: str = "") -> None:
        """Release a latched alarm whose condition is over and which is acknowledged.

        Raises:
            Refused: 409 with the reason; 404 for an occurrence that is not there.
        """
        watch = self._by_occurrence.get(occurrence)
        if watch is None:
            raise Refused("alarm.answer.gone", 404)
        result = self._apply(watch, Event.RESET, person=person, comment=comment)
        if result.entry is None:
            raise Refused(result.refused or "alarm.why.not_latched", 409)
        await self._settle()

    # ---- what is shown --------------------------------------------------------------------------------

    def standing(self) -> list[Standing]:
        """The active list: everything that is annunciated, most important first."""
        return [one for one in self._all() if one.state in ANNUNCIATED]

    def hidden(self) -> list[Standing]:
        """What is shelved, suppressed or out of service."""
        return [one for one in self._all() if one.state in HIDDEN]

    def find(self, occurrence: int) -> Standing | None:
        """The alarm whose present occurrence this is; None when it is over."""
        watch = self._by_occurrence.get(occurrence)
        return self._standing(watch) if watch and watch.life.state is not State.NORMAL else None

    def latest(self) -> Standing | None:
        """The most important one that waits for an acknowledgement: by priority, then the newest."""
        return next((one for one in self._all() if one.unacked), None)

    @property
    def told(self) -> Sequence[int]:
        """Times of all annunciations of the last 24 hours [µs UTC]."""
        since = self._clock.micros() - journal.DAY
        while self._told and self._told[0] < since:
            self._told.popleft()
        return tuple(self._told)

    @property
    def news(self) -> int:
        """Number of annunciations since the server started."""
        return self._news

    def definition(self, id: str) -> Alarm | None:
        """The row of the alarm `id`."""
        watch = self._watches.get(id)
        return watch.alarm if watch else None

    def labels(self) -> Iterable[tuple[str, str, str, Mapping[str, object]]]:
        """Id, equipment type, text key and parameters of every alarm, for searching in a reader's language."""
        return [(watch.id, watch.type, watch.alarm.label, watch.params) for watch in self._watches.values()]

    def _all(self) -> list[Standing]:
        if self._list[0] != self.revision:
            found = [self._standing(watch) for watch in self._watches.values() if watch.life.state is not State.NORMAL]
            self._list = (self.revision, sorted(found, key=lambda one: one.order))
        return self._list[1]

    def _standing(self, watch: Watch) -> Standing:
        if watch.standing is None:
            root = self._roots.get(watch.equipment)
            rule = root.alarm.key if root and watch.life.suppressed else ""
            watch.standing = standing(watch, watch.chattering(self._clock.monotonic()), rule)
        return watch.standing

    def counts(self) -> dict[str, Value]:
        """Values of the points `sys.alarms.…`, by what follows that."""
        unack = dict.fromkeys(PRIORITIES, 0)
        active = dict.fromkeys(PRIORITIES, 0)
        by = {item: dict.fromkeys(PRIORITIES, 0) for item in (*self._equipment, SYSTEM)}
        sound = 0
        for one in self._all():
            if one.state not in ANNUNCIATED:
                continue
            active[one.priority] += 1
            unack[one.priority] += one.unacked
            by[one.equipment or SYSTEM][one.priority] += 1
            if one.state in AUDIBLE and (not sound or one.priority < sound) and one.audible:
                sound = one.priority
        values: dict[str, Value] = {
            "revision": self.revision,
            "new": self._news,
            "sound": sound,
            "total": sum(active.values()),
            "unack": sum(unack.values()),
            "flood": int(self.flood),
        }
        for priority in PRIORITIES:
            values[f"unack_{priority}"], values[f"active_{priority}"] = unack[priority], active[priority]
        for item, numbers in by.items():
            values |= {f"by.{item}.p{priority}": number for priority, number in numbers.items()}
        return values

    def publish(self) -> None:
        """Bring the points `sys.alarms.…` up to date."""
        self._sent_at, self._sent_revision = self._clock.monotonic(), self.revision
        known, tags, now = self._tags.handles, self._tags, self._clock.micros()
        handles, values = [], []
        for key, value in self.counts().items():
            handle = known.get(f"{SYSTEM}.{PREFIX}.{key}")
            if handle is not None and (tags.value(handle) != value or quality.is_bad(tags.quality(handle))):
                handles.append(handle)
                values.append(value)
        tags.publish(Batch(SYSTEM, BLOCK, now, now, handles, values))

    # ---- what runs ------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Look at delays when they are due and publish the counts, for ever."""
        while True:
            self.tick()
            now = self._clock.monotonic()
            wait = IDLE if self.due is None else max(0.0, min(IDLE, self.due - now))
            if self.revision != self._sent_revision:
                pause = self._sent_at + PUBLISH_PERIOD - now
                if pause <= 0:
                    self.publish()
                    self._written.set()
                else:
                    wait = min(wait, pause)
                    await asyncio.sleep(wait)
                    continue
            self._wake.clear()
            try:
                async with asyncio.timeout(wait):
                    await self._wake.wait()
            except TimeoutError:
                pass

    async def keep_journal(self) -> None:
        """Write the journal as soon as there is something, for ever."""
        while True:
            self._written.clear()
            waited = self._clock.monotonic() - self._marked_at
            marks_due = bool(self._new_marks) and (waited >= MARK_PERIOD or self._unmarked >= MARK_EVERY)
            if marks_due:
                self._marked_at = self._clock.monotonic()
            if self._records or self._dirty or marks_due:
                try:
                    await self.flush()
                except StorageError:
                    await asyncio.sleep(RETRY_PERIOD)
                    continue
            try:
                async with asyncio.timeout(IDLE):
                    await self._written.wait()
            except TimeoutError:
                pass

    async def flush(self) -> None:
        """Write what waits.

        Raises:
            StorageError: the database did not take it; it waits on.
        """
        async with self._lock:
            records, dirty, marks = self._records, self._dirty, self._new_marks
            if not records and not dirty and not marks:
                return
            self._records, self._dirty, self._new_marks, self._unmarked = [], {}, {}, 0
            reached = dict(self._marks)
            standing = [stored(watch) for watch in dirty.values() if watch and watch.life != Life()]
            gone = [id for id, watch in dirty.items() if watch is None or watch.life == Life()]
            try:
                await self._db.write(
                    lambda connection: journal.write(connection, self._key, records, standing, gone, marks)
                )
            except StorageError as error:
                self._records = records + self._records
                self._dirty = dirty | self._dirty
                self._new_marks = marks | self._new_marks
                if self.healthy:
                    self.healthy = False
                    log.error("alarm journal waits reason=%s", error)
                    self.raise_system("journal_waiting")
                raise
            self._safe = reached
            if not self.healthy:
                self.healthy = True
                log.warning("alarm journal written again records=%d", len(records))
                self.raise_system("journal_waiting", active=False)

    async def settle(self) -> None:
        """Return when everything is in the journal, or when the database has not taken it for 2 s: then it waits in memory."""
        if self._records or self._dirty:
            await self._settle()

    async def _settle(self) -> None:
        self._wake.set()
        try:
            async with asyncio.timeout(2.0):
                await asyncio.shield(self.flush())
        except (StorageError, TimeoutError):
            return

    async def close(self) -> None:
        """Stop following the tags and write what waits."""
        self._unsubscribe()
        try:
            await self.flush()
        except StorageError as error:
            log.error("alarm journal not written records=%d reason=%s", len(self._records), error)

    async def verify(self) -> Verdict:
        """Walk the chain of the journal."""
        return await self._db.read(lambda connection: journal.verify(connection, self._key))


def _in_stop(one: Watch, at: int) -> bool:
    """Whether an alarm is part of the first-out group that stands at `at` [µs UTC]."""
    if not one.ordinal or one.life.state is State.NORMAL:
        return False
    return one.alarm.alarm_class == TRIP or (
        one.alarm.event > 0 and (one.life.active or at - one.first_true < STOP_SPAN)
    )
