"""Whether an order can be carried out now: every check that reads the person, the token and the plant, in the order of the gate."""

from collections.abc import Mapping, Sequence

from app.access.roles import ROLE_PERMISSION, Person, Rights
from app.clock import Clock
from app.commands import interlocks, value_set
from app.commands.control_token import ControlToken
from app.commands.entered import argument_of, arguments_of, check_relations, check_seen, confirm, entered
from app.commands.interlocks import Prepared, RefusalReason
from app.commands.machine import Machine
from app.commands.orders import Order, Task, Writer
from app.commands.readings import Readings
from app.commands.value_set import Change
from app.errors import LinkError, Refused
from app.plant import expression
from app.plant.definitions import EquipmentType, Scan
from app.tags.quality import QualityReason as Why
from app.tags.quality import is_good, reason

PULSE_PAUSE = 5.0
"""Least time between two resets and other pulses of one kind [s]."""
RENEW_AFTER = 2.0
"""Age from which values that are read once or on demand are read again for a command [s]."""
DEFAULT_LIMIT = 5.0
"""Time for a feedback whose own time-out is not known [s]."""
LARGEST_STATE = 0xFFFF
STOP = "stop"
"""Permission that a Stop needs."""


class Checks:
    """Judges orders and conditions; sends nothing."""

    def __init__(
        self,
        readings: Readings,
        clock: Clock,
        writers: Mapping[str, Writer],
        control: ControlToken,
        rights: Rights,
    ) -> None:
        self._readings = readings
        self._clock = clock
        self._writers = writers
        self._control = control
        self._rights = rights

    def lacking(self, person: Person | None, machine: Machine, prepared: Prepared) -> list[tuple[RefusalReason, int]]:
        """What the person lacks as of now; to stop, who could when they asked still can."""
        command = prepared.command
        if person is not None and not command.stop:
            person = self._rights(person)
        if person is None:
            return [(RefusalReason("why.signed_out"), 401)]
        reasons: list[tuple[RefusalReason, int]] = []
        needed = {STOP: command.role} if command.stop else {ROLE_PERMISSION[role]: role for role in prepared.roles}
        lacking = next((role for permission, role in needed.items() if not person.may(permission)), None)
        if lacking is not None:
            key = "why.idle" if person.idle and lacking in person.roles else "why.role"
            reasons.append((RefusalReason(key, {"role": lacking}), 403))
        if command.stop:
            return reasons
        holder = self._control.holder(machine.item.id)
        if holder is None:
            reasons.append((RefusalReason("why.no_token"), 423))
        elif holder.session != person.session:
            reasons.append((RefusalReason("why.held", {"display": holder.display, "since": holder.since}), 423))
        return reasons

    def reasons(
        self, person: Person | None, machine: Machine, prepared: Prepared, *, running: bool = False
    ) -> list[tuple[RefusalReason, int]]:
        """Everything that stands in the way of a command without its value, in the order of the gate; of one that is `running` only what
        keeps it from going on."""
        reasons = self.lacking(person, machine, prepared)
        writer = self._writers.get(machine.item.link)
        if writer is None:
            reasons.append((RefusalReason("why.no_link", {"link": machine.item.link}), 503))
        elif not machine.link.may_write:
            reasons.append((RefusalReason("why.writes_off", {"link": machine.item.link}), 409))
        if writer is not None and writer.paused and not prepared.command.stop:
            reasons.append((RefusalReason("why.simulation_paused"), 409))
        if prepared.command.stop:
            return reasons
        look, age = self._readings.look(machine), self._readings.age(machine)
        stale = interlocks.stale(machine.item, machine.link, prepared.used, look, age)
        silent = [found for found in stale if reason(look(_key(found))[1]) is Why.COMM_FAILURE]
        if silent:
            # whoever operates does not want to hear it of each value
            reasons.append((RefusalReason("why.no_communication", {"point": silent[0].params["point"]}), 503))
        halted = [found for found in stale if reason(look(_key(found))[1]) is Why.HALTED]
        if halted:
            reasons.append((RefusalReason("why.program_halted", {"point": halted[0].params["point"]}), 409))
        reasons += [(found, 409) for found in stale if found not in silent and found not in halted]
        reasons += [(found, 409) for found in interlocks.unlimited(prepared, look)]
        reasons += [(found, 409) for found in interlocks.missing(prepared.permissives, look, age=age)]
        reasons += [(found, 409) for found in interlocks.missing(prepared.interlocks, look, age=age)]
        if not running:
            reasons += self._occupied(machine, prepared)
        return reasons

    def _occupied(self, machine: Machine, prepared: Prepared) -> list[tuple[RefusalReason, int]]:
        """What is at work on the machine and lets nothing beside it."""
        reasons: list[tuple[RefusalReason, int]] = []
        job, command = machine.job, prepared.command
        uses = command.moves or command.argument or command.arguments or prepared.parts
        if machine.left and uses and not command.puts_back:
            reasons.append((RefusalReason("why.left_changed"), 409))
        elif command.puts_back and not machine.left:
            reasons.append((RefusalReason("why.nothing_left"), 409))
        if machine.set is not None:
            at_work = machine.set.progress
            reasons.append((RefusalReason("why.busy", {"display": at_work.person}, at_work.label), 409))
        elif machine.restoring or (job and job.ending is not None and not prepared.command.hold):
            reasons.append((RefusalReason("why.hold_ending"), 409))
        elif job and job.lease is not None and job.lease.moving:
            reasons.append((RefusalReason("why.hold_active", {"display": job.progress.person}), 423))
        elif job and (job.writing or (job.prepared.command.stop and (job.since is None or prepared.parts))):
            reasons.append((RefusalReason("why.busy", {"display": job.progress.person}, job.progress.label), 409))
        if is_pulse(machine, prepared) and prepared.command.key in machine.pulses:
            left = PULSE_PAUSE - (self._clock.monotonic() - machine.pulses[prepared.command.key])
            if left > 0:
                reasons.append((RefusalReason("why.too_soon", {"seconds": max(0.1, round(left, 1))}), 409))
        return reasons

    def task(self, order: Order, machine: Machine, prepared: Prepared) -> Task:
        """Every check that reads the plant, and what is to be written."""
        command, look = prepared.command, self._readings.look(machine)
        reasons = self.reasons(order.person, machine, prepared)
        if prepared.parts:
            return self._set_task(order, machine, prepared, reasons)
        guarding = ("why.condition", "why.condition_unknown")
        first = next((found for found in reasons if found[0].key not in guarding), None)
        if first is not None:
            raise Refused(first[0].key, first[1], label=first[0].label, **first[0].params)
        argument = argument_of(order, prepared, machine.item.type, look)
        arguments = arguments_of(order, prepared, look)
        self._refuse_first(reasons)
        old = look(prepared.point.key)[0] if prepared.point else None
        level, why = interlocks.level(prepared, look, argument)
        if not command.stop:
            confirm(order, prepared, level, why, argument, old, arguments, interlocks.limits(prepared, look))
        limit = expression.number(command.timeout, look)
        previous = {key: float(value) for key, value in self._readings.previous(machine, prepared).items()}
        telegrams = interlocks.telegrams(machine.item, command.writes, argument, previous)
        if command.puts_back:
            point, argument = next(iter(previous.items()))
            old = look(point)[0]
        if command.code:
            telegrams = (("code", float(command.code)), *arguments.items())
        return Task(
            telegrams,
            argument,
            old,
            limit if limit is not None and limit > 0 else DEFAULT_LIMIT,
            level,
            arguments,
            tuple(interlocks.raw(one, arguments[one.name]) for one in command.arguments),
            self._expected(machine, prepared),
        )

    @staticmethod
    def _refuse_first(reasons: Sequence[tuple[RefusalReason, int]]) -> None:
        for found, status in reasons:
            others = [other.label for other, _ in reasons]
            raise Refused(found.key, status, label=found.label, missing=others, **found.params)

    def _set_task(
        self, order: Order, machine: Machine, prepared: Prepared, reasons: Sequence[tuple[RefusalReason, int]]
    ) -> Task:
        """As `task`, of a set: each value as by itself, with the others in place; then the checks between them, and their order."""
        guarding = ("why.condition", "why.condition_unknown")
        first = next((found for found in reasons if found[0].key not in guarding), None)
        if first is not None:
            raise Refused(first[0].key, first[1], label=first[0].label, **first[0].params)
        look, kind = self._readings.look(machine), machine.item.type
        values = {part.command.key: entered(order, part, order.arguments[part.command.key]) for part in prepared.parts}
        then = value_set.after(look, values)
        for part in prepared.parts:
            wrong = interlocks.wrong_value(part, values[part.command.key], then)
            if wrong is not None:
                raise Refused(wrong.key, 422, label=wrong.label, argument=part.command.key, **wrong.params)
            check_seen(part, look, order.seen.get(part.command.key))
        check_relations(kind, values, look)
        self._refuse_first(reasons)
        groups = self._writers[machine.item.link].together(machine.item.id, list(values))
        steps = value_set.steps(kind, prepared.parts, groups, values, look)
        if isinstance(steps, RefusalReason):
            raise Refused(steps.key, 409, label=steps.label, **steps.params)
        changes = tuple(self._change(kind, part, look, values[part.command.key]) for part in prepared.parts)
        found = [interlocks.level(part, look, values[part.command.key]) for part in prepared.parts]
        level, why = (
            max(level for level, _ in found),
            tuple(dict.fromkeys(line for _, lines in found for line in lines)),
        )
        confirm(order, prepared, level, why, None, value_set.values_text(changes, old=True), values)
        limit = expression.number(prepared.command.timeout, look) or DEFAULT_LIMIT
        telegrams = tuple((key, values[key]) for step in steps for key in step)
        old = value_set.values_text(changes, old=True)
        return Task(telegrams, None, old, limit, level, values, changes=changes, steps=steps)

    @staticmethod
    def _change(kind: EquipmentType, part: Prepared, look: expression.Look, value: float) -> Change:
        assert part.point is not None and part.setpoint is not None
        old, point = look(part.point.key)[0], part.point
        assert isinstance(old, int | float)  # a value that is not known keeps a set from being written
        return Change(
            point.key, part.setpoint.code or point.key, point.label, float(old), value, point.unit, point.decimals
        )

    def _expected(self, machine: Machine, prepared: Prepared) -> int:
        """State of the device as the screen has it, for a command that makes it move: in any other it is not what the person meant."""
        command, plc = prepared.command, machine.item.type.device.plc
        if not (command.code and command.moves and plc and plc.status) or command.stop:
            return 0
        value, word = self._readings.look(machine)(plc.status)
        seen = is_good(word) and isinstance(value, int | float) and 0 < value <= LARGEST_STATE
        return int(value) if seen and isinstance(value, int | float) else 0

    async def renew(self, machine: Machine, prepared: Prepared) -> None:
        """Read again what is not read in turn and matters: values of open pages, a setpoint before it changes, a device's watchdog."""
        writer = self._writers.get(machine.item.link)
        age, points = self._readings.age(machine), machine.item.points
        scans = {Scan.PAGE, Scan.ONCE} if prepared.command.hold else {Scan.PAGE}
        keys = [key for key in prepared.used if points[key].scan in scans]
        written = [part.point for part in prepared.parts or (prepared,) if part.point is not None]
        keys += [point.key for point in written if point.scan in (Scan.PAGE, Scan.ONCE)]
        keys = [key for key in dict.fromkeys(keys) if points[key].register and age(key) > RENEW_AFTER]
        if not keys or writer is None or not machine.link.may_write:
            return
        try:
            await writer.refresh(machine.item.id, keys)
        except LinkError as error:
            raise Refused("why.no_answer", 503, cause=f"link.error.{error.kind}") from error


def _key(stale: RefusalReason) -> str:
    """Of the point that a reason is about."""
    return str(stale.params["point"]).partition(".")[2]


def is_pulse(machine: Machine, prepared: Prepared) -> bool:
    """Whether the command is a reset or the like: it moves nothing, sets nothing, and is none of the ways to stop."""
    command = prepared.command
    stops = command.stop or (machine.stop is not None and command.feedback == machine.stop.command.feedback)
    return not (command.moves or command.argument or command.arguments or stops)


def holds(text: str, look: expression.Look) -> bool | None:
    """Whether a sentence over the points of a machine holds; None = not known."""
    return expression.parse(text).true(look)
