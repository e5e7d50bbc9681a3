"""The steps of sequences that this server runs, as they reach other machines: what they read of them, and what they have them do.

Every command goes the way of a person's: the gate judges it, the machine takes it, its feedback confirms it, the audit has its line. A
sequence is a person of its own there: an operator named after it, with its own control of the machines it commands, which it
takes when it is free, gives back after the run, and loses to whoever asks for it. It moves nothing that is not simulated, whatever the
plant file says.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite, nan

from app import chance
from app.access.roles import Person, permissions_of
from app.commands.gate import Gate
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import Writer
from app.errors import Refused
from app.plant.actions import Action, ActionCommand
from app.plant.definitions import Equipment, Plant
from app.plant.sequence_definition import SequenceOrder
from app.plant.sequence_recipe import last_of
from app.running.order_end import ENDED, OrderEnd, seen
from app.sim.plant import SimPlant
from app.tags.database import TagDatabase
from app.tags.quality import is_good

log = logging.getLogger(__name__)

SESSION = "sequence-"
"""How the sessions of sequences begin; no session id of a person does."""
OPERATOR = frozenset({"operator"})
LIVE = "why.sequence_live"
TOO_SOON = "why.too_soon"
NEWER = "why.superseded"
STANDING = 60.0
"""How long a machine may take to stand after its `suspend`; then it is stopped [s]."""


def is_sequence(person: Person) -> bool:
    """Whether `person` is a sequence that this server runs."""
    return person.id == 0 and person.session.startswith(SESSION)


def point_of(tags: TagDatabase) -> Callable[[str], float]:
    """Gives the value of a point, `m1.speed`: NaN unless it is there, good and a number, so that what is bad or stale fulfils nothing."""

    def value(name: str) -> float:
        handle = tags.handles.get(name)
        if handle is None or not is_good(tags.quality(handle)):
            return nan
        found = tags.value(handle)
        return float(found) if isinstance(found, int | float) and isfinite(found) else nan

    return value


@dataclass(slots=True)
class GivenOrders:
    """Commands of one step under way."""

    orders: list[SequenceOrder]
    open: int
    """Orders that are not over yet."""
    refused: int = 0
    order: SequenceOrder | None = None
    """The first that failed."""
    reason: str = ""
    """Text key of why."""
    params: Mapping[str, object] = field(default_factory=dict)

    @property
    def pending(self) -> bool:
        """Whether some are not over yet."""
        return self.open > 0 and not self.refused

    def fail(self, number: int, reason: str, params: Mapping[str, object]) -> None:
        """Order `number`, from 1, was refused, not confirmed or not done; the first one counts."""
        if not self.refused:
            self.refused, self.order, self.reason, self.params = number, self.orders[number - 1], reason, params


class Stage(Enum):
    """How far an order is."""

    WAITING = 0
    SENT = 1
    """Its last command was asked: the machine does it, or will in a moment."""
    DONE = 2
    """Confirmed, and of an action with an end of its own: it has ended."""


@dataclass(slots=True)
class _Carried:
    """One order of this run."""

    order: SequenceOrder
    action: Action
    given: GivenOrders
    number: int
    end: OrderEnd
    stage: Stage = Stage.WAITING
    again: bool = False
    """It was confirmed and is given again after a Stop."""

    @property
    def moves(self) -> bool:
        """Whether the machine perhaps does something for it: it was given, and has not ended by itself."""
        return self.stage is Stage.SENT or (self.stage is Stage.DONE and not self.action.done)


class SequenceDesk:
    """Carries the commands of one sequence through the gate.

    What a run has a machine do is kept as a list of orders: one that is confirmed takes the place of those before it, unless it only
    sets a value or has an end of its own.
    """

    def __init__(
        self, item: Equipment, gate: Gate, plant: Plant, writers: Mapping[str, Writer], tags: TagDatabase | None
    ) -> None:
        self.person = _person(item, plant)
        self.failed: GivenOrders | None = None
        """What was refused, not confirmed or not done last; its reason stays for the page."""
        self.gate = gate
        self.plant_now: Callable[[], Plant | None] = lambda: plant
        """The plant as it is at any time: in it a sequence that is gone stops what it ran."""
        self._plant, self._writers, self._tags = plant, writers, tags
        self._waits: dict[str, asyncio.Future[Progress]] = {}
        self._number, self._prefix = 0, chance.token_hex(8)
        self._carried: dict[str, list[_Carried]] = {}
        """Machine → what this run has it do, in order."""
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._halts: dict[str, asyncio.Task[None]] = {}
        """Machines that are being stopped or suspended: nothing is given to them meanwhile."""
        self._ends: dict[str, asyncio.Task[None]] = {}
        """Those of them that end what the run had the machine do."""
        self._paused: set[str] = set()
        """Machines that stand still by the `suspend` of an action and go on by its `resume`."""
        self._close = gate.subscribe_ends(self._ended)

    def renew(self, item: Equipment, gate: Gate, plant: Plant) -> None:
        """Go on in the plant as it was read again."""
        former, self.person, self._plant = self.person, _person(item, plant), plant
        _hand_over(gate, self._carried, former, self.person)
        if gate is not self.gate:
            self._close()
            self.gate, self._close = gate, gate.subscribe_ends(self._ended)

    @property
    def pending(self) -> bool:
        """Whether an order is not over yet."""
        return any(one.stage is not Stage.DONE for held in self._carried.values() for one in held)

    def give(self, orders: Sequence[SequenceOrder]) -> GivenOrders:
        """Give `orders`: those of one machine one after the other, machines side by side."""
        given = GivenOrders(list(orders), len(orders))
        for number, order in enumerate(orders, 1):
            item = self._plant.equipment.get(order.machine)
            action = item.type.orders.get(order.action) if item else None
            if action is None:
                self._fail(given, number, "fb.failed", {})  # it was there when the plant was read
                return given
            end = OrderEnd(self._tags, action, order.values)
            self._carried.setdefault(order.machine, []).append(_Carried(order, action, given, number, end))
        for machine in dict.fromkeys(order.machine for order in orders):
            self._go(machine)
        return given

    def suspend(self) -> None:
        """Everything of this run stands still: by the action's `suspend` where it goes on from there, else by the Stop of the type."""
        self._halt(self._suspend)

    def resume(self) -> GivenOrders:
        """What stood still goes on. After a Stop what has no end of its own is given again, and what had not ended."""
        again = GivenOrders([], 0)
        for machine, held in self._carried.items():
            for one in held if machine not in self._paused else ():
                if one.stage is Stage.DONE and not one.action.done:
                    again.orders.append(one.order)
                    again.open += 1
                    one.given, one.number, one.stage, one.again = again, again.open, Stage.WAITING, True
            self._go(machine)
        return again

    def stop(self) -> None:
        """Stop every machine that still does something for this run: by the action's `stop`, else by the Stop of its type, which the
        gate repeats until it is read back."""
        self._halt(self._end)
        self._carried, self._paused = {}, set()

    def leave(self) -> None:
        """The run is over: its control of its machines is free."""
        machines = list(self._carried)
        self._carried, self._paused = {}, set()
        for machine in machines:
            self._free(machine)

    def _free(self, machine: str) -> None:
        if machine not in self._carried and self.gate.control.holds(self.person, machine):
            self.gate.control.release(self.person, machine)

    def _go(self, machine: str) -> None:
        before = self._tasks.get(machine)
        if before is None or before.done():
            self._tasks[machine] = asyncio.ensure_future(self._follow(machine))

    def _halt(self, how: Callable[[str, Sequence[_Carried]], Coroutine[None, None, None]]) -> None:
        for task in self._tasks.values():
            task.cancel()
        self._tasks = {}
        for machine, held in self._carried.items():
            task = asyncio.ensure_future(self._after(self._halts.get(machine), machine, how, list(held)))
            self._halts[machine] = task
            if how == self._end:
                self._ends[machine] = task

    async def _after(
        self,
        before: asyncio.Task[None] | None,
        machine: str,
        how: Callable[[str, Sequence[_Carried]], Coroutine[None, None, None]],
        held: Sequence[_Carried],
    ) -> None:
        if before is not None:
            if before is not self._ends.get(machine):  # a suspend gives way; what ends something is never given up
                before.cancel()
            await asyncio.wait([before])
        try:
            await how(machine, held)
        except Exception:
            log.exception("stop by a sequence failed sequence=%s machine=%s", self.person.name, machine)
        self._free(machine)

    async def _follow(self, machine: str) -> None:
        halt = self._halts.get(machine)
        if halt is not None:
            await asyncio.wait([halt])
        held = self._carried.get(machine, [])
        if machine in self._paused:  # it goes on from where it stands
            for each in held:
                if each.again and each.stage is Stage.WAITING:
                    each.stage = Stage.DONE
                    each.given.open -= 1
        while one := next((each for each in held if each.stage is not Stage.DONE), None):
            if one.given.refused:
                return
            try:
                await self._carry_out(one)
            except Refused as refusal:
                other = _other_stop(self.gate, self._plant, machine, self._prefix) if refusal.reason == ENDED else None
                said = (NEWER, _newer(other)) if other else (refusal.reason, refusal.params)
                self._fail(one.given, one.number, *said)
                if refusal.reason == ENDED and _held_by_other(self.gate, self.person, machine):
                    self._carried.pop(machine, None)  # who has ended it keeps it as it goes
                return
            except Exception:
                log.exception("order of a sequence failed sequence=%s order=%s", self.person.name, one.order)
                self._fail(one.given, one.number, "fb.failed", {})
                return
            one.stage = Stage.DONE
            one.given.open -= 1
            held[:] = [each for each in held if each is one or not _replaces(one, each)]

    def _fail(self, given: GivenOrders, number: int, reason: str, params: Mapping[str, object]) -> None:
        given.fail(number, reason, params)
        self.failed = given

    async def _carry_out(self, one: _Carried) -> None:
        """Every command of the action, each confirmed before the next, and its end if it has one, with the command that it ends with.

        Raises:
            Refused: the gate said no, nothing confirmed it, or it ended otherwise.
        """
        item = self._plant.equipment[one.order.machine]
        if one.stage is Stage.SENT and item.id in self._paused:
            self._paused.discard(item.id)
            if not one.end.done(item):
                await self._confirmed(item, ActionCommand(one.action.resume), one.order)
        else:
            if one.stage is Stage.WAITING:
                await one.end.begin(item)
            *first, last = one.action.commands
            for command in first:
                await self._confirmed(item, command, one.order)
            one.stage = Stage.SENT
            try:
                asked = await self._given(item, last, one.order)
            except Refused:
                one.stage = Stage.WAITING  # nothing left: what the machine does is not of this run
                raise
            _check(asked)
        await one.end.wait(item)
        if one.action.then:
            await self._confirmed(item, ActionCommand(one.action.then))

    async def _confirmed(self, item: Equipment, command: ActionCommand, order: SequenceOrder | None = None) -> None:
        """Ask for one command and wait until it is confirmed.

        Raises:
            Refused: the gate said no, or nothing confirmed it.
        """
        _check(await self._given(item, command, order))

    async def _given(self, item: Equipment, command: ActionCommand, order: SequenceOrder | None = None) -> Progress:
        """Ask for one command and wait until it is over.

        Raises:
            Refused: the gate said no, and nothing was sent.
        """
        moves = not item.type.commands[command.command].stop
        if moves and not self._writers[item.link].simulated:
            raise Refused(LIVE, 409, machine=item.id)
        return await self._ask_in_time(item, command, order.values if order else {})

    async def _ask_in_time(self, item: Equipment, command: ActionCommand, values: Mapping[str, float]) -> Progress:
        """As `_ask`; a pulse that was given a moment ago waits until its pause is over, once."""
        try:
            return await self._ask(item, command, values)
        except Refused as refusal:
            seconds = refusal.params.get("seconds")
            if refusal.reason != TOO_SOON or not isinstance(seconds, int | float):
                raise
            await asyncio.sleep(seconds + 0.1)
        return await self._ask(item, command, values)

    async def _ask(self, item: Equipment, command: ActionCommand, values: Mapping[str, float]) -> Progress:
        stop = item.type.commands[command.command].stop
        if not stop and (other := _other_stop(self.gate, self._plant, item.id, self._prefix)) is not None:
            raise Refused(NEWER, 409, **_newer(other))
        self._number += 1
        id = f"{self._prefix}-{self._number}"
        ended = self._waits[id] = asyncio.get_running_loop().create_future()
        try:
            if not stop:
                self.gate.control.take(self.person, item.id)
            nonce = self.gate.nonces.issue(self.person.session)
            asked = await self.gate.ask(
                self.person,
                item.id,
                command.command,
                argument=values.get(command.value),
                arguments={name: values[name] for name in command.arguments}
                or _of_run(self._tags, item, command.command, values if command.optional else {}),
                id=id,
                nonce=nonce,
                confirmed=True,
            )
            return asked if asked.over else await ended
        finally:
            self._waits.pop(id, None)

    def _ended(self, progress: Progress) -> None:
        waiting = self._waits.get(progress.id)
        if waiting is not None and not waiting.done():
            waiting.set_result(progress)
        held = self._carried.get(progress.equipment, ())
        if held and (_is_stop(self._plant, progress, self._prefix) or _is_anew(held, progress, self._prefix)):
            self._lose(progress)

    def _lose(self, stop: Progress) -> None:
        """Somebody else stopped a machine of this run, or gave it another order: it gets nothing more, and the run is over."""
        machine, last = stop.equipment, self._carried[stop.equipment][-1]
        self._fail(last.given, last.number, NEWER, _newer(stop))
        if (task := self._tasks.pop(machine, None)) is not None:
            task.cancel()
        if stop.state is ProgressState.CONFIRMED:  # it does what was asked; else the run stops it as well
            del self._carried[machine]
            self._paused.discard(machine)
            self._free(machine)

    # ---- standing still and ending --------------------------------------------------------------------

    async def _suspend(self, machine: str, held: Sequence[_Carried]) -> None:
        under_way = next((one for one in held if one.stage is Stage.SENT), None)
        suspend = under_way.action.suspend if under_way is not None else ""
        if under_way is not None and suspend and (machine in self._paused or await self._done(machine, suspend)):
            self._paused.add(machine)
            item, stands = self._plant.equipment[machine], under_way.action.stands
            if not stands or await under_way.end.first_true(item, stands, within=STANDING):
                return
            self._paused.discard(machine)
            log.warning("suspended machine does not stand sequence=%s machine=%s", self.person.name, machine)
        if any(one.moves for one in held):
            await self._stop(machine)

    async def _end(self, machine: str, held: Sequence[_Carried]) -> None:
        last = next((one for one in reversed(held) if one.moves), None)
        if last is None or (last.action.stop and await self._done(machine, last.action.stop)):
            return
        self._free(machine)  # a Stop needs no control
        await self._stop(machine)

    async def _done(self, machine: str, command: str) -> bool:
        """Whether the machine did `command`."""
        try:
            item = _as_it_is(self._plant.equipment[machine], self.plant_now())
            await self._confirmed(item, ActionCommand(command))
        except Refused as refusal:
            log.warning(
                "%s by a sequence refused sequence=%s machine=%s reason=%s",
                command, self.person.name, machine, refusal.reason,
            )  # fmt: skip
            return False
        return True

    async def _stop(self, machine: str) -> None:
        item = _as_it_is(self._plant.equipment[machine], self.plant_now())
        stop = next((key for key, command in item.type.commands.items() if command.stop), "")
        if stop and _other_stop(self.gate, self._plant, item.id, self._prefix) is None:  # else it is repeated already
            await self._done(machine, stop)  # the audit has it, and the gate alarms a Stop that nobody confirms


def _as_it_is(known: Equipment, plant: Plant | None) -> Equipment:
    """A machine of a former plant in `plant`, where it may be called otherwise."""
    same = (item for item in plant.equipment.values() if item.lasting == known.lasting) if plant else iter(())
    return next(same, known)


def _hand_over(gate: Gate, machines: Iterable[str], former: Person, person: Person) -> None:
    """A sequence that is called otherwise now keeps the control of its machines, unless somebody waits for it."""
    for machine in machines if former.session != person.session else ():
        if gate.control.holds(former, machine):
            gate.control.release(former, machine)
            if gate.control.holder(machine) is None:
                gate.control.take(person, machine)


def _is_stop(plant: Plant, progress: Progress, own: str) -> bool:
    """Whether it is a Stop of somebody else than whoever's ids begin with `own`."""
    if progress.id.startswith(f"{own}-"):
        return False
    item = plant.equipment.get(progress.equipment)
    command = item.type.commands.get(progress.command) if item else None
    return command is not None and command.stop


def _other_stop(gate: Gate, plant: Plant, machine: str, own: str) -> Progress | None:
    """A Stop of somebody else that is at work."""
    at_work = gate.progress(machine)
    return at_work if at_work and not at_work.over and _is_stop(plant, at_work, own) else None


def _is_anew(held: Iterable[_Carried], progress: Progress, own: str) -> bool:
    """Whether somebody else gave the order anew whose end a run waits for: that end would not be its own."""
    return (
        progress.state is ProgressState.CONFIRMED
        and not progress.id.startswith(f"{own}-")
        and any(
            one.stage is Stage.SENT and one.action.done and one.action.commands[-1].command == progress.command
            for one in held
        )
    )


def _held_by_other(gate: Gate, person: Person, machine: str) -> bool:
    """Whether somebody else than `person` has the control of a machine."""
    holder = gate.control.holder(machine)
    return holder is not None and holder.session != person.session


def _newer(progress: Progress) -> dict[str, object]:
    """What `NEWER` tells of it."""
    return {"label": progress.label, "display": progress.person}


def _check(asked: Progress) -> None:
    """Whether what was asked is confirmed.

    Raises:
        Refused: it is not.
    """
    if asked.state is not ProgressState.CONFIRMED:
        raise Refused(asked.reason or asked.text, 409, **asked.params)


def _of_run(tags: TagDatabase | None, item: Equipment, command: str, given: Mapping[str, float]) -> dict[str, float]:
    """The values of the run with which another sequence is started: what is given, else those of its last one, else its defaults."""
    if item.sequence is None or not item.type.commands[command].arguments:
        return {}
    last = last_of(item.sequence, lambda key: seen(tags, f"{item.id}.{key}"))
    return last | {key: value for key, value in given.items() if key in last}


def _replaces(one: _Carried, former: _Carried) -> bool:
    """Whether `former`, which is over, need not be given again once `one` is confirmed."""
    if former.stage is not Stage.DONE:
        return False
    if one.action.adjusts:
        return former.action.key == one.action.key
    return bool(former.action.done or one.action.then) or not one.action.done


class SequenceDesks:
    """The desks of all sequences that the server runs."""

    def __init__(
        self, gate: Callable[[], Gate | None], plant: Callable[[], Plant | None], writers: Mapping[str, Writer]
    ) -> None:
        self._gate, self._plant, self._writers = gate, plant, writers
        self._tags: TagDatabase | None = None
        self._desks: dict[str, tuple[Plant, SequenceDesk]] = {}
        """By what stays when a sequence is renamed."""

    def serve(self, sim: SimPlant, tags: TagDatabase) -> SimPlant:
        """`sim`, whose sequences see the plant by its tags and command it by the gate from now on."""
        sim.point, sim.desk, self._tags = point_of(tags), self.of, tags
        return sim

    def of(self, sequence: str) -> SequenceDesk | None:
        """The desk of a sequence of the plant as it is now; None while there is no gate."""
        gate, plant = self._gate(), self._plant()
        if gate is None or plant is None or sequence not in plant.equipment:
            return None
        item = plant.equipment[sequence]
        read, desk = self._desks.get(item.lasting, (None, None))
        if desk is None:
            desk = SequenceDesk(item, gate, plant, self._writers, self._tags)
            desk.plant_now = self._plant
        elif read is not plant or desk.gate is not gate:
            desk.renew(item, gate, plant)
        self._desks[item.lasting] = plant, desk
        return desk

    def known(self, sequence: str) -> SequenceDesk | None:
        """The desk of a sequence that commanded something since the server was started; None = it did not."""
        plant = self._plant()
        item = plant.equipment.get(sequence) if plant else None
        found = self._desks.get(item.lasting) if item else None
        return found[1] if found else None

    def failure(self, sequence: str) -> GivenOrders | None:
        """What was refused, not confirmed or not done last, with its reason; None = nothing."""
        desk = self.known(sequence)
        return desk.failed if desk else None


def _person(item: Equipment, plant: Plant) -> Person:
    label = item.label.get(plant.languages[0]) or next(iter(item.label.values()), item.id)
    return Person(0, item.id, label, OPERATOR, permissions_of(OPERATOR), f"{SESSION}{item.id}")
