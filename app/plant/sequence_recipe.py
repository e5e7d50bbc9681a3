"""Values of a run (recipe values) of a sequence file: what an operator gives at Start, fixed until the run is over.

    [[recipe]]                                          up to four, in the order in which Start takes them
    key = "frequency"
    label = { hr = "Frekvencija", en = "Frequency", de = "Frequenz", cs = "Frekvence" }
    unit = "Hz"
    decimals = 1
    minimum = 5.0
    maximum = 50.0
    default = 30.0                                      before the first run; then the values of the last one

`recipe.<key>` stands for the value in place of a time of a step (`minimum`, `maximum`), of a value of an order, of the count of a loop
(`times`; whole numbers only), and as a name in the sentences of permissives and abort conditions. Whatever is checked of a number is
checked of both ends of its range.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from app.plant import expression
from app.plant.actions import Action
from app.plant.definitions import Argument, Command, Condition, Equipment, Point, Texts
from app.plant.said import said
from app.plant.sequence_definition import PREFIX, RecipeValue, SequenceDefinition
from app.plant.tables import Table, is_number, one_of, span
from app.plant.type_files.names import KEY, KEY_EXPECTED

ReadLabel = Callable[[Table, str], Texts]
MOST_VALUES = 4
"""As many arguments as a command takes."""
START = "start"
COUNT = "recipe_count"
"""Point: how many values of a run the device takes."""
TAKEN = ("step", "bit", "override")
"""Names that arguments of a sequence have already."""


def read_recipe(root: Table, label: ReadLabel) -> tuple[RecipeValue, ...]:
    """`[[recipe]]` of a sequence file; notes everything that cannot be."""
    found: list[RecipeValue] = []
    for index, row in enumerate(root.rows("recipe")):
        key = row.text("key", pattern=KEY, expected=KEY_EXPECTED)
        if index == MOST_VALUES:
            row.note("key", key, said("mistake.values_of_run", most=MOST_VALUES))
        if key in (one.key for one in found):
            row.note("key", key, said("mistake.run_key_twice"))
        elif key in expression.RESERVED or key in TAKEN:
            row.note("key", key, said("mistake.run_key_taken", taken=", ".join(TAKEN)))
        low, high = float(row.number("minimum")), float(row.number("maximum"))
        usable = all(is_number(row.data.get(name)) for name in ("minimum", "maximum"))  # else it is told already
        if low >= high:
            if usable:
                row.note("maximum", row.data["maximum"], said("mistake.more_than", low=f"{low:g}"))
            high = low + 1
        default = float(row.number("default"))
        if not low <= default <= high:
            if usable and is_number(row.data.get("default")):
                row.note("default", row.data["default"], span("number", low, high))
            default = low
        text = label(row, "label")
        found.append(RecipeValue(key, text, low, high, default, row.text("unit", ""), row.whole("decimals", 1, 0, 6)))
        row.done()
    return tuple(found[:MOST_VALUES])


def named(table: Table, key: str, known: Sequence[RecipeValue]) -> RecipeValue | None:
    """The value of a run that `key` of `table` names in place of a number; None = it names none, noted when it means one."""
    given = table.data.get(key)
    if not refers(given):
        return None
    table.raw(key)
    found = next((one for one in known if given == PREFIX + one.key), None)
    if found is None:
        names = [PREFIX + one.key for one in known]
        known_names = one_of(names, given) if names else said("mistake.no_recipe")
        table.note(key, given, said("mistake.number_or", what=known_names))
    return found


def refers(given: object) -> bool:
    """Whether `given` is meant as the name of a value of a run."""
    return isinstance(given, str) and given.startswith(PREFIX)


def check_time(table: Table, key: str, value: RecipeValue, most: float) -> None:
    """Note a value of a run that no time of a step can be."""
    if not (value.low >= 0 and value.high <= most):
        ends = {"low": f"{value.low:g}", "high": f"{value.high:g}"}
        table.note(key, PREFIX + value.key, said("mistake.run_time", most=f"{most:g}", **ends))


def check_count(table: Table, key: str, value: RecipeValue, most: int) -> None:
    """Note a value of a run that cannot be how often something is done: whole numbers from 1."""
    if check_whole(table, key, value) and not (value.low >= 1 and value.high <= most):
        ends = {"low": f"{value.low:g}", "high": f"{value.high:g}"}
        table.note(key, PREFIX + value.key, said("mistake.run_count", most=most, **ends))


def check_whole(table: Table, key: str, value: RecipeValue) -> bool:
    """Whether a value of a run is always a whole number; noted when not."""
    if not value.decimals and all(one.is_integer() for one in (value.low, value.high, value.default)):
        return True
    ends = {"low": f"{value.low:g}", "high": f"{value.high:g}", "default": f"{value.default:g}"}
    table.note(key, PREFIX + value.key, said("mistake.run_whole", decimals=value.decimals, **ends))
    return False


def check_names(table: Table, key: str, text: str, names: Sequence[str], known: Sequence[RecipeValue]) -> None:
    """Note values of a run that a sentence names and the file does not have."""
    for name in names:
        if name not in (PREFIX + one.key for one in known):
            have = one_of([PREFIX + one.key for one in known], name) if known else said("mistake.none_in_file")
            table.note(key, text, said("mistake.run_values", name=name, known=have))


def with_recipe(item: Equipment) -> Equipment:
    """`item` with a Start that takes the values of its run, and points that are called as they are; itself when it has none."""
    values = item.sequence.recipe if item.sequence else ()
    if not values or START not in item.type.commands:
        return item
    start: Command = replace(item.type.commands[START], arguments=tuple(_argument(item, value) for value in values))
    takes = Condition(
        "recipe_taken",
        "screen.recipe_taken",
        f"{COUNT} == {len(values)}",
        (START,),
        "screen.recipe_missing",
    )
    type = replace(
        item.type,
        commands={**item.type.commands, START: start},
        permissives=(*item.type.permissives, takes),
        orders={key: _giving(action, tuple(one.key for one in values)) for key, action in item.type.orders.items()},
    )
    points = dict(item.points)
    for number, value in enumerate(values, 1):
        points[point_of(number)] = _called(item, points[point_of(number)], value)
    return replace(item, type=type, points=points)


def point_of(number: int) -> str:
    """The point that shows value `number` of a run, from 1."""
    return f"recipe_{number}"


def texts_of(items: Mapping[str, Equipment]) -> Iterator[tuple[str, Texts]]:
    """Key → label of every value of a run of the plant, as its arguments and points ask for them."""
    for item in items.values():
        for value in item.sequence.recipe if item.sequence else ():
            yield _label(item, value), value.label


def last_of(definition: SequenceDefinition, look: expression.Look) -> dict[str, float]:
    """What a start takes that nobody gives values for: those of the last run as the device says, else the defaults."""
    found: dict[str, float] = {}
    for number, value in enumerate(definition.recipe, 1):
        known = look(point_of(number))[0]
        usable = isinstance(known, int | float) and value.low <= known <= value.high
        found[value.key] = float(known) if usable and known is not None else value.default
    return found


def _argument(item: Equipment, value: RecipeValue) -> Argument:
    return Argument(
        value.key, low=f"{value.low!r}", high=f"{value.high!r}", unit=value.unit, decimals=value.decimals,
        label=_label(item, value),
    )  # fmt: skip


def _giving(action: Action, keys: tuple[str, ...]) -> Action:
    """`action`, with which a step of another sequence may give the values of the run if it starts one."""
    commands = (replace(each, optional=keys) if each.command == START else each for each in action.commands)
    return replace(action, commands=tuple(commands))


def _called(item: Equipment, point: Point, value: RecipeValue) -> Point:
    return replace(point, label=_label(item, value), unit=value.unit, decimals=value.decimals)


def _label(item: Equipment, value: RecipeValue) -> str:
    return f"recipe.{item.sequence.name if item.sequence else item.id}.{value.key}"
