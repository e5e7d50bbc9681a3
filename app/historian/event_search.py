"""Questions to the events of all machines: what a person filters, page by page, newest first."""

import heapq
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice

from sqlalchemy import Connection

from app.historian.event_query import filtered
from app.historian.events import COLUMNS, event_of
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
        where, given = _where(wanted, number, name)
        rows = connection.exec_driver_sql(
            f"SELECT count(*) FROM (SELECT 1 FROM event e {where} LIMIT ?)", (*given, most - found)
        )
        found += int(rows.scalar_one())
    return found


def get(connection: Connection, number: int) -> Event | None:
    """The event `number`."""
    row = connection.exec_driver_sql(
        f"SELECT {COLUMNS} FROM event e JOIN event_machine m ON m.id = e.machine WHERE e.id = ?", (number,)
    ).first()
    return None if row is None else event_of(row)


def known(connection: Connection, equipment: str) -> bool:
    """Whether there is an event of a machine, whatever the plant says of it."""
    return any(_machines(connection, EventFilter(equipment))) and bool(find(connection, EventFilter(equipment), 1))


def _machines(connection: Connection, wanted: EventFilter) -> list[tuple[int, str]]:
    """Number and name of the machines that are asked for."""
    driver = connection.connection.driver_connection
    assert driver is not None
    driver.create_function("casefold", 1, str.casefold, deterministic=True)  # of SQLite itself only ASCII has no case
    where, given = filtered((("name = ?", wanted.equipment or None),))
    rows = connection.exec_driver_sql(f"SELECT id, name FROM event_machine {where} ORDER BY id", tuple(given))
    return [(row[0], row[1]) for row in rows if wanted.codes is None or wanted.codes.get(row[1])]


def _of_machine(connection: Connection, wanted: EventFilter, number: int, name: str, limit: int) -> Iterator[Event]:
    """Its events, newest first, read as they are asked for: the index has them in this order."""
    where, given = _where(wanted, number, name)
    rows = connection.exec_driver_sql(
        f"SELECT {COLUMNS} FROM event e JOIN event_machine m ON m.id = e.machine {where} "
        "ORDER BY e.time DESC, e.id DESC LIMIT ?",
        (*given, limit),
    )
    return (event_of(row) for row in rows)


def _where(wanted: EventFilter, number: int, name: str) -> tuple[str, list[object]]:
    where, given = filtered(
        (
            ("e.machine = ?", number),
            ("e.time >= ?", wanted.begin),
            ("e.time < ?", wanted.end),
            ("e.code = ?", wanted.code),
            ("(e.time, e.id) < (?, ?)", wanted.before),
        )
    )
    if wanted.codes is not None:
        where += f" AND e.code IN ({_numbers(wanted.codes[name])})"
    if wanted.text:
        asked = ""
        if wanted.people:
            asked = " OR e.person <> '' AND (instr(casefold(e.person), ?) OR instr(casefold(e.reason), ?))"
            given += [wanted.text.casefold()] * 2
        where += f" AND (e.code IN ({_numbers((wanted.worded or {}).get(name, ()))}){asked})"
    return where, given


def _numbers(codes: Collection[int]) -> str:
    return ", ".join(str(int(code)) for code in sorted(codes))
