"""The command gate: the one way from a person to the plant.

    role → control token → nonce → freshness → value and limits → permissives and interlocks → confirmation → write → feedback

Everything is judged in one place right before the write, and the operator sees requested → accepted → confirmed, or why not. Nothing is
queued over a reconnect, sent again or resumed after a restart; only Stop is repeated, until it is read back or 10 s have passed. A write
without a valid answer makes the command *unknown*: the machine is read again, and only a change proves that it happened. Every command
leaves one line in the audit trail when it is over, refused ones too, and one before its telegram leaves; a question back to the person
(`Question`) is not a command yet.

The parts, in the order of that way: `execution` (each order once), `admission` (who may ask), `checks` (what must be true now), `sending`
(telegrams), `following` (what became of them), `motion` (what lasts as long as a button is held); `command_state` is what they share.

F113 of an E800 is written to EEPROM and RAM unless 0x2001 = 4 was written before; a command whose data lists that write first has it
sent first. Nothing here knows an equipment type.
"""

import asyncio
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from zoneinfo import ZoneInfo

from app import chance
from app.access.roles import Person, Rights
from app.clock import Clock, local_day
from app.commands import interlocks, value_set
from app.commands.admission import Admission
from app.commands.command_state import CommandState, machines_of
from app.commands.encoder_adjustment import EncoderAdjustments
from app.commands.execution import Execution
from app.commands.following import Following
from app.commands.interlocks import Prepared, RefusalReason
from app.commands.later_looks import LaterLooks
from app.commands.lifecycle import Progress, ProgressState
from app.commands.machine import Machine
from app.commands.motion import HeldMotion
from app.commands.open_commands import OpenCommand
from app.commands.orders import Audit, Foretell, Order, Writer, foretell_nothing
from app.commands.orders import Question as Question
from app.commands.parameter_sets import ParameterSets
from app.commands.sending import Sending
from app.commands.set_follow_up import SetFollowUp
from app.commands.sets import Sets
from app.plant.definitions import Condition, EquipmentType, Plant
from app.tags.database import TagDatabase

TICK = 0.05
"""Between two looks at what is pending [s]."""
LOOK = 0.2
"""Between two looks at the conditions of a machine [s]."""
FEW = 8
"""So many machines are looked at together; of more each tick has its share, so that no command waits until all were looked at."""
NOTHING: Mapping[str, str | float] = MappingProxyType({})
NO_NUMBERS: Mapping[str, float] = MappingProxyType({})


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
        rights: Rights = lambda person: person,
        foretell: Foretell = foretell_nothing,
    ) -> None:
        """`writers` by link, looked up at every write; `on_stop_unconfirmed` is called with the machine; `rights` gives a person as of
        now, None when the session is over: asked before everything that starts, goes on or is sent; `foretell` has a line on the disk
        before the telegram leaves, beside it for a Stop.
        """
        self._state = state = CommandState(
            tags, clock, writers, audit,
            dry_run=dry_run, on_stop_unconfirmed=on_stop_unconfirmed, rights=rights, foretell=foretell,
        )  # fmt: skip
        self._admission = Admission(state)
        self._sending = Sending(state)
        self._looks = LaterLooks(state, self._sending.refresh)
        self._follow_up = SetFollowUp(state)
        self._sets = Sets(state, self._follow_up)
        self._execution = Execution(state, self._admission, self._sending, self._sets)
        self.parameters = ParameterSets(state, self._execution)
        """Writes drive parameters that lie behind a mailbox."""
        self.encoders = EncoderAdjustments(state, self._execution)
        """Adjusts absolute encoders of such drives."""
        self._motion = HeldMotion(state, self._admission, self._sending)
        self._following = Following(state, self._sending, self._motion)
        self.control = state.control
        self.hold = state.hold
        self.nonces = self._admission.nonces
        self._zone = ZoneInfo("UTC")
        self._day = local_day(clock.micros(), self._zone)

    @property
    def dry_run(self) -> bool:
        """Whether everything is judged and nothing sent."""
        return self._state.dry_run

    def configure(self, plant: Plant) -> None:
        """As `take`, of a plant that nobody has looked at yet."""
        self.take(machines_of(plant), plant.timezone)

    def take(self, machines: Mapping[str, Machine], timezone: str) -> None:
        """Take the machines of a plant (`command_state.machines_of`), also after a reload.

        What is pending goes on for a machine that stays; for one that goes it is superseded. At midnight in `timezone` (IANA name) every
        machine is told of: what was yesterday says its day from then on.
        """
        self._zone = ZoneInfo(timezone)
        self._day = local_day(self._state.clock.micros(), self._zone)
        former = self._state.configure(machines)
        for machine in former:
            self._sets.stop(machine, "why.reloaded")
        self.control.keep_only(frozenset(self._state.machines))

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
            person, equipment, command, argument, id or chance.token_hex(16), nonce, expected, confirmed, proven, reason, address,
            language, self._state.clock.micros(), arguments,
        )  # fmt: skip
        return await self._execution.take(order, lambda machine: machine.commands.get(command))

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
            person, equipment, setpoint, value, id or chance.token_hex(16), nonce, expected, confirmed, proven, reason, address,
            language, self._state.clock.micros(),
        )  # fmt: skip
        return await self._execution.take(order, lambda machine: machine.setpoints.get(setpoint))

    async def set_values(
        self,
        person: Person | None,
        equipment: str,
        values: Mapping[str, str | float],
        *,
        seen: Mapping[str, float] = NO_NUMBERS,
        id: str = "",
        nonce: str = "",
        confirmed: bool = False,
        proven: bool = False,
        reason: str = "",
        address: str = "",
        language: str = "en",
    ) -> Progress:
        """Write several parameters and setpoints of a machine as one: all, or none (sets.py); otherwise as `ask`. `seen` is what the
        person saw them at [EU]. Returns when the set is over, with what the device holds of each value."""
        order = Order(
            person, equipment, value_set.KEY, None, id or chance.token_hex(16), nonce, None, confirmed, proven, reason, address,
            language, self._state.clock.micros(), dict(values), dict(seen),
        )  # fmt: skip
        return await self._execution.take(order, lambda machine: _parts(machine, values))

    def take_open_sets(self, sets: Iterable[Progress]) -> None:
        """Tell that these sets of a former run may be half written, and what is found of them as soon as it can be read."""
        self._follow_up.take_open(sets)

    def take_open_commands(self, commands: Iterable[OpenCommand]) -> None:
        """Tell that nobody knows what became of these commands of a former run. Nothing is sent."""
        for one in commands:
            self._state.tell_open(one)

    def take_left(self, left: Mapping[str, Mapping[str, float]]) -> None:
        """Tell that points (machine → point → what it held) were left changed by a former run. Nothing is sent until somebody asks."""
        for equipment, held in left.items():
            machine = self._state.machines.get(equipment)
            if machine is not None and not machine.restore:
                machine.restore.update(held)
                self._motion.leave(machine)

    def left(self, equipment: str) -> Mapping[str, float]:
        """Point → what it held before a hold-to-run that was never given back; empty = nothing waits for that."""
        machine = self._state.machines.get(equipment)
        return dict(machine.restore) if machine is not None and machine.left else {}

    def why_not(self, person: Person | None, equipment: str, command: str) -> Sequence[RefusalReason]:
        """Every reason why `person` cannot give `command` (or write that setpoint) now, the first missing one first; empty = possible.

        Raises:
            Refused: 404, no such machine or command.
        """
        machine, prepared = self._state.find(equipment, command)
        return [found for found, _ in self._state.checks.reasons(person, machine, prepared)]

    def level(self, equipment: str, command: str) -> str:
        """Confirmation level of `command` now, C0–C4.

        Raises:
            Refused: 404, no such machine or command.
        """
        machine, prepared = self._state.find(equipment, command)
        return interlocks.level(prepared, self._state.readings.look(machine))[0]

    def permissives(self, equipment: str) -> Sequence[tuple[Condition, bool | None, int]]:
        """What must be true to start: (condition, met or None for not known, since [µs UTC]). Empty for a machine that is not there: a
        page may be drawn while it goes with a reload."""
        return self._conditions(equipment, lambda kind: kind.permissives)

    def interlocks(self, equipment: str) -> Sequence[tuple[Condition, bool | None, int]]:
        """What must be true at any time, as `permissives`."""
        return self._conditions(equipment, lambda kind: kind.interlocks)

    def _conditions(
        self, equipment: str, chosen: Callable[[EquipmentType], Sequence[Condition]]
    ) -> Sequence[tuple[Condition, bool | None, int]]:
        machine = self._state.machines.get(equipment)
        if machine is None:
            return ()
        return [self._state.readings.condition(machine, condition) for condition in chosen(machine.item.type)]

    def progress(self, equipment: str) -> Progress | None:
        """The command at work, else the last one that was carried out."""
        machine = self._state.machines.get(equipment)
        if machine is None:
            return None
        at_work = machine.job or machine.set
        return at_work.progress if at_work else machine.last

    def former(self, equipment: str, key: str) -> float | None:
        """What a setpoint was before its last change in this run of the server [EU]; None = it was not changed."""
        machine = self._state.machines.get(equipment)
        return machine.former.get(key) if machine else None

    def history(self, equipment: str) -> Sequence[Progress]:
        """The last commands, newest first, refused ones too."""
        machine = self._state.machines.get(equipment)
        return tuple(reversed(machine.history)) if machine else ()

    def subscribe(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Call `callback` with the machine whose progress, reasons or control token changed, at most ten times a second each.

        The returned function ends it.
        """
        self._state.subscribers.append(callback)
        return lambda: self._state.subscribers.remove(callback)

    def subscribe_ends(self, callback: Callable[[Progress], None]) -> Callable[[], None]:
        """Call `callback` with every command that is over (for the alarm "command not confirmed"); the returned function ends it."""
        self._state.enders.append(callback)
        return lambda: self._state.enders.remove(callback)

    async def run(self) -> None:
        """Follow what is pending, until cancelled."""
        while True:
            self.tick()
            await asyncio.sleep(TICK)

    def tick(self) -> None:
        """One look at everything that waits: leases, tokens, feedback, repeated stops, notices."""
        now = self._state.clock.monotonic()
        self.hold.tick()
        self.control.tick()
        self._admission.tick(now)
        self._looks.tick(now)
        for machine in list(self._state.machines.values()):
            if machine.job is not None:
                self._following.follow(machine, machine.job, now)
        self._look(now)
        self._state.tell_changed(now)

    def _look(self, now: float) -> None:
        """Look at the conditions of those machines whose turn it is."""
        machines = self._state.machines.values()
        if not self._day[0] <= self._state.clock.micros() < self._day[1]:
            self._day = local_day(self._state.clock.micros(), self._zone)
            for machine in machines:
                self._state.changed(machine.item.id)
        share = max(FEW, math.ceil(len(machines) * TICK / LOOK))
        due = sorted((machine for machine in machines if now - machine.looked >= LOOK), key=lambda one: one.looked)
        for machine in due[:share]:
            machine.looked = now
            writer = self._state.writers.get(machine.item.link)
            if self._state.readings.watch(machine, paused=writer is not None and writer.paused):
                self._state.changed(machine.item.id)

    def session_ended(self, session: str) -> None:
        """The session is over: its motion stops, its tokens are free, its nonces are void."""
        self.hold.release_session(session)
        self.control.session_ended(session)
        self.nonces.drop(session)

    def rights_changed(self) -> None:
        """Somebody's rights are others now: motions and tokens of who may operate no more end at once."""
        self.hold.judge()
        self.control.check_rights()

    async def close(self) -> None:
        """Stop what is held to run, give its telegrams a second, and end all tasks."""
        self._admission.close()
        for machine in self._state.machines.values():
            self._sets.stop(machine, "why.shutdown")
        for machine in self._state.machines.values():
            lease = self.hold.active(machine.item.id)
            if lease is not None:
                self.hold.end(lease, "shutdown")
        if self._state.tasks:
            await asyncio.wait(self._state.tasks, timeout=1.0)
        for machine in list(self._state.machines.values()):
            if machine.job is not None and not machine.job.progress.over:
                self._state.end(machine, machine.job, ProgressState.SUPERSEDED, "why.shutdown")
        if self._state.tasks:
            await asyncio.wait(self._state.tasks, timeout=2.0)
        for task in list(self._state.tasks):
            task.cancel()
        await asyncio.gather(*self._state.tasks, return_exceptions=True)


def _parts(machine: Machine, values: Mapping[str, object]) -> Prepared | None:
    """The setpoints of a set as one; None when there are none, too many, or one that the machine does not have."""
    if not 0 < len(values) <= value_set.MOST or not all(key in machine.setpoints for key in values):
        return None
    return value_set.joined([machine.setpoints[key] for key in values])
