"""The values of a run as people see them: at Start and on the page of the sequence."""

from dataclasses import dataclass

from app.plant.sequence_definition import RecipeValue, SequenceDefinition
from app.plant.sequence_recipe import last_of, point_of
from app.web import format as fmt
from app.web.points import EquipmentView, PointView


@dataclass(frozen=True, slots=True)
class RecipeValueView:
    """One value."""

    value: RecipeValue
    label: str
    unit: str
    """As it is written."""
    point: PointView
    """What the last start took; in effect while a run lasts."""
    last: str
    """What the field at Start begins with: the last value, else the default."""
    limits: str
    known: bool
    """Whether a run has shown it: the device says it."""

    @property
    def key(self) -> str:
        return self.value.key


def recipe_of(equipment: EquipmentView, definition: SequenceDefinition) -> list[RecipeValueView]:
    """The values of its runs, in the order of the definition; none where the machine has no points for them."""
    if not definition.recipe or not equipment.has(point_of(1)):
        return []
    last = last_of(definition, lambda key: (equipment.point(key).value, equipment.point(key).quality))
    found = []
    for number, one in enumerate(definition.recipe, 1):
        decimals = max(fmt.shortest(bound, one.decimals) for bound in (one.low, one.high))
        written = fmt.number(last[one.key], fmt.shortest(last[one.key], one.decimals), equipment.lang)
        point = equipment.point(point_of(number))
        found.append(
            RecipeValueView(
                one,
                equipment.words(one.label),
                fmt.unit_symbol(one.unit, equipment.text),
                point,
                written.replace(fmt.GROUP, ""),
                fmt.span(one.low, one.high, decimals, equipment.lang),
                point.usable,
            )
        )
    return found
