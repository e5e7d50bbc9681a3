"""How an order is carried out: once, however often its button was pressed; judged right before it is sent."""

import asyncio
from collections.abc import Awaitable, Callable

from app.commands.admission import Admission
from app.commands.command_state import CommandState
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress
from app.commands.machine import Machine
from app.commands.nonce import Once
from app.commands.orders import LONGEST_REASON, Order, Question, Task
from app.commands.sending import Sending
from app.commands.sets import Sets
from app.errors import Refused

Send = Callable[[Order, Machine, Prepared, Task], Awaitable[Progress]]
"""Sends an order that was admitted."""


class Execution:
    """Takes orders to the telegrams of `sending` and `sets`."""

    def __init__(self, state: CommandState, admission: Admission, sending: Sending, sets: Sets) -> None:
        self._state, self._admission, self._sending, self._sets = state, admission, sending, sets
        self._once: Once[Progress] = Once(state.clock)

    async def take(
        self, order: Order, choose: Callable[[Machine], Prepared | None], send: Send | None = None
    ) -> Progress:
        """Carry out `order`; `choose` finds what it asks for, `send` sends what is no telegram to registers. A second one with the same id
        gets the first one's result.

        Raises:
            Question, Refused: as `Gate.ask`.
        """
        machine = self._state.machines.get(order.equipment)
        prepared = choose(machine) if machine else None
        known, stop = self._once.known(order.id), prepared is not None and prepared.command.stop
        if not stop and not known and not self._admission.within_rate(order, prepared):
            raise Refused("why.rate", 429)
        if machine is None or prepared is None:
            refusal = Refused("why.no_such_command", 404, equipment=order.equipment, command=order.key)
            self._admission.note_refusal(order, None, refusal)
            raise refusal
        if prepared.command.hold:
            refusal = Refused("why.hold_only", 409)
            self._admission.note_refusal(order, prepared, refusal)
            raise refusal
        if prepared.command.stop:
            machine.stopped = self._state.clock.monotonic()
            return await asyncio.shield(
                self._state.keep(self._carry_out(order, prepared, choose), f"stop {order.equipment}")
            )
        if len(order.reason) > LONGEST_REASON:
            raise Refused("why.reason_too_long", 422, length=len(order.reason), limit=LONGEST_REASON)
        owner = "" if order.person is None else f"{order.person.id} {order.person.session}"
        try:
            return await self._once.run(
                order.id,
                owner,
                lambda: self._carry_out(order, prepared, choose, send),
                keep=lambda refusal: not isinstance(refusal, Question),
            )
        except Refused as refusal:
            if refusal.reason == "why.replayed":
                self._admission.note_refusal(order, prepared, refusal)
            raise

    async def _carry_out(
        self, order: Order, prepared: Prepared, choose: Callable[[Machine], Prepared | None], send: Send | None = None
    ) -> Progress:
        try:
            machine, prepared = self._state.still(order.equipment, choose)
            if not prepared.command.stop:
                issued = self._admission.check_person(order, machine, prepared)
                await self._state.checks.renew(machine, prepared)
                machine, prepared = self._state.still(order.equipment, choose)
                self._admission.check_not_stopped(machine, issued)
            if prepared.command.stop and machine.job is not None and machine.job.order.id == order.id:
                return machine.job.progress  # the second click of a double click
            plan = self._state.checks.task(order, machine, prepared)
            if send is not None:
                return await send(order, machine, prepared, plan)
        except Question:
            raise
        except Refused as refusal:
            self._admission.note_refusal(order, prepared, refusal)
            raise
        if prepared.parts:
            return await self._sets.send(order, machine, prepared, plan)
        return await self._sending.send(order, machine, prepared, plan)
