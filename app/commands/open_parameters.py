"""Sets of drive parameters of which the audit trail does not say what became of them, as open_sets.py has it for setpoints. Pure.

An element stands in its line as `2:p1120` (parameter_change.py). A set of which one element cannot be made out any more, because the plant
has another drive there, is none of these: it is told as a command without an end (open_commands.py).
"""

import re
from collections.abc import Iterable, Mapping

from app.access.audit.line import Record
from app.commands.lifecycle import Progress
from app.commands.open_commands import SENT, without_late
from app.commands.open_sets import values_of
from app.commands.parameter_change import KEY, LABEL, MOST, ParameterChange
from app.commands.set_follow_up import UNTOLD, left_open
from app.errors import TelegramError
from app.plant.definitions import Equipment
from app.plant.register_parameters import unknown
from app.profidrive.parameter_access.parameter import DriveParameter

OBJECT = f".{KEY}"
"""What the objects of these lines end with."""
ELEMENT = re.compile(r"(\d+):(\w+)(?:\[(\d+)\])?")

OpenParameters = tuple[Progress, tuple[ParameterChange, ...]]


def open_parameters(lines: Iterable[Record], plant: Mapping[str, Equipment]) -> list[OpenParameters]:
    """The sets that are open, of `lines` newest first, each with what was to be written."""
    known: set[str] = set()
    found: list[OpenParameters] = []
    for line in without_late(lines):
        id = line.parameters.get("id", "")
        if not line.object.endswith(OBJECT) or not id or id in known:
            continue
        known.add(id)
        item = plant.get(line.object.removesuffix(OBJECT))
        if item is None or not (line.kind == SENT or line.reason in UNTOLD):
            continue
        values = values_of(line.parameters, MOST)
        changes = tuple(filter(None, (_change(item, key, new) for key, _, new, *_ in values)))
        if not changes or len(changes) < len(values):
            continue
        try:
            told = tuple(one.described(old) for one, (_, old, *_) in zip(changes, values, strict=True))
        except TelegramError:  # a parameter of that name that cannot be the value
            continue
        person, asked = line.parameters.get("by") or line.person, line.parameters.get("requested", "")
        requested = int(asked) if asked.isdecimal() else 0
        found.append((left_open(item.id, id, person, requested, told, key=KEY, label=LABEL), changes))
    return found


def _change(item: Equipment, key: str, new: float) -> ParameterChange | None:
    """The element `key` of the machine; None when it has none."""
    named = ELEMENT.fullmatch(key)
    if named is None:
        return None
    object, code, index = named.groups()
    parameter = _parameter(item, code)
    return None if parameter is None else ParameterChange(int(object), parameter, new, int(index or 0))


def _parameter(item: Equipment, code: str) -> DriveParameter | None:
    """What is known of a code; of one of a drive whose parameters are registers also what its name tells."""
    known = item.type.drive_parameters.get(code)
    return known or (unknown(code) if item.type.device.parameters is not None else None)
