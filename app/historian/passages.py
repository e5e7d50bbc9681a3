"""Product passages: what became of each product on a machine that tracks them, made of the machine's own events.

Nothing here is polled: order and times are those of the event ring. Every event is stored once, by its boot and sequence, so that a ring
delivered again after a crash changes nothing; the mark of a machine is written in the same transaction as what the event did. Events that
were lost are counted in every passage that was under way. Codes are those of machines that track products (docs/registers).
"""

import asyncio
import logging
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from sqlalchemy import Connection

from app.clock import Clock
from app.db import Database
from app.errors import StorageError
from app.plant.definitions import Equipment
from app.plant.events import Mark, RingEvent, Snapshot, begins_again, is_new, mark_of, snapshot_of

log = logging.getLogger(__name__)

TABLE = "product"
"""Key of the table of a machine that tracks products."""
RETRY_PAUSE = 5.0
"""Pause between attempts while the disk does not take anything [s]."""
MOST_WAITING = 50_000
"""Events kept in memory while the database does not take them; then the oldest are dropped, and counted as lost."""
LATE = 60_000_000
"""An event this long after the end of a product still belongs to it [µs]; later it is another product with its number."""
TOLD_BEFORE, TOLD_AFTER = 10_000_000, 3_000_000
"""How long before a command ended, and after, its event may have happened [µs]."""


class Code(IntEnum):
    """Events that make a passage."""

    ARRIVED = 1
    IDENTIFIED = 2
    HEAD = 3
    TAIL = 4
    UNLOADED = 5
    DELETED = 6
    EDITED = 7
    INSERTED = 8
    CONFIRMED = 9
    TOLERANCE = 10
    LOST = 11
    UNEXPECTED = 12
    WITHDRAWN = 15
    LEFT_BACKWARDS = 16
    GAP_STOP = 20
    GAP_CLEAR = 21


class Outcome(StrEnum):
    """What became of a product."""

    OPEN = "open"
    """It is on its way."""
    UNLOADED = "unloaded"
    DELETED = "deleted"
    LOST = "lost"
    RETURNED = "returned"
    """It went back past the beginning."""
    UNKNOWN = "unknown"
    """Its end was not seen: events were lost, or another product came with its number."""


ENTRIES = (Code.ARRIVED, Code.INSERTED)
"""With these a passage begins; with `UNEXPECTED` when nothing is known of the product."""
PAIRS = (Code.GAP_STOP, Code.GAP_CLEAR)
NOT_OVER = ("open", "lost", "unknown")
BY_COMMAND: Mapping[int, int] = {
    5: Code.DELETED,
    6: Code.EDITED,
    7: Code.CONFIRMED,
    8: Code.INSERTED,
}
"""Code of a command → code of the event that it causes."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """What a link handed over at once."""

    equipment: str
    events: Sequence[RingEvent]
    lost: int = 0
    """Events lost before the first of them."""


@dataclass(frozen=True, slots=True)
class Told:
    """A person's command that changed a product."""

    equipment: str
    code: int
    """Of the event that it caused."""
    product: int | None
    """None: the number was not known when it was asked (inserted), or all."""
    person: str
    reason: str
    requested: int
    """[µs UTC]"""
    ended: int


def tracks_products(item: Equipment) -> bool:
    """Whether a machine tells of products: it has an event ring and a product table."""
    plc = item.type.device.plc
    return plc is not None and plc.events and TABLE in item.type.tables


class Passages:
    """Keeps the passages of all machines. A history that is full or broken stops nothing: it is told, and tried again."""

    def __init__(
        self, database: Database, clock: Clock, changed: Callable[[str], None] = lambda equipment: None
    ) -> None:
        """`changed` is called with a machine when its passages are other ones now."""
        self.failed = False
        """True while the database does not take what happens."""
        self.dropped = 0
        """Events dropped because it did not take them for too long."""
        self.changed = changed
        self._database = database
        self._clock = clock
        self._alarms: Mapping[str, frozenset[int]] = {}
        self._tracking: frozenset[str] = frozenset()
        self._marks: dict[str, Mark] = {}
        self._waiting: list[Delivery] = []
        self._told: list[Told] = []
        self._taken = self._stored = 0
        self._lock = asyncio.Lock()
        self._retry_at = 0.0

    async def load(self) -> None:
        """Read how far the events of each machine were stored; a history that cannot be read is told by the recorder."""
        try:
            self._marks = await self._database.read(marks)
        except StorageError as error:
            log.warning("marks of events not read reason=%s", error)

    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant: those that track products, and which of their events are alarms."""
        tracking = [item for item in machines if tracks_products(item)]
        self._tracking = frozenset(item.id for item in tracking)
        self._alarms = {item.id: frozenset(one.event for one in item.alarms if one.event) for item in tracking}

    def last(self, equipment: str) -> Mark | None:
        """The last event of a machine that is stored; None = none ever was."""
        return self._marks.get(equipment)

    @property
    def waiting(self) -> int:
        """Events that the database has not taken yet."""
        return sum(len(one.events) for one in self._waiting)

    async def take(self, equipment: str, events: Sequence[RingEvent], lost: int = 0) -> None:
        """Keep what happened; returns when it is stored.

        Raises:
            StorageError: the database does not take it now; it waits in memory and is tried again by `run`.
        """
        if equipment not in self._tracking or not (events or lost):
            return
        self._waiting.append(Delivery(equipment, tuple(events), lost))
        self._taken += 1
        number = self._taken
        self._trim()
        async with self._lock:
            if self._stored < number:
                await self._write()

    def told(self, told: Told) -> None:
        """A person's command that changed a product has ended: its event, stored already or still to come, says who and why."""
        self._told = [*self._told[-200:], told]

    async def run(self) -> None:
        """Store what was not taken at once, and who asked for what, for ever."""
        while True:
            await asyncio.sleep(1.0)
            if self._waiting or self._told:
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
                log.error("passages lost events=%d reason=%s", self.waiting, error)

    async def _write(self) -> None:
        if self.failed and self._clock.monotonic() < self._retry_at:
            raise StorageError("history.db: not written at the moment")
        waiting, told, number = self._waiting[:], self._told, self._taken
        now, alarms = self._clock.micros(), self._alarms

        def work(connection: Connection) -> tuple[dict[str, Mark], list[Told], set[str]]:
            touched: set[str] = set()
            for one in waiting:
                if store(connection, one, alarms.get(one.equipment, frozenset()), now):
                    touched.add(one.equipment)
            rest = []
            for command in told:
                if attribute(connection, command):
                    touched.add(command.equipment)
                elif now - command.ended <= LATE:
                    rest.append(command)
            return marks(connection), rest, touched

        try:
            found, rest, touched = await self._database.write(work)
        except StorageError as error:
            self._retry_at = self._clock.monotonic() + RETRY_PAUSE
            if not self.failed:
                log.error("passages are not written reason=%s", error)
            self.failed = True
            raise
        self._stored = number
        del self._waiting[: len(waiting)]
        self._told = [*rest, *(one for one in self._told if one not in told)]
        self._marks = found
        if self.failed:
            self.failed = False
            log.info("passages are written again dropped=%d", self.dropped)
        for equipment in touched:
            self.changed(equipment)

    def _trim(self) -> None:
        """Drop the oldest deliveries when too much waits; what comes after them says how much was lost."""
        excess = self.waiting - MOST_WAITING
        while excess > 0 and len(self._waiting) > 1:
            gone = self._waiting.pop(0)
            excess -= len(gone.events)
            self.dropped += len(gone.events)
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


def store(connection: Connection, delivery: Delivery, alarms: Collection[int], now: int) -> bool:
    """Store those events that are new, and that some were lost; `alarms` are the codes that are alarms. True when anything was new."""
    equipment = delivery.equipment
    row = connection.exec_driver_sql(
        "SELECT boot, sequence, time FROM event_mark WHERE equipment = ?", (equipment,)
    ).first()
    mark = None if row is None else Mark(row[0], row[1], row[2])
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
    if delivery.lost > 0 and (not fresh or fresh[0] is delivery.events[0]):
        _lose(connection, equipment, delivery.lost, fresh[0] if fresh else None, mark, now)
    for event in fresh:
        if event in again:  # the device knows nothing any more of what was on it
            connection.exec_driver_sql(
                "UPDATE passage SET outcome = 'unknown', ended = ? WHERE equipment = ? AND outcome = 'open'",
                (event.time, equipment),
            )
        _put(connection, equipment, event, alarms)
    if fresh and mark is not None:
        connection.exec_driver_sql(
            "INSERT INTO event_mark (equipment, boot, sequence, time) VALUES (?, ?, ?, ?) ON CONFLICT (equipment) DO UPDATE "
            "SET boot = excluded.boot, sequence = excluded.sequence, time = excluded.time",
            (equipment, mark.boot, mark.sequence, mark.time),
        )
    return True


def _lose(
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
    connection.exec_driver_sql(
        "UPDATE passage SET missed = missed + ? WHERE equipment = ? AND outcome = 'open'", (lost, equipment)
    )


def _put(connection: Connection, equipment: str, event: RingEvent, alarms: Collection[int]) -> None:
    said = snapshot_of(event.snapshot)
    if not said.product:
        return
    number = _passage(connection, equipment, event, said.product)
    _step(connection, number, event, said, alarms)
    if event.code in PAIRS and said.second and said.second != said.product:
        # the one in front is part of it, too; its step names the one behind
        front = _passage(connection, equipment, event, said.second)
        _step(connection, front, event, Snapshot(said.second, said.product, said.value), alarms)
    match event.code:
        case Code.IDENTIFIED if math.isfinite(event.value):
            connection.exec_driver_sql("UPDATE passage SET length = ? WHERE id = ?", (event.value, number))
        case Code.HEAD | Code.TAIL:
            _found(connection, number)
            if math.isfinite(event.value):
                connection.exec_driver_sql(
                    "UPDATE passage SET corrections = corrections + 1, greatest = max(coalesce(greatest, 0), ?) WHERE id = ?",
                    (abs(event.value), number),
                )
        case Code.UNEXPECTED:
            _found(connection, number)
        case Code.TOLERANCE if math.isfinite(event.value):
            connection.exec_driver_sql(
                "UPDATE passage SET greatest = max(coalesce(greatest, 0), ?) WHERE id = ?", (abs(event.value), number)
            )
        case Code.UNLOADED:
            _end(connection, number, Outcome.UNLOADED, event.time, *NOT_OVER)
            # of those who arrived, nobody leaves before who came earlier: of these the end was among the lost events
            connection.exec_driver_sql(
                "UPDATE passage SET outcome = 'unknown', ended = ? WHERE equipment = ? AND outcome = 'open' AND missed > 0 "
                "AND entry = 1 AND entered < (SELECT entered FROM passage WHERE id = ? AND entry = 1)",
                (event.time, equipment, number),
            )
        case Code.DELETED:
            _end(connection, number, Outcome.DELETED, event.time, "open", "unknown")
        case Code.WITHDRAWN | Code.LEFT_BACKWARDS:
            _end(connection, number, Outcome.RETURNED, event.time, *NOT_OVER)
        case Code.LOST:
            _end(connection, number, Outcome.LOST, event.time, "open", "unknown")


def _passage(connection: Connection, equipment: str, event: RingEvent, product: int) -> int:
    """The passage that an event belongs to, a new one where there is none."""
    row = connection.exec_driver_sql(
        "SELECT id, outcome, ended FROM passage WHERE product = ? AND equipment = ? ORDER BY id DESC LIMIT 1",
        (product, equipment),
    ).first()
    begins = event.code in ENTRIES
    if row is not None:
        number, outcome, ended = int(row[0]), str(row[1]), row[2]
        if begins and outcome == Outcome.OPEN:
            _end(connection, number, Outcome.UNKNOWN, event.time, "open")
        elif not begins and (outcome in (Outcome.OPEN, Outcome.LOST) or event.time - ended <= LATE):
            return number
    return int(
        connection.exec_driver_sql(
            "INSERT INTO passage (equipment, boot, product, entered, entry, corrections, alarms, outcome, missed) "
            "VALUES (?, ?, ?, ?, ?, 0, '', 'open', 0) RETURNING id",
            (equipment, event.boot, product, event.time, event.code if begins or event.code == Code.UNEXPECTED else 0),
        ).scalar_one()
    )


def _step(connection: Connection, number: int, event: RingEvent, said: Snapshot, alarms: Collection[int]) -> None:
    value = event.value if math.isfinite(event.value) else None
    second = said.value if math.isfinite(said.value) else None
    connection.exec_driver_sql(
        "INSERT OR IGNORE INTO passage_step (passage, boot, sequence, time, code, source, value, second, second_value, person, reason) "
        "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, '', '')",
        (number, event.boot, event.sequence, event.time, event.code, event.source, value, said.second, second),
    )
    if event.code in alarms:
        mark = f" {event.code} "
        connection.exec_driver_sql(
            "UPDATE passage SET alarms = iif(alarms = '', ?, alarms || ?) WHERE id = ? AND instr(alarms, ?) = 0",
            (mark, f"{event.code} ", number, mark),
        )


def _found(connection: Connection, number: int) -> None:
    """Who is seen at a sensor is not lost."""
    connection.exec_driver_sql(
        "UPDATE passage SET outcome = 'open', ended = NULL WHERE id = ? AND outcome = 'lost'", (number,)
    )


def _end(connection: Connection, number: int, outcome: Outcome, time: int, *before: str) -> None:
    marks = ", ".join("?" * len(before))
    connection.exec_driver_sql(
        f"UPDATE passage SET outcome = ?, ended = ? WHERE id = ? AND outcome IN ({marks})",
        (outcome.value, time, number, *before),
    )


def attribute(connection: Connection, told: Told) -> bool:
    """Write into the event that a command caused who had asked for it; False when there is no such event yet."""
    row = connection.exec_driver_sql(
        "SELECT s.passage, s.boot, s.sequence FROM passage p JOIN passage_step s ON s.passage = p.id "
        "WHERE p.equipment = ? AND p.entered <= ? AND (p.ended IS NULL OR p.ended >= ?) AND (? IS NULL OR p.product = ?) "
        "AND s.code = ? AND s.time BETWEEN ? AND ? AND s.person = '' ORDER BY s.time DESC, p.id DESC LIMIT 1",
        (
            told.equipment,
            told.ended + TOLD_AFTER,
            told.requested - TOLD_BEFORE,
            told.product,
            told.product,
            told.code,
            told.requested - TOLD_BEFORE,
            told.ended + TOLD_AFTER,
        ),
    ).first()
    if row is None:
        return False
    connection.exec_driver_sql(
        "UPDATE passage_step SET person = ?, reason = ? WHERE passage = ? AND boot = ? AND sequence = ?",
        (told.person, told.reason, *row),
    )
    return True


def cut(connection: Connection, before: int, at_once: int) -> tuple[int, bool]:
    """Remove passages that entered before `before` [µs UTC], at most `at_once`; how many, and whether all are removed."""
    numbers = [
        row[0]
        for row in connection.exec_driver_sql(
            "SELECT id FROM passage WHERE entered < ? ORDER BY entered LIMIT ?", (before, at_once)
        )
    ]
    if numbers:
        connection.exec_driver_sql("DELETE FROM passage_step WHERE passage = ?", [(number,) for number in numbers])
        connection.exec_driver_sql("DELETE FROM passage WHERE id = ?", [(number,) for number in numbers])
    connection.exec_driver_sql("DELETE FROM event_gap WHERE time < ?", (before,))
    return len(numbers), len(numbers) < at_once
