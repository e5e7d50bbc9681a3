"""What questions to passages and to runs have in common: a filter as SQL, a count with an end, the rows that belong to several."""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from sqlalchemy import Connection

T = TypeVar("T")
AT_ONCE = 500
"""Most numbers in one question."""


def filtered(equal: Iterable[tuple[str, object]], plain: Iterable[str] = ()) -> tuple[str, list[object]]:
    """The WHERE part of a question, empty when nothing filters, and its values: a sentence whose value is None does not filter."""
    parts: list[str] = []
    given: list[object] = []
    for sentence, value in equal:
        if value is not None:
            parts.append(sentence)
            given.extend(value if isinstance(value, tuple) else (value,))
    parts += plain
    return (f"WHERE {' AND '.join(parts)}" if parts else ""), given


def counted(connection: Connection, table: str, where: str, given: Sequence[object], most: int) -> int:
    """How many rows of `table` there are, counted up to `most`."""
    rows = connection.exec_driver_sql(f"SELECT count(*) FROM (SELECT 1 FROM {table} {where} LIMIT ?)", (*given, most))
    return int(rows.scalar_one())


def belonging(
    connection: Connection, select: str, of: str, order: str, numbers: Iterable[int], kind: type[T]
) -> dict[int, list[T]]:
    """Number → what belongs to it, in `order`; `select` begins with the column `of`, the others are those of `kind`."""
    wanted = list(numbers)
    found: dict[int, list[T]] = {number: [] for number in wanted}
    for at in range(0, len(wanted), AT_ONCE):
        part = wanted[at : at + AT_ONCE]
        rows = connection.exec_driver_sql(
            f"{select} WHERE {of} IN ({', '.join('?' * len(part))}) ORDER BY {of}, {order}", tuple(part)
        )
        for row in rows:
            found[row[0]].append(kind(*row[1:]))
    return found
