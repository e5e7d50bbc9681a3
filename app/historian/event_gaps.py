"""Events that a ring had overwritten before they were read: how many, and between which two that are known.

A gap is stored with the first event after it (events.py); what came before it is the event of that machine that was stored last.
"""

from dataclasses import dataclass

from sqlalchemy import Connection, bindparam, select

from app.historian.dialect import Statement, unindexed
from app.historian.tables import event, event_gap, event_machine

MOST = 100
"""Gaps in one answer, the newest."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place in an event ring."""

    boot: int
    sequence: int
    time: int
    """[µs UTC]"""


@dataclass(frozen=True, slots=True)
class Gap:
    """Events of a machine that are lost."""

    equipment: str
    count: int
    noticed: int
    """Time of the first event after them; of one that does not come, when it was noticed [µs UTC]."""
    after: Place | None
    """The last event before them; None: there is none."""
    before: Place | None
    """The first one after them; None: none came."""


def gaps(connection: Connection, equipment: str, begin: int | None, end: int | None, most: int = MOST) -> list[Gap]:
    """The newest `most` gaps of a machine (empty: of all) that were noticed in this time, newest first."""
    found = (
        select(
            event_gap.c.equipment,
            event_machine.c.id,
            event_gap.c.boot,
            event_gap.c.sequence,
            event_gap.c.time,
            event_gap.c["count"],
        )
        .outerjoin_from(event_gap, event_machine, event_machine.c.name == event_gap.c.equipment)
        .order_by(event_gap.c.time.desc(), event_gap.c.equipment, event_gap.c.sequence.desc())
        .limit(most)
    )
    if equipment:
        found = found.where(event_gap.c.equipment == equipment)
    if begin is not None:
        found = found.where(event_gap.c.time >= begin)
    if end is not None:
        found = found.where(event_gap.c.time < end)
    rows = connection.execute(found).all()
    return [
        Gap(name, count, time, *_neighbours(connection, machine, Place(boot, sequence, time)))
        for name, machine, boot, sequence, time, count in rows
    ]


def _neighbours(connection: Connection, machine: int | None, stored: Place) -> tuple[Place | None, Place | None]:
    """The events before and after the gap that is stored at a place."""
    place = {"machine": machine, "time": stored.time, "boot": stored.boot, "sequence": stored.sequence}
    first = FIRST(connection, **place).scalar()
    if first is None:  # none came after it: it is stored with the last one before it
        row = LAST(connection, **place).first()
        return (None if row is None else Place(*row)), None
    # in the order of storing, which is that of the ring whatever its clock says
    row = BEFORE(connection, first=first, machine=machine).first()
    return (None if row is None else Place(*row)), stored


_there = (
    event.c.machine == bindparam("machine"),
    event.c.boot == bindparam("boot"),
    event.c.sequence == bindparam("sequence"),
)
_place = select(event.c.boot, event.c.sequence, event.c.time)
FIRST = Statement(select(event.c.id).where(*_there, event.c.time == bindparam("time")))
LAST = Statement(_place.where(*_there, event.c.time <= bindparam("time")).order_by(event.c.time.desc()).limit(1))
BEFORE = Statement(
    _place.where(event.c.id < bindparam("first"), unindexed(event.c.machine) == bindparam("machine"))
    .order_by(event.c.id.desc())
    .limit(1)
)
