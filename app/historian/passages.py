"""Product passages: what became of each product on a machine that tracks them, made of the machine's own events.

How events are kept is told in events.py. Events that were lost are counted in every passage that was under way. Codes are those of
machines that track products (docs/registers).
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from sqlalchemy import Connection

from app.historian.events import Fold
from app.plant.definitions import Equipment
from app.records.event import Event
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
LATE = 60_000_000
"""An event this long after the end of a passage still belongs to it [µs]; later it is another product with its number."""
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


class Passages(Fold):
    """What the events of machines that track products mean."""

    def __init__(self) -> None:
        self._alarms: Mapping[str, frozenset[int]] = {}

    def configure(self, machines: Iterable[Equipment]) -> None:
        """Take the machines of a plant: those that track products, and which of their events are alarms."""
        tracking = [item for item in machines if tracks_products(item)]
        self._alarms = {item.id: frozenset(one.event for one in item.alarms if one.event) for item in tracking}
        self.machines = frozenset(self._alarms)

    def put(self, connection: Connection, equipment: str, event: Event) -> None:
        _put(connection, equipment, event, self._alarms.get(equipment, ()))

    def lose(self, connection: Connection, equipment: str, lost: int) -> None:
        connection.exec_driver_sql(
            "UPDATE passage SET missed = missed + ? WHERE equipment = ? AND outcome = 'open'", (lost, equipment)
        )

    def begin_again(self, connection: Connection, equipment: str, event: Event) -> None:
        connection.exec_driver_sql(
            "UPDATE passage SET outcome = 'unknown', ended = ? WHERE equipment = ? AND outcome = 'open'",
            (event.time, event.equipment),
        )

    def attributed(self, connection: Connection, equipment: str, event: Event) -> None:
        connection.exec_driver_sql(
            "UPDATE passage_step SET person = ?, reason = ? WHERE boot = ? AND sequence = ? AND time = ? "
            "AND passage IN (SELECT id FROM passage WHERE equipment = ?)",
            (event.person, event.reason, event.boot, event.sequence, event.time, event.equipment),
        )


# ---- what is stored ---------------------------------------------------------------------------------------


def _put(connection: Connection, equipment: str, event: Event, alarms: Collection[int]) -> None:
    said = snapshot_of(event.words)
    if not said.product:
        return
    number = _passage(connection, equipment, event, said.product)
    _step(connection, number, event, said, alarms)
    if event.code in PAIRS and said.second and said.second != said.product:
        # the one in front is part of it, too; its step names the one behind
        front = _passage(connection, equipment, event, said.second)
        _step(connection, front, event, Snapshot(said.second, said.product, said.value), alarms)
    match event.code:
        case Code.IDENTIFIED if event.value is not None:
            connection.exec_driver_sql("UPDATE passage SET length = ? WHERE id = ?", (event.value, number))
        case Code.INSERTED | Code.EDITED if said.value is not None and said.value > 0:
            # the person's measure, where the device passes it on; 0 where it does not
            connection.exec_driver_sql("UPDATE passage SET length = ? WHERE id = ?", (said.value, number))
        case Code.HEAD | Code.TAIL:
            _found(connection, number)
            if event.value is not None:
                connection.exec_driver_sql(
                    "UPDATE passage SET corrections = corrections + 1, greatest = max(coalesce(greatest, 0), ?) WHERE id = ?",
                    (abs(event.value), number),
                )
        case Code.UNEXPECTED:
            _found(connection, number)
        case Code.TOLERANCE if event.value is not None:
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


def _passage(connection: Connection, equipment: str, event: Event, product: int) -> int:
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


def _step(connection: Connection, number: int, event: Event, said: Snapshot, alarms: Collection[int]) -> None:
    connection.exec_driver_sql(
        "INSERT OR IGNORE INTO passage_step (passage, boot, sequence, time, code, source, value, second, second_value, person, reason) "
        "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, '', '')",
        (
            number,
            event.boot,
            event.sequence,
            event.time,
            event.code,
            event.source,
            event.value,
            said.second,
            said.value,
        ),
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
    return len(numbers), len(numbers) < at_once
