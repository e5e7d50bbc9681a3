"""What happened on a machine follows it to its new name, as its samples do: what stays is its lasting id.

Rows say the name that the machine has now, so that whoever asks for a machine asks for its name. `event_machine` remembers under which
name the rows of a lasting id are; a machine that the history meets for the first time had its lasting id as its name until now.
"""

from collections.abc import Mapping

from sqlalchemy import Connection, bindparam, delete, func, or_, select

from app.historian.dialect import Statement, moving, updating
from app.historian.tables import event_gap, event_machine, event_mark

ROWS = (event_gap, event_mark)
"""Tables whose rows say a machine."""


def follow(connection: Connection, machines: Mapping[str, str]) -> set[str]:
    """Give the rows of these machines (lasting id → name now) their name; the names that got other rows by it."""
    known = names(connection)
    machines = dict(machines)
    taken = set(machines.values())
    for id, name in known.items():
        if id not in machines and name in taken:  # of a machine that is gone: another one has its name now
            machines[id] = _between(id)
    moved = {id: name for id, name in machines.items() if known.get(id, id) != name}
    for id, name in machines.items():
        if known.get(id) != name:
            CALL(connection, lasting_id=id, name=name)
    for id in moved:  # two may have changed names
        _rename(connection, known.get(id, id), _between(id))
    for id, name in moved.items():
        if name != _between(id):
            _rename(connection, _between(id), name)
    return {name for name in moved.values() if name in taken}


def names(connection: Connection) -> dict[str, str]:
    """Lasting id → name under which the rows of the machine are."""
    return {row[0]: row[1] for row in NAMES(connection)}


def _between(id: str) -> str:
    """A name that no machine can have."""
    return f"→{id}"


def _rename(connection: Connection, before: str, after: str) -> None:
    # of two marks the later one counts: what was stored since then may have had the new name already
    EARLIER(connection, before=before, after=after)
    for move in MOVES:
        move(connection, before=before, equipment=after)


CALL = Statement(updating(event_machine, ["lasting_id"], lambda new: {"name": new.name}), "lasting_id", "name")
NAMES = Statement(select(event_machine.c.lasting_id, event_machine.c.name))
_both = event_mark.alias()
_latest = (
    select(func.max(_both.c.time))
    .where(or_(_both.c.equipment == bindparam("before"), _both.c.equipment == bindparam("after")))
    .scalar_subquery()
)
_one = or_(event_mark.c.equipment == bindparam("before"), event_mark.c.equipment == bindparam("after"))
EARLIER = Statement(delete(event_mark).where(_one, event_mark.c.time < _latest))
MOVES = [Statement(moving(table).where(table.c.equipment == bindparam("before")), "equipment") for table in ROWS]
