"""What the journal says to the statistics: the records of a time, streamed, and how the alarms stood when it began."""

from collections.abc import Iterator

from sqlalchemy import ColumnElement, Connection, and_, func, select, true

from app.alarms.journal import asks_attention
from app.alarms.lifecycle import ANNUNCIATED, Entry
from app.alarms.statistics import BUCKET, Figures, Step, figures
from app.alarms.tables import journal_table
from app.plant.system import SYSTEM

PORTION = 2000
"""Records that are fetched at once."""


def read_figures(connection: Connection, begin: int, end: int, positions: int = 1, area: str = "") -> Figures | None:
    """The figures of the time from `begin` up to `end` [µs UTC], of one area or of all (`""`); None: nothing was written down by then.

    A time before the first record of the journal is left out: a plant that was not watched was not calm. What is left has ten minutes at
    least, so that a rate is not that of a moment.
    """
    first = connection.execute(select(func.min(journal_table.c.time))).scalar()
    if first is None or first >= end:
        return None
    begin = min(max(begin, first), end - BUCKET)
    return figures(
        _steps(connection, begin, end, area),
        _standing(connection, begin, area),
        begin,
        end,
        positions,
        _hidden(connection, begin, end, area),
    )


def _steps(connection: Connection, begin: int, end: int, area: str) -> Iterator[Step]:
    table = journal_table.c
    query = (
        select(
            table.time, table.event, table.alarm, table.occurrence, table.priority, table.after, asks_attention()
        )
        .where(table.time >= begin, table.time < end, _of(area))
        .order_by(table.seq)
    )  # fmt: skip
    for row in connection.execute(query).yield_per(PORTION):
        yield Step._make(row)


def _hidden(connection: Connection, begin: int, end: int, area: str) -> int:
    table = journal_table.c
    query = select(func.count()).where(
        table.time >= begin, table.time < end, table.event == Entry.RAISED, table.silent, _of(area)
    )
    return connection.execute(query).scalar_one()


def _standing(connection: Connection, begin: int, area: str) -> dict[str, int]:
    """Alarm → since when it had been annunciated at `begin`."""
    table = journal_table.c
    last = (
        select(func.max(table.seq).label("seq"), func.max(table.seq).filter(table.after.not_in(ANNUNCIATED)).label("calm"))
        .where(table.time < begin, _of(area))
        .group_by(table.alarm)
        .subquery()
    )  # fmt: skip
    calm = func.coalesce(last.c.calm, 0)
    standing = select(table.alarm, calm.label("calm")).join(last, table.seq == last.c.seq).where(last.c.seq > calm)
    found = standing.subquery()
    since = (
        select(table.alarm, func.min(table.time))
        .join(found, and_(table.alarm == found.c.alarm, table.seq > found.c.calm))
        .where(table.time < begin)
        .group_by(table.alarm)
    )
    return {alarm: time for alarm, time in connection.execute(since)}


def _of(area: str) -> ColumnElement[bool]:
    if not area:
        return true()
    return journal_table.c.equipment == "" if area == SYSTEM else journal_table.c.area == area
