"""Product passages: what became of each product on a machine that tracks them, made of the machine's own events.

How they are kept is told in event_history.py. Events that were lost are counted in every passage that was under way. Codes are those of
machines that track products (docs/registers).
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Any

from sqlalchemy import Connection

from app.clock import Clock
from app.db import Database
from app.historian import event_history
from app.historian.event_history import LATE, TOLD_AFTER, TOLD_BEFORE, Book, Delivery, EventHistory, Told
from app.plant.definitions import Equipment
from app.plant.events import RingEvent
from app.records.snapshot import Field, decode

TABLE = "product"
"""Key of the table of a machine that tracks products."""


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


LAYOUT: Mapping[str, Field] = {"product": Field(0, "u32"), "second": Field(2, "u32"), "value": Field(4, "f32")}


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What the words of an event say."""

    product: int
    """0 = none."""
    second: int
    value: float | None


def snapshot_of(words: Sequence[int]) -> Snapshot:
    said = decode(LAYOUT, words)
    return Snapshot(int(said["product"] or 0), int(said["second"] or 0), said["value"])


def tracks_products(item: Equipment) -> bool:
    """Whether a machine tells of products: it has an event ring and a product table."""
    plc = item.type.device.plc
    return plc is not None and plc.events and TABLE in item.type.tables


class Passages(EventHistory):
    """Keeps the passages of all machines that track products."""

    name = "passages"

    def __init__(
        self, database: Database, clock: Clock, changed: Callable[[str], None] = lambda equipment: None
    ) -> None:
        super().__init__(database, clock, changed)
        self._alarms: Mapping[str, frozenset[int]] = {}

    def keeps(self, item: Equipment) -> bool:
        return tracks_products(item)

    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant: those that track products, and which of their events are alarms."""
        tracking = [item for item in machines if tracks_products(item)]
        super().configure(tracking)
        self._alarms = {item.id: frozenset(one.event for one in item.alarms if one.event) for item in tracking}

    def caused_by(self, command: int, arguments: Mapping[str, Any]) -> tuple[int, int | None] | None:
        return (BY_COMMAND[command], int(arguments.get("product", 0)) or None) if command in BY_COMMAND else None

    def book(self) -> Book:
        return PassageBook(self._alarms)


class PassageBook(Book):
    """What the events of machines that track products mean."""

    def __init__(self, alarms: Mapping[str, Collection[int]]) -> None:
        """`alarms`: machine → codes of its events that are alarms."""
        self._alarms = alarms

    def put(self, connection: Connection, equipment: str, event: RingEvent) -> None:
        _put(connection, equipment, event, self._alarms.get(equipment, ()))

    def lose(self, connection: Connection, equipment: str, lost: int) -> None:
        connection.exec_driver_sql(
            "UPDATE passage SET missed = missed + ? WHERE equipment = ? AND outcome = 'open'", (lost, equipment)
        )

    def begin_again(self, connection: Connection, equipment: str, event: RingEvent) -> None:
        connection.exec_driver_sql(
            "UPDATE passage SET outcome = 'unknown', ended = ? WHERE equipment = ? AND outcome = 'open'",
            (event.time, equipment),
        )

    def attribute(self, connection: Connection, told: Told) -> bool:
        return attribute(connection, told)


# ---- what is stored ---------------------------------------------------------------------------------------


def store(connection: Connection, delivery: Delivery, alarms: Collection[int], now: int) -> bool:
    """Store those events that are new, and that some were lost; `alarms` are the codes that are alarms. True when anything was new."""
    return event_history.store(connection, delivery, PassageBook({delivery.equipment: alarms}), now)


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
        case Code.INSERTED | Code.EDITED if said.value is not None and said.value > 0:
            # the person's measure, where the device passes it on; 0 where it does not
            connection.exec_driver_sql("UPDATE passage SET length = ? WHERE id = ?", (said.value, number))
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
            # source 0: told as unloaded a moment ago, but the unloader found nothing there; the device counts it as lost, too
            gripped = ("unloaded",) if event.source == 0 else ()
            _end(connection, number, Outcome.LOST, event.time, "open", "unknown", *gripped)


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
    connection.exec_driver_sql(
        "INSERT OR IGNORE INTO passage_step (passage, boot, sequence, time, code, source, value, second, second_value, person, reason) "
        "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, '', '')",
        (number, event.boot, event.sequence, event.time, event.code, event.source, value, said.second, said.value),
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
