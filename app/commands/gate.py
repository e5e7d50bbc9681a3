"""The command gate: the one road from a person to the plant.

    role → control token → nonce → freshness → value and limits → permissives and interlocks → confirmation → write → feedback

Everything is judged in one place right before the write, and the operator sees requested → accepted → confirmed, or why not. Nothing is
queued over a reconnect, sent again or resumed after a restart; only Stop is repeated, until it is read back or 10 s have passed. A write
without a valid answer makes the command *unknown*: the machine is read again, and only a change proves that it happened. Every command
leaves one line in the audit trail when it is over, refused ones too; a question back to the person (`Question`) is not a command yet.

F113 of an E800 is written to EEPROM and RAM unless 0x2001 = 4 was written before; a command whose data lists that write first has it
sent first. Nothing here knows an equipment type.
"""

import asyncio
import logging
import uuid
from collections.abc import Callable, Coroutine, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from app.access.roles import ROLE_PERMISSION, Person
from app.clock import Clock
from app.commands import interlocks
from app.commands.checks import Checks, is_pulse
from app.commands.control_token import ControlToken
from app.commands.delivery import Delivery, refusal_of
from app.commands.hold import HoldToRun, Lease
from app.commands.interlocks import Prepared, Reason
from app.commands.lifecycle import Facts, Progress, State, advance, judge
from app.commands.nonce import Nonces, Once, Rate
from app.commands.orders import LONGEST_REASON, Audit, Job, Machine, Order, Task, Writer
from app.commands.orders import Question as Question
from app.commands.trail import Trail
from app.errors import LinkError, Refused
from app.plant import expression
from app.plant.definitions import Condition, Plant, Scan
from app.registers.plc_map import HOLD_TIMEOUT, AnswerState
from app.tags.batch import Value
from app.tags.database import TagDatabase
from app.tags.quality import is_good

log = logging.getLogger(__name__)

TICK = 0.05
"""Between two looks at what is pending [s]."""
LOOK = 0.2
"""Between two looks at all conditions [s]."""
TELL = 0.1
"""Least time between two notices about one machine [s]."""
STOP_REPEAT = 0.5
"""Between two telegrams of a Stop that is not read back [s]."""
STOP_LIMIT = 10.0
"""Time after which a Stop that is not read back raises an alarm, unless its own time-out (a long ramp) is longer [s]."""
READ_AGAIN = 0.5
"""Between two reads of a feedback that no fast scan brings: a device may take a while to act [s]."""
RESTORE_READS = 4
"""How often a restored value is read until it is there."""
HOLD_REPEAT = 0.2
"""Between two stop telegrams after a hold-to-run [s]."""
HOLD_AFTER = 2.0
"""How long they go on at least [s]."""
HOLD_EVERY = 0.1
"""Least time between two telegrams that hold request bits [s]."""
ASK_AGAIN = 0.2
"""Between two reads of what a device says about a code [s]."""
DRIVE_FAULT = "drive"
"""Alarm class of what stops a machine by itself."""
NOTHING: Mapping[str, str | float] = MappingProxyType({})


class Gate:
    """The gate of one plant. `run` keeps it going; without it nothing is ever confirmed."""

    def __init__(
        self,
        tags: TagDatabase,
        clock: Clock,
        *,
        writers: Mapping[str, Writer],
        audit: Audit,
        dry_run: bool = False,
        on_stop_unconfirmed: Callable[[str], None] = lambda equipment: None,
    ) -> None:
        """`writers` by link, looked up at every write; `on_stop_unconfirmed` is called with the machine."""
        self.dry_run = dry_run
        self._trail = Trail(audit, self._spawn)
        self.nonces = Nonces(clock)
        self.control = ControlToken(clock, moving=self._holding, changed=self._mark, journal=self._trail.control)
        self.hold = HoldToRun(
            clock,
            admit=self._admit_hold,
            start=self._start_hold,
            stop=self._stop_hold,
            lost=self._lost,
            kept=self._pass_on,
        )
        self._delivery = Delivery(writers, clock)
        self._checks = Checks(tags, clock, writers, self.control)
        self.on_stop_unconfirmed = on_stop_unconfirmed
        self._tags = tags
        self._clock = clock
        self._writers = writers
        self._once: Once[Progress] = Once(clock)
        self._rate = Rate(clock)
        self._refused_rate: dict[str, tuple[float, int]] = {}
        self._machines: dict[str, Machine] = {}
        self._subscribers: list[Callable[[str], None]] = []
        self._enders: list[Callable[[Progress], None]] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._admitted: dict[str, tuple[Order, Prepared]] = {}
        self._looked = float("-inf")

    # ---- the plant ------------------------------------------------------------------------------------

    def configure(self, plant: Plant) -> None:
        """Take a plant, also after a reload. What is pending goes on for a machine that stays; for one that goes it is superseded."""
        former, self._machines = self._machines, {}
        for item in plant.equipment.values():
            commands = {key: interlocks.prepare(item, command) for key, command in item.type.commands.items()}
            machine = Machine(
                item,
                plant.links[item.link],
                commands,
                {
                    key: interlocks.prepare(item, interlocks.setting(item, setpoint))
                    for key, setpoint in item.type.setpoints.items()
                },
                next((prepared for prepared in commands.values() if prepared.command.stop), None),
            )
            old = former.pop(item.id, None)
            if old is not None:
                machine.job, machine.last, machine.history = old.job, old.last, old.history
                machine.pulses, machine.restore, machine.restoring = old.pulses, old.restore, old.restoring
                machine.counter = old.counter
            self._machines[item.id] = machine
        for gone in former.values():
            if gone.job is not None:
                if gone.job.lease is not None:
                    self.hold.end(gone.job.lease, "reload")
                self._machines[gone.item.id] = gone
                self._end(gone, gone.job, State.SUPERSEDED, "why.reloaded")
                del self._machines[gone.item.id]
        self.control.keep_only(frozenset(self._machines))

    # ---- asking ---------------------------------------------------------------------------------------

    async def ask(
        self,
        person: Person | None,
        equipment: str,
        command: str,
        *,
        argument: str | float | None = None,
        arguments: Mapping[str, str | float] = NOTHING,
        id: str = "",
        nonce: str = "",
        expected: float | None = None,
        confirmed: bool = False,
        proven: bool = False,
        reason: str = "",
        address: str = "",
        language: str = "en",
    ) -> Progress:
        """Carry out `command`; returns when it was written (accepted), or is unknown or failed; its confirmation follows.

        `id` identifies the press of a button: a second one with the same returns the first result. `arguments` go by name with a command
        that is sent as a code. `expected` is what the person saw the setpoint at [EU]. `confirmed`: the dialog was answered; `proven`:
        with the password. `language` is how typed values read.

        Raises:
            Question: the person has to confirm (`why.confirm`), give a reason (`why.reason_needed`) or the password
                (`why.password_needed`); the value can mean two things (`why.ambiguous`).
            Refused: 401, 403 role; 404; 409 not possible now; 410 expired; 422 bad value; 423 control token; 429; 503 device silent.
        """
        order = Order(
            person, equipment, command, argument, id or uuid.uuid4().hex, nonce, expected, confirmed, proven, reason, address,
            language, self._clock.micros(), arguments,
        )  # fmt: skip
        return await self._admit(order, lambda machine: machine.commands.get(command))

    async def set_value(
        self,
        person: Person | None,
        equipment: str,
        setpoint: str,
        value: str | float,
        *,
        id: str = "",
        nonce: str = "",
        expected: float | None = None,
        confirmed: bool = False,
        proven: bool = False,
        reason: str = "",
        address: str = "",
        language: str = "en",
    ) -> Progress:
        """Write the parameter or setpoint `setpoint` and read it back; otherwise as `ask`."""
        order = Order(
            person, equipment, setpoint, value, id or uuid.uuid4().hex, nonce, expected, confirmed, proven, reason, address,
            language, self._clock.micros(),
        )  # fmt: skip
        return await self._admit(order, lambda machine: machine.setpoints.get(setpoint))

    def why_not(self, person: Person | None, equipment: str, command: str) -> Sequence[Reason]:
        """Every reason why `person` cannot give `command` (or write that setpoint) now, the first missing one first; empty = possible.

        Raises:
            Refused: 404, no such machine or command.
        """
        machine, prepared = self._find(equipment, command)
        return [found for found, _ in self._checks.reasons(person, machine, prepared)]

    def level(self, equipment: str, command: str) -> str:
        """Confirmation level of `command` now, C0–C4.

        Raises:
            Refused: 404, no such machine or command.
        """
        machine, prepared = self._find(equipment, command)
        return interlocks.level(prepared, self._checks.look(machine))[0]

    def permissives(self, equipment: str) -> Sequence[tuple[Condition, bool | None, int]]:
        """What must be true to start: (condition, met or None for not known, since [µs UTC])."""
        machine = self._machines[equipment]
        return [self._checks.condition(machine, condition) for condition in machine.item.type.permissives]

    def interlocks(self, equipment: str) -> Sequence[tuple[Condition, bool | None, int]]:
        """What must be true at any time, as `permissives`."""
        machine = self._machines[equipment]
        return [self._checks.condition(machine, condition) for condition in machine.item.type.interlocks]

    def progress(self, equipment: str) -> Progress | None:
        """The command at work, else the last one that was carried out."""
        machine = self._machines.get(equipment)
        if machine is None:
            return None
        return machine.job.progress if machine.job else machine.last

    def history(self, equipment: str) -> Sequence[Progress]:
        """The last commands, newest first, refused ones too."""
        machine = self._machines.get(equipment)
        return tuple(reversed(machine.history)) if machine else ()

    def subscribe(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Call `callback` with the machine whose progress, reasons or control token changed, at most ten times a second each.

        The returned function ends it.
        """
        self._subscribers.append(callback)
        return lambda: self._subscribers.remove(callback)

    def subscribe_ends(self, callback: Callable[[Progress], None]) -> Callable[[], None]:
        """Call `callback` with every command that is over (for the alarm "command not confirmed"); the returned function ends it."""
        self._enders.append(callback)
        return lambda: self._enders.remove(callback)

    # ---- life -----------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Follow what is pending, until cancelled."""
        while True:
            self.tick()
            await asyncio.sleep(TICK)

    def tick(self) -> None:
        """One look at everything that waits: leases, tokens, feedback, repeated stops, notices."""
        now = self._clock.monotonic()
        self.hold.tick()
        self.control.tick()
        for machine in list(self._machines.values()):
            if machine.job is not None:
                self._follow(machine, machine.job, now)
        if now - self._looked >= LOOK:
            self._looked = now
            for machine in self._machines.values():
                if self._checks.watch(machine):
                    self._mark(machine.item.id)
        for machine in self._machines.values():
            if machine.dirty and now - machine.told >= TELL:
                self._tell(machine, now)

    def session_ended(self, session: str) -> None:
        """The session is over: its motion stops, its tokens are free, its nonces are void."""
        self.hold.release_session(session)
        self.control.session_ended(session)
        self.nonces.drop(session)

    async def close(self) -> None:
        """Stop what is held to run, give its telegrams a second, and end all tasks."""
        for machine in self._machines.values():
            lease = self.hold.active(machine.item.id)
            if lease is not None:
                self.hold.end(lease, "shutdown")
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=1.0)
        for machine in list(self._machines.values()):
            if machine.job is not None and not machine.job.progress.over:
                self._end(machine, machine.job, State.SUPERSEDED, "why.shutdown")
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=2.0)
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # ---- the checks -----------------------------------------------------------------------------------

    async def _admit(self, order: Order, choose: Callable[[Machine], Prepared | None]) -> Progress:
        machine = self._machines.get(order.equipment)
        prepared = choose(machine) if machine else None
        if machine is None or prepared is None:
            refusal = Refused("why.no_such_command", 404, equipment=order.equipment, command=order.key)
            self._note_refusal(order, None, refusal)
            raise refusal
        if prepared.command.hold:
            refusal = Refused("why.hold_only", 409)
            self._note_refusal(order, prepared, refusal)
            raise refusal
        known = self._once.known(order.id)
        if prepared.command.stop:
            return await asyncio.shield(self._keep(self._carry_out(order, prepared), f"stop {order.equipment}"))
        if not known and not self._within_rate(order, prepared):
            raise Refused("why.rate", 429)
        if len(order.reason) > LONGEST_REASON:
            raise Refused("why.reason_too_long", 422, length=len(order.reason), limit=LONGEST_REASON)
        owner = "" if order.person is None else f"{order.person.id} {order.person.session}"
        try:
            return await self._once.run(
                order.id,
                owner,
                lambda: self._carry_out(order, prepared),
                keep=lambda refusal: not isinstance(refusal, Question),
            )
        except Refused as refusal:
            if refusal.reason == "why.replayed":
                self._note_refusal(order, prepared, refusal)
            raise

    async def _carry_out(self, order: Order, prepared: Prepared) -> Progress:
        try:
            if not prepared.command.stop:
                self._check_person(order, prepared)
                await self._checks.renew(self._machines[order.equipment], prepared)
            machine = self._machines[order.equipment]
            if prepared.command.stop and machine.job is not None and machine.job.order.id == order.id:
                return machine.job.progress  # the second click of a double click
            plan = self._checks.task(order, machine, prepared)
        except Question:
            raise
        except Refused as refusal:
            self._note_refusal(order, prepared, refusal)
            raise
        except KeyError as error:  # the machine went with a reload while it was read
            gone = Refused("why.reloaded", 409)
            self._note_refusal(order, prepared, gone)
            raise gone from error
        return await self._send(order, machine, prepared, plan)

    def _check_person(self, order: Order, prepared: Prepared) -> None:
        """Role, token, nonce: before anything is asked of the device."""
        machine = self._machines[order.equipment]
        for found, status in self._checks.standing(order.person, machine, prepared):
            raise Refused(found.key, status, **found.params)
        assert order.person is not None
        self.nonces.use(order.person.session, order.nonce)
        self.control.touch(order.person.session, order.equipment)

    def _within_rate(self, order: Order, prepared: Prepared) -> bool:
        if order.person is None or self._rate.take(_owner(order.person)):
            return True
        now, key = self._clock.monotonic(), _owner(order.person)
        at, count = self._refused_rate.get(key, (float("-inf"), 0))
        if now - at < 10.0:
            self._refused_rate[key] = (at, count + 1)
        else:
            self._refused_rate[key] = (now, 0)
            self._note_refusal(order, prepared, Refused("why.rate", 429, before=count))
        return False

    def _note_refusal(self, order: Order, prepared: Prepared | None, refusal: Refused) -> None:
        argument = order.argument if isinstance(order.argument, int | float) else None
        progress = Progress(
            order.id,
            order.equipment,
            order.key,
            prepared.command.label if prepared else "",
            order.person.display if order.person else "",
            State.REFUSED,
            order.asked,
            ended=self._clock.micros(),
            reason=refusal.reason,
            params=refusal.params,
            argument=argument,
            arguments={name: value for name, value in order.arguments.items() if isinstance(value, int | float)},
        )
        machine = self._machines.get(order.equipment)
        if machine is not None:
            machine.history.append(progress)
        self._trail.command(order, progress, refused=True)

    # ---- writing --------------------------------------------------------------------------------------

    async def _send(self, order: Order, machine: Machine, prepared: Prepared, plan: Task) -> Progress:
        if prepared.command.stop:
            self.hold.disarm(order.equipment)
        job = self._begin(order, machine, prepared, plan)
        if self.dry_run:
            self._end(machine, job, State.DRY_RUN, "why.dry_run")
            return job.progress
        if prepared.command.stop:
            await self._write_stop(machine, job, plan.telegrams, job.prepared)
        else:
            await self._write(machine, job, plan.telegrams)
        return job.progress

    def _begin(self, order: Order, machine: Machine, prepared: Prepared, plan: Task) -> Job:
        look = self._checks.look(machine)
        command, now = prepared.command, self._clock.monotonic()
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
                State.REQUESTED,
                order.asked,
                argument=plan.argument,
                old=plan.old,
                limit=max(plan.limit, STOP_LIMIT) if command.stop else plan.limit,
                telegrams=plan.telegrams,
                arguments=plan.arguments,
            ),
            prepared.feedback.true(look, argument=plan.argument) if prepared.feedback else None,
            tuple(c for c in prepared.interlocks if interlocks.met(c, look)),
            tuple(
                alarm
                for alarm in machine.item.alarms
                if alarm.alarm_class == DRIVE_FAULT and alarm.expression and _holds(alarm.expression, look) is False
            ),
            now,
            words=plan.words,
            expected=plan.expected,
        )
        if self.dry_run:
            return job
        self._supersede(machine, job)
        machine.job = job
        if is_pulse(machine, prepared):
            machine.pulses[command.key] = now
        self._mark(machine.item.id)
        return job

    def _supersede(self, machine: Machine, new: Job) -> None:
        old = machine.job
        if old is None:
            return
        new.other = old if old.writing else old.other
        if old.prepared.command.stop and new.prepared.command.stop:
            new.asked = old.asked
        if old.lease is not None:
            self.hold.drop(old.lease, "stop")
        new.clears = old.clears or bool(old.prepared.command.hold_bits)
        key = "why.superseded"
        self._end(machine, old, State.SUPERSEDED, key, {"label": new.progress.label, "display": new.progress.person})

    async def _write(self, machine: Machine, job: Job, telegrams: Sequence[tuple[str, float]]) -> None:
        """Send the telegrams in order; a Stop or a newer command in between ends it."""
        item = machine.item
        job.writing += 1
        try:
            broke = await self._delivery.send(machine, job, telegrams)
        finally:
            job.writing -= 1
        if job.ending is not None:
            # it may have moved the machine after the first stop
            job.since, job.last_write = None, float("-inf")
        elif job.progress.over:
            return
        elif broke is not None:
            self._broke(machine, job, *broke)
        else:
            job.progress = advance(job.progress, State.ACCEPTED, self._clock.micros())
            job.since = self._clock.monotonic()
            job.echoed = True
            self._mark(item.id)
            self._read_back(machine, job)
            if job.prepared.feedback is None and (job.answer is None or job.answer.state is AnswerState.DONE):
                self._end(machine, job, State.CONFIRMED)

    def _broke(self, machine: Machine, job: Job, state: State, reason: str, params: Mapping[str, object]) -> None:
        """A telegram was refused, never sent, or not answered."""
        if job.lease is not None:
            job.progress = advance(job.progress, State.UNKNOWN, self._clock.micros(), reason=reason, params=params)
            self.hold.end(job.lease, "write")
        elif state is State.UNKNOWN:
            job.progress = advance(job.progress, state, self._clock.micros(), reason=reason, params=params)
            job.since = self._clock.monotonic()
            self._mark(machine.item.id)
            self._read_back(machine, job)
        else:
            self._end(machine, job, state, reason, params)

    def _read_back(self, machine: Machine, job: Job) -> None:
        """Have the feedback read now where no scan brings it."""
        item = machine.item
        job.last_read = self._clock.monotonic()
        unknown = job.progress.state is State.UNKNOWN
        keys = [k for k in job.prepared.watched if unknown or item.points[k].scan in (Scan.PAGE, Scan.ONCE, Scan.SLOW)]
        if keys:
            self._spawn(self._refresh(machine, keys), f"read back {item.id}")

    async def _refresh(self, machine: Machine, keys: Sequence[str]) -> None:
        try:
            await self._writers[machine.item.link].refresh(machine.item.id, keys)
        except (LinkError, KeyError) as error:
            log.info("read back failed equipment=%s error=%s", machine.item.id, error)

    async def _write_stop(
        self, machine: Machine, job: Job, telegrams: Sequence[tuple[str, float]], stop: Prepared | None
    ) -> None:
        """Send a stop once more, before everything that waits on the link; what goes wrong is tried again by `_follow`."""
        item, now = machine.item, self._clock.monotonic()
        job.stopping += 1
        job.last_write = now
        try:
            if not await self._delivery.stop(machine, job, telegrams):
                return
        except (LinkError, Refused, KeyError) as error:
            log.info("stop not answered equipment=%s error=%s", item.id, error)
            return
        finally:
            job.stopping -= 1
        if job.progress.over:
            return
        job.echoed = True
        if job.since is None and job.other is None:
            job.since = self._clock.monotonic()
        if job.progress.state is State.REQUESTED and job.lease is None:
            job.progress = advance(job.progress, State.ACCEPTED, self._clock.micros())
            self._mark(item.id)
        watched = stop.watched if stop else ()
        slow = [key for key in watched if item.points[key].scan is not Scan.FAST]
        if slow:
            self._spawn(self._refresh(machine, slow), f"read back {item.id}")

    # ---- following ------------------------------------------------------------------------------------

    def _follow(self, machine: Machine, job: Job, now: float) -> None:
        if job.other is not None and not job.other.writing:
            job.other = None
            if job.prepared.command.stop or job.ending is not None:
                job.since, job.last_write = None, float("-inf")
        if job.lease is not None and job.ending is None and job.lease.last - job.held > HOLD_TIMEOUT:
            self.hold.end(
                job.lease, "write"
            )  # the button is held, but nothing gets through: the device has let go by itself
        if job.ending is not None:
            self._follow_ending(machine, job, now, job.ending)
        elif job.prepared.command.stop:
            self._follow_stop(machine, job, now)
        elif job.progress.state in (State.ACCEPTED, State.UNKNOWN) and job.since is not None:
            self._follow_answer(machine, job, now)
            if not job.progress.over:
                self._follow_feedback(machine, job, now, job.since)

    def _follow_answer(self, machine: Machine, job: Job, now: float) -> None:
        """What the device says about a code that it has taken."""
        answer = job.answer
        if answer is None:
            return
        refusal = refusal_of(machine.item.type, answer)
        if refusal is not None:
            self._end(machine, job, *refusal)
        elif answer.state is AnswerState.DONE and job.prepared.feedback is None:
            self._end(machine, job, State.CONFIRMED)
        elif answer.state is not AnswerState.DONE and not job.asking and now - job.last_ask >= ASK_AGAIN:
            self._spawn(self._delivery.ask(machine, job), f"answer {machine.item.id}")

    def _follow_feedback(self, machine: Machine, job: Job, now: float, since: float) -> None:
        fresh = self._read_since(machine, job.prepared.watched, since)
        feedback = self._feedback(machine, job.prepared, job.progress.argument) if fresh else None
        fault = self._fault(machine, job) if fresh and not feedback else ""
        verdict = judge(Facts(job.progress.state, now - since, job.progress.limit, feedback, job.before, bool(fault)))
        if verdict is None:
            if not feedback and now - job.last_read >= READ_AGAIN:
                self._read_back(machine, job)
            return
        if job.lease is not None:
            self._judge_hold(machine, job, verdict)
        elif verdict is State.CONFIRMED:
            self._end(machine, job, verdict)
        elif verdict is State.FAILED:
            self._end(machine, job, verdict, "why.fault_appeared", {"label": fault})
        elif verdict is State.UNKNOWN:
            key = "why.unknown_as_asked" if feedback else job.progress.reason
            self._end(machine, job, verdict, key, job.progress.params)
        else:
            self._end(machine, job, verdict, *self._not_confirmed(machine, job))

    def _not_confirmed(self, machine: Machine, job: Job) -> tuple[str, Mapping[str, object]]:
        """Why the time is up: what the device holds instead of what was written, or just that."""
        point = job.prepared.point
        seconds: dict[str, object] = {"seconds": round(job.progress.limit, 1)}
        if point is None or job.progress.argument is None:
            return "why.not_confirmed", seconds
        value, word = self._checks.look(machine)(point.key)
        if not is_good(word) or not isinstance(value, int | float):
            return "why.not_confirmed", seconds
        return "why.value_differs", {**seconds, "value": value, "unit": point.unit, "asked": job.progress.argument}

    def _follow_stop(self, machine: Machine, job: Job, now: float) -> None:
        waited = now - job.asked
        if job.other is None and job.since is not None and self._stands(machine, job.prepared, job.since):
            self._end(machine, job, State.CONFIRMED)
            if machine.restore:
                self._spawn(self._restore(machine), f"restore {machine.item.id}")
            return
        limit = job.progress.limit if job.echoed else STOP_LIMIT
        if waited >= limit:
            self._end(machine, job, State.UNCONFIRMED, "why.stop_not_confirmed", {"seconds": round(limit, 1)})
            machine.restore.clear()
            self._alarm_stop(machine.item.id)
        elif waited < STOP_LIMIT and not job.stopping and now - job.last_write >= STOP_REPEAT:
            if job.other is None and job.since is None and job.last_write > float("-inf"):
                # the echo is lost, but what is read from here on comes after a telegram that may have arrived
                job.since = now
            self._spawn(self._write_stop(machine, job, job.progress.telegrams, job.prepared), f"stop {machine.item.id}")

    def _stands(self, machine: Machine, stop: Prepared | None, since: float) -> bool:
        """Whether values read after `since` say that the machine stands."""
        if stop is None or stop.feedback is None:
            return True
        return self._read_since(machine, stop.watched, since) and self._feedback(machine, stop, None) is True

    def _alarm_stop(self, equipment: str) -> None:
        try:
            self.on_stop_unconfirmed(equipment)
        except Exception:
            log.exception("alarm for an unconfirmed stop failed equipment=%s", equipment)

    def _fault(self, machine: Machine, job: Job) -> str:
        """Label of an interlock that was lost or of a drive fault that came since the command was written; empty = none."""
        look = self._checks.look(machine)
        for alarm in job.quiet:
            if _holds(alarm.expression, look):
                return alarm.label
        for condition in job.guarded:
            if interlocks.met(condition, look) is False:
                return condition.label
        return ""

    def _feedback(self, machine: Machine, prepared: Prepared, argument: float | None) -> bool | None:
        if prepared.feedback is None:
            return None
        return prepared.feedback.true(self._checks.look(machine), argument=argument, age=self._checks.age(machine))

    def _read_since(self, machine: Machine, keys: Sequence[str], since: float) -> bool:
        """Whether every one of `keys` is good and was read after `since`.

        Where a device has several connections an answer that left before the write may arrive after it; its turnaround is added.
        """
        device = machine.item.type.device
        elapsed = self._clock.monotonic() - since - (device.turnaround if device.connections > 1 else 0.0)
        look, age = self._checks.look(machine), self._checks.age(machine)
        return all(is_good(look(key)[1]) and age(key) < elapsed for key in keys)

    # ---- hold-to-run ----------------------------------------------------------------------------------

    async def _admit_hold(
        self, person: Person, equipment: str, command: str, *, id: str, nonce: str, confirmed: bool, address: str
    ) -> str:
        order = Order(
            person, equipment, command, None, id or uuid.uuid4().hex, nonce, None, confirmed, False, "", address, "en",
            self._clock.micros(),
        )  # fmt: skip
        machine = self._machines.get(equipment)
        prepared = machine.commands.get(command) if machine else None
        try:
            if machine is None or prepared is None or not prepared.command.hold:
                raise Refused("why.no_such_command", 404, equipment=equipment, command=command)
            if not self._within_rate(order, prepared):
                raise Refused("why.rate", 429)
            self._check_person(order, prepared)
            await self._checks.renew(machine, prepared)
            machine = self._machines[equipment]
            self._checks.task(order, machine, prepared)
            if self.dry_run:
                raise Refused("why.dry_run", 409)
        except Question:
            raise
        except Refused as refusal:
            if refusal.reason != "why.rate":
                self._note_refusal(order, prepared, refusal)
            raise
        now = self._clock.monotonic()
        self._admitted = {key: kept for key, kept in self._admitted.items() if now - kept[0].asked / 1e6 < 60}
        self._admitted[order.id] = (order, prepared)
        return order.id

    def _start_hold(self, lease: Lease) -> None:
        """The first keep-alive: everything is judged again, then the motion begins."""
        order, prepared = self._admitted.pop(lease.id)
        machine = self._machines[lease.equipment]
        try:
            former, machine.job = machine.job, _without_lease(machine.job)
            try:
                plan = self._checks.task(order, machine, prepared)
            finally:
                machine.job = former
        except Refused as refusal:
            self._note_refusal(order, prepared, refusal)
            raise
        previous = self._checks.previous(machine, prepared)
        job = self._begin(order, machine, prepared, plan)
        job.lease = lease
        if prepared.command.hold_bits:
            job.held = self._clock.monotonic()
        for point, value in previous.items():
            machine.restore.setdefault(point, value)
        self._spawn(self._write(machine, job, plan.telegrams), f"hold {lease.equipment}")

    def _pass_on(self, lease: Lease) -> None:
        """A keep-alive of the browser goes on to a device that watches request bits itself."""
        machine = self._machines.get(lease.equipment)
        job = machine.job if machine else None
        if machine is None or job is None or job.lease is not lease or not job.prepared.command.hold_bits:
            return
        if not job.writing and self._clock.monotonic() - job.last_hold >= HOLD_EVERY:
            job.last_hold = self._clock.monotonic()
            self._spawn(self._hold_on(machine, job), f"hold {lease.equipment}")

    async def _hold_on(self, machine: Machine, job: Job) -> None:
        """One more telegram with the bits. One that is lost is made up for by the next, as long as the device itself goes on."""
        job.writing += 1
        try:
            broke = await self._delivery.send(machine, job, ())
        finally:
            job.writing -= 1
        if job.ending is not None:
            # it may have moved the machine after the first stop
            job.since, job.last_write = None, float("-inf")
        elif broke is not None and broke[0] is State.FAILED and job.lease is not None:
            self.hold.end(job.lease, "write")

    def _stop_hold(self, lease: Lease) -> None:
        """The motion ends: stop now, and go on stopping for 2 s and until it is read back."""
        machine = self._machines.get(lease.equipment)
        job = machine.job if machine else None
        if machine is None or job is None or job.lease is not lease:
            return
        job.ending = self._clock.monotonic()
        job.since, job.echoed = None, False
        job.other = None
        self._mark(lease.equipment)
        self._spawn(
            self._write_stop(machine, job, self._release(machine, job), machine.stop), f"release {lease.equipment}"
        )

    def _judge_hold(self, machine: Machine, job: Job, verdict: State) -> None:
        assert job.lease is not None
        if verdict is State.CONFIRMED:
            if not job.moved:
                job.moved = True
                job.progress = advance(job.progress, State.CONFIRMED, self._clock.micros(), end=False)
                self._mark(machine.item.id)
            return
        self.hold.end(job.lease, "fault" if verdict is State.FAILED else "unconfirmed")

    def _follow_ending(self, machine: Machine, job: Job, now: float, ending: float) -> None:
        """After the release of a hold-to-run. `since` counts from the first echo of the stop."""
        assert job.lease is not None
        waited = now - ending
        limit = STOP_LIMIT
        if job.echoed and machine.stop:
            limit = max(STOP_LIMIT, job.progress.limit)
        stands = job.since is not None and self._stands(machine, machine.stop, job.since)
        if waited >= HOLD_AFTER and stands and not job.writing:
            self._finish_hold(machine, job, job.lease)
        elif waited >= limit:
            machine.restore.clear()
            params = {"seconds": round(limit, 1), "cause": job.lease.cause}
            self._end(machine, job, State.UNCONFIRMED, "why.stop_not_confirmed", params)
            self._alarm_stop(machine.item.id)
        elif not job.stopping and now - job.last_write >= (HOLD_REPEAT if waited < HOLD_AFTER else STOP_REPEAT):
            self._spawn(
                self._write_stop(machine, job, self._release(machine, job), machine.stop), f"release {machine.item.id}"
            )

    def _finish_hold(self, machine: Machine, job: Job, lease: Lease) -> None:
        params: dict[str, object] = {
            "cause": lease.cause,
            "armed": lease.armed_at,
            "started": lease.started_at,
            "stopped": lease.started_at + round(((job.ending or 0.0) - lease.started) * 1e6),
            "seconds": round((job.ending or 0.0) - lease.started, 2),
        }
        state = State.CONFIRMED if job.moved else State.UNCONFIRMED
        if lease.cause in ("fault", "write"):
            state = State.FAILED
        self._end(machine, job, state, f"hold.cause.{lease.cause}", params)
        if machine.restore:
            self._spawn(self._restore(machine), f"restore {machine.item.id}")

    def _lost(self, lease: Lease) -> str:
        """Why a motion that is held may not go on: token, role, values, conditions. Empty = it may."""
        machine = self._machines.get(lease.equipment)
        prepared = machine.commands.get(lease.command) if machine else None
        if machine is None or prepared is None:
            return "reload"
        if not self.control.holds(lease.person, lease.equipment) or not lease.person.may(
            ROLE_PERMISSION[prepared.command.role]
        ):
            return "token"
        look, age = self._checks.look(machine), self._checks.age(machine)
        if interlocks.stale(machine.item, machine.link, prepared.used, look, age):
            return "values"
        if interlocks.missing((*prepared.permissives, *prepared.interlocks), look, age=age):
            return "permissive"
        return ""

    def _release(self, machine: Machine, job: Job) -> tuple[tuple[str, float], ...]:
        """The telegrams that stop; what restores a former value waits until the machine stands."""
        stop = [write for write in job.prepared.command.release if write.value != "previous"]
        return interlocks.telegrams(machine.item, stop, None, {})

    async def _restore(self, machine: Machine) -> None:
        """Give points back what they held before a hold-to-run, and read it back; what fails is told, not tried again."""
        item, held = machine.item, dict(machine.restore)
        machine.restoring = True
        self._mark(item.id)
        try:
            writer = self._writers[item.link]
            for point, value in held.items():
                await writer.write(item.id, point, value)
            wrong = list(held)
            for attempt in range(RESTORE_READS):
                await asyncio.sleep(READ_AGAIN if attempt else 0)
                await writer.refresh(item.id, wrong)
                look = self._checks.look(machine)
                wrong = [p for p in wrong if not _near(look(p)[0], held[p], item.points[p].decimals)]
                if not wrong:
                    break
        except (LinkError, Refused, KeyError) as error:
            log.warning("former value not restored equipment=%s error=%s", item.id, error)
            wrong = list(held)
        finally:
            machine.restoring = False
            machine.restore.clear()
            self._mark(item.id)
        for point in wrong:
            now = self._clock.micros()
            progress = Progress(
                uuid.uuid4().hex, item.id, point, item.points[point].label, "", State.UNCONFIRMED, now, ended=now,
                reason="hold.not_restored", params={"value": held[point], "unit": item.points[point].unit},
                argument=held[point],
            )  # fmt: skip
            machine.history.append(progress)
            machine.last = progress
            self._tell_end(progress)
            self._trail.line(None, f"{item.id}.{point}", None, held[point], progress)

    def _holding(self, equipment: str) -> bool:
        return self.hold.active(equipment) is not None

    # ---- ends and notices -----------------------------------------------------------------------------

    def _end(
        self, machine: Machine, job: Job, state: State, reason: str = "", params: Mapping[str, object] | None = None
    ) -> None:
        if job.progress.over:
            return
        job.progress = advance(job.progress, state, self._clock.micros(), end=True, reason=reason, params=params or {})
        if machine.job is job:
            machine.job = None
        machine.last = job.progress
        machine.history.append(job.progress)
        self._trail.command(job.order, job.progress)
        self._tell_end(job.progress)
        self._mark(machine.item.id)

    def _tell_end(self, progress: Progress) -> None:
        for callback in tuple(self._enders):
            try:
                callback(progress)
            except Exception:
                log.exception("subscriber of command ends failed command=%s", progress.id)

    def _mark(self, equipment: str) -> None:
        """Something about the machine changed: tell at once, or with the next tick when that was just done."""
        machine = self._machines.get(equipment)
        if machine is None:
            return
        machine.dirty = True
        now = self._clock.monotonic()
        if now - machine.told >= TELL:
            self._tell(machine, now)

    def _tell(self, machine: Machine, now: float) -> None:
        machine.dirty, machine.told = False, now
        for callback in tuple(self._subscribers):
            try:
                callback(machine.item.id)
            except Exception:
                log.exception("subscriber of the gate failed equipment=%s", machine.item.id)

    # ---- small things ---------------------------------------------------------------------------------

    def _find(self, equipment: str, key: str) -> tuple[Machine, Prepared]:
        machine = self._machines.get(equipment)
        prepared = (machine.commands.get(key) or machine.setpoints.get(key)) if machine else None
        if machine is None or prepared is None:
            raise Refused("why.no_such_command", 404, equipment=equipment, command=key)
        return machine, prepared

    def _keep(self, work: Coroutine[Any, Any, Progress], name: str) -> "asyncio.Task[Progress]":
        """A task that goes on when its caller goes away."""
        task = asyncio.create_task(work, name=name)
        task.add_done_callback(lambda done: None if done.cancelled() else done.exception())
        return task

    def _spawn(self, work: Coroutine[Any, Any, None], name: str) -> None:
        task = asyncio.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._finished)

    def _finished(self, task: "asyncio.Task[None]") -> None:
        self._tasks.discard(task)
        if not task.cancelled() and task.exception() is not None:
            log.error("task of the gate failed task=%s", task.get_name(), exc_info=task.exception())


def _holds(text: str, look: expression.Look) -> bool | None:
    return expression.parse(text).true(look)


def _owner(person: Person) -> str:
    """Whose rate counts; an API token has no identity of its own."""
    return str(person.id) if person.id else person.session


def _near(value: Value, wanted: float, decimals: int) -> bool:
    return isinstance(value, int | float) and abs(value - wanted) < 0.6 * 10.0**-decimals


def _without_lease(job: Job | None) -> Job | None:
    """A hold-to-run that is ending does not keep the next press from starting, once its stop was echoed."""
    return (
        None
        if job is not None and job.ending is not None and job.echoed and not job.writing and not job.stopping
        else job
    )
