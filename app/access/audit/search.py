"""Finding lines of the audit: what a person wants to see, drawn safely whatever somebody has put into the table."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Select, func, select

from app.access.audit.chain import tolerant
from app.access.audit.line import LONGEST_TEXT, Record, printable
from app.access.tables import audit_table

LONGEST_PARAMS = 40 * LONGEST_TEXT
"""Of all parameters of a line together, when it is read."""


@dataclass(frozen=True, slots=True)
class Filter:
    """Which lines a person wants to see; empty fields do not filter."""

    person: str = ""
    object: str = ""
    """Part of the object's name."""
    kind: str = ""
    """A kind, or the first part of one (`signin`)."""
    since: int | None = None
    """µs UTC."""
    until: int | None = None
    before: int | None = None
    """Only lines with a smaller number: the next page."""


def find(connection: Connection, wanted: Filter, limit: int) -> list[Record]:
    """The newest `limit` lines that `wanted` lets through, newest first."""
    query = _filtered(select(audit_table), wanted).order_by(audit_table.c.seq.desc()).limit(limit)
    with tolerant(connection):
        return [_record(row) for row in connection.execute(query).all()]


def kinds(connection: Connection) -> list[str]:
    """All kinds that occur, sorted."""
    return list(connection.execute(select(audit_table.c.kind).distinct().order_by(audit_table.c.kind)).scalars())


def count(connection: Connection) -> int:
    """Number of lines."""
    return connection.execute(select(func.count()).select_from(audit_table)).scalar_one()


def _record(row: Any) -> Record:
    """A line as it can be shown, also one that somebody has put something else into."""
    numbers = ("seq", "time", "person_id")
    found: dict[str, Any] = {}
    for column in audit_table.c:
        value = getattr(row, column.name)
        if column.name in numbers:
            found[column.name] = value if isinstance(value, int) and abs(value) < 1 << 60 else 0
        else:
            most = LONGEST_PARAMS if column.name == "params" else 4 * LONGEST_TEXT
            found[column.name] = printable(value if isinstance(value, str) else repr(value), most)
    del found["mac"]
    return Record(**found)


def _filtered(query: Select[tuple[object, ...]], wanted: Filter) -> Select[tuple[object, ...]]:
    table = audit_table.c
    conditions: Iterable[tuple[object, Callable[[], object]]] = (
        (wanted.person, lambda: table.person == wanted.person),
        (wanted.object, lambda: table.object.contains(wanted.object, autoescape=True)),
        (wanted.kind, lambda: (table.kind == wanted.kind) | table.kind.startswith(wanted.kind + ".", autoescape=True)),
        (wanted.since is not None, lambda: table.time >= wanted.since),
        (wanted.until is not None, lambda: table.time <= wanted.until),
        (wanted.before is not None, lambda: table.seq < wanted.before),
    )
    for asked, condition in conditions:
        if asked:
            query = query.where(condition())  # type: ignore[arg-type]
    return query
