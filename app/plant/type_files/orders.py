"""device.toml, `[actions.orders]`: what a sequence may have any machine of this type do through the gate."""

import re
from collections.abc import Iterator, Mapping

from app.plant.actions import Action, ActionCommand
from app.plant.definitions import Command
from app.plant.tables import MISSING, Table, one_of
from app.plant.type_files.names import KEY, NAME_EXPECTED


def read_orders(table: Table, commands: Mapping[str, Command]) -> dict[str, Action]:
    """The declared actions by name. `table`: `[actions.orders]`."""
    return {name: Action(name, tuple(_commands(name, row, commands))) for name, row in table.tables()}


def _commands(name: str, row: Table, known: Mapping[str, Command]) -> Iterator[ActionCommand]:
    if not re.fullmatch(KEY, name):
        row.note("", name, NAME_EXPECTED)
    if not row.data.get("commands"):
        row.note("commands", MISSING, "at least one { command = … }")
    may = [key for key, command in known.items() if _may(command)]
    for each in row.rows("commands"):
        key, value = each.text("command", choices=may), each.text("value", "", pattern=KEY, expected=NAME_EXPECTED)
        argument = known[key].argument if key in known else ""
        if key in known and bool(argument) != bool(value):
            expected = f"a name for what {key} is given" if argument else f"no value: {key} takes none"
            each.note("value", value or MISSING, expected)
        each.done()
        yield ActionCommand(key, value)
    row.done()


def _may(command: Command) -> bool:
    """Whether an operator may ask it with a click, and at most one number."""
    return command.role == "operator" and not (command.hold or command.needs_reason or command.arguments)


def expected_action(actions: Mapping[str, Action], type: str, name: str) -> str:
    """What an order should have named."""
    return f"an action of {type}: {one_of(sorted(actions), name)}"
