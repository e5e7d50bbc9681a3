"""Sets of setpoints of which the audit trail does not say what became of them: the server was killed in the middle, or stopped before the
device was back. Pure.

A set has a line before its first telegram and one with its end; while values could not be read, the end is still to be told.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from app.access.audit.line import Record
from app.commands import value_set
from app.commands.lifecycle import Progress
from app.commands.open_commands import SENT, without_late
from app.commands.set_follow_up import UNTOLD, left_open
from app.commands.value_set import Change, Stands
from app.plant.definitions import Equipment

OBJECT = f".{value_set.KEY}"
"""What the objects of these lines end with."""
NEWEST = 500
"""So many lines of sets are looked at."""


def open_sets(lines: Iterable[Record], plant: Mapping[str, Equipment]) -> list[Progress]:
    """The sets that are open, of `lines` newest first; those of machines or setpoints that the plant does not have are left out."""
    known: set[str] = set()
    found: list[Progress] = []
    for line in without_late(lines):
        id = line.parameters.get("id", "")
        if not line.object.endswith(OBJECT) or not id or id in known:
            continue
        known.add(id)
        item = plant.get(line.object.removesuffix(OBJECT))
        changes = _changes(line, item) if item is not None else ()
        if item is not None and changes and (line.kind == SENT or line.reason in UNTOLD):
            person = line.parameters.get("by") or line.person
            found.append(left_open(item.id, id, person, _number(line.parameters.get("requested", "")), changes))
    return found


def values_of(
    params: Mapping[str, str], most: int = value_set.MOST
) -> list[tuple[str, float, float, float | None, str]]:
    """The values that a line of a set has, at most so many: key, former, new, found, where it stands. Those that cannot be read are
    left out."""
    found = []
    for number in range(1, most + 1):
        try:
            key, old, new, now, stands = json.loads(params[f"change_{number}"])
            found.append((str(key), float(old), float(new), None if now is None else float(now), str(stands)))
        except (KeyError, ValueError, TypeError):
            continue
    return found


def _changes(line: Record, item: Equipment) -> tuple[Change, ...]:
    changes = []
    for key, old, new, _, _ in values_of(line.parameters):
        setpoint, point = item.type.setpoints.get(key), item.points.get(key)
        if setpoint is None or point is None:
            return ()
        code = setpoint.code or key
        changes.append(Change(key, code, point.label, old, new, point.unit, point.decimals, stands=Stands.UNKNOWN))
    return tuple(changes)


def _number(text: Any) -> int:
    try:
        return int(text)
    except ValueError:
        return 0
