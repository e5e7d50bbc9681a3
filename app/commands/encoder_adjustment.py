"""Adjusting an absolute encoder of a drive behind its mailbox as one sequence by the gate: nothing but a Stop is let beside it.

    former values read → sent (on the disk) → p2599 written, read back → p2507 = 2 → 3 awaited → position compared → confirmed
                                                 └ 0, 1, 10 s over, refused, cancelled, Stop, moved, a right lost
                                                     → p2507 = 1 where 2 stands, former p2599 written → failed, with what the drive holds

An adjustment cannot be undone by writing: where p2507 reads 3 in the end it is told as adjusted or, when the position does not fit, as
something else than was asked for. Nothing is permanent until it is saved (`ParameterSets.save`), which the story is told of.

That a drive takes p2507 = 1 to withdraw an adjustment is assumed; what it holds afterwards is read and told.
"""

import asyncio
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from app.access.roles import Person
from app.commands import encoder_story as told
from app.commands import value_set
from app.commands.command_state import CommandState
from app.commands.encoder_story import StepState, Story, verdict
from app.commands.execution import Execution
from app.commands.interlocks import Prepared, RefusalReason
from app.commands.lifecycle import Progress, ProgressState
from app.commands.machine import Machine, SetJob
from app.commands.orders import Order, Task
from app.commands.parameter_change import ENCODER, ENCODER_LABEL, SAVE, ParameterChange, wrong_value
from app.commands.parameter_reading import Work
from app.commands.parameter_sets import CANCELLED, at_standstill
from app.commands.parameter_work import ParameterWork
from app.commands.set_follow_up import UNREAD, found_params
from app.commands.sets import NO_AUDIT, RESTORED, Failure
from app.commands.value_set import Change, Stands
from app.errors import Refused
from app.links.mailbox import Missed
from app.plant.definitions import EquipmentType
from app.profidrive.parameter_access.messages import Address, Values
from app.profidrive.parameter_access.parameter import DriveParameter

log = logging.getLogger(__name__)

STATE, COORDINATE, POSITION, WINDOW = "p2507", "p2599", "r2521", "p2544"
LOOK = 0.25
"""Between two looks whether the drive is adjusted [s]."""
FAILED = "why.enc_failed"
LOOKED_AT = (POSITION, STATE, COORDINATE, WINDOW)

Place = tuple[str, str, int]
"""Type, link and unit: a drive is what stands there, whatever it is called."""


@dataclass(frozen=True, slots=True)
class Held:
    """What a drive held at one moment."""

    time: int
    """[µs UTC]"""
    values: Mapping[str, float]
    """Code → value [LU], p2507 as it is; a parameter that the drive does not have is not there."""


@dataclass(slots=True)
class Axis:
    """One adjustment at work: what is written, and where it may have arrived."""

    coordinate: Work
    start: Work
    described: tuple[Change, ...] = ()
    """p2599, p2507 with their former values."""
    window: float = 0.0
    """So far the position may be from the coordinate [LU]."""

    @property
    def element(self) -> ParameterChange:
        """p2507 = 2."""
        return self.start.changes[0]


class Stories:
    """The last adjustment of each drive since the server began; whoever looks at a drive hears of every step."""

    def __init__(self, state: CommandState) -> None:
        self._state = state
        self._found: dict[Place, Story] = {}
        state.enders.append(self._ended)

    def place(self, equipment: str) -> Place:
        """What stands under this name now."""
        machine = self._state.machines.get(equipment)
        return (machine.item.type.name, machine.item.link, machine.item.unit) if machine else (equipment, "", 0)

    def get(self, equipment: str) -> Story | None:
        """Of one drive; None when there was none."""
        return self._found.get(self.place(equipment))

    def of(self, machine: Machine) -> Story:
        """The one at work."""
        return self._found[self.place(machine.item.id)]

    def began(self, machine: Machine, key: str) -> None:
        """A step begins."""
        self.tell(machine, self.of(machine).began(key, self._state.clock.micros()))

    def done(self, machine: Machine, key: str, value: float | None = None) -> None:
        """A step is over."""
        self.tell(machine, self.of(machine).done(key, self._state.clock.micros(), value))

    def broke(self, machine: Machine, key: str, failure: Failure) -> Failure:
        """A step failed; why, given back."""
        self.tell(machine, self.of(machine).broke(key, self._state.clock.micros(), *failure))
        return failure

    def tell(self, machine: Machine, story: Story) -> None:
        """Keep it so."""
        self._found[self.place(machine.item.id)] = story
        self._state.changed(machine.item.id)

    def _ended(self, progress: Progress) -> None:
        """A save that ended after an adjustment is its last step, whoever asked for it."""
        place = self.place(progress.equipment)
        story = self._found.get(place)
        if story is None or progress.command != SAVE or not story.succeeded:
            return
        story = story.began(told.SAVE, progress.requested)
        if progress.state is ProgressState.CONFIRMED:
            self._found[place] = story.done(told.SAVE, progress.ended)
        else:
            self._found[place] = story.broke(told.SAVE, progress.ended, progress.reason, progress.params)


class EncoderAdjustments:
    """Adjusts the encoders of all drives; at most one adjustment is at work on each."""

    def __init__(self, state: CommandState, execution: Execution) -> None:
        self._state, self._execution = state, execution
        self._work = ParameterWork(state)
        self._stories = Stories(state)
        self._held: dict[Place, Held] = {}
        self._looking: set[Place] = set()

    def story(self, equipment: str) -> Story | None:
        """The last adjustment of the drive since the server began; None when there was none."""
        return self._stories.get(equipment)

    def held(self, equipment: str) -> Held | None:
        """What the drive held when it was looked at last."""
        return self._held.get(self._stories.place(equipment))

    def looking(self, equipment: str) -> bool:
        """Whether it is being looked at."""
        return self._stories.place(equipment) in self._looking

    def tell(self, equipment: str) -> None:
        """Whoever looks at the machine sees it anew."""
        self._state.changed(equipment)

    def busy(self, equipment: str) -> bool:
        """Whether an adjustment is at work."""
        machine = self._state.machines.get(equipment)
        return machine is not None and machine.set is not None and machine.set.order.key == ENCODER

    async def look(self, equipment: str, object: int) -> None:
        """Read what the drive holds now (`held`); nothing is written, and nothing is added to a look that goes on.

        Raises:
            Refused: 404, no such machine; 503, the plant has no such link.
            LinkError: the drive did not answer.
        """
        machine = self._state.machines.get(equipment)
        if machine is None or not adjustable(machine.item.type):
            raise Refused("why.no_such_command", 404, equipment=equipment, command=ENCODER)
        place = self._stories.place(equipment)
        if place in self._looking:
            return
        self._looking.add(place)
        self._state.changed(equipment)
        try:
            known = machine.item.type.drive_parameters
            wanted = [known[code] for code in LOOKED_AT if code in known]
            asked = [Address(one.number, 0, 1 if one.count else 0) for one in wanted]
            outcomes = await self._work.mailbox(machine).read(object, asked, [one.format for one in wanted])
            missed = next((one for one in outcomes if isinstance(one, Missed)), None)
            if missed is not None:
                raise missed.error
            pairs = zip(wanted, outcomes, strict=True)
            values = {one.code: float(said.values[0]) for one, said in pairs if isinstance(said, Values)}
            self._held[place] = Held(self._state.clock.micros(), values)
        finally:
            self._looking.discard(place)
            self._state.changed(equipment)

    async def adjust(
        self,
        person: Person | None,
        equipment: str,
        coordinate: float,
        *,
        object: int,
        id: str = "",
        nonce: str = "",
        confirmed: bool = False,
        proven: bool = False,
        reason: str = "",
        address: str = "",
        language: str = "en",
    ) -> Progress:
        """Make `coordinate` [LU] the position of the axis of drive `object` where it stands. Returns when it is over; it goes on when the
        caller goes away.

        Raises:
            Question: confirmation, reason or password are missing.
            Refused: as `Gate.ask`; 409, the axis moves, or the drive is being adjusted already; 422, a coordinate that is not permitted.
        """
        order = self._work.order(person, equipment, ENCODER, id, nonce, confirmed, proven, reason, address, language)
        return await self._execution.take(order, _adjusting, partial(self._send, object, coordinate))

    def why_not(self, person: Person | None, equipment: str) -> Sequence[RefusalReason]:
        """Every reason why `person` cannot adjust it now; empty = possible."""
        machine = self._state.machines.get(equipment)
        prepared = _adjusting(machine) if machine else None
        if machine is None or prepared is None:
            return [RefusalReason("why.no_such_command", {"equipment": equipment, "command": ENCODER})]
        return [found for found, _ in self._state.checks.reasons(person, machine, prepared)]

    def cancel(self, equipment: str) -> bool:
        """End the adjustment at work and put back what can be; False when there is none."""
        machine = self._state.machines.get(equipment)
        if machine is None or machine.set is None or not self.busy(equipment):
            return False
        machine.set.interrupt(CANCELLED)
        return True

    # details

    async def _send(
        self, object: int, coordinate: float, order: Order, machine: Machine, prepared: Prepared, plan: Task
    ) -> Progress:
        known = machine.item.type.drive_parameters
        wrong = wrong_value(known[COORDINATE], coordinate)
        if wrong is not None:
            raise Refused(wrong[0], 422, label=known[COORDINATE].text_key, argument=COORDINATE, **wrong[1])
        mailbox = self._work.mailbox(machine)
        started = ParameterChange(object, known[STATE], told.STARTED, becomes=(told.ADJUSTED,))
        axis = Axis(Work([ParameterChange(object, known[COORDINATE], coordinate)], mailbox), Work([started], mailbox))
        job = self._work.job(order, machine, prepared, plan)
        self._stories.tell(machine, Story(coordinate, job.progress.person, order.id))
        return await self._work.done(machine, job, self._carry_out(machine, job, axis))

    async def _carry_out(self, machine: Machine, job: SetJob, axis: Axis) -> None:
        try:
            await self._read(machine, axis)
        except Refused as refusal:
            self._stories.broke(machine, told.READ, (refusal.reason, refusal.params))
            raise
        job.went(replace(job.progress, changes=axis.described, old=value_set.values_text(axis.described, old=True)))
        if self._state.dry_run:
            self._stories.broke(machine, told.COORDINATE, ("why.dry_run", {}))
            self._state.end_set(machine, job, ProgressState.DRY_RUN, "why.dry_run", {})
            return
        if not await self._state.audit_lines.sent(job.order, job.progress):
            self._stories.broke(machine, told.COORDINATE, (NO_AUDIT, {}))
            self._state.end_set(machine, job, ProgressState.FAILED, NO_AUDIT, {})
            return
        failure = await self._steps(machine, job, axis)
        if failure is not None:
            await self._undo(machine, job, axis, failure)
            return
        found = tuple(replace(change, found=change.new, stands=Stands.NEW) for change in axis.described)
        self._state.end_set(machine, job, ProgressState.CONFIRMED, "", {}, found)

    async def _read(self, machine: Machine, axis: Axis) -> None:
        """Former values, where the axis is, how far it may be off.

        Raises:
            Refused: the drive does not tell what is to be written, or is being adjusted.
        """
        self._stories.began(machine, told.READ)
        id, former = machine.item.id, dict[str, float]()
        for work in (axis.coordinate, axis.start):
            former |= await self._work.reading.former(id, work)
        coordinate, started = axis.coordinate.changes[0], axis.element
        if former[started.key] == told.STARTED:
            raise Refused("why.enc_running", 409)
        wanted = replace(started.described(former[started.key]), new=float(told.ADJUSTED))
        axis.described = (coordinate.described(former[coordinate.key]), wanted)
        position = await self._value(machine, axis, POSITION)
        axis.window = await self._value(machine, axis, WINDOW) or 0.0
        codes = {COORDINATE: former[coordinate.key], STATE: former[started.key]}
        codes |= {POSITION: position} if position is not None else {}
        self._stories.tell(machine, replace(self._stories.of(machine), former=codes))
        self._stories.done(machine, told.READ, position)

    async def _steps(self, machine: Machine, job: SetJob, axis: Axis) -> Failure | None:
        """Everything that changes the drive, in its order; why it did not come to its end, None = it did."""
        self._stories.began(machine, told.COORDINATE)
        failure = await self._work.write(machine, job, axis.coordinate)
        if failure is None:
            (found,) = await self._work.reading.found(machine.item.id, axis.coordinate, axis.described[:1])
            failure = None if found.stands is Stands.NEW else _differing(found)
        if failure is not None:
            return self._stories.broke(machine, told.COORDINATE, failure)
        self._stories.done(machine, told.COORDINATE, axis.described[0].new)
        self._stories.began(machine, told.START)
        failure = await self._work.write(machine, job, axis.start)
        if failure is not None:
            return self._stories.broke(machine, told.START, failure)
        self._stories.done(machine, told.START, told.STARTED)
        failure = await self._wait(machine, job, axis)
        return failure if failure is not None else await self._verify(machine, axis)

    async def _wait(self, machine: Machine, job: SetJob, axis: Axis) -> Failure | None:
        self._stories.began(machine, told.WAIT)
        began = self._state.clock.monotonic()
        while True:
            state = await self._value(machine, axis, STATE)
            if state is not None:
                self._stories.tell(machine, self._stories.of(machine).saw(told.WAIT, state))
            verdict_now = verdict(state, self._state.clock.monotonic() - began)
            if verdict_now == "":
                self._stories.done(machine, told.WAIT, state)
                return None
            failure = (
                (verdict_now, {"seconds": told.WAIT_LIMIT}) if verdict_now else self._state.hindrance(machine, job)
            )
            if failure is not None:
                return self._stories.broke(machine, told.WAIT, failure)
            await asyncio.sleep(LOOK)

    async def _verify(self, machine: Machine, axis: Axis) -> Failure | None:
        self._stories.began(machine, told.VERIFY)
        wanted = axis.described[0].new
        position = await self._value(machine, axis, POSITION)
        if position is None:
            return self._stories.broke(machine, told.VERIFY, ("why.enc_position_unread", {}))
        self._stories.tell(machine, self._stories.of(machine).saw(told.VERIFY, position))
        if abs(position - wanted) > axis.window:
            return self._stories.broke(
                machine, told.VERIFY, ("why.enc_position", {"value": position, "asked": wanted, "unit": "LU"})
            )
        self._stories.done(machine, told.VERIFY, position)
        return None

    async def _undo(self, machine: Machine, job: SetJob, axis: Axis, failure: Failure) -> None:
        """Withdraw what has not been carried out, put the former coordinate back, and tell what the drive holds."""
        log.warning("encoder not adjusted equipment=%s reason=%s", machine.item.id, failure[0])
        if axis.start.sent and await self._value(machine, axis, STATE) == told.STARTED:
            await self._work.change(machine, job, axis.start, axis.start.changes, [float(told.NOT_ADJUSTED)], new=False)
        if self._stories.of(machine).step(told.WAIT).state is StepState.DONE:  # adjusted, but not as asked
            (coordinate,) = await self._work.reading.found(machine.item.id, axis.coordinate, axis.described[:1])
        else:
            (coordinate,) = await self._work.restore(machine, job, axis.coordinate, axis.described[:1])
        before = self._stories.of(machine).former.get(POSITION)
        (state,) = await self._work.reading.found(machine.item.id, axis.start, axis.described[1:])
        found = (coordinate, await self._settled(machine, axis, before, state))
        cause: dict[str, object] = {**failure[1], "cause": failure[0]}
        if "cause" in failure[1]:
            cause["deeper"] = failure[1]["cause"]
        stands = {change.stands for change in found}
        if stands == {Stands.OLD}:
            self._state.end_set(machine, job, ProgressState.FAILED, RESTORED, cause, found)
            return
        params = {**cause, **found_params(found)}
        if Stands.UNKNOWN not in stands:
            self._state.end_set(machine, job, ProgressState.FAILED, FAILED, params, found)
            return
        self._state.end_set(machine, job, ProgressState.UNCONFIRMED, UNREAD, params, found)
        both = [*axis.coordinate.changes, *axis.start.changes]
        left = Work(both, axis.start.mailbox, [*axis.coordinate.sent, *axis.start.sent])

        async def judge(read: tuple[Change, ...]) -> tuple[Change, ...]:
            return read[0], await self._settled(machine, axis, before, read[1])

        self._state.spawn(
            self._work.follow(machine.item.id, job.progress, left, judge), f"encoder of {machine.item.id}"
        )

    async def _settled(self, machine: Machine, axis: Axis, before: float | None, state: Change) -> Change:
        """p2507 as it stands. That it is 3 as before proves nothing: then the position tells whether it was adjusted anew, as far as it
        can be read."""
        if state.found is None or state.found != state.old:
            return state
        if axis.start.sent and state.old == told.ADJUSTED:
            position = await self._value(machine, axis, POSITION)
            if position is None or before is None:
                return replace(state, stands=Stands.UNKNOWN)
            if abs(position - before) > axis.window:
                return state
        return replace(state, stands=Stands.OLD)

    async def _value(self, machine: Machine, axis: Axis, code: str) -> float | None:
        """One value of the drive; None = the type does not have it, or the drive did not tell."""
        parameter: DriveParameter | None = machine.item.type.drive_parameters.get(code)
        if parameter is None:
            return None
        address = Address(parameter.number, 0, 1 if parameter.count else 0)
        try:
            (outcome,) = await axis.start.mailbox.read(axis.element.object, [address], [parameter.format])
        except Refused:  # the plant was read anew, and its link may not write any more
            return None
        return float(outcome.values[0]) if isinstance(outcome, Values) else None


def adjustable(kind: EquipmentType) -> bool:
    """Whether drives of this type have the parameters of the adjustment."""
    return all(code in kind.drive_parameters for code in (STATE, COORDINATE, POSITION))


def _adjusting(machine: Machine) -> Prepared | None:
    """What is asked for to adjust an encoder; None for a machine that cannot be."""
    return at_standstill(machine, ENCODER, ENCODER_LABEL) if adjustable(machine.item.type) else None


def _differing(change: Change) -> Failure:
    if change.found is None:
        return "why.set_not_read", {"label": change.label}
    params: Mapping[str, object] = {"value": change.found, "unit": change.unit, "asked": change.new}
    return "why.set_differs", {"label": change.label, **params}
