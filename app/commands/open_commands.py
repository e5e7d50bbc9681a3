"""Commands that the audit trail has as sent and of which it does not say what became: the server ended meanwhile. Pure.

Nobody knows whether they were carried out. They are told as such, once; nothing is sent, and nothing is confirmed afterwards.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from app.access.audit.line import Record
from app.commands.lifecycle import Progress, ProgressState
from app.commands.parameter_change import ENCODER, ENCODER_LABEL, KEY, LABEL, SAVE, SAVE_LABEL
from app.plant.definitions import Equipment

SENT = "command.sent"
SERVER_ENDED = "why.server_ended"
LABELS = {KEY: LABEL, SAVE: SAVE_LABEL, ENCODER: ENCODER_LABEL}
NEWEST = 2000
"""So many lines of commands are looked at."""


@dataclass(frozen=True, slots=True)
class OpenCommand:
    """A command without an end."""

    progress: Progress
    old: str
    new: str
    """As its line has them."""
    stop: bool
    """Whether it is the Stop of its machine."""


def open_commands(
    lines: Iterable[Record], plant: Mapping[str, Equipment], now: int, followed: Collection[str] = ()
) -> list[OpenCommand]:
    """Commands without an end, oldest first, of `lines` newest first; `followed` are looked after by others. `now`: [µs UTC].

    Those of machines and commands that the plant does not have are among them: they, too, have a line that needs an end.
    """
    ended, found = set(followed), list[OpenCommand]()
    for line in without_late(lines):
        id = line.parameters.get("id", "")
        if not id or id in ended:
            continue
        ended.add(id)
        if line.kind == SENT:
            found.append(_open(line, id, plant, now))
    return found[::-1]


def without_late(lines: Iterable[Record]) -> list[Record]:
    """`lines` but for those of commands as sent that have another line: on a slow disk one waits in the buffer behind the outcome."""
    found = list(lines)
    told = {line.parameters.get("id", "") for line in found if line.kind != SENT}
    return [line for line in found if line.kind != SENT or line.parameters.get("id", "") not in told]


def _open(line: Record, id: str, plant: Mapping[str, Equipment], now: int) -> OpenCommand:
    equipment, _, key = line.object.partition(".")
    item = plant.get(equipment)
    command = item.type.commands.get(key) if item is not None else None
    point = item.points.get(key) if item is not None else None
    label = command.label if command is not None else point.label if point is not None else LABELS.get(key, key)
    asked = line.parameters.get("requested", "")
    progress = Progress(
        id, equipment, key, label, line.person, ProgressState.UNKNOWN, int(asked) if asked.isdecimal() else line.time,
        ended=now, reason=SERVER_ENDED,
    )  # fmt: skip
    return OpenCommand(progress, line.old, line.new, command is not None and command.stop)
