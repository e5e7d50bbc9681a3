"""interlocks.toml, checks.toml and ratings.toml: what must be true to start, what stops at any time, what must hold between setpoints, what
a device says of itself."""

from collections.abc import Collection, Iterator, Mapping

from app.plant.definitions import Command, Condition
from app.plant.said import said
from app.plant.tables import Table
from app.plant.type_files.sentences import Sentences, names_in, read_values


def read_guards(file: Table, sentences: Sentences) -> tuple[list[Condition], list[Condition]]:
    """`[permissives.…]` and `[interlocks.…]`."""
    permissives = [read_condition("permissive", key, table, sentences) for key, table in file.tables("permissives")]
    interlocks = [read_condition("interlock", key, table, sentences) for key, table in file.tables("interlocks")]
    file.done()
    return permissives, interlocks


def read_checks(file: Table, sentences: Sentences, setpoints: Collection[str]) -> list[Condition]:
    """Sentences over values of which at least one is a setpoint."""
    checks = [read_condition("check", key, table, sentences) for key, table in file.tables()]
    for check in checks:
        points = names_in(check.expression)
        if points is not None and points.isdisjoint(setpoints):
            file.note(f"{check.key}.expression", check.expression, said("mistake.over_setpoint"))
        if check.commands:
            file.note(f"{check.key}.commands", ", ".join(check.commands), said("mistake.no_commands"))
    return checks


def read_ratings(file: Table, sentences: Sentences) -> list[Condition]:
    """ratings.toml: what a device says of itself, against the options of the plant file."""
    return [read_condition("rating", key, table, sentences) for key, table in file.tables()]


def check_commands(
    file: Table, group: str, conditions: Collection[Condition], commands: Mapping[str, Command], owner: str
) -> None:
    """What a condition guards must be a command of the type."""
    for condition in conditions:
        for command in condition.commands:
            if command not in commands:
                file.note(f"{group}.{condition.key}.commands", command, said("mistake.command_of_type", owner=owner))
            elif commands[command].stop:
                file.note(f"{group}.{condition.key}.commands", command, said("mistake.stop_is_free"))


def _commands(table: Table) -> Iterator[str]:
    for index, command in enumerate(table.items("commands", [])):
        if isinstance(command, str):
            yield command
        else:
            table.note(f"commands.{index}", command, said("mistake.text"))


def read_condition(group: str, key: str, table: Table, sentences: Sentences) -> Condition:
    """One sentence with its texts, `<group>.<key>` and `missing.<group>.<key>`."""
    condition = Condition(
        key=key,
        label=table.text("label", f"{group}.{key}"),
        expression=table.text("expression"),
        commands=tuple(_commands(table)),
        missing="" if group == "check" else table.text("missing", f"missing.{group}.{key}"),
        values=read_values(table, sentences),
        situational=table.flag("situational"),
    )
    if condition.expression:
        sentences.add(table, "expression", condition.expression, argument=group not in ("check", "need"))
    table.done()
    return condition
