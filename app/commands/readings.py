"""What the plant says of a machine now: values, ages, conditions, and whether a command has worked."""

from collections.abc import Mapping, Sequence

from app.clock import Clock
from app.commands import interlocks
from app.commands.interlocks import Age, Prepared
from app.commands.machine import Machine
from app.errors import Refused
from app.plant import expression
from app.plant.definitions import Condition
from app.tags.database import TagDatabase
from app.tags.quality import NO_DATA, is_good


class Readings:
    """Reads the tags of machines; keeps since when their conditions are as they are."""

    def __init__(self, tags: TagDatabase, clock: Clock) -> None:
        self._tags = tags
        self._clock = clock

    def look(self, machine: Machine) -> expression.Look:
        """Value and quality of a point of the machine by its key."""
        tags, handles = self._tags, self._handles

        def look(key: str) -> expression.Reading:
            handle = handles(machine).get(key)
            return (None, NO_DATA) if handle is None else (tags.value(handle), tags.quality(handle))

        return look

    def age(self, machine: Machine) -> Age:
        """Age of the value of a point of the machine by its key [s]."""
        tags, handles = self._tags, self._handles

        def age(key: str) -> float:
            handle = handles(machine).get(key)
            return float("inf") if handle is None else tags.age(handle)

        return age

    def _handles(self, machine: Machine) -> Mapping[str, int]:
        """Point → handle, looked up once for each revision of the plant."""
        revision, found = machine.handles
        if revision != self._tags.revision:
            known, prefix = self._tags.handles, machine.item.id + "."
            found = {key: known[prefix + key] for key in machine.item.points if prefix + key in known}
            machine.handles = self._tags.revision, found
        return found

    def watch(self, machine: Machine, *, paused: bool = False) -> bool:
        """Judge every condition of the machine; whether anything that a screen says about its commands is other than before.

        `paused`: its simulation is, which stands in the way of every command.
        """
        look, age, kind = self.look(machine), self.age(machine), machine.item.type
        for condition in (*kind.permissives, *kind.interlocks):
            self._judge(machine, condition, look, age)
        signature = (
            paused,
            tuple(value for value, _ in machine.met.values()),
            tuple(
                tuple(interlocks.amounts(condition.values, look).items())
                for condition in (*kind.permissives, *kind.interlocks)
                if condition.values and machine.met[condition.key][0] is False
            ),
            tuple((r.key, r.label) for r in interlocks.stale(machine.item, machine.link, machine.used, look, age)),
            tuple(interlocks.level(prepared, look)[0] for prepared in machine.commands.values()),
        )
        changed = signature != machine.signature
        machine.signature = signature
        return changed

    def condition(self, machine: Machine, condition: Condition) -> tuple[Condition, bool | None, int]:
        """`condition`, whether it is met (None = not known), and since when [µs UTC]."""
        return self._judge(machine, condition, self.look(machine), self.age(machine))

    def _judge(
        self, machine: Machine, condition: Condition, look: expression.Look, age: Age
    ) -> tuple[Condition, bool | None, int]:
        value = interlocks.met(condition, look, age=age)
        before = machine.met.get(condition.key)
        if before is None or before[0] is not value:
            machine.met[condition.key] = before = (value, self._clock.micros())
        return condition, value, before[1]

    def previous(self, machine: Machine, prepared: Prepared) -> dict[str, float]:
        """What the points hold that the command puts back when it is over.

        Raises:
            Refused: 409, one of them is not known.
        """
        look = self.look(machine)
        command = prepared.command
        result: dict[str, float] = {}
        for write in (*command.writes, *command.release):
            if write.value == "previous":
                value = machine.restore.get(write.point, look(write.point)[0])
                if not isinstance(value, int | float):
                    raise Refused("why.bad_value", 409, label=machine.item.points[write.point].label, point=write.point)
                result[write.point] = float(value)
        return result

    def stands(self, machine: Machine, stop: Prepared | None, since: float) -> bool:
        """Whether values read after `since` say that the machine stands."""
        if stop is None or stop.feedback is None:
            return True
        return self.read_since(machine, stop.watched, since) and self.feedback(machine, stop, None) is True

    def feedback(self, machine: Machine, prepared: Prepared, argument: float | None) -> bool | None:
        """Whether the values say that the command has worked; None = not known."""
        if prepared.feedback is None:
            return None
        return prepared.feedback.true(self.look(machine), argument=argument, age=self.age(machine))

    def says(self, machine: Machine, sentence: str, since: float | None = None) -> bool | None:
        """Whether `sentence` holds; None = not known, with `since` also while a value that it uses was not read after that."""
        keys = interlocks.sources(machine.item.points, expression.parse(sentence).names)
        if since is not None and not self.read_since(machine, keys, since):
            return None
        return expression.parse(sentence).true(self.look(machine), age=self.age(machine))

    def read_since(self, machine: Machine, keys: Sequence[str], since: float) -> bool:
        """Whether every one of `keys` is good and was read after `since`.

        Where a device has several connections an answer that left before the write may arrive after it; its turnaround is added.
        """
        device = machine.item.type.device
        elapsed = self._clock.monotonic() - since - (device.turnaround if device.connections > 1 else 0.0)
        look, age = self.look(machine), self.age(machine)
        return all(is_good(look(key)[1]) and age(key) < elapsed for key in keys)
