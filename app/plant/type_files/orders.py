"""device.toml, `[actions.orders]`: what a sequence may have any machine of this type do through the gate."""

import re
from collections.abc import Iterator, Mapping, Sequence

from app.plant.actions import Action, ActionCommand
from app.plant.definitions import Argument, Command, Condition
from app.plant.said import said
from app.plant.tables import MISSING, Table, is_number, one_of
from app.plant.type_files.arguments import read_arguments
from app.plant.type_files.conditions import read_condition
from app.plant.type_files.names import KEY, NAME_EXPECTED
from app.plant.type_files.sentences import Sentences, names_in


def read_orders(table: Table, commands: Mapping[str, Command], sentences: Sentences) -> dict[str, Action]:
    """The declared actions by name. `table`: `[actions.orders]`."""
    return {name: _action(name, row, commands, sentences) for name, row in table.tables()}


def _action(name: str, row: Table, known: Mapping[str, Command], sentences: Sentences) -> Action:
    commands = tuple(_commands(name, row, known))
    arguments = tuple(_arguments(row, commands, sentences))
    given = [one.name for one in arguments]
    said_of = {key: row.text(key, "") for key in ("done", "failed", "stands", "armed")}
    for key, text in said_of.items():
        if text:
            sentences.add(row, key, text, given=given)
    plain = [key for key, command in known.items() if _may(command) and not (command.argument or command.arguments)]
    ways = [row.text(key, "", choices=plain) if row.has(key) else "" for key in ("suspend", "resume", "stop", "then")]
    if not said_of["done"]:
        for key in ("armed", "then", "suspend", "stands"):
            if row.has(key):
                row.note("done", MISSING, said("mistake.needs_done", key=key))
        if said_of["failed"]:
            row.note("done", MISSING, said("mistake.done"))
    for key in ("done", "failed", "armed", "stands"):
        names = names_in(said_of[key], machines=True) if said_of[key] else None
        if names is not None and not names - set(given):
            row.note(key, said_of[key], said("mistake.over_point"))
    if said_of["failed"] and said_of["failed"] == said_of["done"]:
        row.note("failed", said_of["failed"], said("mistake.another_sentence"))
    read = {name for text in said_of.values() for name in (names_in(text, machines=True) if text else None) or ()}
    for index, one in enumerate(arguments):
        if one.name not in read:
            row.note(f"arguments.{index}.name", one.name, said("mistake.argument_read"))
    if said_of["stands"] and not ways[0]:
        row.note("suspend", MISSING, said("mistake.both_or_none", first="stands", second="suspend"))
    if bool(ways[0]) != bool(ways[1]):
        row.note(
            "resume" if ways[0] else "suspend", MISSING, said("mistake.both_or_none", first="suspend", second="resume")
        )
    needs = tuple(_needs(row, sentences))
    label = row.text("label", "")
    row.done()
    return Action(
        name, commands, said_of["done"], said_of["failed"], suspend=ways[0], resume=ways[1], stands=said_of["stands"],
        stop=ways[2], then=ways[3], armed=said_of["armed"], arguments=arguments, needs=needs, label=label,
    )  # fmt: skip


def _arguments(row: Table, commands: Sequence[ActionCommand], sentences: Sentences) -> Iterator[Argument]:
    """Values for the sentences of the action itself: a step is held against their limits when it is read, so these are numbers."""
    taken = {name for each in commands for name in (each.value, *each.arguments)}
    for index, one in enumerate(read_arguments(row, sentences)):
        if one.name in taken:
            row.note(f"arguments.{index}.name", one.name, said("mistake.argument_name"))
        for bound in ("low", "high"):
            if not is_number(given := row.data["arguments"][index].get(bound)):
                row.note(f"arguments.{index}.{bound}", MISSING if given is None else given, said("mistake.number"))
        low, high = (row.data["arguments"][index].get(bound) for bound in ("low", "high"))
        if is_number(low) and is_number(high) and low > high:
            row.note(f"arguments.{index}.low", low, said("mistake.pair", pair="low, high", order="low <= high"))
        yield one


def _needs(row: Table, sentences: Sentences) -> Iterator[Condition]:
    for key, table in row.tables("needs"):
        if not re.fullmatch(KEY, key):
            table.note("", key, NAME_EXPECTED)
        need = read_condition("need", key, table, sentences)
        if need.commands:
            table.note("commands", ", ".join(need.commands), said("mistake.no_commands"))
        yield need


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
