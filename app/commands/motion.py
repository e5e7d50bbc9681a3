"""Motions that last as long as a button is held: judged at the press and at the first keep-alive, stopped when the button is let go, is
lost or may not be held any longer, and what they changed put back when the machine stands.
"""

import asyncio
import logging
from collections.abc import Mapping, Sequence

from app import chance
from app.access.roles import ROLE_PERMISSION, Person
from app.commands import interlocks
from app.commands.admission import Admission
from app.commands.command_state import CommandState
from app.commands.hold import HoldToRun, Lease
from app.commands.interlocks import Prepared
from app.commands.job import Job
from app.commands.lifecycle import Progress, ProgressState
from app.commands.machine import Machine
from app.commands.orders import Order, Question
from app.commands.sending import STOP_LIMIT, STOP_REPEAT, Sending
from app.errors import LinkError, Refused
from app.plant.definitions import Command, Write
from app.tags.batch import Value

log = logging.getLogger(__name__)

RESTORE_READS = 4
"""How often a restored value is read until it is there."""
RESTORE_AGAIN = 0.5
"""Between two of these reads: a device may take a while to act [s]."""
HOLD_REPEAT = 0.2
"""Between two stop telegrams after a hold-to-run [s]."""
HOLD_AFTER = 2.0
"""How long they go on at least [s]."""
NOT_RESTORED = "hold.not_restored"
"""Why it is told that a point may still be what a hold-to-run has made it."""
REMEMBERED = 60.0
"""An order that was armed and never begun is forgotten after this [s]."""
HOLD_EVERY = 0.1
"""Least time between two telegrams that hold request bits [s]."""


class HeldMotion:
    """Hold-to-run, from the press to the machine that stands again."""

    def __init__(self, state: CommandState, admission: Admission, sending: Sending) -> None:
        self._state = state
        self._admission = admission
        self._sending = sending
        self._admitted: dict[str, tuple[Order, Prepared, float]] = {}
        state.hold = HoldToRun(
            state.clock, admit=self._admit, start=self._start, stop=self._stop, lost=self._lost, kept=self._pass_on
        )

    async def _admit(
        self, person: Person, equipment: str, command: str, *, id: str, nonce: str, confirmed: bool, address: str
    ) -> str:
        order = Order(
            person, equipment, command, None, id or chance.token_hex(16), nonce, None, confirmed, False, "", address, "en",
            self._state.clock.micros(),
        )  # fmt: skip
        machine = self._state.machines.get(equipment)
        prepared = machine.commands.get(command) if machine else None
        try:
            if machine is None or prepared is None or not prepared.command.hold:
                raise Refused("why.no_such_command", 404, equipment=equipment, command=command)
            if not self._admission.within_rate(order, prepared):
                raise Refused("why.rate", 429)
            issued = self._admission.check_person(order, machine, prepared)
            await self._state.checks.renew(machine, prepared)
            machine, prepared = self._state.still(equipment, lambda one: _held(one, command))
            self._admission.check_not_stopped(machine, issued)
            self._state.checks.task(order, machine, prepared)
            if self._state.dry_run:
                raise Refused("why.dry_run", 409)
        except Question:
            raise
        except Refused as refusal:
            if refusal.reason != "why.rate":
                self._admission.note_refusal(order, prepared, refusal)
            raise
        now = self._state.clock.monotonic()
        self._admitted = {key: kept for key, kept in self._admitted.items() if now - kept[2] < REMEMBERED}
        self._admitted[order.id] = (order, prepared, now)
        return order.id

    def _start(self, lease: Lease) -> None:
        """The first keep-alive: everything is judged again, then the motion begins."""
        order, prepared, _ = self._admitted.pop(lease.id)
        try:
            machine, prepared = self._state.still(lease.equipment, lambda one: _held(one, lease.command))
            former, machine.job = machine.job, _without_lease(machine.job)
            try:
                plan = self._state.checks.task(order, machine, prepared)
            finally:
                machine.job = former
        except Refused as refusal:
            self._admission.note_refusal(order, prepared, refusal)
            raise
        previous = self._state.readings.previous(machine, prepared)
        job = self._sending.begin(order, machine, prepared, plan)
        job.lend(lease, self._state.clock.monotonic())
        for point, value in previous.items():
            machine.restore.setdefault(point, value)
        machine.then = interlocks.telegrams(machine.item, _parted(prepared.command)[1], None, {})
        job.keeps(dict(machine.restore))
        self._state.spawn(self._sending.write(machine, job, plan.telegrams), f"hold {lease.equipment}")

    def _pass_on(self, lease: Lease) -> None:
        """A keep-alive of the browser goes on to a device that watches request bits itself."""
        machine = self._state.machines.get(lease.equipment)
        job = machine.job if machine else None
        if machine is None or job is None or job.lease is not lease or not job.prepared.command.hold_bits:
            return
        if not job.writing and self._state.clock.monotonic() - job.last_hold >= HOLD_EVERY:
            job.bits_sent(self._state.clock.monotonic())
            self._state.spawn(self._hold_on(machine, job), f"hold {lease.equipment}")

    async def _hold_on(self, machine: Machine, job: Job) -> None:
        """One more telegram with the bits. One that is lost is made up for by the next, as long as the device itself goes on."""
        with job.telegrams():
            broke = await self._state.delivery.send(machine, job, ())
        if job.ending is not None:
            job.stop_anew()
        elif broke is not None and broke[0] is ProgressState.FAILED and job.lease is not None:
            self._state.hold.end(job.lease, "write")

    def _stop(self, lease: Lease) -> None:
        """The motion ends: stop now, and go on stopping for 2 s and until it is read back."""
        machine = self._state.machines.get(lease.equipment)
        job = machine.job if machine else None
        if machine is None or job is None or job.lease is not lease:
            return
        self._look_back(machine, job)
        job.let_go(self._state.clock.monotonic())
        self._state.changed(lease.equipment)
        self._state.spawn(
            self._sending.write_stop(machine, job, self._release(machine, job), _stands(machine, job)),
            f"release {lease.equipment}",
        )

    def judge(self, machine: Machine, job: Job, verdict: ProgressState) -> None:
        """What the feedback says of a motion that is held."""
        assert job.lease is not None
        if verdict is ProgressState.CONFIRMED:
            if not job.moved:
                job.seen_moving(self._state.clock.micros())
                self._state.changed(machine.item.id)
            return
        self._state.hold.end(job.lease, "fault" if verdict is ProgressState.FAILED else "unconfirmed")

    def follow_ending(self, machine: Machine, job: Job, now: float, ending: float) -> None:
        """After the release of a hold-to-run. `since` counts from the first echo of the stop."""
        assert job.lease is not None
        waited = now - ending
        limit = STOP_LIMIT
        if job.echoed and machine.stop:
            limit = max(STOP_LIMIT, job.progress.limit)
        stands = job.since is not None and self._state.readings.stands(machine, _stands(machine, job), job.since)
        self._look_back(machine, job)
        if waited >= HOLD_AFTER and stands and not job.writing:
            self._finish(machine, job, job.lease)
        elif waited >= limit:
            params = {"seconds": round(limit, 1), "cause": job.lease.cause}
            self._state.end(machine, job, ProgressState.UNCONFIRMED, "why.stop_not_confirmed", params)
            self.leave(machine)
            self._state.alarm_stop(machine.item.id)
        elif not job.stopping and now - job.last_write >= (HOLD_REPEAT if waited < HOLD_AFTER else STOP_REPEAT):
            self._state.spawn(
                self._sending.write_stop(machine, job, self._release(machine, job), _stands(machine, job)),
                f"release {machine.item.id}",
            )

    def _look_back(self, machine: Machine, job: Job) -> None:
        """A motion may be let go before its echo was through, or before the next scan: it is confirmed as well by what was read since its
        telegram, if that did not hold before.
        """
        if job.moved or job.before is not False:
            return
        readings, prepared = self._state.readings, job.prepared
        if readings.read_since(machine, prepared.watched, job.sent) and readings.feedback(machine, prepared, None):
            job.seen_moving(self._state.clock.micros())

    def _finish(self, machine: Machine, job: Job, lease: Lease) -> None:
        params: dict[str, object] = {
            "cause": lease.cause,
            "armed": lease.armed_at,
            "started": lease.started_at,
            "stopped": lease.started_at + round(((job.ending or 0.0) - lease.started) * 1e6),
            "seconds": round((job.ending or 0.0) - lease.started, 2),
        }
        state = ProgressState.CONFIRMED if job.moved else ProgressState.UNCONFIRMED
        if lease.cause in ("fault", "write"):
            state = ProgressState.FAILED
        self._state.end(machine, job, state, f"hold.cause.{lease.cause}", params)
        if machine.restore:
            self._state.spawn(self.restore(machine), f"restore {machine.item.id}")

    def _lost(self, lease: Lease) -> str:
        """Why a motion that is held may not go on: token, role, values, conditions. Empty = it may."""
        machine = self._state.machines.get(lease.equipment)
        prepared = machine.commands.get(lease.command) if machine else None
        if machine is None or prepared is None:
            return "reload"
        person = self._state.rights(lease.person)
        if person is None:
            return "session"
        if not person.may(ROLE_PERMISSION[prepared.command.role]):
            return "token"
        if not self._state.control.holds(lease.person, lease.equipment):
            return "token"
        look, age = self._state.readings.look(machine), self._state.readings.age(machine)
        if interlocks.stale(machine.item, machine.link, prepared.used, look, age):
            return "values"
        if interlocks.missing((*prepared.permissives, *prepared.interlocks), look, age=age):
            return "permissive"
        return ""

    def _release(self, machine: Machine, job: Job) -> tuple[tuple[str, float], ...]:
        """The telegrams that stop; what restores a former value waits until the machine stands."""
        return interlocks.telegrams(machine.item, _parted(job.prepared.command)[0], None, {})

    async def restore(self, machine: Machine) -> None:
        """Give points back what they held before a hold-to-run, and read it back. What fails is told and not tried again by itself: the
        command that puts it back then waits for somebody (`Machine.left`)."""
        if machine.restoring:  # a Stop that came meanwhile is over: once is enough
            return
        item, held = machine.item, dict(machine.restore)
        machine.restoring = True
        self._state.changed(item.id)
        wrong = list(held)
        try:
            wrong = await self._written_back(machine, held)
        except (LinkError, Refused, KeyError) as error:
            log.warning("former value not restored equipment=%s error=%s", item.id, error)
        finally:
            machine.restoring = False
            if wrong:
                machine.leave()
            else:
                machine.put_back()
            self._state.changed(item.id)
        if wrong:
            self.tell_left(machine, {point: held[point] for point in wrong})
        else:
            self._tell_put_back(machine, held)

    async def _written_back(self, machine: Machine, held: Mapping[str, float]) -> list[str]:
        """The points of `held` that do not hold it in the end; those that hold it already are not written.

        Raises:
            LinkError, Refused, KeyError: it could not be written or read.
        """
        item, writer = machine.item, self._state.writers[machine.item.link]

        async def differing(points: Sequence[str]) -> list[str]:
            await writer.refresh(item.id, points)
            look = self._state.readings.look(machine)
            return [point for point in points if not _near(look(point)[0], held[point], item.points[point].decimals)]

        wrong = await differing(list(held))
        for point in wrong:
            await writer.write(item.id, point, held[point])
        for attempt in range(RESTORE_READS):
            if not wrong:
                break
            await asyncio.sleep(RESTORE_AGAIN if attempt else 0)
            wrong = await differing(wrong)
        for point, value in () if wrong else machine.then:
            await writer.write(item.id, point, value)
        return wrong

    def leave(self, machine: Machine) -> None:
        """What a hold-to-run has changed is not given back: nobody knows whether the machine stands."""
        held = dict(machine.restore)
        machine.leave()
        if machine.left:
            self.tell_left(machine, held)

    def tell_left(self, machine: Machine, held: Mapping[str, float]) -> None:
        """Tell of every point that it may still be what a hold-to-run has made it."""
        item, now = machine.item, self._state.clock.micros()
        for point, value in held.items():
            told = item.points[point]
            progress = Progress(
                chance.token_hex(16), item.id, point, told.label, "", ProgressState.UNCONFIRMED, now, ended=now,
                reason=NOT_RESTORED, params={"value": value, "unit": told.unit}, argument=value,
            )  # fmt: skip
            self._state.close(machine, progress)
            self._state.audit_lines.line(None, f"{item.id}.{point}", None, value, progress)

    def _tell_put_back(self, machine: Machine, held: Mapping[str, float]) -> None:
        """Write down that nothing is left changed: who starts after a crash looks for that."""
        key = next((key for key, one in machine.commands.items() if one.command.puts_back), "")
        if not key:
            return
        item, now = machine.item, self._state.clock.micros()
        progress = Progress(
            chance.token_hex(16),
            item.id,
            key,
            machine.commands[key].command.label,
            "",
            ProgressState.CONFIRMED,
            now,
            ended=now,
        )
        new = ", ".join(f"{point} = {value:.10g}" for point, value in held.items())
        self._state.audit_lines.line(None, f"{item.id}.{key}", None, new, progress)


def _held(machine: Machine, command: str) -> Prepared | None:
    """The command, when it is one that lasts as long as its button is held."""
    prepared = machine.commands.get(command)
    return prepared if prepared is not None and prepared.command.hold else None


def _stands(machine: Machine, job: Job) -> Prepared | None:
    """What tells that the motion is over: its own condition, else what the Stop of the machine is confirmed by."""
    return job.prepared.released or machine.stop


def _parted(command: Command) -> tuple[Sequence[Write], Sequence[Write]]:
    """What a release writes at once, and what follows when the machine stands and its points hold what they held."""
    writes = command.release
    first = next((place for place, write in enumerate(writes) if write.value == "previous"), len(writes))
    return writes[:first], [write for write in writes[first:] if write.value != "previous"]


def _near(value: Value, wanted: float, decimals: int) -> bool:
    return isinstance(value, int | float) and abs(value - wanted) < 0.6 * 10.0**-decimals


def _without_lease(job: Job | None) -> Job | None:
    """A hold-to-run that is ending does not keep the next press from starting, once its stop was echoed."""
    return (
        None
        if job is not None and job.ending is not None and job.echoed and not job.writing and not job.stopping
        else job
    )
