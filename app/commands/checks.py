"""Whether an order can be carried out now: every check that reads the person, the token and the plant, in the order of the gate."""

from collections.abc import Mapping, Sequence

from app.access.roles import ROLE_PERMISSION, Person, Rights
from app.clock import Clock
from app.commands import interlocks, value_set
from app.commands.control_token import ControlToken
from app.commands.entry import parse_number
from app.commands.interlocks import Age, Prepared, Reason
from app.commands.machine import Machine
from app.commands.orders import Order, Question, Task, Writer
from app.commands.value_set import Change
from app.errors import LinkError, Refused
from app.plant import expression
from app.plant.definitions import Condition, EquipmentType, Scan
from app.tags.batch import Value
from app.tags.database import TagDatabase
from app.tags.quality import NO_DATA, is_good, reason
from app.tags.quality import Reason as Why

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
        tags: TagDatabase,
        clock: Clock,
        writers: Mapping[str, Writer],
        control: ControlToken,
        rights: Rights,
    ) -> None:
        self._tags = tags
        self._clock = clock
        self._writers = writers
        self._control = control
        self._rights = rights

    def standing(self, person: Person | None, machine: Machine, prepared: Prepared) -> list[tuple[Reason, int]]:
        """What the person lacks as of now; to stop, who could when they asked still can."""
        command = prepared.command
        if person is not None and not command.stop:
            person = self._rights(person)
        if person is None:
            return [(Reason("why.signed_out"), 401)]
        reasons: list[tuple[Reason, int]] = []
        needed = {STOP: command.role} if command.stop else {ROLE_PERMISSION[role]: role for role in prepared.roles}
        lacking = next((role for permission, role in needed.items() if not person.may(permission)), None)
        if lacking is not None:
            key = "why.idle" if person.idle and lacking in person.roles else "why.role"
            reasons.append((Reason(key, {"role": lacking}), 403))
        if command.stop:
            return reasons
        holder = self._control.holder(machine.item.id)
        if holder is None:
            reasons.append((Reason("why.no_token"), 423))
        elif holder.session != person.session:
            reasons.append((Reason("why.held", {"display": holder.display, "since": holder.since}), 423))
        return reasons

    def reasons(
        self, person: Person | None, machine: Machine, prepared: Prepared, *, running: bool = False
    ) -> list[tuple[Reason, int]]:
        """Everything that stands in the way of a command without its value, in the order of the gate; of one that is `running` only what
        keeps it from going on."""
        reasons = self.standing(person, machine, prepared)
        writer = self._writers.get(machine.item.link)
        if writer is None:
            reasons.append((Reason("why.no_link", {"link": machine.item.link}), 503))
        elif not machine.link.may_write:
            reasons.append((Reason("why.writes_off", {"link": machine.item.link}), 409))
        if prepared.command.stop:
            return reasons
        look, age = self.look(machine), self.age(machine)
        stale = interlocks.stale(machine.item, machine.link, prepared.used, look, age)
        silent = [found for found in stale if reason(look(_key(found))[1]) is Why.COMM_FAILURE]
        if silent:
            # whoever operates does not want to hear it of each value
            reasons.append((Reason("why.no_communication", {"point": silent[0].params["point"]}), 503))
        halted = [found for found in stale if reason(look(_key(found))[1]) is Why.HALTED]
        if halted:
            reasons.append((Reason("why.program_halted", {"point": halted[0].params["point"]}), 409))
        reasons += [(found, 409) for found in stale if found not in silent and found not in halted]
        reasons += [(found, 409) for found in interlocks.unlimited(prepared, look)]
        reasons += [(found, 409) for found in interlocks.missing(prepared.permissives, look, age=age)]
        reasons += [(found, 409) for found in interlocks.missing(prepared.interlocks, look, age=age)]
        if not running:
            reasons += self._occupied(machine, prepared)
        return reasons

    def _occupied(self, machine: Machine, prepared: Prepared) -> list[tuple[Reason, int]]:
        """What is at work on the machine and lets nothing beside it."""
        reasons: list[tuple[Reason, int]] = []
        job = machine.job
        if machine.set is not None:
            at_work = machine.set.progress
            reasons.append((Reason("why.busy", {"display": at_work.person}, at_work.label), 409))
        elif machine.restoring or (job and job.ending is not None and not prepared.command.hold):
            reasons.append((Reason("why.hold_ending"), 409))
        elif job and job.lease is not None and job.lease.moving:
            reasons.append((Reason("why.hold_active", {"display": job.progress.person}), 423))
        elif job and (job.writing or (job.prepared.command.stop and (job.since is None or prepared.parts))):
            reasons.append((Reason("why.busy", {"display": job.progress.person}, job.progress.label), 409))
        if is_pulse(machine, prepared) and prepared.command.key in machine.pulses:
            left = PULSE_PAUSE - (self._clock.monotonic() - machine.pulses[prepared.command.key])
            if left > 0:
                reasons.append((Reason("why.too_soon", {"seconds": round(left, 1)}), 409))
        return reasons

    def task(self, order: Order, machine: Machine, prepared: Prepared) -> Task:
        """Every check that reads the plant, and what is to be written."""
        command, look = prepared.command, self.look(machine)
        reasons = self.reasons(order.person, machine, prepared)
        if prepared.parts:
            return self._set_task(order, machine, prepared, reasons)
        guarding = ("why.condition", "why.condition_unknown")
        first = next((found for found in reasons if found[0].key not in guarding), None)
        if first is not None:
            raise Refused(first[0].key, first[1], label=first[0].label, **first[0].params)
        argument = self._argument(order, prepared, machine)
        arguments = self._arguments(order, prepared, machine)
        self._refuse_first(reasons)
        old = look(prepared.point.key)[0] if prepared.point else None
        level, why = interlocks.level(prepared, look, argument)
        if not command.stop:
            self._confirm(order, prepared, level, why, argument, old, arguments)
        limit = expression.number(command.timeout, look)
        previous = {key: float(value) for key, value in self.previous(machine, prepared).items()}
        telegrams = interlocks.telegrams(machine.item, command.writes, argument, previous)
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
    def _refuse_first(reasons: Sequence[tuple[Reason, int]]) -> None:
        for found, status in reasons:
            others = [other.label for other, _ in reasons]
            raise Refused(found.key, status, label=found.label, missing=others, **found.params)

    def _set_task(
        self, order: Order, machine: Machine, prepared: Prepared, reasons: Sequence[tuple[Reason, int]]
    ) -> Task:
        """As `task`, of a set: each value as by itself, with the others in place; then the checks between them, and their order."""
        guarding = ("why.condition", "why.condition_unknown")
        first = next((found for found in reasons if found[0].key not in guarding), None)
        if first is not None:
            raise Refused(first[0].key, first[1], label=first[0].label, **first[0].params)
        look, kind = self.look(machine), machine.item.type
        values = {
            part.command.key: self._entered(order, part, order.arguments[part.command.key]) for part in prepared.parts
        }
        then = value_set.after(look, values)
        for part in prepared.parts:
            wrong = interlocks.wrong_value(part, values[part.command.key], then)
            if wrong is not None:
                raise Refused(wrong.key, 422, label=wrong.label, argument=part.command.key, **wrong.params)
            self._check_seen(part, look, order.seen.get(part.command.key))
        self._check_relations(kind, values, look)
        self._refuse_first(reasons)
        groups = self._writers[machine.item.link].together(machine.item.id, list(values))
        steps = value_set.steps(kind, prepared.parts, groups, values, look)
        if isinstance(steps, Reason):
            raise Refused(steps.key, 409, label=steps.label, **steps.params)
        changes = tuple(self._change(kind, part, look, values[part.command.key]) for part in prepared.parts)
        found = [interlocks.level(part, look, values[part.command.key]) for part in prepared.parts]
        level, why = (
            max(level for level, _ in found),
            tuple(dict.fromkeys(line for _, lines in found for line in lines)),
        )
        self._confirm(order, prepared, level, why, None, value_set.told(changes, old=True), values)
        limit = expression.number(prepared.command.timeout, look) or DEFAULT_LIMIT
        telegrams = tuple((key, values[key]) for step in steps for key in step)
        old = value_set.told(changes, old=True)
        return Task(telegrams, None, old, limit, level, values, changes=changes, steps=steps)

    @staticmethod
    def _change(kind: EquipmentType, part: Prepared, look: expression.Look, value: float) -> Change:
        assert part.point is not None and part.setpoint is not None
        old, point = look(part.point.key)[0], part.point
        assert isinstance(old, int | float)  # a value that is not known keeps a set from being written
        return Change(
            point.key, part.setpoint.code or point.key, point.label, float(old), value, point.unit, point.decimals
        )

    def _check_relations(self, kind: EquipmentType, values: Mapping[str, float], look: expression.Look) -> None:
        check = value_set.broken(kind, values, look)
        if check is not None:
            raise Refused("why.check", 422, label=check.label, check=check.key)

    def _expected(self, machine: Machine, prepared: Prepared) -> int:
        """State of the device as the screen has it, for a command that makes it move: in any other it is not what the person meant."""
        command, plc = prepared.command, machine.item.type.device.plc
        if not (command.code and command.moves and plc and plc.status) or command.stop:
            return 0
        value, word = self.look(machine)(plc.status)
        seen = is_good(word) and isinstance(value, int | float) and 0 < value <= LARGEST_STATE
        return int(value) if seen and isinstance(value, int | float) else 0

    def _arguments(self, order: Order, prepared: Prepared, machine: Machine) -> dict[str, float]:
        """What goes with a code: each named once, a number, within its limits."""
        known, look = prepared.command.arguments, self.look(machine)
        for name in order.arguments:
            if name not in (argument.name for argument in known):
                raise Refused("why.unknown_argument", 422, argument=name[:40])
        found: dict[str, float] = {}
        for argument in known:
            given = order.arguments.get(argument.name, "")
            if given == "":
                raise Refused("why.argument_missing", 422, label=argument.label, argument=argument.name)
            try:
                value = parse_number(given, order.language, argument.unit) if isinstance(given, str) else float(given)
            except Refused as refusal:
                more = {**refusal.params, "label": argument.label, "argument": argument.name, "unit": argument.unit}
                if refusal.reason == "why.ambiguous":
                    raise Question(refusal.reason, refusal.status, **more) from refusal
                raise Refused(refusal.reason, refusal.status, **more) from refusal
            wrong = interlocks.wrong_argument(argument, value, look)
            if wrong is not None:
                raise Refused(wrong.key, 422, label=wrong.label, **wrong.params)
            found[argument.name] = value
        return found

    def _argument(self, order: Order, prepared: Prepared, machine: Machine) -> float | None:
        if prepared.point is None:
            if order.argument not in (None, ""):
                raise Refused("why.no_argument", 422)
            return None
        if order.argument is None or order.argument == "":
            raise Refused("why.argument_missing", 422, label=prepared.point.label)
        value = self._entered(order, prepared, order.argument)
        look = self.look(machine)
        wrong = interlocks.wrong_value(prepared, value, look)
        if wrong is not None:
            raise Refused(wrong.key, 422, label=wrong.label, **wrong.params)
        self._check_seen(prepared, look, order.expected)
        self._check_relations(machine.item.type, {prepared.point.key: value}, look)
        return value

    @staticmethod
    def _entered(order: Order, prepared: Prepared, given: str | float) -> float:
        """What was entered for the point of `prepared`, as a number."""
        assert prepared.point is not None
        more: dict[str, object] = {"argument": prepared.command.key} if order.arguments else {}
        try:
            return parse_number(given, order.language, prepared.point.unit) if isinstance(given, str) else float(given)
        except Refused as refusal:
            if refusal.reason != "why.ambiguous":
                raise Refused(refusal.reason, refusal.status, **{**refusal.params, **more}) from refusal
            raise Question(
                refusal.reason,
                refusal.status,
                label=prepared.point.label,
                unit=prepared.point.unit,
                **{**refusal.params, **more},
            ) from refusal

    @staticmethod
    def _check_seen(prepared: Prepared, look: expression.Look, seen: float | None) -> None:
        """The setpoint still is what the person saw it at."""
        point = prepared.point
        if point is None or seen is None:
            return
        current = look(point.key)[0]
        if not isinstance(current, int | float) or not abs(current - seen) < 0.6 * 10.0**-point.decimals:
            raise Refused("why.changed", 409, label=point.label, current=current, expected=seen, unit=point.unit)

    def _confirm(
        self,
        order: Order,
        prepared: Prepared,
        level: str,
        why: tuple[str, ...],
        argument: float | None,
        old: Value,
        arguments: Mapping[str, float],
    ) -> None:
        """Ask back when the level wants more than the person gave."""
        needs_reason = level >= "C3" or prepared.command.needs_reason
        point, setpoint = prepared.point, prepared.setpoint
        missing = ""
        if level >= "C2" and not order.confirmed:
            missing = "why.confirm"
        elif needs_reason and not order.reason.strip():
            missing = "why.reason_needed"
        elif level >= "C4" and not order.proven:
            missing = "why.password_needed"
        if not missing:
            return
        difference = argument - old if argument is not None and isinstance(old, int | float) else None
        raise Question(
            missing,
            409,
            level=level,
            equipment=order.equipment,
            command=prepared.command.key,
            label=prepared.command.label,
            why=why,
            old=old,
            new=argument,
            difference=difference,
            unit=point.unit if point else "",
            decimals=point.decimals if point else 0,
            warning=setpoint.warning if setpoint else "",
            needs_reason=needs_reason,
            arguments=arguments,
        )

    async def renew(self, machine: Machine, prepared: Prepared) -> None:
        """Read again what is not read in turn and matters: values of open pages, a setpoint before it changes, a device's watchdog."""
        writer = self._writers.get(machine.item.link)
        age, points = self.age(machine), machine.item.points
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

    def watch(self, machine: Machine) -> bool:
        """Judge every condition of the machine; whether anything that a screen says about its commands is other than before."""
        look, age, kind = self.look(machine), self.age(machine), machine.item.type
        for condition in (*kind.permissives, *kind.interlocks):
            self._judge(machine, condition, look, age)
        signature = (
            tuple(value for value, _ in machine.met.values()),
            tuple((r.key, r.label) for r in interlocks.stale(machine.item, machine.link, machine.used, look, age)),
            tuple(interlocks.level(prepared, look)[0] for prepared in machine.commands.values()),
        )
        changed = signature != machine.signature
        machine.signature = signature
        return changed

    def condition(self, machine: Machine, condition: Condition) -> tuple[Condition, bool | None, int]:
        """`condition`, whether it is met (None = not known), and since when [µs UTC]."""
        return self._judge(machine, condition, self.look(machine), self.age(machine))

    def _judge(
        self, machine: Machine, condition: Condition, look: expression.Look, age: Age
    ) -> tuple[Condition, bool | None, int]:
        value = interlocks.met(condition, look, age=age)
        before = machine.met.get(condition.key)
        if before is None or before[0] is not value:
            machine.met[condition.key] = before = (value, self._clock.micros())
        return condition, value, before[1]

    def previous(self, machine: Machine, prepared: Prepared) -> dict[str, float]:
        look = self.look(machine)
        command = prepared.command
        result: dict[str, float] = {}
        for write in (*command.writes, *command.release):
            if write.value == "previous":
                value = machine.restore.get(write.point, look(write.point)[0])
                if not isinstance(value, int | float):
                    raise Refused("why.bad_value", 409, label=machine.item.points[write.point].label, point=write.point)
                result[write.point] = float(value)
        return result

    def stands(self, machine: Machine, stop: Prepared | None, since: float) -> bool:
        """Whether values read after `since` say that the machine stands."""
        if stop is None or stop.feedback is None:
            return True
        return self.read_since(machine, stop.watched, since) and self.feedback(machine, stop, None) is True

    def feedback(self, machine: Machine, prepared: Prepared, argument: float | None) -> bool | None:
        """Whether the values say that the command has worked; None = not known."""
        if prepared.feedback is None:
            return None
        return prepared.feedback.true(self.look(machine), argument=argument, age=self.age(machine))

    def read_since(self, machine: Machine, keys: Sequence[str], since: float) -> bool:
        """Whether every one of `keys` is good and was read after `since`.

        Where a device has several connections an answer that left before the write may arrive after it; its turnaround is added.
        """
        device = machine.item.type.device
        elapsed = self._clock.monotonic() - since - (device.turnaround if device.connections > 1 else 0.0)
        look, age = self.look(machine), self.age(machine)
        return all(is_good(look(key)[1]) and age(key) < elapsed for key in keys)

    def look(self, machine: Machine) -> expression.Look:
        tags, handles = self._tags, self._handles

        def look(key: str) -> expression.Reading:
            handle = handles(machine).get(key)
            return (None, NO_DATA) if handle is None else (tags.value(handle), tags.quality(handle))

        return look

    def age(self, machine: Machine) -> Age:
        tags, handles = self._tags, self._handles

        def age(key: str) -> float:
            handle = handles(machine).get(key)
            return float("inf") if handle is None else tags.age(handle)

        return age

    def _handles(self, machine: Machine) -> Mapping[str, int]:
        """Point → handle, looked up once for each revision of the plant."""
        revision, found = machine.handles
        if revision != self._tags.revision:
            known, prefix = self._tags.handles, machine.item.id + "."
            found = {key: known[prefix + key] for key in machine.item.points if prefix + key in known}
            machine.handles = self._tags.revision, found
        return found


def _key(stale: Reason) -> str:
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
