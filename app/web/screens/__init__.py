"""What an equipment type brings to its screens in Python, found by the name of the type: `screens/<type>.py`, which most do not need.

Such a module may hold

| name | what it is |
| --- | --- |
| `NAMES` | what templates everywhere get, by name |
| `check_asked` | (machine, command, what is given): refuses a dialog for what is not there |
| `row_name` | (machine, table, row): what a row of a table is called |
| `in_words`, `TOGETHER` | (machine, arguments): what some of them mean together; which they are |
"""

from collections.abc import Collection, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from app.plant.definitions import Command
from app.web.points import EquipmentView
from app.web.tables import RowName, RowView

_MODULES: Mapping[str, ModuleType] = {
    found.name: import_module(f"{__name__}.{found.name}") for found in iter_modules(__path__)
}


def template_names() -> dict[str, Any]:
    """What all of them give to templates."""
    return {name: value for module in _MODULES.values() for name, value in getattr(module, "NAMES", {}).items()}


def check_asked(machine: EquipmentView, command: Command, given: Mapping[str, str]) -> None:
    """Whether there is what `command` is asked for, as far as the type of `machine` can tell.

    Raises:
        Refused: there is not; with the status of the answer.
    """
    check = getattr(_MODULES.get(machine.type), "check_asked", None)
    if check:
        check(machine, command, given)


def in_words(machine: EquipmentView, arguments: Mapping[str, float]) -> tuple[str, Collection[str]]:
    """Arguments of a command that mean one thing together: its name, and which they are; empty when the type knows nothing of them."""
    words = getattr(_MODULES.get(machine.type), "in_words", None)
    text: str = words(machine, arguments) if words else ""
    return text, getattr(_MODULES.get(machine.type), "TOGETHER", ()) if text else ()


def row_name(machine: EquipmentView, table: str, row: RowView) -> RowName:
    """What a row of a table is called; its number when the type has no name for it."""
    name = getattr(_MODULES.get(machine.type), "row_name", None)
    found: RowName = name(machine, table, row) if name else RowName(f"#{row.id}", "", row.id)
    return found
