"""device.toml, `[actions.orders]`: what a sequence may have any machine of this type do through the gate."""

import re
from collections.abc import Iterator, Mapping

from app.plant.actions import Action, ActionCommand
from app.plant.definitions import Command
from app.plant.said import said
from app.plant.tables import MISSING, Table, one_of
from app.plant.type_files.names import KEY, NAME_EXPECTED
from app.plant.type_files.sentences import Sentences


def read_orders(table: Table, commands: Mapping[str, Command], sentences: Sentences) -> dict[str, Action]:
    """The declared actions by name. `table`: `[actions.orders]`."""
    return {name: _action(name, row, commands, sentences) for name, row in table.tables()}


def _action(name: str, row: Table, known: Mapping[str, Command], sentences: Sentences) -> Action:
    commands = tuple(_commands(name, row, known))
    done, failed, stands = (row.text(key, "") for key in ("done", "failed", "stands"))
    for key, text in (("done", done), ("failed", failed), ("stands", stands)):
        if text:
            sentences.add(row, key, text)
    plain = [key for key, command in known.items() if _may(command) and not (command.argument or command.arguments)]
    ways = [row.text(key, "", choices=plain) if row.has(key) else "" for key in ("suspend", "resume", "stop")]
    if failed and not done:
        row.note("done", MISSING, said("mistake.done"))
    if bool(ways[0]) != bool(ways[1]):
        row.note(
            "resume" if ways[0] else "suspend", MISSING, said("mistake.both_or_none", first="suspend", second="resume")
        )
    row.done()
    return Action(name, commands, done, failed, suspend=ways[0], resume=ways[1], stands=stands, stop=ways[2])


def _commands(name: str, row: Table, known: Mapping[str, Command]) -> Iterator[ActionCommand]:
    if not re.fullmatch(KEY, name):
        row.note("", name, NAME_EXPECTED)
    if not row.data.get("commands"):
        row.note("commands", MISSING, said("mistake.at_least_one", what="{ command = … }"))
    may = [key for key, command in known.items() if _may(command)]
    for each in row.rows("commands"):
        key, value = each.text("command", choices=may), each.text("value", "", pattern=KEY, expected=NAME_EXPECTED)
        argument = known[key].argument if key in known else ""
        if key in known and bool(argument) != bool(value):
            expected = said(f"mistake.{'name_for' if argument else 'no_value'}", command=key)
            each.note("value", value or MISSING, expected)
        each.done()
        yield ActionCommand(key, value, tuple(one.name for one in known[key].arguments) if key in known else ())


def _may(command: Command) -> bool:
    """Whether an operator may ask it with a click, and perhaps numbers."""
    return command.role == "operator" and not (command.hold or command.needs_reason)


def expected_action(actions: Mapping[str, Action], type: str, name: str) -> str:
    """What an order should have named."""
    return said("mistake.action_of", type=type, known=one_of(sorted(actions), name))
