"""What machines tell with their event rings, kept in the history: every event of every ring, once.

Nothing here is polled: order and times are those of the event ring. A position per machine says up to which event of its ring is stored. It
is written in the same transaction as the events, so that a ring delivered again after a crash changes nothing. What events mean is for the
folds, which are handed each new event in that transaction, too. Who caused an event is known by the id of the command that it carries.
"""

import asyncio
import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import Connection, Select, bindparam, delete, func, insert, select, update

from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.historian import renames
from app.historian.dialect import Statement, updating
from app.historian.tables import event as event_table
from app.historian.tables import event_gap, event_machine, event_mark
from app.plant.definitions import Equipment
from app.plant.events import Ring, RingEvent, RingPosition, begins_again, is_new, position_of
from app.records.event import Event, packed, unpacked

log = logging.getLogger(__name__)

RETRY_PAUSE = 5.0
"""Pause between attempts while the disk does not take anything [s]."""
MOST_WAITING = 50_000
"""Events kept in memory while the database does not take them; then the oldest are dropped, and counted as lost."""
LATE = 60_000_000
"""The events of a command happen at most this long before it was asked and after it has ended [µs]: after 65 535 others another command
has its id."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """What a link handed over at once."""

    equipment: str
    events: Sequence[RingEvent]
    lost: int = 0
    """Events lost before the first of them."""


@dataclass(frozen=True, slots=True)
class EndedCommand:
    """A person's command that has ended."""

    equipment: str
    requests: tuple[int, ...]
    """Ids under which the device knows it (a Stop is sent until it is read back, each time with another id)."""
    person: str
    reason: str
    requested: int
    """[µs UTC]"""
    ended: int


class Fold(ABC):
    """What is made of the events of some machines while they are stored; its methods run on the database's thread.

    `number` is that under which the events of a machine are stored.
    """

    machines: frozenset[str] = frozenset()
    """Of whose events it is told."""

    @abstractmethod
    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant."""

    @abstractmethod
    def put(self, connection: Connection, equipment: str, number: int, event: Event) -> None:
        """A new event is stored."""

    @abstractmethod
    def lose(self, connection: Connection, equipment: str, number: int, lost: int) -> None:
        """So many events were lost before the next one."""

    @abstractmethod
    def begin_again(self, connection: Connection, equipment: str, number: int, event: Event) -> None:
        """The ring counts from 1 again with `event`, which is put next: the device knows nothing any more of what was under way."""

    def attributed(self, connection: Connection, equipment: str, event: Event) -> None:  # noqa: B027
        """Who caused an event that was put is known now: its `person` and `reason`."""

    def done(self, connection: Connection, equipment: str) -> None:  # noqa: B027
        """What was delivered at once has been put."""


def has_ring(item: Equipment) -> bool:
    """Whether a machine has an event ring."""
    plc = item.type.device.plc
    return plc is not None and plc.events


class Events:
    """Keeps the events of all machines. A history that is full or broken stops nothing: it is told, and tried again."""

    def __init__(
        self,
        database: Database,
        clock: Clock,
        changed: Callable[[str], None] = lambda equipment: None,
        folds: Sequence[Fold] = (),
    ) -> None:
        """`changed` is called with a machine when there is something new of it; `folds` are told of every event."""
        self.failed = False
        """True while the database does not take what happens."""
        self.dropped = 0
        """Events dropped because it did not take them for too long."""
        self.changed = changed
        self.folds = folds
        self._database = database
        self._clock = clock
        self._machines: frozenset[str] = frozenset()
        self._positions: dict[str, RingPosition] = {}
        self._names: dict[str, str] = {}
        """Lasting id → name under which the rows of a machine are, as far as is known."""
        self._now: dict[str, str] = {}
        """Lasting id → name of the machines of the plant."""
        self._followed = True
        """Whether the rows have the names of the plant as it is now."""
        self._revision = 0
        """Of the names."""
        self._waiting: list[Delivery] = []
        self._commands: list[EndedCommand] = []
        self._taken = self._stored = 0
        self._lock = asyncio.Lock()
        self._retry_at = 0.0

    async def load(self) -> None:
        """Read how far the events of each machine were stored; a history that cannot be read is told by the recorder."""

        def work(connection: Connection) -> tuple[dict[str, RingPosition], dict[str, str]]:
            return ring_positions(connection), renames.names(connection)

        try:
            self._positions, self._names = await self._database.read(work)
        except StorageError as error:
            log.warning("marks of events not read reason=%s", error)
            return
        for equipment in self._now.values():
            self.changed(equipment)

    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant; what is kept of one that was renamed gets its new name."""
        kept = [item for item in machines if has_ring(item)]
        for fold in self.folds:
            fold.configure(kept)
        self._machines = frozenset(item.id for item in kept)
        now = self._now = {item.lasting: item.id for item in kept}
        former = {self._names.get(id, id): name for id, name in now.items()}
        moved = {before: after for before, after in former.items() if before != after}
        if moved:
            taken = set(moved.values()) - set(moved)
            self._positions = {
                moved.get(name, name): position for name, position in self._positions.items() if name not in taken
            }
            self._waiting = [replace(one, equipment=moved.get(one.equipment, one.equipment)) for one in self._waiting]
            self._commands = [replace(one, equipment=moved.get(one.equipment, one.equipment)) for one in self._commands]
        self._followed = self._followed and all(self._names.get(id) == name for id, name in now.items())
        self._names |= now
        self._revision += bool(moved)

    def last(self, equipment: str) -> RingPosition | None:
        """The last event of a machine that is stored; None = none ever was."""
        return self._positions.get(equipment)

    @property
    def waiting(self) -> int:
        """Events that the database has not taken yet."""
        return sum(len(one.events) for one in self._waiting)

    def unstored(self, machines: Collection[str] | None = None) -> int:
        """Events of these machines, or of all, that a list has not because the database does not take them; 0 while it does."""
        if not self.failed:
            return 0
        return sum(len(one.events) for one in self._waiting if machines is None or one.equipment in machines)

    async def take(self, equipment: str, events: Sequence[RingEvent], lost: int = 0) -> None:
        """Keep what happened; returns when it is stored (`last` says how far that is).

        Raises:
            StorageError: the database does not take it now; it waits in memory and is tried again by `run`. Until it is stored the ring of
                the machine is where a server that was killed finds it again.
        """
        if equipment not in self._machines or not (events or lost):
            return
        self._waiting.append(Delivery(equipment, tuple(events), lost or self._unnoticed(equipment, events)))
        self._taken += 1
        number = self._taken
        self._trim()
        async with self._lock:
            if self._stored < number:
                await self._write()

    def _unnoticed(self, equipment: str, events: Sequence[RingEvent]) -> int:
        """Events that are missing before these although nobody noticed it: the link was killed before it had acknowledged anything, and
        the ring went round meanwhile."""
        waiting = (
            position_of(one.events[-1]) for one in reversed(self._waiting) if one.equipment == equipment and one.events
        )
        last = next(waiting, self._positions.get(equipment))
        if last is None or not events or not is_new(events[0], last) or begins_again(events[0], last):
            return 0
        return (events[0].sequence - last.sequence) % 2**32 - 1

    def command_ended(self, command: EndedCommand) -> None:
        """A person's command has ended: its event, stored already or still to come, says who and why."""
        self._commands = [*self._commands[-200:], command]

    async def run(self) -> None:
        """Store what was not taken at once, and who asked for what, for ever."""
        while True:
            await asyncio.sleep(1.0)
            if self._waiting or self._commands or not self._followed:
                async with self._lock:
                    try:
                        await self._write()
                    except StorageError:
                        continue

    async def close(self) -> None:
        """Store what waits."""
        self._retry_at = 0.0
        async with self._lock:
            try:
                await self._write()
            except StorageError as error:
                log.error("events lost count=%d reason=%s", self.waiting, error)

    async def _write(self) -> None:
        if self.failed and self._clock.monotonic() < self._retry_at:
            raise StorageError("history.db: not written at the moment")
        waiting, commands, number = self._waiting[:], self._commands, self._taken
        now = self._clock.micros()
        names, revision, before = self._now, self._revision, self._positions

        def work(connection: Connection) -> tuple[dict[str, RingPosition], list[EndedCommand], set[str]]:
            touched = renames.follow(connection, names)
            rings = {equipment: position.ring for equipment, position in before.items()}
            for one in waiting:
                if store(connection, one, self.folds, now, rings.get(one.equipment)):
                    touched.add(one.equipment)
                if one.events:
                    rings[one.equipment] = one.events[-1].ring
            rest = []
            for command in commands:
                if attribute(connection, command, self.folds):
                    touched.add(command.equipment)
                elif now - command.ended <= LATE:
                    rest.append(command)
            found = {
                name: replace(position, ring=rings.get(name)) for name, position in ring_positions(connection).items()
            }
            return found, rest, touched

        try:
            found, rest, touched = await self._database.write(work)
        except StorageError as error:
            self._retry_at = self._clock.monotonic() + RETRY_PAUSE
            if not self.failed:
                log.error("events are not written reason=%s", error)
            self.failed = True
            for equipment in {one.equipment for one in waiting}:
                self.changed(equipment)
            raise
        self._stored = number
        del self._waiting[: len(waiting)]
        if revision == self._revision:
            self._commands = [*rest, *(one for one in self._commands if one not in commands)]
            self._positions, self._followed = found, True
        if self.failed:
            self.failed = False
            log.info("events are written again dropped=%d", self.dropped)
        for equipment in touched:
            self.changed(equipment)

    def _trim(self) -> None:
        """Drop the oldest deliveries when too much waits; what comes after them says how much was lost."""
        excess = self.waiting - MOST_WAITING
        while excess > 0 and len(self._waiting) > 1:
            gone = self._waiting.pop(0)
            excess -= len(gone.events)
            self.dropped += len(gone.events)
            log.error("events dropped machine=%s count=%d", gone.equipment, len(gone.events))
            missing = len(gone.events) + gone.lost
            for index, one in enumerate(self._waiting):
                if one.equipment == gone.equipment:
                    self._waiting[index] = Delivery(one.equipment, one.events, one.lost + missing)
                    break


# ---- what is stored ---------------------------------------------------------------------------------------


def ring_positions(connection: Connection) -> dict[str, RingPosition]:
    """Machine → its last stored event."""
    return {row[0]: RingPosition(row[1], row[2], row[3]) for row in POSITIONS(connection).all()}


def machine(connection: Connection, equipment: str) -> int:
    """Number under which the events of a machine are."""
    row = MACHINE(connection, name=equipment).first()
    if row is not None:
        return int(row[0])
    return int(NEW_MACHINE(connection, lasting_id=equipment, name=equipment).scalar_one())


def store(
    connection: Connection, delivery: Delivery, folds: Sequence[Fold], now: int, ring: Ring | None = None
) -> bool:
    """Store those events that are new, and that some were lost. True when anything was new.

    `ring`: the one of which this program stored before; None = none yet.
    """
    equipment = delivery.equipment
    row = POSITION(connection, equipment=equipment).first()
    position = known = None if row is None else RingPosition(row[0], row[1], row[2], ring)
    fresh: list[RingEvent] = []
    again: list[RingEvent] = []
    for event in delivery.events:
        if is_new(event, position):
            if position is not None and begins_again(event, position):
                again.append(event)
            fresh.append(event)
            position = position_of(event)
    if delivery.events and not fresh:
        return False
    told = [fold for fold in folds if equipment in fold.machines]
    # only before the first event of a delivery is anything missing: when that one is known, the loss is, too
    missing = delivery.lost if not fresh or fresh[0] is delivery.events[0] else 0
    if known is not None and fresh and fresh[0] not in again:  # whoever counted may have known less than is stored
        missing = min(missing, (fresh[0].sequence - known.sequence) % 2**32 - 1)
    number = machine(connection, equipment)
    if missing > 0:
        _note_gap(connection, equipment, missing, fresh[0] if fresh else None, position, now)
        for fold in told:
            fold.lose(connection, equipment, number, missing)
    for event in fresh:
        kept = _insert(connection, number, equipment, event)
        for fold in told:
            if event in again:
                fold.begin_again(connection, equipment, number, kept)
            fold.put(connection, equipment, number, kept)
    if fresh and position is not None:
        REACHED(connection, equipment=equipment, boot=position.boot, sequence=position.sequence, time=position.time)
    for fold in told:
        fold.done(connection, equipment)
    return True


def _insert(connection: Connection, machine: int, equipment: str, event: RingEvent) -> Event:
    value = event.value if math.isfinite(event.value) else None
    number = NEW(
        connection,
        machine=machine,
        boot=event.boot,
        sequence=event.sequence,
        time=event.time,
        code=event.code,
        source=event.source,
        value=value,
        words=packed(event.snapshot),
        request=event.request,
        person="",
        reason="",
    ).scalar_one()
    return Event(
        int(number),
        equipment,
        event.boot,
        event.sequence,
        event.time,
        event.code,
        event.source,
        value,
        tuple(event.snapshot),
        event.request,
    )


def attribute(connection: Connection, command: EndedCommand, folds: Sequence[Fold]) -> bool:
    """Write into the events that a command caused who had asked for it, and why; False when there are none (yet)."""
    rows = connection.execute(
        told()
        .where(
            event_machine.c.name == command.equipment,
            event_table.c.time.between(command.requested - LATE, command.ended + LATE),
            event_table.c.request.in_(command.requests),
            event_table.c.person == "",
        )
        .order_by(event_table.c.id)
    ).all()
    for row in rows:
        event = replace(event_of(row), person=command.person, reason=command.reason)
        ASKED(connection, person=event.person, reason=event.reason, number=event.id)
        for fold in folds:
            if event.equipment in fold.machines:
                fold.attributed(connection, event.equipment, event)
    return bool(rows)


def told() -> Select[*tuple[Any, ...]]:
    """Events with the names of their machines, as `event_of` takes them."""
    return select(*COLUMNS).join_from(event_table, event_machine, event_machine.c.id == event_table.c.machine)


_e = event_table.c
COLUMNS = (
    _e.id, event_machine.c.name, _e.boot, _e.sequence, _e.time, _e.code, _e.source, _e.value, _e.words, _e.request, _e.person, _e.reason,
)  # fmt: skip
"""Of an event and its machine."""


def event_of(row: Sequence[Any]) -> Event:
    """The event in a row of `told`."""
    id, equipment, boot, sequence, time, code, source, value, words, request, person, reason = row
    return Event(id, equipment, boot, sequence, time, code, source, value, unpacked(words), request, person, reason)


def cut(connection: Connection, before: int, at_once: int) -> tuple[int, bool]:
    """Remove events that happened before `before` [µs UTC], at most `at_once` of a machine; how many, and whether all are removed."""
    removed, done = 0, True
    for number in MACHINES(connection).scalars().all():
        gone = CUT(connection, machine=number, before=before, at_once=at_once).rowcount
        removed, done = removed + gone, done and gone < at_once
    CUT_GAPS(connection, before=before)
    return removed, done


def oldest(connection: Connection) -> int | None:
    """When the oldest event happened [µs UTC]."""
    time: int | None = OLDEST(connection).scalar()
    return time


def _note_gap(
    connection: Connection, equipment: str, lost: int, first: RingEvent | None, position: RingPosition | None, now: int
) -> None:
    boot, sequence, time = (
        (first.boot, first.sequence, first.time)
        if first is not None
        else (position.boot if position else 0, position.sequence if position else 0, now)
    )
    GAP(connection, equipment=equipment, boot=boot, sequence=sequence, time=time, count=lost)


def lost(connection: Connection, equipment: str, begin: int | None, end: int | None) -> int:
    """Events of a machine (empty: of all) that were lost in this time."""
    found = select(func.coalesce(func.sum(event_gap.c["count"]), 0))
    if equipment:
        found = found.where(event_gap.c.equipment == equipment)
    if begin is not None:
        found = found.where(event_gap.c.time >= begin)
    if end is not None:
        found = found.where(event_gap.c.time < end)
    return int(connection.execute(found).scalar_one())


_mark = event_mark.c
POSITIONS = Statement(select(_mark.equipment, _mark.boot, _mark.sequence, _mark.time))
POSITION = Statement(select(_mark.boot, _mark.sequence, _mark.time).where(_mark.equipment == bindparam("equipment")))
REACHED = Statement(
    updating(event_mark, ["equipment"], lambda new: {"boot": new.boot, "sequence": new.sequence, "time": new.time}),
    "equipment",
    "boot",
    "sequence",
    "time",
)
MACHINE = Statement(select(event_machine.c.id).where(event_machine.c.name == bindparam("name")))
MACHINES = Statement(select(event_machine.c.id))
NEW_MACHINE = Statement(insert(event_machine).returning(event_machine.c.id), "lasting_id", "name")
NEW = Statement(
    insert(event_table).returning(_e.id),
    "machine", "boot", "sequence", "time", "code", "source", "value", "words", "request", "person", "reason",
)  # fmt: skip
ASKED = Statement(update(event_table).where(_e.id == bindparam("number")), "person", "reason")
GAP = Statement(
    updating(event_gap, ["equipment", "boot", "sequence"], lambda new: {"count": event_gap.c["count"] + new["count"]}),
    *event_gap.c.keys(),
)
_old = event_table.alias()
CUT = Statement(
    delete(event_table).where(
        _e.id.in_(
            select(_old.c.id)
            .where(_old.c.machine == bindparam("machine"), _old.c.time < bindparam("before"))
            .order_by(_old.c.time)
            .limit(bindparam("at_once"))
        )
    )
)
CUT_GAPS = Statement(delete(event_gap).where(event_gap.c.time < bindparam("before")))
_least = select(func.min(_e.time)).where(_e.machine == event_machine.c.id).correlate(event_machine).scalar_subquery()
_of_each = select(_least.label("t")).select_from(event_machine).subquery()
OLDEST = Statement(select(func.min(_of_each.c.t)))
