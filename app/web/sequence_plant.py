"""What templates know of a sequence and the rest of the plant: where it runs, what its steps command, which points it cannot rely on."""

from collections.abc import Sequence
from functools import cached_property
from urllib.parse import quote
from zoneinfo import ZoneInfo

from app.plant.definitions import Argument
from app.plant.expression import Reading, parse
from app.plant.sequence_definition import SequenceDefinition, SequenceOrder
from app.running.sequence_orders import SequenceDesk, SequenceDesks
from app.tags.quality import NO_DATA
from app.web import format as fmt
from app.web import sentences
from app.web.points import EquipmentView, PointView
from app.web.sequence_recipe import RecipeValueView, recipe_of


class SequencePlant:
    """A sequence among the machines of its plant."""

    def __init__(self, equipment: EquipmentView, definition: SequenceDefinition) -> None:
        self.equipment = equipment
        self.definition = definition

    def doubt(self, sentence: str) -> str:
        """The first point of another machine in a sentence that has no good value."""
        names = parse(sentence, machines=True).names if "." in sentence else ()
        for id, _, key in sorted(
            name.partition(".") for name in names if "." in name and not self.definition.is_recipe(name)
        ):
            machine = self.equipment.other(id)
            if machine is None or not machine.has(key) or machine.point(key).state != "good":
                return f"{machine.label if machine else id} · {machine.point(key).label if machine and machine.has(key) else key}"
        return ""

    @cached_property
    def runs_here(self) -> bool:
        """Whether this server runs it, not a PLC of its own."""
        plant = self.equipment.runtime.plant
        link = plant.links.get(self.equipment.link) if plant else None
        return link is not None and link.simulated

    @cached_property
    def recipe(self) -> list[RecipeValueView]:
        """The values of its runs."""
        return recipe_of(self.equipment, self.definition)

    @property
    def asks_start(self) -> str:
        """Where a start asks for the values of the run; empty = it takes none."""
        return f"/equipment/{quote(self.equipment.id)}/ask/start" if self.recipe else ""

    def orders(self, step: int) -> list[str]:
        """What step `step` commands, each in words: `Fan 1: Frequency 30.0 Hz, Forward`."""
        return [self._order(order) for order in self.definition.steps[step - 1].orders]

    def _order(self, order: SequenceOrder) -> str:
        machine = self.equipment.other(order.machine)
        action = machine.equipment.type.orders.get(order.action) if machine else None
        if machine is None or action is None:
            return str(order)
        order = order.given({one.key: one.point.value for one in self.recipe if one.known})  # type: ignore[misc]
        if action.label:
            return f"{machine.label}: {machine.t(action.label)}{self._given(order, machine, action.arguments)}"
        said = []
        for each in action.commands:
            view, value = machine.commands[each.command], order.values.get(each.value)
            point = machine.point(view.argument.key) if value is not None and view.argument else None
            written = (
                fmt.quantity(value, point.decimals, point.unit, self.equipment.lang)
                if value is not None and point
                else ""
            )
            said.append(f"{view.label} {written}".rstrip() + self._arguments(order, machine, each.command))
        return f"{machine.label}: {', '.join(said)}"

    def _arguments(self, order: SequenceOrder, machine: EquipmentView, command: str) -> str:
        return self._given(order, machine, machine.equipment.type.commands[command].arguments)

    def _given(self, order: SequenceOrder, machine: EquipmentView, arguments: Sequence[Argument]) -> str:
        """What goes with a code or with the whole: ` (from 1, to 2)`."""
        said = []
        for one in arguments:
            if one.name in order.values:
                written = fmt.quantity(order.values[one.name], one.decimals, one.unit, self.equipment.lang)
                said.append(f"{machine.t(one.label)} {written}")
        return f" ({', '.join(said)})" if said else ""

    @property
    def _desk(self) -> SequenceDesk | None:
        desks: SequenceDesks | None = getattr(self.equipment.runtime, "desks", None)
        return desks.known(self.equipment.id) if desks else None

    def failed_order(self, step: int, number: int) -> str:
        """Command `number` of step `step`, in words; empty = there is none."""
        orders = self.orders(step) if 0 < step <= len(self.definition.steps) else []
        return orders[number - 1] if 0 < number <= len(orders) else ""

    @property
    def failure(self) -> str:
        """Why it was not carried out, as the gate said; empty after a restart of the server (the audit has it)."""
        desk = self._desk
        given = desk.failed if desk else None
        if given is None or given.order is None:
            return ""
        machine = self.equipment.other(given.order.machine) or self.equipment
        plant = self.equipment.runtime.plant
        filled = fmt.parameters(given.params, self.equipment.lang, self.equipment.text)
        if isinstance(since := given.params.get("since"), int):
            zone, now = ZoneInfo(plant.timezone if plant else "UTC"), self.equipment.runtime.clock.micros()
            filled["since"] = fmt.moment_or_time(since, zone, self.equipment.lang, now)
        label = given.params.get("label")
        filled["label"] = machine.told(str(label), given.params) if label else machine.label
        return self.equipment.text(given.reason, **filled).rstrip()

    @property
    def pending(self) -> bool:
        """Whether commands of the active step are not confirmed yet."""
        desk = self._desk
        return desk is not None and desk.pending

    @property
    def held(self) -> bool | None:
        """Whether `suspend_when` has it stand still; None = nobody knows, and so it stands."""
        when = self.definition.suspend_when
        return parse(when, machines=True).true(self._reading) if when and self.runs_here else False

    def told(self, sentence: str) -> str:
        """`sentence` in words: names of points and their machines in place of keys."""
        return sentences.told(sentence, self._named, self.equipment.text, self.equipment.lang)

    def _named(self, name: str) -> tuple[str, PointView | None]:
        id, _, key = name.rpartition(".")
        if self.definition.is_recipe(name):
            own = next((one for one in self.recipe if one.key == key), None)
            return (own.label, own.point) if own else (name, None)
        machine = self.equipment.other(id or self.equipment.equipment.machine)
        if machine is None or not machine.has(key):
            return name, None
        point = machine.point(key)
        return (f"{machine.label} · {point.label}" if id else point.label), point

    def _reading(self, name: str) -> Reading:
        id, _, key = name.rpartition(".")
        if self.definition.is_recipe(name):
            own = next((one.point for one in self.recipe if one.key == key and one.known), None)
            return (own.value, own.quality) if own else (None, NO_DATA)
        machine = self.equipment.other(id) if id else self.equipment.other(self.equipment.equipment.machine)
        point = machine.point(key) if machine is not None and machine.has(key) else None
        return (point.value, point.quality) if point and point.state == "good" else (None, NO_DATA)
