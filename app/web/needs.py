"""What a machine needs for what one does next: conditions in words, the same for all who look in one language."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from zoneinfo import ZoneInfo

from app.commands import interlocks
from app.commands.gate import Gate
from app.plant.definitions import Condition
from app.plant.expression import Reading
from app.tags.quality import NO_DATA
from app.web.command_words import CommandWords
from app.web.points import EquipmentView


@dataclass(frozen=True, slots=True)
class ConditionLine:
    """A permissive or an interlock in words."""

    label: str
    met: bool | None
    """None = not known, which counts as not met."""
    since: str
    first: bool


class Needs:
    """Of one machine, in the language of its view; nobody is named."""

    def __init__(self, equipment: EquipmentView) -> None:
        self.equipment = equipment
        self.gate: Gate | None = getattr(equipment.runtime, "gate", None)
        plant = equipment.runtime.plant
        self.zone = ZoneInfo(plant.timezone) if plant else ZoneInfo("UTC")
        self.words = CommandWords(equipment, self.zone, signed_in=False)

    @property
    def id(self) -> str:
        """The machine."""
        return self.equipment.id

    @cached_property
    def permissives(self) -> list[ConditionLine]:
        """What must be true to start, missing ones first."""
        return self._lines(
            line for line in self._permissives if not self._only_for_hold(line[0]) and not line[0].situational
        )

    @property
    def _permissives(self) -> Sequence[tuple[Condition, bool | None, int]]:
        return self.gate.permissives(self.id) if self.gate else ()

    def _only_for_hold(self, condition: Condition) -> bool:
        commands = self.equipment.equipment.type.commands
        return bool(condition.commands) and all(key in commands and commands[key].hold for key in condition.commands)

    @cached_property
    def interlocks(self) -> list[ConditionLine]:
        """What must be true at any time, missing ones first."""
        return self._lines(self.gate.interlocks(self.id)) if self.gate else []

    @cached_property
    def lacking(self) -> str:
        """The first thing that is missing for what one does next, in words; empty while nothing is.

        What is known to be missing goes before what is not known; in both what must hold at any time before what one needs to start.
        """
        lines = [*self.interlocks, *self.permissives]
        known = next((line.label for line in lines if line.met is False), "")
        unknown = next((line.label for line in lines if line.met is None), "")
        return known or (f"{unknown}: {self.equipment.text('operate.unknown')}" if unknown else "")

    def _lines(
        self, conditions: Iterable[tuple[Condition, bool | None, int]], *, normal: bool = False
    ) -> list[ConditionLine]:
        found = sorted(conditions, key=lambda line: line[1] is True)
        return [
            ConditionLine(
                self.equipment.t(condition.label) if normal else self._named(condition, met),
                met,
                self.words.time(since),
                met is not True and number == 0,
            )
            for number, (condition, met, since) in enumerate(found)
        ]

    def _named(self, condition: Condition, met: bool | None) -> str:
        """A condition that holds by what holds, a missing one by what is wrong."""
        if met is not False or not condition.missing:
            return self.equipment.t(condition.label)
        return self.words.told(condition.missing, interlocks.amounts(condition.values, self.look))

    def look(self, key: str) -> Reading:
        """Value and quality of a point of the machine, for an expression over its points."""
        tags = self.equipment.runtime.tags
        handle = tags.handles.get(f"{self.id}.{key}")
        return (None, NO_DATA) if handle is None else (tags.value(handle), tags.quality(handle))
