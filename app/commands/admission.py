"""Who may ask, and how often: what is judged of a person before anything is asked of a device; and what becomes of a refusal."""

from app.access.roles import Person
from app.commands.desk import Desk
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress, State
from app.commands.nonce import Nonces, Rate
from app.commands.orders import Order
from app.errors import Refused


class Admission:
    """The door of the gate."""

    def __init__(self, desk: Desk) -> None:
        self.nonces = Nonces(desk.clock)
        self.rate = Rate(desk.clock)
        self._desk = desk
        self._refused_rate: dict[str, tuple[float, int]] = {}

    def check_person(self, order: Order, prepared: Prepared) -> None:
        """Role, token, nonce: before anything is asked of the device."""
        machine = self._desk.machines[order.equipment]
        for found, status in self._desk.checks.standing(order.person, machine, prepared):
            raise Refused(found.key, status, **found.params)
        assert order.person is not None
        self.nonces.use(order.person.session, order.nonce)
        self._desk.control.touch(order.person.session, order.equipment)

    def within_rate(self, order: Order, prepared: Prepared) -> bool:
        """Whether the person has not asked too often; else it is noted, once in a while."""
        if order.person is None or self.rate.take(_owner(order.person)):
            return True
        now, key = self._desk.clock.monotonic(), _owner(order.person)
        at, count = self._refused_rate.get(key, (float("-inf"), 0))
        if now - at < 10.0:
            self._refused_rate[key] = (at, count + 1)
        else:
            self._refused_rate[key] = (now, 0)
            self.note_refusal(order, prepared, Refused("why.rate", 429, before=count))
        return False

    def note_refusal(self, order: Order, prepared: Prepared | None, refusal: Refused) -> None:
        """One line in the trail, and in the history of the machine."""
        argument = order.argument if isinstance(order.argument, int | float) else None
        progress = Progress(
            order.id,
            order.equipment,
            order.key,
            prepared.command.label if prepared else "",
            order.person.display if order.person else "",
            State.REFUSED,
            order.asked,
            ended=self._desk.clock.micros(),
            reason=refusal.reason,
            params=refusal.params,
            argument=argument,
            arguments={name: value for name, value in order.arguments.items() if isinstance(value, int | float)},
        )
        machine = self._desk.machines.get(order.equipment)
        if machine is not None:
            machine.history.append(progress)
        self._desk.trail.command(order, progress, refused=True)


def _owner(person: Person) -> str:
    """Whose rate counts; an API token has no identity of its own."""
    return str(person.id) if person.id else person.session
