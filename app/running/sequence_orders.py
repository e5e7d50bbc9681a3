"""The steps of sequences that this server runs, as they reach other machines: what they read of them, and what they have them do.

Every command goes the way of a person's: the gate judges it, the machine takes it, its feedback confirms it, the audit has its line. A
sequence is a person of its own there: an operator named after it, with its own control of the machines it commands, which it
takes when it is free, gives back after the run, and loses to whoever asks for it. It moves nothing that is not simulated, whatever the
plant file says.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan

from app import chance
from app.access.roles import Person, permissions_of
from app.commands.gate import Gate
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import Writer
from app.errors import Refused
from app.plant.actions import ActionCommand
from app.plant.definitions import Equipment, Plant
from app.plant.sequence_definition import SequenceOrder
from app.sim.plant import SimPlant
from app.tags.database import TagDatabase
from app.tags.quality import is_good

log = logging.getLogger(__name__)

SESSION = "sequence-"
"""How the sessions of sequences begin; no session id of a person does."""
OPERATOR = frozenset({"operator"})
LIVE = "why.sequence_live"
TOO_SOON = "why.too_soon"


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

    orders: Sequence[SequenceOrder]
    open: int
    """Orders that are not confirmed yet."""
    refused: int = 0
    reason: str = ""
    """Text key of why the first failed."""
    params: Mapping[str, object] = field(default_factory=dict)
    tasks: list[asyncio.Task[None]] = field(default_factory=list)

    @property
    def pending(self) -> bool:
        """Whether some are not confirmed yet."""
        return self.open > 0 and not self.refused

    def fail(self, order: SequenceOrder, reason: str, params: Mapping[str, object]) -> None:
        """`order` was refused or not confirmed; the first one counts."""
        if not self.refused:
            self.refused, self.reason, self.params = self.orders.index(order) + 1, reason, params


class SequenceDesk:
    """Carries the commands of one sequence through the gate."""

    def __init__(self, item: Equipment, gate: Gate, plant: Plant, writers: Mapping[str, Writer]) -> None:
        self.person = _person(item, plant)
        self.last: GivenOrders | None = None
        """What was given last; its reason stays for the page."""
        self._gate, self._plant, self._writers = gate, plant, writers
        self._waits: dict[str, asyncio.Future[Progress]] = {}
        self._number, self._prefix = 0, chance.token_hex(8)
        self._stops: set[asyncio.Task[None]] = set()
        self.close = gate.subscribe_ends(self._ended)
        """Ends it."""

    def give(self, orders: Sequence[SequenceOrder]) -> GivenOrders:
        """Give `orders`: those of one machine one after the other, machines side by side. What was under way is given up."""
        self._give_up()
        given = self.last = GivenOrders(tuple(orders), len(orders))
        for machine in dict.fromkeys(order.machine for order in orders):
            mine = [order for order in orders if order.machine == machine]
            given.tasks.append(asyncio.ensure_future(self._follow(given, mine)))
        return given

    def stop(self, machines: Sequence[str]) -> None:
        """Give up what is under way, and stop `machines`: each by the Stop of its type, which the gate repeats until it is read back."""
        self._give_up()
        for machine in machines:
            self._keep(self._stop(machine))

    def leave(self, machines: Sequence[str]) -> None:
        """The run is over: its control of `machines` is free."""
        for machine in machines:
            if self._gate.control.holds(self.person, machine):
                self._gate.control.release(self.person, machine)

    def _give_up(self) -> None:
        for task in self.last.tasks if self.last else ():
            task.cancel()

    def _keep(self, work: Coroutine[None, None, None]) -> None:
        task = asyncio.ensure_future(work)
        self._stops.add(task)
        task.add_done_callback(self._stops.discard)

    async def _follow(self, given: GivenOrders, orders: Sequence[SequenceOrder]) -> None:
        for order in orders:
            if given.refused:
                return
            try:
                await self._carry_out(order)
            except Refused as refusal:
                given.fail(order, refusal.reason, refusal.params)
                return
            except Exception:
                log.exception("order of a sequence failed sequence=%s order=%s", self.person.name, order)
                given.fail(order, "fb.failed", {})
                return
            given.open -= 1

    async def _carry_out(self, order: SequenceOrder) -> None:
        """Every command of the action, each confirmed before the next.

        Raises:
            Refused: the gate said no, or nothing confirmed it.
        """
        item = self._plant.equipment[order.machine]
        if not self._writers[item.link].simulated:
            raise Refused(LIVE, 409, machine=item.id)
        for command in item.type.orders[order.action].commands:
            progress = await self._ask_in_time(item, command, order.values.get(command.value))
            if progress.state is not ProgressState.CONFIRMED:
                raise Refused(progress.reason or progress.text, 409, **progress.params)

    async def _ask_in_time(self, item: Equipment, command: ActionCommand, value: float | None) -> Progress:
        """As `_ask`; a pulse that was given a moment ago waits until its pause is over, once."""
        try:
            return await self._ask(item, command, value)
        except Refused as refusal:
            seconds = refusal.params.get("seconds")
            if refusal.reason != TOO_SOON or not isinstance(seconds, int | float):
                raise
            await asyncio.sleep(seconds + 0.1)
        return await self._ask(item, command, value)

    async def _ask(self, item: Equipment, command: ActionCommand, value: float | None) -> Progress:
        self._number += 1
        id = f"{self._prefix}-{self._number}"
        ended = self._waits[id] = asyncio.get_running_loop().create_future()
        try:
            if not item.type.commands[command.command].stop:
                self._gate.control.take(self.person, item.id)
            nonce = self._gate.nonces.issue(self.person.session)
            asked = await self._gate.ask(
                self.person, item.id, command.command, argument=value, id=id, nonce=nonce, confirmed=True
            )
            return asked if asked.over else await ended
        finally:
            self._waits.pop(id, None)

    def _ended(self, progress: Progress) -> None:
        waiting = self._waits.get(progress.id)
        if waiting is not None and not waiting.done():
            waiting.set_result(progress)

    async def _stop(self, machine: str) -> None:
        item = self._plant.equipment[machine]
        stop = next((key for key, command in item.type.commands.items() if command.stop), "")
        if not stop or not self._writers[item.link].simulated:
            return
        try:
            await self._gate.ask(self.person, machine, stop, confirmed=True)
        except Refused as refusal:  # the audit has it, and the gate alarms a Stop that nobody confirms
            log.warning(
                "stop by a sequence refused sequence=%s machine=%s reason=%s", self.person.name, machine, refusal.reason
            )


class SequenceDesks:
    """The desks of all sequences that the server runs."""

    def __init__(
        self, gate: Callable[[], Gate | None], plant: Callable[[], Plant | None], writers: Mapping[str, Writer]
    ) -> None:
        self._gate, self._plant, self._writers = gate, plant, writers
        self._desks: dict[str, tuple[Plant, Gate, SequenceDesk]] = {}

    def serve(self, sim: SimPlant, tags: TagDatabase) -> SimPlant:
        """`sim`, whose sequences see the plant by its tags and command it by the gate from now on."""
        sim.point, sim.desk = point_of(tags), self.of
        return sim

    def of(self, sequence: str) -> SequenceDesk | None:
        """The desk of a sequence of the plant as it is now; None while there is no gate."""
        gate, plant = self._gate(), self._plant()
        if gate is None or plant is None or sequence not in plant.equipment:
            return None
        known = self._desks.get(sequence)
        if known is None or known[0] is not plant or known[1] is not gate:
            if known is not None:
                known[2].close()
            known = self._desks[sequence] = (
                plant,
                gate,
                SequenceDesk(plant.equipment[sequence], gate, plant, self._writers),
            )
        return known[2]

    def known(self, sequence: str) -> SequenceDesk | None:
        """The desk of a sequence that commanded something since the plant was read; None = it did not."""
        found = self._desks.get(sequence)
        return found[2] if found else None

    def failure(self, sequence: str) -> GivenOrders | None:
        """What was refused or not confirmed last, with its reason; None = nothing."""
        known = self._desks.get(sequence)
        given = known[2].last if known else None
        return given if given is not None and given.refused else None


def _person(item: Equipment, plant: Plant) -> Person:
    label = item.label.get(plant.languages[0]) or next(iter(item.label.values()), item.id)
    return Person(0, item.id, label, OPERATOR, permissions_of(OPERATOR), f"{SESSION}{item.id}")
