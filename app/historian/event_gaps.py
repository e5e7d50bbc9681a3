"""Events that a ring had overwritten before they were read: how many, and between which two that are known.

A gap is stored with the first event after it (events.py); what came before it is the event of that machine that was stored last.
"""

from dataclasses import dataclass

from sqlalchemy import Connection

from app.historian.event_query import filtered

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
    where, given = filtered((("g.equipment = ?", equipment or None), ("g.time >= ?", begin), ("g.time < ?", end)))
    rows = connection.exec_driver_sql(
        "SELECT g.equipment, m.id, g.boot, g.sequence, g.time, g.count FROM event_gap g LEFT JOIN event_machine m ON m.name = g.equipment "
        f"{where} ORDER BY g.time DESC, g.equipment, g.sequence DESC LIMIT ?",
        (*given, most),
    ).all()
    return [
        Gap(name, count, time, *_neighbours(connection, machine, Place(boot, sequence, time)))
        for name, machine, boot, sequence, time, count in rows
    ]


def _neighbours(connection: Connection, machine: int | None, stored: Place) -> tuple[Place | None, Place | None]:
    """The events before and after the gap that is stored at a place."""
    first = connection.exec_driver_sql(
        "SELECT id FROM event WHERE machine = ? AND time = ? AND boot = ? AND sequence = ?",
        (machine, stored.time, stored.boot, stored.sequence),
    ).scalar()
    if first is None:  # none came after it: it is stored with the last one before it
        row = connection.exec_driver_sql(
            "SELECT boot, sequence, time FROM event WHERE machine = ? AND time <= ? AND boot = ? AND sequence = ? "
            "ORDER BY time DESC LIMIT 1",
            (machine, stored.time, stored.boot, stored.sequence),
        ).first()
        return (None if row is None else Place(*row)), None
    row = connection.exec_driver_sql(  # in the order of storing, which is that of the ring whatever its clock says
        "SELECT boot, sequence, time FROM event NOT INDEXED WHERE id < ? AND machine = ? ORDER BY id DESC LIMIT 1",
        (first, machine),
    ).first()
    return (None if row is None else Place(*row)), stored
