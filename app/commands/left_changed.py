"""Points that a hold-to-run has changed and that, by the audit trail, were not given back: the server ended meanwhile. Pure.

The line before the first telegram of such a motion has what the points held; one with the command that puts it back, confirmed, says
that it is there again. The oldest motion since then knows what was there: a later one began with what that one had left.
"""

import json
from collections.abc import Iterable, Mapping

from app.access.audit.line import Record
from app.plant.definitions import Equipment

CONFIRMED = "confirmed"


def left_changed(lines: Iterable[Record], plant: Mapping[str, Equipment]) -> dict[str, dict[str, float]]:
    """Machine → point → what it held, of `lines` newest first. Machines and points that the plant does not have are left out."""
    settled: set[str] = set()
    found: dict[str, dict[str, float]] = {}
    for line in lines:
        equipment, _, key = line.object.partition(".")
        item = plant.get(equipment)
        command = item.type.commands.get(key) if item is not None else None
        if item is None or command is None or equipment in settled:
            continue
        if command.puts_back and line.result == CONFIRMED:
            settled.add(equipment)
        elif command.hold and (former := _former(line, item)):
            found.setdefault(equipment, {}).update(former)
    return found


def _former(line: Record, item: Equipment) -> dict[str, float]:
    try:
        told = json.loads(line.parameters.get("former", "{}"))
        return {str(point): float(value) for point, value in told.items() if point in item.points}
    except (ValueError, TypeError, AttributeError):
        return {}
