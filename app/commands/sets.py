"""A set of setpoints on its way: written in order, each step read back before the next, and all put back when one fails.

    sent (on the disk) → step, read back → step, read back → … → all read back → confirmed
                            └ refused, not as written, a right or a condition lost, Stop → former values written and read back → failed

It ends with all new values, with all former ones, or with a mixed state that names which value stands where and is an alarm. What a device
takes at once (a staging area) is one step. A write of which nobody knows is looked up: new values that are there are there. Putting back
asks for no right and waits at most `RESTORE_LIMIT` for a device that is silent; each former value is written once, after the device has
answered, never later. Values that cannot be read then are read when the device is back, and told again (`found`): nothing is written then.

A Stop waits for no set. It ends the set, which puts back what it had changed.
"""

import asyncio
import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from app.commands import value_set
from app.commands.command_state import CommandState
from app.commands.delivery import Outcome, outcome_of
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress, ProgressState, advance
from app.commands.machine import Machine, SetJob
from app.commands.orders import Order, Task
from app.commands.set_follow_up import UNREAD, UNTOLD, SetFollowUp, found_params, read_now, value_now
from app.commands.value_set import Change, Stands
from app.errors import LinkError, NoAnswer, Refused
from app.links.contract import LateAnswerDue
from app.links.schedule import PERMIT

log = logging.getLogger(__name__)

FIRST_PAUSE, LAST_PAUSE = 0.02, 0.5
"""Between two reads of a value that is not there yet [s]."""
RESTORE_LIMIT = 10.0
"""Longest wait for a device that is silent before its former values are given up [s]."""
NO_AUDIT = "why.no_audit"
RESTORED, MIXED = "why.set_restored", "why.set_mixed"
"""Ends of a set, besides `UNREAD`: all former values stand; some new, some old."""

Failure = tuple[str, Mapping[str, object]]
"""Why a set does not go on: text key, what fills it."""


class Sets:
    """The sets of all machines; at most one at work on each."""

    def __init__(self, state: CommandState, follow_up: SetFollowUp) -> None:
        self._state = state
        self._follow_up = follow_up

    async def send(self, order: Order, machine: Machine, prepared: Prepared, plan: Task) -> Progress:
        """Write an admitted set; returns when it is over. It goes on when the caller goes away.

        Raises:
            Refused: 503, it can be written down nowhere; nothing was sent.
        """
        assert order.person is not None
        progress = Progress(
            order.id, order.equipment, prepared.command.key, prepared.command.label, order.person.display, ProgressState.REQUESTED,
            order.asked, old=plan.old, limit=plan.limit, telegrams=plan.telegrams, arguments=plan.arguments,
            changes=plan.changes, asker=order.person.id,
        )  # fmt: skip
        job = SetJob(order, prepared, plan, progress)
        if self._state.dry_run:
            self._end(machine, job, ProgressState.DRY_RUN, "why.dry_run", {})
            return job.progress
        if machine.job is not None:
            new = {"label": progress.label, "display": progress.person}
            self._state.end(machine, machine.job, ProgressState.SUPERSEDED, "why.superseded", new)
        machine.set = job
        self._state.changed(order.equipment)
        await asyncio.shield(self._state.work(self._carry_out(machine, job), f"set {order.equipment}"))
        if job.progress.reason == NO_AUDIT:
            raise Refused(NO_AUDIT, 503)
        return job.progress

    def stop(self, machine: Machine, why: str) -> None:
        """Write no further new value: put back what was changed (`why`: text key)."""
        if machine.set is not None:
            machine.set.interrupt(why)

    # details

    async def _carry_out(self, machine: Machine, job: SetJob) -> None:
        try:
            if not await self._state.audit_lines.sent(job.order, job.progress):
                self._end(machine, job, ProgressState.FAILED, NO_AUDIT, {})
                return
            failure = await self._write(machine, job)
            if failure is None:
                self._end(machine, job, ProgressState.CONFIRMED, "", {}, self._judged(machine, job))
                return
            log.warning("set not written equipment=%s reason=%s", machine.item.id, failure[0])
            await self._restore(machine, job)
            self._end_failed(machine, job, failure)
        finally:
            self._state.release_set(machine, job)

    async def _write(self, machine: Machine, job: SetJob) -> Failure | None:
        """All new values, step by step; why it does not go on, None when they are all there."""
        values = job.plan.arguments
        for step in job.plan.steps:
            failure = self._state.hindrance(machine, job)
            if failure is not None:
                return failure
            job.touched.append(step)
            since = self._state.clock.monotonic()
            broke = await self._send(machine, job, {key: values[key] for key in step}, since + job.plan.limit, new=True)
            if broke is not None and broke[0] is not ProgressState.UNKNOWN:
                job.touched.remove(step)
                return broke[1], broke[2]
            if broke is None and job.progress.state is ProgressState.REQUESTED:
                job.went(advance(job.progress, ProgressState.ACCEPTED, self._state.clock.micros()))
                self._state.changed(machine.item.id)
            failure = await self._there(machine, job, step, values, since)
            if failure is not None:
                return failure if broke is None else (broke[1], broke[2])
            job.unsettled.difference_update(step)  # seen in effect: nothing of it is still to come
        return await self._there(machine, job, list(values), values, self._state.clock.monotonic())

    async def _send(
        self, machine: Machine, job: SetJob, values: Mapping[str, float], until: float, *, new: bool
    ) -> Outcome | None:
        """One step; None = the device has taken it. New values go only while the person may, former ones always.

        A line that still owes an answer and has sent nothing is waited for, at most `until` [s].
        """
        permit = partial(self._may_go_on, machine, job) if new else None
        before = PERMIT.set(permit)
        try:
            while not await self._sent(machine, job, values, until):
                pass
        except (LinkError, Refused, KeyError) as error:
            if isinstance(error, NoAnswer):
                job.known_as(error.request)
            outcome = outcome_of(error, machine.item, as_code=False)
            if outcome[0] is ProgressState.UNKNOWN:
                job.unsettled |= values.keys()
            return outcome
        finally:
            PERMIT.reset(before)
        job.unsettled.difference_update(values)
        return None

    async def _sent(self, machine: Machine, job: SetJob, values: Mapping[str, float], until: float) -> bool:
        """Whether the step is written; False when it was not sent and the line is free for it now."""
        try:
            job.known_as(await self._state.writers[machine.item.link].write_set(machine.item.id, values))
        except LinkError as error:
            late = error if isinstance(error, LateAnswerDue) else error.__cause__
            if not isinstance(late, LateAnswerDue) or self._state.clock.monotonic() + late.wait > until:
                raise
            await asyncio.sleep(late.wait)
            return False
        return True

    def _may_go_on(self, machine: Machine, job: SetJob) -> bool:
        return not job.stop and self._state.may_go_on(job.order, job.prepared)

    async def _there(
        self, machine: Machine, job: SetJob, keys: Sequence[str], wanted: Mapping[str, float], since: float,
        *, putting_back: bool = False,
    ) -> Failure | None:  # fmt: skip
        """Wait until the device holds the `wanted` values of `keys`; why it does not."""
        parts = {part.command.key: part for part in job.prepared.parts}
        until, pause = self._state.clock.monotonic() + job.plan.limit, FIRST_PAUSE
        while True:
            read = await read_now(self._state, machine, keys, since)
            wrong = [
                key for key in keys
                if not read or not value_set.is_value(parts[key], value_now(self._state, machine, key) or 0.0, wanted[key])
            ]  # fmt: skip
            if not wrong:
                return None
            if job.stop and not putting_back:
                return job.stop, {}
            if self._state.clock.monotonic() >= until:
                break
            await asyncio.sleep(pause)
            pause = min(2 * pause, LAST_PAUSE)
        change = next(change for change in job.plan.changes if change.key == wrong[0])
        if not read:
            return "why.set_not_read", {"label": change.label}
        found = value_now(self._state, machine, change.key)
        return "why.set_differs", {
            "label": change.label,
            "value": found,
            "unit": change.unit,
            "asked": wanted[change.key],
        }

    async def _restore(self, machine: Machine, job: SetJob) -> None:
        """Write the former values of every step that may have arrived, the last one first, and read them back."""
        former = {change.key: change.old for change in job.plan.changes}
        until = self._state.clock.monotonic() + RESTORE_LIMIT
        since = self._state.clock.monotonic()
        for step in reversed(job.touched):
            if not await self._answers(machine, step, until):
                job.unsettled |= set(step)
                continue
            since = self._state.clock.monotonic()
            broke = await self._send(machine, job, {key: former[key] for key in step}, until, new=False)
            if broke is not None:
                log.warning("former values not taken equipment=%s reason=%s", machine.item.id, broke[1])
        keys = [key for step in job.touched for key in step]
        if keys:
            await self._there(machine, job, keys, former, since, putting_back=True)

    async def _answers(self, machine: Machine, keys: Sequence[str], until: float) -> bool:
        """Whether the device answers with good values before `until`: nothing is sent into silence."""
        pause = FIRST_PAUSE
        while not await read_now(self._state, machine, keys, float("-inf")):
            if self._state.clock.monotonic() >= until:
                return False
            await asyncio.sleep(pause)
            pause = min(2 * pause, LAST_PAUSE)
        return True

    def _judged(self, machine: Machine, job: SetJob) -> tuple[Change, ...]:
        """What the device holds of each value. Of one that was never sent and cannot be read it is the former one."""
        parts = {part.command.key: part for part in job.prepared.parts}
        touched = {key for step in job.touched for key in step}
        uncertain = job.unsettled if machine.item.type.device.plc else frozenset[str]()
        changes = []
        for change in job.plan.changes:
            value = None if change.key in uncertain else value_now(self._state, machine, change.key)
            if value is None and change.key not in touched:
                changes.append(replace(change, found=change.old, stands=Stands.OLD))
            else:
                changes.append(value_set.judged(change, parts[change.key], value))
        return tuple(changes)

    def _end_failed(self, machine: Machine, job: SetJob, failure: Failure) -> None:
        changes = self._judged(machine, job)
        stands = {change.stands for change in changes}
        cause: dict[str, object] = {**failure[1], "cause": failure[0]}
        if "cause" in failure[1]:
            cause["deeper"] = failure[1]["cause"]
        if stands == {Stands.OLD}:
            self._end(machine, job, ProgressState.FAILED, RESTORED, cause, changes)
        else:
            reason = UNREAD if Stands.UNKNOWN in stands else MIXED
            self._end(machine, job, ProgressState.UNCONFIRMED, reason, {**cause, **found_params(changes)}, changes)

    def _end(
        self,
        machine: Machine,
        job: SetJob,
        state: ProgressState,
        reason: str,
        params: Mapping[str, object],
        changes: tuple[Change, ...] = (),
    ) -> None:
        self._state.end_set(machine, job, state, reason, params, changes)
        if reason in UNTOLD:
            self._follow_up.begin(job.progress)
