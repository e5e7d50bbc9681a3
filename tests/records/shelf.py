"""Records in a dictionary, and readings of rings made by hand."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from app.plant.definitions import EquipmentType
from app.records.kind import RecordKind
from app.records.record import Reading, Record
from app.records.snapshot import decode
from tests.historian.rings import Event


def reading(kind: EquipmentType, event: Event) -> Reading:
    """An event of a ring in the words of its type."""
    return Reading(
        event.boot,
        event.sequence,
        event.time,
        event.code,
        kind.events.get(event.code, str(event.code)),
        event.source,
        event.value if math.isfinite(event.value) else None,
        decode(kind.snapshot, event.snapshot, event.code),
    )


@dataclass
class MemoryShelf:
    """The records of one machine."""

    records: list[Record] = field(default_factory=list)
    events: dict[int, list[Reading]] = field(default_factory=dict)
    """Record → its events."""

    def latest(self, kind: RecordKind, number: int) -> Record | None:
        return next((one for one in reversed(self.records) if (one.kind, one.number) == (kind.name, number)), None)

    def open(self, kind: RecordKind) -> Iterable[Record]:
        return [one for one in self.records if one.kind == kind.name and one.open]

    def lasting(self, kind: str, time: int) -> int:
        return sum(
            one.kind == kind and one.begun <= time and (one.ended is None or one.ended > time) for one in self.records
        )

    def add(self, record: Record) -> Record:
        record.id = len(self.records) + 1
        self.records.append(record)
        self.events[record.id] = []
        return record

    def put(self, record: Record) -> None:
        self.records[record.id - 1] = record

    def note(self, record: Record, event: Reading) -> None:
        self.events[record.id].append(event)
