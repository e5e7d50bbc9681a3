"""What is kept of commands: a line of the audit each, who asked for what an event tells, an alarm where one was not seen to work."""

import logging
from collections import Counter
from collections.abc import Callable

from app.access.access import Access
from app.access.audit.kinds import Kind
from app.access.audit.search import Filter
from app.access.roles import Person
from app.alarms.engine import AlarmEngine
from app.clock import Clock
from app.commands.gate import Gate
from app.commands.left_changed import left_changed
from app.commands.lifecycle import Progress, ProgressState
from app.commands.motion import NOT_RESTORED
from app.commands.open_commands import NEWEST, open_commands
from app.commands.open_parameters import OBJECT as OF_PARAMETERS
from app.commands.open_parameters import open_parameters
from app.commands.open_sets import NEWEST as NEWEST_SETS
from app.commands.open_sets import OBJECT, open_sets
from app.commands.orders import AuditLine
from app.commands.set_follow_up import FOUND_NEW, FOUND_OLD
from app.commands.value_set import found_texts
from app.errors import StorageError
from app.historian.events import EndedCommand, Events
from app.plant.definitions import Plant
from app.tags.batch import Value

log = logging.getLogger(__name__)


class CommandEnds:
    """Hears from the gate what is to be written down, and how commands ended."""

    def __init__(
        self, access: Access, alarms: AlarmEngine, events: Events, clock: Clock, plant: Callable[[], Plant | None]
    ) -> None:
        self.counts: Counter[str] = Counter()
        """Commands by how they ended, since the start."""
        self._access = access
        self._alarms = alarms
        self._events = events
        self._clock = clock
        self._plant = plant

    async def write(self, line: AuditLine) -> None:
        """One line of the audit; who gave a command that a device knows by its id is also told to the history of events."""
        person, params = line.person, line.params
        if person is not None and params.get("requests"):
            ended = int(params["ended"]) or self._clock.micros()
            name, why = person.display or person.name, str(params.get("why", ""))
            equipment = line.object.partition(".")[0]
            self._events.command_ended(
                EndedCommand(equipment, tuple(params["requests"]), name, why, int(params["requested"]), ended)
            )
        await self._access.audit.record(*_written(line), **params)

    async def foretell(self, line: AuditLine) -> bool:
        """One line of the audit that is on the disk when this returns true."""
        return await self._access.audit.foretell(self._access.audit.entry(*_written(line), **line.params))

    def ended(self, progress: Progress) -> None:
        """A command that was sent and not seen to work is an alarm; a Stop has its own."""
        self.counts[progress.state.value] += 1
        plant = self._plant()
        item = plant.equipment.get(progress.equipment) if plant else None
        command = item.type.commands.get(progress.command) if item else None
        if progress.changes:
            self._set_ended(progress)
        elif progress.reason == NOT_RESTORED:
            self._alarms.system.report("left_changed", progress.equipment, params={"point": f"@{progress.label}"})
        elif command is not None and command.puts_back and progress.state is ProgressState.CONFIRMED:
            self._alarms.system.report("left_changed", progress.equipment, active=False)
        elif (
            progress.state in (ProgressState.UNCONFIRMED, ProgressState.UNKNOWN)
            and item
            and not (command and command.stop)
        ):
            self._alarms.system.report(
                "command_unconfirmed", progress.equipment, params={"command": f"@{progress.label}"}
            )

    async def resume(self, gate: Gate, plant: Plant) -> None:
        """Tell `gate` of commands and sets of setpoints that a former run of this server has not brought to an end."""
        audit = self._access.audit
        try:
            of_sets = await audit.find(Filter(object=OBJECT, kind="command"), NEWEST_SETS)
            of_parameters = await audit.find(Filter(object=OF_PARAMETERS, kind="command"), NEWEST_SETS)
            lines = await audit.find(Filter(kind="command"), NEWEST)
        except StorageError as error:
            log.error("open commands not looked for reason=%s", error)
            return
        sets = open_sets(of_sets, plant.equipment)
        gate.take_open_sets(sets)
        parameters = open_parameters(of_parameters, plant.equipment)
        gate.parameters.take_open(parameters)
        known = {progress.id for progress in (*sets, *(one for one, _ in parameters))}
        gate.take_open_commands(open_commands(lines, plant.equipment, self._clock.micros(), known))
        gate.take_left(left_changed(lines, plant.equipment))

    def _set_ended(self, progress: Progress) -> None:
        """Values that nobody chose together are an alarm, until all are found to be new or all former ones."""
        mixed = progress.state is ProgressState.UNCONFIRMED
        if mixed or progress.reason in (FOUND_NEW, FOUND_OLD):
            params = {"values": found_texts(progress.changes)} if mixed else None
            self._alarms.system.report("set_mixed", progress.equipment, mixed, params=params)


def _written(line: AuditLine) -> tuple[Kind, Person | None, str, Value, Value, str, str, str]:
    """`line` as the audit takes it, but for its parameters."""
    return line.kind, line.person, line.object, line.old, line.new, line.result, line.reason, line.address
