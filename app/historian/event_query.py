"""What questions to events and to records have in common: a count with an end, and places in their lists."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, Connection, Table, func, literal_column, select, tuple_

AT_ONCE = 500
"""Most numbers in one question."""


def counted(connection: Connection, table: Table, conditions: Sequence[ColumnElement[bool]], most: int) -> int:
    """How many rows of `table` there are, counted up to `most`."""
    rows = select(literal_column("1")).select_from(table).where(*conditions).limit(most).subquery()
    return int(connection.execute(select(func.count()).select_from(rows)).scalar_one())


def comes_after(time: ColumnElement[int], id: ColumnElement[int], place: tuple[Any, Any]) -> ColumnElement[bool]:
    """What comes after `place` in a list with the newest first."""
    return tuple_(time, id) < tuple_(*place)
