"""Stops of machines: how often each was stopped, and what came first the last time, as the journal has it."""

from dataclasses import dataclass, field

from sqlalchemy import Connection, select

from app.alarms.first_out import STOP_SPAN, TRIP
from app.alarms.journal import Record, by_number
from app.alarms.lifecycle import Entry
from app.alarms.tables import journal_table

SERIOUS = 2
"""An alarm of a first-out group that is so important, or more, stops a machine as a trip does."""


@dataclass(frozen=True, slots=True)
class Stops:
    """Of one machine."""

    count: int
    first_out: Record
    """What came first in the last of them."""


def read_stops(connection: Connection, begin: int, end: int) -> dict[str, Stops]:
    """Machine → its stops that began with begin <= time < end [µs UTC]; one that had none is left out.

    A machine is stopped by a trip, or another important alarm with a place in a first-out group (first_out.py), while none of these
    stands. What follows in the same group within a minute is of the same stop, and what a stop of before `begin` draws after it is, too.
    """
    table = journal_table.c
    rows = connection.execute(
        select(table.seq, table.time, table.event, table.alarm, table.equipment, table.ordinal, table.alarm_class, table.priority)
        .where(table.time >= begin, table.time < end, table.event.in_((Entry.RAISED, Entry.RTN, Entry.REMOVED)), table.equipment != "")
        .order_by(table.seq)
    ).all()  # fmt: skip
    machines: dict[str, _Machine] = {}
    for row in rows:
        machine = machines.setdefault(row.equipment, _Machine())
        serious = row.alarm_class == TRIP or row.priority <= SERIOUS
        if row.event == Entry.RAISED and row.ordinal:
            machine.raised(row.seq, row.time, row.alarm, first=row.ordinal == 1, serious=serious)
        elif row.event != Entry.RAISED:
            machine.standing.discard(row.alarm)
    records = by_number(connection, [one.last for one in machines.values() if one.count])
    return {name: Stops(one.count, records[one.last]) for name, one in machines.items() if one.count}


@dataclass(slots=True)
class _Machine:
    """One that is followed through the journal."""

    count: int = 0
    last: int = 0
    """What came first in the last stop."""
    head: int = 0
    """What came first in the group."""
    latest: int = 0
    """When the last of the group came [µs UTC]; 0: nothing came yet."""
    standing: set[str] = field(default_factory=set)
    """Alarms that stop it."""

    def raised(self, seq: int, time: int, alarm: str, *, first: bool, serious: bool) -> None:
        """An alarm of a first-out group."""
        again = not self.standing and (time - self.latest >= STOP_SPAN if self.latest else False)
        if first or again:
            self.head = seq
        self.latest = time
        if not serious:
            return
        if self.head and self.head != self.last and not self.standing:
            self.count, self.last = self.count + 1, self.head
        self.standing.add(alarm)
