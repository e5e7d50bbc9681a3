"""What machines tell with their event rings, kept in the history: what every book of events has in common.

Nothing here is polled: order and times are those of the event ring. Every event is stored once, by its boot and sequence, so that a ring
delivered again after a crash changes nothing; the mark of a machine is written in the same transaction as what the event did. What the
events mean is the book's (`passages`, `runs`): a machine is in one book only, as there is one mark.
"""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import Connection

from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.historian import renames
from app.plant.definitions import Equipment
from app.plant.events import Mark, RingEvent, begins_again, is_new, mark_of

log = logging.getLogger(__name__)

RETRY_PAUSE = 5.0
"""Pause between attempts while the disk does not take anything [s]."""
MOST_WAITING = 50_000
"""Events kept in memory while the database does not take them; then the oldest are dropped, and counted as lost."""
LATE = 60_000_000
"""An event this long after the end of something still belongs to it [µs]; later it is another thing with its number."""
TOLD_BEFORE, TOLD_AFTER = 10_000_000, 3_000_000
"""How long before a command ended, and after, its event may have happened [µs]."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """What a link handed over at once."""

    equipment: str
    events: Sequence[RingEvent]
    lost: int = 0
    """Events lost before the first of them."""


@dataclass(frozen=True, slots=True)
class Told:
    """A person's command that caused an event."""

    equipment: str
    code: int
    """Of the event that it caused."""
    product: int | None
    """Whatever the command named: a product, a permissive; None: not known when it was asked (inserted), or all."""
    person: str
    reason: str
    requested: int
    """[µs UTC]"""
    ended: int


class Book(ABC):
    """What the events of some machines mean."""

    @abstractmethod
    def put(self, connection: Connection, equipment: str, event: RingEvent) -> None:
        """Store a new event."""

    @abstractmethod
    def lose(self, connection: Connection, equipment: str, lost: int) -> None:
        """So many events were lost before the next one."""

    @abstractmethod
    def begin_again(self, connection: Connection, equipment: str, event: RingEvent) -> None:
        """The ring counts from 1 again with `event`: the device knows nothing any more of what was under way."""

    @abstractmethod
    def attribute(self, connection: Connection, told: Told) -> bool:
        """Write into the event that a command caused who had asked for it; False when there is no such event yet."""


class EventHistory(ABC):
    """Keeps a book of machines. A history that is full or broken stops nothing: it is told, and tried again."""

    name = "events"
    """In the log."""

    def __init__(
        self, database: Database, clock: Clock, changed: Callable[[str], None] = lambda equipment: None
    ) -> None:
        """`changed` is called with a machine when there is something new of it."""
        self.failed = False
        """True while the database does not take what happens."""
        self.dropped = 0
        """Events dropped because it did not take them for too long."""
        self.changed = changed
        self._database = database
        self._clock = clock
        self._machines: frozenset[str] = frozenset()
        self._marks: dict[str, Mark] = {}
        self._names: dict[str, str] = {}
        """Lasting id → name under which the rows of a machine are, as far as is known."""
        self._now: dict[str, str] = {}
        """Lasting id → name of the machines of this book."""
        self._followed = True
        """Whether the rows have the names of the plant as it is now."""
        self._revision = 0
        """Of the names."""
        self._waiting: list[Delivery] = []
        self._told: list[Told] = []
        self._taken = self._stored = 0
        self._lock = asyncio.Lock()
        self._retry_at = 0.0

    async def load(self) -> None:
        """Read how far the events of each machine were stored; a history that cannot be read is told by the recorder."""

        def work(connection: Connection) -> tuple[dict[str, Mark], dict[str, str]]:
            return marks(connection), renames.names(connection)

        try:
            self._marks, self._names = await self._database.read(work)
        except StorageError as error:
            log.warning("marks of events not read reason=%s", error)
            return
        for equipment in self._now.values():
            self.changed(equipment)

    @abstractmethod
    def keeps(self, item: Equipment) -> bool:
        """Whether a machine is in this book."""

    @abstractmethod
    def caused_by(self, command: int, arguments: Mapping[str, Any]) -> tuple[int, int | None] | None:
        """Code of the event that a command (its code) causes, and what it is about (`Told.product`); None: none that is kept."""

    @abstractmethod
    def book(self) -> Book:
        """What the events mean as the plant is now; it is used on another thread."""

    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant that are in this book; what is kept of one that was renamed gets its new name."""
        kept = [item for item in machines if self.keeps(item)]
        self._machines = frozenset(item.id for item in kept)
        now = self._now = {item.lasting: item.id for item in kept}
        former = {self._names.get(id, id): name for id, name in now.items()}
        moved = {before: after for before, after in former.items() if before != after}
        if moved:
            taken = set(moved.values()) - set(moved)
            self._marks = {moved.get(name, name): mark for name, mark in self._marks.items() if name not in taken}
            self._waiting = [replace(one, equipment=moved.get(one.equipment, one.equipment)) for one in self._waiting]
            self._told = [replace(one, equipment=moved.get(one.equipment, one.equipment)) for one in self._told]
        self._followed = self._followed and all(self._names.get(id) == name for id, name in now.items())
        self._names |= now
        self._revision += bool(moved)

    def last(self, equipment: str) -> Mark | None:
        """The last event of a machine that is stored; None = none ever was."""
        return self._marks.get(equipment)

    @property
    def waiting(self) -> int:
        """Events that the database has not taken yet."""
        return sum(len(one.events) for one in self._waiting)

    async def take(self, equipment: str, events: Sequence[RingEvent], lost: int = 0) -> None:
        """Keep what happened; returns when it is stored (`last` says how far that is).

        Raises:
            StorageError: the database does not take it now; it waits in memory and is tried again by `run`. Until it is stored the ring of
                the machine is where a server that was killed finds it again.
        """
        if equipment not in self._machines or not (events or lost):
            return
        self._waiting.append(Delivery(equipment, tuple(events), lost))
        self._taken += 1
        number = self._taken
        self._trim()
        async with self._lock:
            if self._stored < number:
                await self._write()

    def told(self, told: Told) -> None:
        """A person's command has ended: its event, stored already or still to come, says who and why."""
        self._told = [*self._told[-200:], told]

    async def run(self) -> None:
        """Store what was not taken at once, and who asked for what, for ever."""
        while True:
            await asyncio.sleep(1.0)
            if self._waiting or self._told or not self._followed:
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
                log.error("%s lost events=%d reason=%s", self.name, self.waiting, error)

    async def _write(self) -> None:
        if self.failed and self._clock.monotonic() < self._retry_at:
            raise StorageError("history.db: not written at the moment")
        waiting, told, number = self._waiting[:], self._told, self._taken
        now, book = self._clock.micros(), self.book()
        names, revision = self._now, self._revision

        def work(connection: Connection) -> tuple[dict[str, Mark], list[Told], set[str]]:
            touched = renames.follow(connection, names)
            for one in waiting:
                if store(connection, one, book, now):
                    touched.add(one.equipment)
            rest = []
            for command in told:
                if book.attribute(connection, command):
                    touched.add(command.equipment)
                elif now - command.ended <= LATE:
                    rest.append(command)
            return marks(connection), rest, touched

        try:
            found, rest, touched = await self._database.write(work)
        except StorageError as error:
            self._retry_at = self._clock.monotonic() + RETRY_PAUSE
            if not self.failed:
                log.error("%s are not written reason=%s", self.name, error)
            self.failed = True
            raise
        self._stored = number
        del self._waiting[: len(waiting)]
        if revision == self._revision:
            self._told = [*rest, *(one for one in self._told if one not in told)]
            self._marks, self._followed = found, True
        if self.failed:
            self.failed = False
            log.info("%s are written again dropped=%d", self.name, self.dropped)
        for equipment in touched:
            self.changed(equipment)

    def _trim(self) -> None:
        """Drop the oldest deliveries when too much waits; what comes after them says how much was lost."""
        excess = self.waiting - MOST_WAITING
        while excess > 0 and len(self._waiting) > 1:
            gone = self._waiting.pop(0)
            excess -= len(gone.events)
            self.dropped += len(gone.events)
            log.error("%s dropped machine=%s events=%d", self.name, gone.equipment, len(gone.events))
            missing = len(gone.events) + gone.lost
            for index, one in enumerate(self._waiting):
                if one.equipment == gone.equipment:
                    self._waiting[index] = Delivery(one.equipment, one.events, one.lost + missing)
                    break


# ---- what is stored ---------------------------------------------------------------------------------------


def marks(connection: Connection) -> dict[str, Mark]:
    """Machine → its last stored event."""
    rows = connection.exec_driver_sql("SELECT equipment, boot, sequence, time FROM event_mark").all()
    return {row[0]: Mark(row[1], row[2], row[3]) for row in rows}


def store(connection: Connection, delivery: Delivery, book: Book, now: int) -> bool:
    """Store those events that are new, and that some were lost. True when anything was new."""
    equipment = delivery.equipment
    row = connection.exec_driver_sql(
        "SELECT boot, sequence, time FROM event_mark WHERE equipment = ?", (equipment,)
    ).first()
    mark = known = None if row is None else Mark(row[0], row[1], row[2])
    fresh: list[RingEvent] = []
    again: list[RingEvent] = []
    for event in delivery.events:
        if is_new(event, mark):
            if mark is not None and begins_again(event, mark):
                again.append(event)
            fresh.append(event)
            mark = mark_of(event)
    if delivery.events and not fresh:
        return False
    # only before the first event of a delivery is anything missing: when that one is known, the loss is, too
    missing = delivery.lost if not fresh or fresh[0] is delivery.events[0] else 0
    if (
        known is not None and fresh and fresh[0].sequence > known.sequence
    ):  # whoever counted may have known less than is stored
        missing = min(missing, fresh[0].sequence - known.sequence - 1)
    if missing > 0:
        _note_gap(connection, equipment, missing, fresh[0] if fresh else None, mark, now)
        book.lose(connection, equipment, missing)
    for event in fresh:
        if event in again:
            book.begin_again(connection, equipment, event)
        book.put(connection, equipment, event)
    if fresh and mark is not None:
        connection.exec_driver_sql(
            "INSERT INTO event_mark (equipment, boot, sequence, time) VALUES (?, ?, ?, ?) ON CONFLICT (equipment) DO UPDATE "
            "SET boot = excluded.boot, sequence = excluded.sequence, time = excluded.time",
            (equipment, mark.boot, mark.sequence, mark.time),
        )
    return True


def _note_gap(
    connection: Connection, equipment: str, lost: int, first: RingEvent | None, mark: Mark | None, now: int
) -> None:
    boot, sequence, time = (
        (first.boot, first.sequence, first.time)
        if first is not None
        else (mark.boot if mark else 0, mark.sequence if mark else 0, now)
    )
    connection.exec_driver_sql(
        "INSERT INTO event_gap (equipment, boot, sequence, time, count) VALUES (?, ?, ?, ?, ?) "
        "ON CONFLICT (equipment, boot, sequence) DO UPDATE SET count = count + excluded.count",
        (equipment, boot, sequence, time, lost),
    )


def lost(connection: Connection, equipment: str, begin: int | None, end: int | None) -> int:
    """Events of a machine (empty: of all) that were lost in this time."""
    given: list[object] = []
    parts = []
    for sentence, value in (("equipment = ?", equipment or None), ("time >= ?", begin), ("time < ?", end)):
        if value is not None:
            parts.append(sentence)
            given.append(value)
    where = f"WHERE {' AND '.join(parts)}" if parts else ""
    return int(
        connection.exec_driver_sql(f"SELECT coalesce(sum(count), 0) FROM event_gap {where}", tuple(given)).scalar_one()
    )
