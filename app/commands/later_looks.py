"""What a command wrote and no scan brings is read again after it was not confirmed: a device may do it late, and the value that was last
read would be shown as good for ever."""

from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from app.commands.command_state import CommandState
from app.commands.lifecycle import Progress, ProgressState
from app.commands.machine import Machine
from app.plant.definitions import Scan

WHEN = (0.5, 2.0, 8.0, 30.0)
"""After the end of the command [s]."""
SETTLED = (ProgressState.CONFIRMED, ProgressState.REFUSED, ProgressState.DRY_RUN)
"""Ends after which what was read last is so, or nothing was sent."""


class LaterLooks:
    """The looks that are still to come, of every machine."""

    def __init__(
        self, state: CommandState, read: Callable[[Machine, Sequence[str]], Coroutine[Any, Any, None]]
    ) -> None:
        """`read` has points of a machine read from its device; what goes wrong is its own."""
        self._state = state
        self._read = read
        self._due: dict[tuple[str, str], list[float]] = {}
        """Machine and point → when it is read [s, monotonic]."""
        state.enders.append(self._ended)

    def tick(self, now: float) -> None:
        """Read what is due at `now` [s, monotonic]."""
        due: dict[str, list[str]] = {}
        for (id, point), times in list(self._due.items()):
            if now < times[0]:
                continue
            due.setdefault(id, []).append(point)
            if later := [time for time in times if time > now]:
                self._due[id, point] = later
            else:
                del self._due[id, point]
        for id, points in due.items():
            machine = self._state.machines.get(id)
            known = [key for key in points if key in machine.item.points] if machine else []
            if machine and known:
                self._state.spawn(self._read(machine, known), f"look later {id}")

    def _ended(self, progress: Progress) -> None:
        machine = self._state.machines.get(progress.equipment)
        if machine is None or progress.state in SETTLED:
            return
        points, now = machine.item.points, self._state.clock.monotonic()
        written = (*(point for point, _ in progress.telegrams), *(change.key for change in progress.changes))
        for key in dict.fromkeys(written):
            register = points[key].register if key in points else None
            if register is not None and register.readable and points[key].scan in (Scan.ONCE, Scan.PAGE):
                self._due[machine.item.id, key] = [now + pause for pause in WHEN]
