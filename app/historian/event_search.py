"""Questions to the events of all machines: what a person filters, page by page, newest first."""

import heapq
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice

from sqlalchemy import ColumnElement, Connection, or_, select

from app.historian.dialect import folded, holds, know_folding
from app.historian.event_query import comes_after, counted
from app.historian.events import event_of, told
from app.historian.tables import event, event_machine
from app.records.event import Event

GONE = "→"
"""The name of a machine that is in the plant no more begins with this when another one has its name (renames.py)."""
Codes = Mapping[str, Collection[int]]
"""Machine → codes of its events."""


@dataclass(frozen=True, slots=True)
class EventFilter:
    """Which events a person wants to see; what is empty does not filter."""

    equipment: str = ""
    begin: int | None = None
    """Happened at or after [µs UTC]."""
    end: int | None = None
    """Happened before."""
    codes: Codes | None = None
    """Only these; of a machine that is not in it, none."""
    code: int | None = None
    """Only this one, whatever a machine calls it."""
    text: str = ""
    """Only those whose person or reason has this text in it, or that are in `worded`."""
    worded: Codes | None = None
    """Events whose own words have the text in them."""
    people: bool = True
    """Whether the text is looked for in persons and reasons, too."""
    before: tuple[int, int] | None = None
    """Only what comes after this one in the list (time, id): the next page."""


def find(connection: Connection, wanted: EventFilter, limit: int) -> list[Event]:
    """The newest `limit` events that `wanted` lets through, newest first."""
    lists = [_of_machine(connection, wanted, number, name, limit) for number, name in _machines(connection, wanted)]
    return list(islice(heapq.merge(*lists, key=lambda one: (one.time, one.id), reverse=True), limit))


def count(connection: Connection, wanted: EventFilter, most: int) -> int:
    """How many events `wanted` lets through, counted up to `most`."""
    found = 0
    for number, name in _machines(connection, wanted):
        found += counted(connection, event, _where(wanted, number, name), most - found)
    return found


def get(connection: Connection, number: int) -> Event | None:
    """The event `number`."""
    row = connection.execute(told().where(event.c.id == number)).first()
    return None if row is None else event_of(row)


def known(connection: Connection, equipment: str) -> bool:
    """Whether there is an event of a machine, whatever the plant says of it."""
    return any(_machines(connection, EventFilter(equipment))) and bool(find(connection, EventFilter(equipment), 1))


def _machines(connection: Connection, wanted: EventFilter) -> list[tuple[int, str]]:
    """Number and name of the machines that are asked for."""
    know_folding(connection)
    machines = select(event_machine.c.id, event_machine.c.name).order_by(event_machine.c.id)
    if wanted.equipment:
        machines = machines.where(event_machine.c.name == wanted.equipment)
    rows = connection.execute(machines)
    return [(row[0], row[1]) for row in rows if wanted.codes is None or wanted.codes.get(row[1])]


def _of_machine(connection: Connection, wanted: EventFilter, number: int, name: str, limit: int) -> Iterator[Event]:
    """Its events, newest first, read as they are asked for: the index has them in this order."""
    conditions = _where(wanted, number, name)
    newest = told().where(*conditions).order_by(event.c.time.desc(), event.c.id.desc()).limit(limit)
    return (event_of(row) for row in connection.execute(newest))


def _where(wanted: EventFilter, number: int, name: str) -> list[ColumnElement[bool]]:
    conditions: list[ColumnElement[bool]] = [event.c.machine == number]
    if wanted.begin is not None:
        conditions.append(event.c.time >= wanted.begin)
    if wanted.end is not None:
        conditions.append(event.c.time < wanted.end)
    if wanted.code is not None:
        conditions.append(event.c.code == wanted.code)
    if wanted.before is not None:
        conditions.append(comes_after(event.c.time, event.c.id, wanted.before))
    if wanted.codes is not None:
        conditions.append(event.c.code.in_(sorted(wanted.codes[name])))
    if wanted.text:
        text = wanted.text.casefold()
        asked: list[ColumnElement[bool]] = [event.c.code.in_(sorted((wanted.worded or {}).get(name, ())))]
        if wanted.people:
            said = or_(holds(folded(event.c.person), text), holds(folded(event.c.reason), text))
            asked.append((event.c.person != "") & said)
        conditions.append(or_(*asked))
    return conditions
