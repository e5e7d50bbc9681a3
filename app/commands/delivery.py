"""What a command is sent as, and what came of it: telegrams to registers, one code with arguments, or request bits of a hold-to-run.

A code is answered by the device itself (registers/plc_map.py): accepted, running, done, or why not. Without an answer nobody knows; a
command that is proven not to have arrived has failed. Nothing is sent twice here.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import cast

from app.clock import Clock
from app.commands import interlocks
from app.commands.interlocks import Prepared
from app.commands.job import Job
from app.commands.lifecycle import ProgressState
from app.commands.machine import Machine
from app.commands.orders import MapWriter, Order, Writer
from app.commands.readings import Readings
from app.errors import (
    MAY_HAVE_ACTED,
    BadAnswer,
    DeviceException,
    LinkError,
    NoAnswer,
    NotTaken,
    Overtaken,
    Refused,
    Rejected,
    Withdrawn,
)
from app.links.schedule import PERMIT
from app.plant.definitions import Command, Equipment, EquipmentType, Scan, Write
from app.plant.expression import parse
from app.registers.plc_map import Answer, AnswerState

log = logging.getLogger(__name__)

TAKEN = (AnswerState.ACCEPTED, AnswerState.RUNNING, AnswerState.DONE)
REFUSED = (AnswerState.REJECTED, AnswerState.FAILED, AnswerState.EXPIRED)
LARGEST_COUNTER = 0xFFFF
LOOK_AGAIN = 0.05
"""Between two looks at what a telegram waits for [s]."""

Outcome = tuple[ProgressState, str, Mapping[str, object]]
"""What became of a command that was not simply taken: state, text key, what fills it."""
RIGHT_ENDED: Outcome = (ProgressState.FAILED, "why.right_ended", {})


class Delivery:
    """The one place from which the gate writes."""

    def __init__(
        self,
        writers: Mapping[str, Writer],
        clock: Clock,
        may_go_on: Callable[[Order, Prepared], bool],
        readings: Readings,
    ) -> None:
        """`writers` by link, looked up at every write; `may_go_on`: whether whoever gave an order still may."""
        self._writers = writers
        self._clock = clock
        self._may_go_on = may_go_on
        self._readings = readings

    async def send(self, machine: Machine, job: Job, telegrams: Sequence[tuple[str, float]]) -> Outcome | None:
        """Send the command; None = every telegram was echoed, or the device has accepted the code. A Stop in between ends it.

        Whether the person still may is asked when it is the turn of a telegram on the wire, of each one.
        """
        before = PERMIT.set(partial(self._may_go_on, job.order, job.prepared))
        try:
            return await self._send(machine, job, telegrams)
        finally:
            PERMIT.reset(before)

    async def _send(self, machine: Machine, job: Job, telegrams: Sequence[tuple[str, float]]) -> Outcome | None:
        command = job.prepared.command
        try:
            if command.code:
                answer = await self._mapped(machine).order(
                    machine.item.id, command.code, job.words, expected=job.expected, owner=owner_of(job)
                )
                job.answered(answer)
                return refusal_of(machine.item.type, answer)
            if command.hold_bits:
                if not job.progress.over and job.ending is None:
                    await self._bits(machine, job, command.hold_bits)
                return None
            steps = command.writes if len(command.writes) == len(telegrams) else ()
            for number, (point, value) in enumerate(telegrams):
                step = steps[number] if steps else Write(point, "")
                if step.when and not self._readings.says(machine, step.when):
                    continue
                if step.after and (late := await self._wait(machine, job, step)) is not None:
                    return late
                if job.progress.over or job.ending is not None:
                    return None
                if not self._may_go_on(job.order, job.prepared):
                    return RIGHT_ENDED
                job.goes_out(self._clock.monotonic())
                job.known_as(await self._writers[machine.item.link].write(machine.item.id, point, value))
                if job.lease is None:
                    machine.restore.pop(point, None)
        except (LinkError, Refused, KeyError) as error:
            if isinstance(error, NoAnswer):
                job.known_as(error.request)
            return outcome_of(error, machine.item, as_code=bool(command.code), command=command)
        return None

    async def _wait(self, machine: Machine, job: Job, step: Write) -> Outcome | None:
        """Until the device says what `step` comes after; why it is not written if it does not, or may not be any more."""
        began = self._clock.monotonic()
        points = machine.item.points
        keys = interlocks.sources(points, parse(step.after).names)
        slow = [key for key in keys if points[key].scan is not Scan.FAST]
        while not self._readings.says(machine, step.after, began):
            if job.progress.over or job.ending is not None:
                return None
            if self._clock.monotonic() - began >= step.within:
                return ProgressState.FAILED, "why.not_ready", {"seconds": round(step.within, 1)}
            if slow:
                await self._writers[machine.item.link].refresh(machine.item.id, slow)
            await asyncio.sleep(LOOK_AGAIN)
        look = self._readings.look(machine)
        lost = next((each for each in job.guarded if interlocks.met(each, look) is False), None)
        return (ProgressState.FAILED, "why.fault_appeared", {"label": lost.label}) if lost else None

    async def stop(self, machine: Machine, job: Job, telegrams: Sequence[tuple[str, float]]) -> bool:
        """Send a Stop, or the release of a hold-to-run, before everything that waits. False: the device did not take it.

        Raises:
            LinkError, Refused, KeyError: it may not have arrived.
        """
        command, item = job.prepared.command, machine.item
        if command.hold_bits:
            await self._bits(machine, job, 0, urgent=True)
            return True
        if not command.code:
            for point, value in telegrams:
                await self._writers[item.link].write(item.id, point, value, urgent=True)
            return True
        try:
            answer = await self._mapped(machine).order(item.id, command.code, owner=owner_of(job), urgent=True)
        finally:
            if job.clears:
                await self._bits(machine, job, 0, urgent=True)
        job.answered(answer)
        if answer.state not in TAKEN:
            log.warning("stop not taken equipment=%s state=%s reason=%s", item.id, answer.state.name, answer.reason)
        return answer.state in TAKEN

    async def ask(self, machine: Machine, job: Job) -> None:
        """Read again what the device says about a code that it has taken."""
        assert job.answer is not None
        with job.asked_again(self._clock.monotonic()):
            try:
                found = await self._mapped(machine).answer(machine.item.id, job.answer.id)
                job.answered(found or job.answer)
            except (LinkError, KeyError) as error:
                log.info("answer not read equipment=%s error=%s", machine.item.id, error)

    async def _bits(self, machine: Machine, job: Job, bits: int, *, urgent: bool = False) -> None:
        """Request bits with a counter that no telegram before had."""
        job.bits_sent(self._clock.monotonic())
        machine.counter = machine.counter % LARGEST_COUNTER + 1
        await self._mapped(machine).hold(machine.item.id, bits, machine.counter, urgent=urgent)
        job.bits_echoed(self._clock.monotonic())

    def _mapped(self, machine: Machine) -> MapWriter:
        return cast(MapWriter, self._writers[machine.item.link])


def outcome_of(
    error: LinkError | Refused | KeyError, item: Equipment, *, as_code: bool, command: Command | None = None
) -> Outcome:
    """What an error of the link says about `command`; `as_code`: it was a code, of which a link proves that it did not arrive."""
    match error:
        case DeviceException() if error.code in MAY_HAVE_ACTED:
            return ProgressState.UNKNOWN, "why.unknown", {"cause": f"communication.exception.{error.code}"}
        case DeviceException() if command and error.code in command.refused:
            meant = {"code": error.code, "label": command.refused[error.code]}
            return ProgressState.FAILED, "why.device_rejected", meant
        case DeviceException():
            return ProgressState.FAILED, "why.device_refused", {"code": error.code}
        case Overtaken():
            return ProgressState.SUPERSEDED, "why.overtaken", {}
        case Withdrawn():
            return RIGHT_ENDED
        case Refused():  # the link knows better than we that its device is live
            return ProgressState.FAILED, "why.writes_off", error.params
        case NotTaken():
            return ProgressState.FAILED, "why.not_arrived", {"cause": f"link.error.{error.kind}"}
        case Rejected():
            return rejection(item.type, error.reason, error.detail, error.state)
        case LinkError() if as_code and not isinstance(error, NoAnswer | BadAnswer):
            return ProgressState.FAILED, "why.not_arrived", {"cause": f"link.error.{error.kind}"}
        case LinkError():
            return ProgressState.UNKNOWN, "why.unknown", {"cause": f"link.error.{error.kind}"}
        case _:
            return ProgressState.FAILED, "why.no_link", {"link": item.link}


def refusal_of(kind: EquipmentType, answer: Answer) -> Outcome | None:
    """Why the device did not carry it out, in its own words; None when it did not say so."""
    if answer.state not in REFUSED:
        return None
    return rejection(kind, answer.reason, answer.detail, answer.state.name.lower())


def rejection(kind: EquipmentType, reason: int, detail: int, state: str) -> Outcome:
    """The device's own reason: its text, or its number when the type has none."""
    params: dict[str, object] = {"code": reason, "detail": detail, "answer": state}
    name = kind.reasons.get(reason)
    if name is None:
        return ProgressState.FAILED, "why.device_rejected_code", params
    return ProgressState.FAILED, "why.device_rejected", {**params, "label": f"reason.{name}"}


def owner_of(job: Job) -> int:
    """Who asks, for the device's own records: the number of the person, cut to a word."""
    return job.order.person.id & 0xFFFF if job.order.person else 0
