"""Events stored with the records that they make, as links deliver them."""

import math
from collections.abc import Sequence

from sqlalchemy import Connection

from app.historian.records import RecordFold
from app.plant.events import Mark, begins_again, is_new, mark_of
from app.records.event import Event, packed
from tests.historian import rings


def machine(connection: Connection, equipment: str) -> int:
    """The number of a machine."""
    found = connection.exec_driver_sql("SELECT id FROM event_machine WHERE name = ?", (equipment,)).scalar()
    if found is None:
        found = connection.exec_driver_sql(
            "INSERT INTO event_machine (lasting_id, name) VALUES (?, ?) RETURNING id", (equipment, equipment)
        ).scalar_one()
    return int(found)


def store(connection: Connection, fold: RecordFold, equipment: str, told: Sequence[rings.Event], lost: int = 0) -> None:
    """Events of one machine, after so many that were lost."""
    number = machine(connection, equipment)
    row = connection.exec_driver_sql(
        "SELECT boot, sequence, time FROM event_mark WHERE equipment = ?", (equipment,)
    ).first()
    mark = known = None if row is None else Mark(*row)
    fresh: list[tuple[rings.Event, bool]] = []
    for event in told:
        if is_new(event, mark):
            fresh.append((event, mark is not None and begins_again(event, mark)))
            mark = mark_of(event)
    if told and not fresh:
        return
    missing = lost if not fresh or fresh[0][0] is told[0] else 0
    if known is not None and fresh and fresh[0][0].sequence > known.sequence:
        missing = min(missing, fresh[0][0].sequence - known.sequence - 1)
    if missing > 0:
        fold.lose(connection, equipment, missing)
    for one, again in fresh:
        value = one.value if math.isfinite(one.value) else None
        id = connection.exec_driver_sql(
            "INSERT INTO event (machine, boot, sequence, time, code, source, value, words, request, person, reason) "
            "VALUES (?, ?, ?, ?, ?, ?, ?, ?, 0, '', '') RETURNING id",
            (number, one.boot, one.sequence, one.time, one.code, one.source, value, packed(one.snapshot)),
        ).scalar_one()
        event = Event(id, equipment, one.boot, one.sequence, one.time, one.code, one.source, value, tuple(one.snapshot))
        if again:
            fold.begin_again(connection, equipment, event)
        fold.put(connection, equipment, event)
    if mark is not None:
        connection.exec_driver_sql(
            "INSERT OR REPLACE INTO event_mark (equipment, boot, sequence, time) VALUES (?, ?, ?, ?)",
            (equipment, mark.boot, mark.sequence, mark.time),
        )
