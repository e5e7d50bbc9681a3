"""Parameters of a drive on their way: written in order, all read back, and all put back when one fails.

    former values read → sent (on the disk) → request → request → … → all read back → confirmed
                                                └ refused, not as written, a right or a condition lost, Stop, cancelled
                                                    → former values written where others stand, and read back → failed

It ends with all new values, with all former ones, or with a mixed state that names which value stands where and is an alarm. A request of
which nobody knows is looked up by reading. Putting back asks for no right and waits at most `RESTORE_LIMIT` for a drive that is silent.
Values that cannot be read then are read when the drive is back, and told again: nothing is written then.

Nothing here is permanent until it is saved, which is a command of its own (`save`).
"""

import asyncio
import logging
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

from app.access.roles import Person
from app.commands import interlocks, value_set
from app.commands.command_state import CommandState
from app.commands.execution import Execution
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress, ProgressState, advance
from app.commands.machine import Machine, SetJob
from app.commands.open_parameters import OpenParameters
from app.commands.orders import Order, Task
from app.commands.parameter_change import (
    KEY,
    LABEL,
    MOST,
    SAVE,
    SAVE_LABEL,
    ParameterChange,
    apart,
    in_order,
    saving_of,
    wrong_value,
)
from app.commands.parameter_reading import Stage, Work, why
from app.commands.parameter_work import ParameterWork
from app.commands.set_follow_up import UNREAD, found_params
from app.commands.sets import MIXED, NO_AUDIT, RESTORED, Failure
from app.commands.value_set import Change, Stands
from app.errors import LinkError, Refused
from app.links.mailbox import Missed, ParameterAccess
from app.plant.definitions import Command
from app.plant.expression import parse
from app.profidrive.parameter_access.messages import Failed, Values
from app.profidrive.parameter_access.parameter import When

log = logging.getLogger(__name__)

SAVE_LIMIT, SAVE_LOOK = 60.0, 0.25
"""Longest time for saving, and between two looks whether it is over [s]; how long a real drive takes is not known here."""
NOT_SAVED = "why.par_not_saved"
CANCELLED = "why.par_cancelled"


class ParameterSets:
    """Writes and saves the parameters of all drives; at most one set is at work on each."""

    def __init__(self, state: CommandState, execution: Execution) -> None:
        self._state, self._execution = state, execution
        self._work = ParameterWork(state)

    def stage(self, equipment: str) -> Stage | None:
        """How far the set at work is; None when none is."""
        return self._work.reading.stages.get(equipment)

    async def change(
        self,
        person: Person | None,
        equipment: str,
        changes: Sequence[ParameterChange],
        *,
        id: str = "",
        nonce: str = "",
        confirmed: bool = False,
        proven: bool = False,
        reason: str = "",
        address: str = "",
        language: str = "en",
    ) -> Progress:
        """Write `changes` in their order: all or none. Returns when it is over, with what the drive holds of each; it goes on when the
        caller goes away.

        Raises:
            Question: confirmation, reason or password are missing.
            Refused: as `Gate.ask`; 409 `why.changed`, an element is another than it was seen at; 422, a value that is not permitted.
        """
        order = self._work.order(person, equipment, KEY, id, nonce, confirmed, proven, reason, address, language)
        return await self._execution.take(order, partial(_writing, changes), partial(self._send_changes, changes))

    async def save(
        self,
        person: Person | None,
        equipment: str,
        *,
        id: str = "",
        nonce: str = "",
        confirmed: bool = False,
        proven: bool = False,
        reason: str = "",
        address: str = "",
        language: str = "en",
    ) -> Progress:
        """Have the drive copy its RAM to ROM, at standstill; returns when it says that it is done. Otherwise as `change`."""
        order = self._work.order(person, equipment, SAVE, id, nonce, confirmed, proven, reason, address, language)
        return await self._execution.take(order, _saving, self._send_save)

    def cancel(self, equipment: str) -> bool:
        """Write no further new value and put back what was changed; False when no set of parameters is at work."""
        machine = self._state.machines.get(equipment)
        if machine is None or machine.set is None or machine.set.order.key != KEY:
            return False
        machine.set.interrupt(CANCELLED)
        return True

    def take_open(self, sets: Iterable[OpenParameters]) -> None:
        """Sets of a former run whose end is not known: told as such, and what is found of them as soon as it can be read. Nothing is
        written."""
        for progress, changes in sets:
            machine = self._state.machines.get(progress.equipment)
            if machine is not None:
                self._state.close(machine, replace(progress, ended=self._state.clock.micros()))
                try:
                    work = Work(changes, self._work.mailbox(machine), sent=[changes])
                except Refused as refusal:
                    log.error("open parameters not read equipment=%s reason=%s", progress.equipment, refusal)
                    continue
                self._state.spawn(
                    self._work.follow(progress.equipment, progress, work), f"parameters of {progress.equipment}"
                )

    # details

    async def _send_changes(
        self, changes: Sequence[ParameterChange], order: Order, machine: Machine, prepared: Prepared, plan: Task
    ) -> Progress:
        _check(changes)
        work, job = Work(changes, self._work.mailbox(machine)), self._work.job(order, machine, prepared, plan)
        return await self._work.done(machine, job, self._carry_out(machine, job, work))

    async def _send_save(self, order: Order, machine: Machine, prepared: Prepared, plan: Task) -> Progress:
        mailbox = self._work.mailbox(machine)
        job = self._work.job(order, machine, prepared, plan)
        return await self._work.done(machine, job, self._save(machine, job, mailbox))

    async def _carry_out(self, machine: Machine, job: SetJob, work: Work) -> None:
        await _read_related(self._state, machine, work.changes)
        work.changes = in_order(machine.item.type, work.changes, self._state.readings.look(machine))
        former = await self._work.reading.former(machine.item.id, work)
        described = tuple(one.described(former[one.key]) for one in work.changes)
        job.went(replace(job.progress, changes=described, old=value_set.values_text(described, old=True)))
        if self._state.dry_run:
            self._state.end_set(machine, job, ProgressState.DRY_RUN, "why.dry_run", {})
            return
        if not await self._state.audit_lines.sent(job.order, job.progress):
            self._state.end_set(machine, job, ProgressState.FAILED, NO_AUDIT, {})
            return
        failure = await self._work.write(machine, job, work)
        if failure is None:
            found = await self._work.reading.found(machine.item.id, work, described)
            failure = ((job.stop, {}) if job.stop else None) or _differing(found)
            if failure is None:
                self._state.end_set(machine, job, ProgressState.CONFIRMED, "", {}, found)
                return
        log.warning("parameters not written equipment=%s reason=%s", machine.item.id, failure[0])
        found = await self._work.restore(machine, job, work, described)
        self._end_failed(machine, job, work, failure, found)

    def _end_failed(
        self, machine: Machine, job: SetJob, work: Work, failure: Failure, found: tuple[Change, ...]
    ) -> None:
        cause: dict[str, object] = {**failure[1], "cause": failure[0]}
        if "cause" in failure[1]:
            cause["deeper"] = failure[1]["cause"]
        if {change.stands for change in found} == {Stands.OLD}:
            self._state.end_set(machine, job, ProgressState.FAILED, RESTORED, cause, found)
            return
        unread = any(change.stands is Stands.UNKNOWN for change in found)
        reason = UNREAD if unread else MIXED
        self._state.end_set(machine, job, ProgressState.UNCONFIRMED, reason, {**cause, **found_params(found)}, found)
        if unread:
            self._state.spawn(
                self._work.follow(machine.item.id, job.progress, work), f"parameters of {machine.item.id}"
            )

    async def _save(self, machine: Machine, job: SetJob, mailbox: ParameterAccess) -> None:
        parameter = saving_of(machine.item.type)
        assert parameter is not None
        object = parameter.objects[0]
        job.went(replace(job.progress, telegrams=((parameter.code, 1.0),)))
        if self._state.dry_run:
            self._state.end_set(machine, job, ProgressState.DRY_RUN, "why.dry_run", {})
            return
        if not await self._state.audit_lines.sent(job.order, job.progress):
            self._state.end_set(machine, job, ProgressState.FAILED, NO_AUDIT, {})
            return
        if (failure := self._state.hindrance(machine, job)) is not None:  # writing it down takes long on a slow disk
            self._state.end_set(machine, job, ProgressState.FAILED, *failure)
            return
        self._work.reading.begin(machine.item.id, "saving", 0)
        one = ParameterChange(object, parameter, 1.0)
        work = Work([one], mailbox)
        told = await self._work.change(machine, job, work, [one], [1.0])
        if isinstance(told, tuple):
            self._state.end_set(machine, job, ProgressState.FAILED, told[0], told[1])
            return
        if isinstance(told[0], Failed | Missed):
            sent = isinstance(told[0], Missed) and told[0].sent
            key, params = why(one, told[0])
            state = ProgressState.UNCONFIRMED if sent else ProgressState.FAILED
            self._state.end_set(machine, job, state, key, params)
            return
        job.went(advance(job.progress, ProgressState.ACCEPTED, self._state.clock.micros()))
        self._state.changed(machine.item.id)
        until = self._state.clock.monotonic() + SAVE_LIMIT
        while self._state.clock.monotonic() < until:
            await asyncio.sleep(SAVE_LOOK)
            outcome = (await self._work.reading.asked(mailbox, object, [one]))[0]
            if isinstance(outcome, Values) and not outcome.values[0]:
                self._state.end_set(machine, job, ProgressState.CONFIRMED, "", {})
                return
        self._state.end_set(machine, job, ProgressState.UNCONFIRMED, NOT_SAVED, {"seconds": SAVE_LIMIT})


def _command(key: str, label: str) -> Command:
    return Command(key, label, writes=(), feedback="", timeout="5", level="C4", role="engineer", moves=False)


def _writing(changes: Sequence[ParameterChange], machine: Machine) -> Prepared | None:
    """What is asked for to write parameters; None for a machine that has none.

    A drive behind a mailbox judges itself when a parameter may be changed. Of one whose parameters are registers nothing says so: what is
    only for standstill, as everything of which nothing is known, waits for it here.
    """
    kind = machine.item.type
    if not kind.drive_parameters:
        return None
    guarded = kind.device.parameters is not None and any(one.parameter.when is not When.ALWAYS for one in changes)
    return at_standstill(machine, KEY, LABEL) if guarded else interlocks.prepare(machine.item, _command(KEY, LABEL))


async def _read_related(state: CommandState, machine: Machine, changes: Sequence[ParameterChange]) -> None:
    """Read now what the checks of the type compare the new values with.

    Raises:
        Refused: 503, it cannot be read.
    """
    points = {one.parameter.point for one in changes if one.parameter.point}
    names = [parse(check.expression).names for check in machine.item.type.checks]
    related = {key for used in names if not used.isdisjoint(points) for key in used}
    wanted = interlocks.sources(machine.item.points, related)
    if not wanted:
        return
    try:
        await state.writers[machine.item.link].refresh(machine.item.id, wanted)
    except LinkError as error:
        raise Refused("why.no_answer", 503, cause=f"link.error.{error.kind}") from error


def _check(changes: Sequence[ParameterChange]) -> None:
    """Raises:
    Refused: 422, a value that is not permitted, one element twice, none, or too many.
    """
    if not 0 < len(changes) <= MOST or len({one.key for one in changes}) < len(changes):
        raise Refused("why.par_count", 422, n=len(changes), limit=MOST)
    for one in changes:
        own = apart(one.parameter, one.new)
        wrong = (own, {}) if own else wrong_value(one.parameter, one.new)
        if wrong is not None:
            raise Refused(wrong[0], 422, label=one.parameter.text_key, argument=one.key, **wrong[1])


def _saving(machine: Machine) -> Prepared | None:
    """Saving, at standstill; None for a machine that has nothing to be saved by."""
    return at_standstill(machine, SAVE, SAVE_LABEL) if saving_of(machine.item.type) is not None else None


def at_standstill(machine: Machine, key: str, label: str) -> Prepared:
    """An engineer's command that the machine must stand for, with everything confirmed."""
    prepared = interlocks.prepare(machine.item, _command(key, label))
    stopped = interlocks.stopped(machine.item.type)
    used = interlocks.sources(machine.item.points, parse(stopped.expression).names)
    return replace(
        prepared,
        permissives=(*prepared.permissives, stopped),
        used=tuple(dict.fromkeys((*prepared.used, *used))),
    )


def _differing(found: Sequence[Change]) -> Failure | None:
    """The first element that does not hold its new value."""
    wrong = next((change for change in found if change.stands is not Stands.NEW), None)
    if wrong is None:
        return None
    if wrong.found is None:
        return "why.set_not_read", {"label": wrong.label}
    return "why.set_differs", {"label": wrong.label, "value": wrong.found, "unit": wrong.unit, "asked": wrong.new}
