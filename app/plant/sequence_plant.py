"""What a sequence asks of other machines of the plant: points in its sentences, actions in the orders of its steps.

| subject | rule |
| --- | --- |
| `m1.speed` | any point of any machine that is a number; known only while it is good, so a bad or stale one fulfils nothing |
| orders | only of a sequence that this server runs, and only of machines that are simulated: in memory, or `simulated = true` |
| values of the run of another sequence | a number stands in this file and is checked with it; of the own run only what that one takes |
| sequences with a PLC of their own | command by themselves: their files give no orders |

A value of the own run is handed on only in the unit, the decimals and the range of the other sequence: nobody reaches through one
sequence what he may not set in the other. Values of a run have no right of their own, theirs is that of Start, which is the same for
every sequence: there is none to compare.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches

from app.plant.definitions import Argument, Equipment, Kind, Link, Plant, Point, Scan, Type
from app.plant.said import said
from app.plant.sequence_definition import PREFIX, RecipeValue, SequenceOrder
from app.plant.sequence_recipe import check_whole
from app.plant.tables import MISSING, Table, one_of, perhaps, span
from app.plant.type_files.orders import expected_action
from app.plant.type_files.sentences import check_choices


def own(names: Sequence[str] | frozenset[str]) -> list[str]:
    """Those of `names` that are points of the machine of a sequence itself."""
    return sorted(name for name in names if "." not in name)


def others(names: Sequence[str] | frozenset[str], but: Collection[str] = ()) -> list[str]:
    """Those of `names` that are points of any machine of the plant `but` these."""
    return sorted(name for name in names if "." in name and name.partition(".")[0] not in but)


def commanding(plant: Plant, machine: str) -> list[Equipment]:
    """Machines whose sequence gives orders to `machine`."""
    return [
        item
        for item in plant.equipment.values()
        if item.sequence and any(order.machine == machine for step in item.sequence.steps for order in step.orders)
    ]


def check_points(table: Table, key: str, text: str, names: Sequence[str], found: Mapping[str, Equipment]) -> None:
    """Note every one of `names`, `equipment.point` each, that the plant does not have as a number that is read in turn, or that is
    compared with a choice that it does not have."""
    check_choices(table, key, text, lambda name: _point_of(name, found) if name in names else None, machines=True)
    for name in names:
        machine, _, point = name.partition(".")
        item = found.get(machine)
        if item is None:
            table.note(key, text, said("mistake.points_of_plant", machine=machine, what=_near(machine, found)))
        elif point not in item.points:
            near = get_close_matches(point, list(item.points), n=1)
            meant = perhaps(f"{machine}.{near[0]}" if near else "")
            table.note(key, text, said("mistake.points_of", machine=machine, point=point, near=meant))
        elif item.points[point].kind is Kind.TEXT:
            table.note(key, text, said("mistake.point_is_text", point=name))
        elif item.points[point].scan in (Scan.PAGE, Scan.ONCE) and item.points[point].register is not None:
            table.note(key, text, said("mistake.point_is_rare", point=name))


def _point_of(name: str, found: Mapping[str, Equipment]) -> Point | None:
    """What `equipment.point` means in the plant; None when it means nothing."""
    machine, _, key = name.partition(".")
    return found[machine].points.get(key) if machine in found else None


def check_order(
    table: Table,
    order: SequenceOrder,
    item: Equipment,
    found: Mapping[str, Equipment],
    links: Mapping[str, Link],
    recipe: Sequence[RecipeValue] = (),
) -> None:
    """Note what is wrong with an order of the sequence `item`: where it runs, whom it commands, what, with which values."""
    if item.link in links and not links[item.link].simulated:
        table.note("machine", order.machine, said("mistake.own_plc", machine=item.id))
        return
    machine = found.get(order.machine)
    if machine is None or machine.id == item.id:
        known = sorted(id for id, other in found.items() if other.type.orders and id != item.id)
        table.note("machine", order.machine, said("mistake.takes_orders", known=one_of(known, order.machine)))
        return
    link = links.get(machine.link)
    if link is not None and not (link.simulated or link.believe_simulated):
        table.note("machine", order.machine, said("mistake.simulated", machine=item.id))
    elif link is not None and not link.may_write:
        table.note("machine", order.machine, said("mistake.may_write", link=link.name))
    action = machine.type.orders.get(order.action)
    if action is None:
        table.note("action", order.action, expected_action(machine.type.orders, machine.type.name, order.action))
        return
    for name in action.values:
        if name not in order.values:
            table.note(
                f"values.{name}", MISSING, said("mistake.needs", what=order.action, values=", ".join(action.values))
            )
    for name, value in order.values.items():
        if name not in (*action.values, *action.optional):
            values = one_of([*action.values, *action.optional], name)
            expected = said("mistake.value_of", action=order.action, known=values)
            table.note(f"values.{name}", value, expected)
    ends = {one.key: (one.low, one.high) for one in recipe}
    spans = {name: ends.get(order.recipe.get(name, ""), (value,)) for name, value in order.values.items()}
    for each in action.commands:
        command = machine.type.commands[each.command]
        if each.value in order.values:
            low, high = (_widest(machine, command.argument, end) for end in ("low", "high"))
            _check_range(table, each.value, spans[each.value], low, high, machine)
        for argument in command.arguments:
            if argument.name in order.values:
                value = order.values[argument.name]
                ends_of_it = spans[argument.name]
                _check_range(table, argument.name, ends_of_it, _number(argument.low), _number(argument.high), machine)
                if argument.name in each.optional:
                    _check_taken(table, argument, order, recipe, machine)
                if argument.type is not Type.F32 and argument.name in order.recipe:
                    table.note(
                        f"values.{argument.name}",
                        PREFIX + order.recipe[argument.name],
                        said("mistake.whole_no_run"),
                    )
                elif argument.type is not Type.F32 and not value.is_integer():
                    table.note(f"values.{argument.name}", value, said("mistake.whole"))
    for argument in action.arguments:
        if argument.name in order.values:
            _check_own(table, argument, order, recipe, machine, spans[argument.name])


def _check_own(
    table: Table,
    argument: Argument,
    order: SequenceOrder,
    recipe: Sequence[RecipeValue],
    machine: Equipment,
    ends: Sequence[float],
) -> None:
    """A value that the sentences of the action read: no command is there to refuse it later."""
    name, value = f"values.{argument.name}", order.values[argument.name]
    _check_range(table, argument.name, ends, _number(argument.low), _number(argument.high), machine)
    own = next((one for one in recipe if one.key == order.recipe.get(argument.name)), None)
    if argument.type is not Type.F32 and own is not None:
        check_whole(table, name, own)
    elif argument.type is not Type.F32 and not value.is_integer():
        table.note(name, value, said("mistake.whole"))


def _check_range(
    table: Table, name: str, values: Sequence[float], low: float | None, high: float | None, machine: Equipment
) -> None:
    """The widest range that there can be; narrower limits that are set in the drive are the gate's. `values`: one, or both ends."""
    wrong = [value for value in values if (low is not None and value < low) or (high is not None and value > high)]
    if wrong:
        ends = span("number", -math.inf if low is None else low, math.inf if high is None else high)
        table.note(f"values.{name}", wrong[0], said("mistake.for_machine", what=ends, machine=machine.id))


def _check_taken(
    table: Table, argument: Argument, order: SequenceOrder, recipe: Sequence[RecipeValue], machine: Equipment
) -> None:
    """A value for the run of another sequence: one with more decimals would be refused at its start, one in another unit misread."""
    value, name = order.values[argument.name], f"values.{argument.name}"
    own = next((one for one in recipe if one.key == order.recipe.get(argument.name)), None)
    takes = said("mistake.decimals", most=argument.decimals) if argument.decimals else said("mistake.in_whole")
    if own is not None and own.decimals > argument.decimals:
        expected = said("mistake.run_decimals", takes=takes, machine=machine.id, key=own.key, decimals=own.decimals)
        table.note(name, PREFIX + own.key, expected)
    elif own is not None and own.unit != argument.unit:
        units = [
            said("mistake.in_unit", unit=unit) if unit else said("mistake.no_unit")
            for unit in (argument.unit, own.unit)
        ]
        expected = said("mistake.run_unit", takes=units[0], machine=machine.id, key=own.key, unit=units[1])
        table.note(name, PREFIX + own.key, expected)
    elif own is None and round(value, argument.decimals) != value:
        table.note(name, value, said("mistake.number_as", takes=takes, machine=machine.id))


def _widest(machine: Equipment, key: str, end: str) -> float | None:
    """The bound of a point itself, else that of the setpoint: a number, or the bound of the point that it names."""
    own = getattr(machine.points[key], end) if key in machine.points else None
    setpoint = machine.type.setpoints.get(key)
    if own is not None or setpoint is None:
        return None if own is None else float(own)
    text = getattr(setpoint, end)
    if text in machine.points:
        bound = getattr(machine.points[text], end)
        return None if bound is None else float(bound)
    return _number(text)


def _number(text: str) -> float | None:
    """A limit that is a number; None = none, or one that the machine knows."""
    try:
        return float(text)
    except ValueError:
        return None


def _near(machine: str, found: Mapping[str, Equipment]) -> str:
    near = get_close_matches(machine, list(found), n=1)
    return perhaps(near[0] if near else "")
