"""From an admitted order to telegrams on a link, and what is known when they were answered, or were not.

Nothing is ever sent again from here but a Stop, which `following` and `motion` ask for until it is read back.
"""

import asyncio
import logging
from collections.abc import Mapping, Sequence

from app.commands import interlocks
from app.commands.checks import holds, is_pulse
from app.commands.command_state import CommandState
from app.commands.interlocks import Prepared
from app.commands.job import Job
from app.commands.lifecycle import Progress, ProgressState
from app.commands.machine import Machine
from app.commands.orders import Order, Task
from app.errors import LinkError, Refused
from app.plant.definitions import Scan
from app.registers.plc_map import AnswerState

log = logging.getLogger(__name__)

STOP_REPEAT = 0.5
"""Between two telegrams of a Stop that is not read back [s]."""
STOP_LIMIT = 10.0
"""Time after which a Stop that is not read back raises an alarm, unless its own time-out (a long ramp) is longer [s]."""
LINE_LIMIT = 1.0
"""Whoever pressed Stop is answered at the latest this long after its telegram, whatever the disk does [s]."""
NO_AUDIT = "why.no_audit"
"""It was not sent because it can be written down nowhere."""
DRIVE_FAULT = "drive"
"""Alarm class of what stops a machine by itself."""


class Sending:
    """Commands on their way down."""

    def __init__(self, state: CommandState) -> None:
        self._state = state

    async def send(self, order: Order, machine: Machine, prepared: Prepared, plan: Task) -> Progress:
        """Carry out what was admitted; returns when it was written, or is unknown or failed."""
        if prepared.command.stop:
            self._state.hold.disarm(order.equipment)
        job = self.begin(order, machine, prepared, plan)
        if self._state.dry_run:
            self._state.end(machine, job, ProgressState.DRY_RUN, "why.dry_run")
            return job.progress
        if prepared.command.stop:
            line = self._state.keep(self._state.audit_lines.sent(order, job.progress), f"audit of {order.equipment}")
            await self.write_stop(machine, job, plan.telegrams, job.prepared)
            await asyncio.wait([line], timeout=LINE_LIMIT)
        else:
            await self.write(machine, job, plan.telegrams)
            if job.progress.reason == NO_AUDIT:
                raise Refused(NO_AUDIT, 503)
        return job.progress

    def begin(self, order: Order, machine: Machine, prepared: Prepared, plan: Task) -> Job:
        """The job of an admitted order, at work on its machine from now on; what was at work there is superseded."""
        look = self._state.readings.look(machine)
        command, now = prepared.command, self._state.clock.monotonic()
        assert order.person is not None
        job = Job(
            order,
            prepared,
            Progress(
                order.id,
                order.equipment,
                command.key,
                command.label,
                order.person.display,
                ProgressState.REQUESTED,
                order.asked,
                argument=plan.argument,
                old=plan.old,
                limit=max(plan.limit, STOP_LIMIT) if command.stop else plan.limit,
                telegrams=plan.telegrams,
                arguments=plan.arguments,
                asker=order.person.id,
            ),
            prepared.feedback.true(look, argument=plan.argument) if prepared.feedback else None,
            tuple(c for c in prepared.interlocks if interlocks.met(c, look)),
            tuple(
                alarm
                for alarm in machine.item.alarms
                if alarm.alarm_class == DRIVE_FAULT and alarm.expression and holds(alarm.expression, look) is False
            ),
            now,
            words=plan.words,
            expected=plan.expected,
        )
        if self._state.dry_run:
            return job
        if machine.set is not None:
            machine.set.interrupt("why.set_stopped")
        self._supersede(machine, job)
        machine.job = job
        if is_pulse(machine, prepared):
            machine.pulses[command.key] = now
        self._state.changed(machine.item.id)
        return job

    def _supersede(self, machine: Machine, new: Job) -> None:
        old = machine.job
        if old is None:
            return
        new.supersede(old)
        if old.lease is not None:
            self._state.hold.drop(old.lease, "stop")
        key = "why.superseded"
        self._state.end(
            machine, old, ProgressState.SUPERSEDED, key, {"label": new.progress.label, "display": new.progress.person}
        )

    async def write(self, machine: Machine, job: Job, telegrams: Sequence[tuple[str, float]]) -> None:
        """Send the telegrams in order; a Stop or a newer command in between ends it."""
        item = machine.item
        with job.telegrams():
            if await self._state.audit_lines.sent(job.order, job.progress):
                broke = await self._state.delivery.send(machine, job, telegrams)
            else:
                broke = ProgressState.FAILED, NO_AUDIT, {}
        if job.ending is not None:
            job.stop_anew()
        elif job.progress.over:
            return
        elif broke is not None:
            self._broke(machine, job, *broke)
        else:
            job.accepted(self._state.clock.monotonic(), self._state.clock.micros())
            self._state.changed(item.id)
            self.read_back(machine, job)
            if job.prepared.feedback is None and (job.answer is None or job.answer.state is AnswerState.DONE):
                self._state.end(machine, job, ProgressState.CONFIRMED)

    def _broke(
        self, machine: Machine, job: Job, state: ProgressState, reason: str, params: Mapping[str, object]
    ) -> None:
        """A telegram was refused, never sent, or not answered."""
        if job.lease is not None:
            job.outcome_unknown(self._state.clock.monotonic(), self._state.clock.micros(), reason, params)
            self._state.hold.end(job.lease, "session" if reason == "why.right_ended" else "write")
        elif state is ProgressState.UNKNOWN:
            job.outcome_unknown(self._state.clock.monotonic(), self._state.clock.micros(), reason, params)
            self._state.changed(machine.item.id)
            self.read_back(machine, job)
        else:
            self._state.end(machine, job, state, reason, params)

    def read_back(self, machine: Machine, job: Job) -> None:
        """Have the feedback read now where no scan brings it."""
        item = machine.item
        job.read_back(self._state.clock.monotonic())
        unknown = job.progress.state is ProgressState.UNKNOWN
        keys = [k for k in job.prepared.watched if unknown or item.points[k].scan in (Scan.PAGE, Scan.ONCE, Scan.SLOW)]
        if keys:
            self._state.spawn(self.refresh(machine, keys), f"read back {item.id}")

    def look_again(self, machine: Machine) -> None:
        """Read what commands depend on and no scan brings: the device did not do what was asked, so it may have been set at its keypad."""
        points = machine.item.points
        keys = [key for key in machine.used if points[key].register and points[key].scan in (Scan.PAGE, Scan.ONCE)]
        if keys:
            self._state.spawn(self.refresh(machine, keys), f"look again {machine.item.id}")

    async def refresh(self, machine: Machine, keys: Sequence[str]) -> None:
        """Have points of a machine read from its device; a failure is told in the log."""
        try:
            await self._state.writers[machine.item.link].refresh(machine.item.id, keys)
        except (LinkError, KeyError) as error:
            log.info("read back failed equipment=%s error=%s", machine.item.id, error)

    async def write_stop(
        self, machine: Machine, job: Job, telegrams: Sequence[tuple[str, float]], stop: Prepared | None
    ) -> None:
        """Send a stop once more, before everything that waits on the link; what goes wrong is tried again by `following`."""
        item, now = machine.item, self._state.clock.monotonic()
        with job.stop_telegrams(now):
            try:
                if not await self._state.delivery.stop(machine, job, telegrams):
                    return
            except (LinkError, Refused, KeyError) as error:
                log.info("stop not answered equipment=%s error=%s", item.id, error)
                return
        if job.progress.over:
            return
        if job.stop_echoed(self._state.clock.monotonic(), self._state.clock.micros()):
            self._state.changed(item.id)
        watched = stop.watched if stop else ()
        slow = [key for key in watched if item.points[key].scan is not Scan.FAST]
        if slow:
            self._state.spawn(self.refresh(machine, slow), f"read back {item.id}")
