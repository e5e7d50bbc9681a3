"""What the parts of the command gate share: the machines, what is at work on each, its end, and whom to tell."""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from app.access.roles import ROLE_PERMISSION, Rights
from app.clock import Clock
from app.commands import interlocks
from app.commands.audit_lines import AuditLines
from app.commands.checks import PULSE_PAUSE, Checks
from app.commands.control_token import ControlToken
from app.commands.delivery import Delivery
from app.commands.hold import HoldToRun
from app.commands.interlocks import Prepared
from app.commands.job import Job
from app.commands.lifecycle import Progress, ProgressState, advance
from app.commands.machine import Machine, SetJob
from app.commands.open_commands import OpenCommand
from app.commands.orders import Audit, Foretell, Order, Writer
from app.commands.readings import Readings
from app.commands.value_set import Change
from app.errors import Refused
from app.plant.definitions import Equipment, Plant
from app.tags.database import TagDatabase

log = logging.getLogger(__name__)

T = TypeVar("T")

TELL = 0.1
"""Least time between two notices about one machine [s]."""


class CommandState:
    """The machines of one plant with the commands at work on them. `hold` is set by who leads motions (`motion.HeldMotion`)."""

    hold: HoldToRun

    def __init__(
        self,
        tags: TagDatabase,
        clock: Clock,
        writers: Mapping[str, Writer],
        audit: Audit,
        *,
        dry_run: bool,
        on_stop_unconfirmed: Callable[[str], None],
        rights: Rights,
        foretell: Foretell,
    ) -> None:
        self.clock = clock
        self.writers = writers
        self.dry_run = dry_run
        self.on_stop_unconfirmed = on_stop_unconfirmed
        self.machines: dict[str, Machine] = {}
        self.subscribers: list[Callable[[str], None]] = []
        self.enders: list[Callable[[Progress], None]] = []
        self.tasks: set[asyncio.Task[None]] = set()
        self.audit_lines = AuditLines(audit, self.spawn, foretell)
        self.rights = rights
        self.control = ControlToken(
            clock, moving=self.moving, changed=self.changed, journal=self.audit_lines.control, rights=rights
        )
        self.readings = Readings(tags, clock)
        self.delivery = Delivery(writers, clock, self.may_go_on, self.readings)
        self.checks = Checks(self.readings, clock, writers, self.control, rights)

    def configure(self, machines: Mapping[str, Machine]) -> list[Machine]:
        """Take `machines`, as `machines_of` makes them; those that were there before, with what is at work on them, are returned.

        What is at work goes on for a machine that stays; for one that goes it is superseded.
        """
        former, self.machines = self.machines, {}
        for id, machine in machines.items():
            if (old := former.get(id)) is not None:
                machine.go_on_from(old)
            self.machines[id] = machine
        for gone in former.values():
            if gone.item.id in self.machines or gone.job is None:
                continue
            if gone.job.lease is not None:
                self.hold.end(gone.job.lease, "reload")
            self.machines[gone.item.id] = gone
            self.end(gone, gone.job, ProgressState.SUPERSEDED, "why.reloaded")
            del self.machines[gone.item.id]
        return list(former.values())

    def may_go_on(self, order: Order, prepared: Prepared) -> bool:
        """Whether whoever gave an order still may give it."""
        person = self.rights(order.person) if order.person is not None else None
        return person is not None and all(person.may(ROLE_PERMISSION[role]) for role in prepared.roles)

    def moving(self, equipment: str) -> bool:
        """Whether somebody holds a button that moves the machine."""
        return self.hold.active(equipment) is not None

    def tell_changed(self, now: float) -> None:
        """Tell of what changed too short after it was told to be told at once, and of pulses that may be repeated now."""
        for machine in self.machines.values():
            for key in [key for key, at in machine.pulses.items() if now - at >= PULSE_PAUSE]:
                del machine.pulses[key]
                machine.dirty = True
            if machine.dirty and now - machine.announced_at >= TELL:
                self._tell(machine, now)

    def end(
        self,
        machine: Machine,
        job: Job,
        state: ProgressState,
        reason: str = "",
        params: Mapping[str, object] | None = None,
    ) -> None:
        """The command of `job` is over."""
        if job.progress.over:
            return
        job.end(state, self.clock.micros(), reason, params or {})
        if state is ProgressState.CONFIRMED and job.prepared.command.puts_back:
            machine.put_back()
        if machine.job is job:
            machine.job = None
        self.audit_lines.command(job.order, job.progress)
        self.close(machine, job.progress)

    def hindrance(self, machine: Machine, job: SetJob) -> tuple[str, Mapping[str, object]] | None:
        """What keeps a set from going on (text key, what fills it): a Stop, a right, the token, a value or condition that is lost."""
        if job.stop:
            return job.stop, {}
        if self.machines.get(machine.item.id) is not machine:
            return "why.reloaded", {}
        reasons = self.checks.reasons(job.order.person, machine, job.prepared, running=True)
        if not reasons:
            return None
        first = reasons[0][0]
        return first.key, {**first.params, "label": first.label} if first.label else first.params

    def end_set(
        self,
        machine: Machine,
        job: SetJob,
        state: ProgressState,
        reason: str,
        params: Mapping[str, object],
        changes: tuple[Change, ...] = (),
    ) -> None:
        """The set of `job` is over; `changes`: what was found of its values."""
        ended = advance(job.progress, state, self.clock.micros(), end=True, reason=reason, params=params)
        job.went(replace(ended, changes=changes or ended.changes))
        self.release_set(machine, job)
        self.close(machine, job.progress)
        self.audit_lines.command(job.order, job.progress)

    def release_set(self, machine: Machine, job: SetJob) -> None:
        """The machine takes other commands again, also when the plant was read anew meanwhile."""
        for known in (machine, self.machines.get(machine.item.id, machine)):
            if known.set is job:
                known.set = None
                self.changed(machine.item.id)

    def tell_open(self, one: OpenCommand) -> None:
        """A command of a former run is over, and nobody knows how."""
        progress = one.progress
        self.audit_lines.line(
            None, f"{progress.equipment}.{progress.command}", one.old, one.new, progress, by=progress.person
        )
        machine = self.machines.get(progress.equipment)
        if machine is None:
            return
        self.close(machine, progress)
        if one.stop:
            self.alarm_stop(progress.equipment)

    def close(self, machine: Machine, progress: Progress) -> None:
        """Keep how a command or a set of `machine` ended, and tell whoever asked for ends."""
        machine = self.machines.get(machine.item.id, machine)
        machine.last = progress
        changed = progress.state is ProgressState.CONFIRMED and progress.argument not in (None, progress.old)
        if changed and isinstance(progress.old, int | float):
            machine.former[progress.command] = float(progress.old)
        machine.history.append(progress)
        for callback in tuple(self.enders):
            try:
                callback(progress)
            except Exception:
                log.exception("subscriber of command ends failed command=%s", progress.id)
        self.changed(machine.item.id)

    def changed(self, equipment: str) -> None:
        """Something about the machine changed: tell at once, or with the next tick when that was just done."""
        machine = self.machines.get(equipment)
        if machine is None:
            return
        machine.dirty = True
        now = self.clock.monotonic()
        if now - machine.announced_at >= TELL:
            self._tell(machine, now)

    def _tell(self, machine: Machine, now: float) -> None:
        machine.dirty, machine.announced_at = False, now
        for callback in tuple(self.subscribers):
            try:
                callback(machine.item.id)
            except Exception:
                log.exception("subscriber of the gate failed equipment=%s", machine.item.id)

    def find(self, equipment: str, key: str) -> tuple[Machine, Prepared]:
        """A machine and its command or setpoint `key`.

        Raises:
            Refused: 404.
        """
        machine = self.machines.get(equipment)
        prepared = (machine.commands.get(key) or machine.setpoints.get(key)) if machine else None
        if machine is None or prepared is None:
            raise Refused("why.no_such_command", 404, equipment=equipment, command=key)
        return machine, prepared

    def still(self, equipment: str, choose: Callable[[Machine], Prepared | None]) -> tuple[Machine, Prepared]:
        """A machine as the plant has it now, and what `choose` finds of it, for an order that found them before something was waited for.

        Raises:
            Refused: 409, they went with a reload.
        """
        machine = self.machines.get(equipment)
        prepared = choose(machine) if machine else None
        if machine is None or prepared is None:
            raise Refused("why.reloaded", 409)
        return machine, prepared

    def keep(self, work: Coroutine[Any, Any, T], name: str) -> "asyncio.Task[T]":
        """A task that goes on when its caller goes away."""
        task = asyncio.create_task(work, name=name)
        task.add_done_callback(lambda done: None if done.cancelled() else done.exception())
        return task

    def work(self, work: Coroutine[Any, Any, None], name: str) -> "asyncio.Task[None]":
        """As `spawn`, for who waits for it: closing the gate waits for it as well."""
        task = asyncio.create_task(work, name=name)
        self.tasks.add(task)
        task.add_done_callback(self._finished)
        return task

    def spawn(self, work: Coroutine[Any, Any, None], name: str) -> None:
        """Do `work` without waiting for it; what goes wrong is logged."""
        self.work(work, name)

    def _finished(self, task: "asyncio.Task[None]") -> None:
        self.tasks.discard(task)
        if not task.cancelled() and task.exception() is not None:
            log.error("task of the gate failed task=%s", task.get_name(), exc_info=task.exception())

    def alarm_stop(self, equipment: str) -> None:
        """A Stop was not read back."""
        try:
            self.on_stop_unconfirmed(equipment)
        except Exception:
            log.exception("alarm for an unconfirmed stop failed equipment=%s", equipment)


def machines_of(plant: Plant) -> dict[str, Machine]:
    """The machines of `plant`, with nothing at work on them; with some hundred of them this takes a while."""
    return {item.id: _machine(item, plant) for item in plant.equipment.values()}


def _machine(item: Equipment, plant: Plant) -> Machine:
    kind = item.type
    commands = {key: interlocks.prepare(item, command) for key, command in kind.commands.items()}
    setpoints = {
        key: interlocks.prepare(item, interlocks.setting(item, setpoint)) for key, setpoint in kind.setpoints.items()
    }
    stop = next((prepared for prepared in commands.values() if prepared.command.stop), None)
    return Machine(item, plant.links[item.link], commands, setpoints, stop)
