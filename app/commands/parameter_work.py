"""What all that writes drive parameters by the gate has in common: taking the machine, sending requests, putting former values back."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol, cast

from app import chance
from app.access.roles import Person
from app.commands import value_set
from app.commands.command_state import CommandState
from app.commands.delivery import outcome_of
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress, ProgressState, advance
from app.commands.machine import Machine, SetJob
from app.commands.orders import Order, Task, Writer
from app.commands.parameter_change import ParameterChange, requests
from app.commands.parameter_reading import PAUSE, ParameterReading, Work, why
from app.commands.set_follow_up import FOUND_EVERY, FOUND_MIXED, FOUND_NEW, FOUND_OLD, found_params
from app.commands.sets import NO_AUDIT, RESTORE_LIMIT, Failure
from app.commands.value_set import Change, Stands
from app.errors import LinkError, Refused
from app.links.mailbox import Missed, Outcome, ParameterAccess
from app.links.schedule import PERMIT
from app.profidrive.parameter_access.messages import Failed

log = logging.getLogger(__name__)

RESTORE_PASSES = 3
"""So often former values are written that are not there then: one may be refused until another one is back."""


Judge = Callable[[tuple[Change, ...]], Awaitable[tuple[Change, ...]]]
"""What was found, as it is to be told."""


class ParameterWriter(Writer, Protocol):
    """What is needed of a link to drives with parameters."""

    def parameters(self, equipment: str) -> ParameterAccess:
        """The one queue to the parameters of a drive.

        Raises:
            LinkError: it has none.
        """
        ...


class ParameterWork:
    """Takes a machine for one piece of work over its mailbox, sends what belongs to it and puts former values back."""

    def __init__(self, state: CommandState) -> None:
        self._state = state
        self.reading = ParameterReading()

    def order(
        self, person: Person | None, equipment: str, key: str, id: str, nonce: str,
        confirmed: bool, proven: bool, reason: str, address: str, language: str,
    ) -> Order:  # fmt: skip
        """What a person asks, as it came."""
        return Order(
            person, equipment, key, None, id or chance.token_hex(16), nonce, None, confirmed, proven, reason, address,
            language, self._state.clock.micros(),
        )  # fmt: skip

    def job(self, order: Order, machine: Machine, prepared: Prepared, plan: Task) -> SetJob:
        """The machine is taken: nothing but a Stop is let beside it."""
        assert order.person is not None
        progress = Progress(
            order.id, order.equipment, order.key, prepared.command.label, order.person.display, ProgressState.REQUESTED,
            order.asked, limit=plan.limit, asker=order.person.id,
        )  # fmt: skip
        job = SetJob(order, prepared, plan, progress)
        if machine.job is not None:
            new = {"label": progress.label, "display": progress.person}
            self._state.end(machine, machine.job, ProgressState.SUPERSEDED, "why.superseded", new)
        machine.set = job
        self._state.changed(order.equipment)
        return job

    async def done(self, machine: Machine, job: SetJob, work: Coroutine[Any, Any, None]) -> Progress:
        """Do `work` to its end, also when the caller goes away; what has become of it.

        Raises:
            Refused: by the work, or 503 when the audit trail takes nothing.
        """
        refusals: list[Refused] = []

        async def carried_out() -> None:
            try:
                await work
            except Refused as refusal:
                refusals.append(refusal)
            finally:
                self.reading.stages.pop(machine.item.id, None)
                self._state.release_set(machine, job)
                await _read_points(self._state, machine, job)

        await asyncio.shield(self._state.work(carried_out(), f"parameters {machine.item.id}"))
        if refusals:
            raise refusals[0]
        if job.progress.reason == NO_AUDIT:
            raise Refused(NO_AUDIT, 503)
        return job.progress

    def mailbox(self, machine: Machine) -> ParameterAccess:
        """The one queue to the parameters of the machine.

        Raises:
            Refused: 503, it has none.
        """
        try:
            return cast(ParameterWriter, self._state.writers[machine.item.link]).parameters(machine.item.id)
        except LinkError as error:
            raise Refused("why.no_answer", 503, cause=f"link.error.{error.kind}") from error

    async def write(self, machine: Machine, job: SetJob, work: Work) -> Failure | None:
        """All new values, request by request; why it does not go on, None when the drive has taken all."""
        stage = self.reading.begin(machine.item.id, "writing", len(work.changes))
        for request in requests(work.changes):
            failure = self._state.hindrance(machine, job)
            if failure is not None:
                return failure
            told = await self.change(machine, job, work, request, [one.new for one in request])
            if isinstance(told, tuple):
                return told
            if any(not isinstance(outcome, Missed) or outcome.sent for outcome in told):
                work.sent.append(request)
            for one, outcome in zip(request, told, strict=True):
                if isinstance(outcome, Failed):
                    work.errors[one.key] = outcome.number
            bad = next((pair for pair in zip(request, told, strict=True) if isinstance(pair[1], Failed | Missed)), None)
            if bad is not None:
                return why(*bad)
            stage.done += len(request)
            if job.progress.state is ProgressState.REQUESTED:
                job.went(advance(job.progress, ProgressState.ACCEPTED, self._state.clock.micros()))
                self._state.changed(machine.item.id)
        return None

    async def change(
        self, machine: Machine, job: SetJob, work: Work, request: Sequence[ParameterChange], values: Sequence[float],
        *, new: bool = True,
    ) -> "list[Outcome] | Failure":  # fmt: skip
        """One request. New values go only while the person may, former ones always."""
        pairs = [(one.address, one.block(value)) for one, value in zip(request, values, strict=True)]
        before = PERMIT.set(partial(self._may_go_on, job) if new else None)
        try:
            return await work.mailbox.change(request[0].object, pairs)
        except (LinkError, Refused) as error:
            return outcome_of(error, machine.item, as_code=False)[1:]
        finally:
            PERMIT.reset(before)

    def _may_go_on(self, job: SetJob) -> bool:
        return not job.stop and self._state.may_go_on(job.order, job.prepared)

    async def restore(
        self, machine: Machine, job: SetJob, work: Work, described: Sequence[Change]
    ) -> tuple[Change, ...]:
        """Write the former values of what is not the former one, the last request first, and read them back."""
        until = self._state.clock.monotonic() + RESTORE_LIMIT
        found = await self.reading.found(machine.item.id, work, described, failed=True)
        passes = 0
        while passes < RESTORE_PASSES and any(change.stands is not Stands.OLD for change in found):
            if any(change.stands is Stands.UNKNOWN for change in found):  # nothing is sent into silence
                if self._state.clock.monotonic() >= until:
                    break
                await asyncio.sleep(PAUSE)
            else:
                passes += 1
                await self._put_back(machine, job, work, {change.key: change for change in found})
            found = await self.reading.found(machine.item.id, work, described, failed=True)
        return found

    async def follow(self, equipment: str, progress: Progress, work: Work, judge: Judge | None = None) -> None:
        """Wait until what nobody knows can be read, and tell once what stands where. Nothing is written. `judge` looks at more than the
        values by themselves."""
        while True:
            await asyncio.sleep(FOUND_EVERY)
            machine = self._state.machines.get(equipment)
            if machine is None:
                return  # another plant: there is nothing to look at
            if machine.set is not None:
                continue
            try:
                work.mailbox = self.mailbox(machine)
            except (Refused, KeyError):
                return
            found = await self.reading.found(machine.item.id, work, progress.changes)
            if judge is not None:
                found = await judge(found)
            self.reading.stages.pop(equipment, None)
            if not any(change.stands is Stands.UNKNOWN for change in found):
                break
        stands = {change.stands for change in found}
        state, reason = ProgressState.UNCONFIRMED, FOUND_MIXED
        if stands == {Stands.NEW}:
            state, reason = ProgressState.CONFIRMED, FOUND_NEW
        elif stands == {Stands.OLD}:
            state, reason = ProgressState.FAILED, FOUND_OLD
        told = replace(
            progress,
            state=state,
            reason=reason,
            params=found_params(found),
            changes=found,
            ended=self._state.clock.micros(),
        )
        self._state.close(machine, told)
        old, new = (value_set.values_text(found, old=old) for old in (True, False))
        self._state.audit_lines.line(None, f"{equipment}.{progress.command}", old, new, told, by=told.person)

    async def _put_back(self, machine: Machine, job: SetJob, work: Work, found: Mapping[str, Change]) -> None:
        stage = self.reading.begin(
            machine.item.id, "restoring", sum(change.stands is not Stands.OLD for change in found.values())
        )
        for request in reversed(work.sent):
            wrong = [one for one in reversed(request) if found[one.key].stands is not Stands.OLD]
            wrong = [one for one in wrong if not one.acts]
            if wrong:
                await self.change(machine, job, work, wrong, [found[one.key].old for one in wrong], new=False)
                stage.done += len(wrong)


async def _read_points(state: CommandState, machine: Machine, job: SetJob) -> None:
    """Have the points that are the same values as what may have been written read now: nothing else would."""
    known = machine.item.type.drive_parameters
    points = {known[change.code].point for change in job.progress.changes if change.code in known}
    try:
        if wanted := sorted(filter(None, points)):
            await state.writers[machine.item.link].refresh(machine.item.id, wanted)
    except (LinkError, KeyError) as error:
        log.info("points not read equipment=%s error=%s", machine.item.id, error)
