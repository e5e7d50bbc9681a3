"""What questions to events and to records have in common: a filter as SQL, a count with an end."""

from collections.abc import Iterable, Sequence

from sqlalchemy import Connection

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
