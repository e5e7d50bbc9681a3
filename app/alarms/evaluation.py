"""Decides which alarms come and go: conditions, delays, suppression while a device does not answer, first-out.

Only the alarms whose inputs changed are evaluated, in the order of the plant file; delays are looked at when they are due. Then come
suppression (while a device does not answer, its other alarms are hidden: the lost communication is the root) and first-out. Sources:
reference/alarms.md sections 1, 5 and 6.
"""

import asyncio
from collections.abc import Sequence

from app.alarms.conditions import ByEvent, Reported, Truth
from app.alarms.event_params import untold
from app.alarms.first_out import place
from app.alarms.index import AlarmIndex
from app.alarms.lifecycle import AlarmEvent, AlarmState
from app.alarms.occurrences import Occurrences
from app.alarms.states import AlarmStates
from app.alarms.watch import CHATTER_WINDOW, Watch, explain, number
from app.clock import Clock
from app.plant.events import RingEvent
from app.tags.batch import Batch
from app.tags.database import Standstill, TagDatabase
from app.tags.quality import NO_DATA


class Evaluation:
    """Holds the delays that run, and says when an alarm has come or gone."""

    def __init__(
        self,
        index: AlarmIndex,
        states: AlarmStates,
        occurrences: Occurrences,
        tags: TagDatabase,
        clock: Clock,
        wake: asyncio.Event,
    ) -> None:
        """`wake` is set when a delay begins that may be due before anybody looks."""
        self._index = index
        self._states = states
        self._occurrences = occurrences
        self._tags = tags
        self._clock = clock
        self._wake = wake
        self._pending: dict[str, Watch] = {}
        self._settling: dict[str, Watch] = {}

    def clear(self) -> None:
        """No delay runs any more: all alarms are read anew."""
        self._pending, self._settling = {}, {}

    def enrol(self, watch: Watch) -> None:
        """Take an alarm into service, however it stands."""
        self._index.add(watch)
        self.begin(watch)

    def begin(self, watch: Watch) -> None:
        """As `enrol`, of an alarm that the index has already."""
        watch.listed = None
        self._occurrences.keep(watch)
        self._states.arm(watch)
        self._follow(watch)
        if watch.delay.since is not None:
            self._pending[watch.id] = watch

    @property
    def due(self) -> float | None:
        """When the next delay ends [s, monotonic]; None while none runs."""
        return min((watch.delay.due or 0.0 for watch in self._pending.values()), default=None)

    # ---- what makes it look ---------------------------------------------------------------------------

    def take(self, batch: Batch) -> None:
        """Evaluate the alarms whose inputs the batch changed."""
        if found := self._index.readers(batch.handles):
            self.evaluate(found, batch.time)

    def tick(self) -> None:
        """Look at everything that time alone decides: delays, ages, rates, events whose value has not come yet."""
        now = self._clock.monotonic()
        due = {watch.index: watch for watch in self._pending.values() if (watch.delay.due or 0.0) <= now}
        due |= {watch.index: watch for watch in (*self._index.timed, *self._settling.values())}
        if due:
            self.evaluate([due[index] for index in sorted(due)])
        for watch in list(self._settling.values()):
            if isinstance(watch.condition, ByEvent) and not watch.condition.settling:
                del self._settling[watch.id]

    def put_off(self, still: Standstill) -> None:
        """Nobody saw anything for a while: that time does not count for any delay."""
        for watch in self._pending.values():
            if watch.delay.since is not None:
                watch.delay.since += still.seconds

    def evaluate(self, watches: Sequence[Watch], at: int | None = None) -> None:
        """Look at `watches`, in this order; `at` is the time of the values [µs UTC], None = now."""
        now = self._clock.monotonic()
        at = self._clock.micros() if at is None else at
        roots: list[tuple[Watch, bool]] = []
        others: list[tuple[Watch, bool]] = []
        for watch in watches:
            active = self._judge(watch, now, at)
            if active is not None:
                (roots if self._index.root(watch.equipment) is watch else others).append((watch, active))
        for watch, active in roots:
            self.turn(watch, active)
            self._suppress(watch, active, at)
        for watch, active in others:
            root = self._index.root(watch.equipment)
            if active and root is not None and root.life.active and not watch.life.suppressed:
                self._states.apply(watch, AlarmEvent.SUPPRESS, detail=root.alarm.key)
            self.turn(watch, active)

    def force(self, watch: Watch, active: bool) -> None:
        """Let `watch` stand at `active` at once, whatever its condition says: no delay runs, and its inputs count as known."""
        watch.delay.restart(active)
        watch.known = True
        self._pending.pop(watch.id, None)
        self._follow(watch)

    # ---- what comes and goes --------------------------------------------------------------------------

    def turn(self, watch: Watch, active: bool, event: RingEvent | None = None, at: int | None = None) -> None:
        """The condition has come or gone; `at` [µs UTC] is when the `event` of the device happened that says so."""
        if not active:
            self._states.apply(watch, AlarmEvent.RETURN, at=at)
            return
        now = self._clock.monotonic()
        calm = (
            watch.life.state is AlarmState.NORMAL
            and now - (watch.raises[-1] if watch.raises else -1e9) > CHATTER_WINDOW
        )
        watch.count = 1 if calm else watch.count + 1
        watch.raises.append(now)
        self._occurrences.begin(watch)
        watch.returned, watch.acked_at, watch.acked_by = 0, 0, ""
        watch.value, watch.limit = number(watch.look(watch.alarm.value)), watch.alarm.limit
        if event is not None:
            explain(watch, event)
        for one in place(watch, self._index.members(watch.equipment)):
            self._states.changed(one)
        self._states.apply(watch, AlarmEvent.RAISE, at=at)

    def _judge(self, watch: Watch, now: float, at: int) -> bool | None:
        """Whether its condition has come or gone; None = neither."""
        delay = watch.delay
        truth = watch.condition.holds(watch.look, delay.active, now, watch.age)
        if truth is None or not watch.known:
            self._judge_quality(watch, truth)
        change = delay.step(truth, now, at)
        if delay.since is None:
            self._pending.pop(watch.id, None)
        elif watch.id not in self._pending:
            self._pending[watch.id] = watch
            self._wake.set()
        if change is None:
            return None
        if change.active:
            watch.first_true = change.at
            watch.annunciated = change.at + round(delay.on * 1e6)
            condition = watch.condition
            if (
                isinstance(condition, ByEvent) and not condition.raised
            ):  # its sentence says so alone: the event was lost
                watch.event, watch.params = 0, untold(watch.layout)
        return change.active

    def _judge_quality(self, watch: Watch, truth: Truth) -> None:
        if isinstance(watch.condition, ByEvent) and watch.condition.sentence is None:
            return
        known = truth is not None or all(self._tags.quality(handle) & 0xFF == NO_DATA for handle in watch.handles)
        if known is watch.known or (watch.life.state is AlarmState.NORMAL and known is False):
            return
        watch.known = known
        self._states.apply(watch, AlarmEvent.QUALITY, detail="known" if known else "unknown")

    def _suppress(self, root: Watch, active: bool, at: int) -> None:
        freed = []
        for watch in self._index.members(root.equipment):
            condition = watch.condition
            if (
                watch is root
                or isinstance(condition, Reported)
                or (isinstance(condition, ByEvent) and condition.sentence is None)
            ):
                continue  # no value of the device decides it
            if active and watch.life.state is not AlarmState.NORMAL:
                self._states.apply(watch, AlarmEvent.SUPPRESS, detail=root.alarm.key)
            elif not active and watch.life.suppressed and self.free(watch, root):
                freed.append(watch)
        if freed:
            self.evaluate(freed, at)

    def free(self, watch: Watch, root: Watch) -> bool:
        """The lost communication `root` hides `watch` no longer; whether nothing else does, so that its delay begins anew."""
        self._states.apply(watch, AlarmEvent.UNSUPPRESS, detail=root.alarm.key)
        if watch.life.hidden:
            return False
        watch.delay.restart()
        return True

    def _follow(self, watch: Watch) -> None:
        if isinstance(watch.condition, ByEvent) and watch.condition.settling:
            self._settling[watch.id] = watch
