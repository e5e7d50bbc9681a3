"""What is no mistake in the files of a type and seldom meant: told by `pogon check` as a warning, and taken as it is."""

import re
from collections.abc import Iterator, Mapping

from app import bundled
from app.errors import ConfigurationError
from app.plant import expression
from app.plant.definitions import Command, EquipmentType
from app.plant.said import Plain, said
from app.plant.tables import Table
from app.plant.type_files.data import TypeData
from app.plant.type_files.registers import WORDS
from app.plant.type_files.simulation import FILE as SIMULATION

MOST_NAMED = 4
"""Commands that one line names."""


def doubt_type(data: TypeData, files: Mapping[str, Table], *, own: bool) -> None:
    """Tell what is seldom meant, each where it stands in one of the `files` by name; `own`: it lies in a plant folder, so that nothing but
    its files uses its options."""
    kind = data.type
    _stop(kind, files)
    if not kind.device.services:
        _unwritten(kind, files)
    if kind.simulation:
        _never_confirmed(kind, files)
    if own:
        _unused_options(data, files)
        _unseen_acts(kind, files)


def _stop(kind: EquipmentType, files: Mapping[str, Table]) -> None:
    """Somebody can have it move, and nobody can have it stand by the one command that is always there."""
    moving = [command.key for command in kind.commands.values() if command.moves and not command.stop]
    if moving and not any(command.stop for command in kind.commands.values()):
        named = ", ".join(moving[:MOST_NAMED]) + (" …" if len(moving) > MOST_NAMED else "")
        files["commands.toml"].doubt(f"{moving[0]}.moves", Plain("true"), said("mistake.doubt_stop", commands=named))


def _unwritten(kind: EquipmentType, files: Mapping[str, Table]) -> None:
    """What is only written, and by nothing."""
    written = {write.point for command in kind.commands.values() for write in (*command.writes, *command.release)}
    for key, point in kind.points.items():
        register = point.register
        if register and not register.readable and key not in written and key not in kind.setpoints:
            files["points.toml"].doubt(f"{key}.readable", Plain("false"), said("mistake.doubt_unwritten", point=key))


def _never_confirmed(kind: EquipmentType, files: Mapping[str, Table]) -> None:
    """The simulated machine never says what a command waits for."""
    simulation = kind.simulation
    assert simulation
    changed = {key for row in simulation.writes for key in row.set} | set(simulation.values)
    changed |= {key for rule in simulation.rules for key in rule.set}
    places = {place for key in changed for place in _places(kind, key)}
    for command in kind.commands.values():
        names = _names(command)
        known = all(name in kind.points and kind.points[name].register for name in names)
        written = {place for write in command.writes for place in _places(kind, write.point)}
        if names and known and not any(place in places | written for name in names for place in _places(kind, name)):
            expected = said("mistake.doubt_confirmed", file=SIMULATION, points=", ".join(sorted(names)))
            files["commands.toml"].doubt(f"{command.key}.feedback", command.feedback, expected)


def _names(command: Command) -> frozenset[str]:
    try:
        return expression.parse(command.feedback).names if command.feedback else frozenset()
    except ConfigurationError:
        return frozenset()


def _places(kind: EquipmentType, key: str) -> Iterator[tuple[str, int]]:
    point = kind.points.get(key)
    register = point.register if point else None
    for at in range(max(register.words, WORDS[register.type]) if register else 0):
        yield (register.table, register.address + at) if register else ("", at)


def _unused_options(data: TypeData, files: Mapping[str, Table]) -> None:
    """What a plant file may say and nothing asks for."""
    texts = [text for table in files.values() for text in _texts(table.data)]
    for option in data.type.ranges:
        if not any(re.search(rf"\b{re.escape(option)}\b", text) for text in texts):
            files["device.toml"].doubt(f"options.{option}", option, said("mistake.doubt_option", option=option))


def _unseen_acts(kind: EquipmentType, files: Mapping[str, Table]) -> None:
    """What an instructor could do with the hand, and no template offers."""
    if (bundled("templates") / "screens" / kind.name / "hands.html").is_file():
        return
    for group, keys in (("acts", kind.training.acts), ("switches", kind.training.switches)):
        for key in keys:
            files["training.toml"].doubt(f"{group}.{key}", key, said("mistake.doubt_hands", group=group))


def _texts(value: object) -> Iterator[str]:
    """Every text in it, keys aside."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from _texts(each)
    elif isinstance(value, list):
        for each in value:
            yield from _texts(each)
