"""Who may ask, and how often: what is judged of a person before anything is asked of a device; and what becomes of a refusal."""

from dataclasses import dataclass, replace

from app.access.roles import Person
from app.commands.command_state import CommandState
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress, ProgressState
from app.commands.machine import Machine
from app.commands.nonce import Nonces, Rate
from app.commands.orders import Order
from app.errors import Refused

BURST = 1.0
"""Refusals of a person for one reason within so long are one line with their number [s]."""
MOST_APART = 5
"""So many commands of one person are told apart in it; further ones are counted together."""


class Admission:
    """The door of the gate."""

    def __init__(self, state: CommandState) -> None:
        self.nonces = Nonces(state.clock)
        self.rate = Rate(state.clock)
        self._state = state
        self._bursts: dict[tuple[str, str, str], _Burst] = {}

    def check_person(self, order: Order, machine: Machine, prepared: Prepared) -> float:
        """Role, token, nonce: before anything is asked of the device. Returns when the nonce was issued [s, monotonic]."""
        for found, status in self._state.checks.lacking(order.person, machine, prepared):
            raise Refused(found.key, status, **found.params)
        assert order.person is not None
        issued = self.nonces.use(order.person.session, order.nonce)
        self._state.control.touch(order.person.session, order.equipment)
        return issued

    @staticmethod
    def check_not_stopped(machine: Machine, issued: float) -> None:
        """Nobody stopped the machine since the nonce of a command was `issued`: what was pressed before a Stop is not carried out after it.

        Raises:
            Refused: 409.
        """
        if machine.stopped > issued:
            raise Refused("why.stopped_since", 409)

    def within_rate(self, order: Order, prepared: Prepared | None) -> bool:
        """Whether the person has not asked too often; else that is a refusal."""
        if order.person is None or self.rate.take(_owner(order.person)):
            return True
        self.note_refusal(order, prepared, Refused("why.rate", 429))
        return False

    def note_refusal(self, order: Order, prepared: Prepared | None, refusal: Refused) -> None:
        """One line in the trail, and in the history of the machine; what follows within a second is counted."""
        now, owner = self._state.clock.monotonic(), _owner(order.person) if order.person else ""
        key = (owner, refusal.reason, f"{order.equipment}.{order.key}")
        if key not in self._bursts and sum(known[0] == owner for known in self._bursts) >= MOST_APART:
            key = (owner, refusal.reason, "")
        argument = order.argument if isinstance(order.argument, int | float) else None
        progress = Progress(
            order.id,
            order.equipment,
            order.key,
            prepared.command.label if prepared else "",
            order.person.display if order.person else "",
            ProgressState.REFUSED,
            order.asked,
            ended=self._state.clock.micros(),
            reason=refusal.reason,
            params=refusal.params,
            argument=argument,
            arguments={name: value for name, value in order.arguments.items() if isinstance(value, int | float)},
        )
        burst = self._bursts.get(key)
        if burst is not None and now - burst.since < BURST:
            if order.id != burst.written:  # else the same press once more
                burst.count += 1
                burst.last = order, progress
            return
        if burst is not None:
            self._sum_up(burst)
        self._bursts[key] = _Burst(now, order.id)
        machine = self._state.machines.get(order.equipment)
        if machine is not None:
            machine.history.append(progress)
        self._state.audit_lines.command(order, progress, refused=True)

    def tick(self, now: float) -> None:
        """Write down what was counted, a line a second; the rest when the burst is over."""
        for key, burst in list(self._bursts.items()):
            if now - burst.since < BURST:
                continue
            self._sum_up(burst)
            if burst.last is not None:
                self._bursts[key] = _Burst(now, burst.last[0].id)
            else:
                del self._bursts[key]

    def close(self) -> None:
        """Write down what is still counted."""
        for burst in self._bursts.values():
            self._sum_up(burst)
        self._bursts.clear()

    def _sum_up(self, burst: "_Burst") -> None:
        if burst.last is None:
            return
        order, progress = burst.last
        counted = replace(progress, params={**progress.params, "count": burst.count}) if burst.count > 1 else progress
        self._state.audit_lines.command(order, counted, refused=True)


@dataclass(slots=True)
class _Burst:
    """Refusals of one person for one reason after the one that was written down."""

    since: float
    """Monotonic [s]."""
    written: str
    """The press that has its line."""
    count: int = 0
    last: tuple[Order, Progress] | None = None


def _owner(person: Person) -> str:
    """Whose rate counts; an API token has no identity of its own."""
    return str(person.id) if person.id else person.session
