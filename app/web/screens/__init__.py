"""What an equipment type brings to its screens in Python, found by the name of the type: `screens/<type>.py`, which most do not need.

Such a module may hold

| name | what it is |
| --- | --- |
| `NAMES` | what templates everywhere get, by name |
| `check_asked` | (machine, command, what is given): refuses a dialog for what is not there |
| `row_name` | (machine, table, row): what a row of a table is called |
| `in_words`, `TOGETHER` | (machine, arguments): what some of them mean together; which they are |
| `PAGES` | page → (permission, work): work takes what the address asks and gives what the page gets as `worked`; pure, in a thread |
"""

import asyncio
from collections.abc import Collection, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from app.access.roles import Person
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


async def worked(kind: str, page: str, person: Person | None, asked: Mapping[str, str]) -> Any:
    """What the work of a page of the type `kind` gives for what its address asks; None when it has none, or `person` may not.

    The work runs in a thread, so that it holds up nobody.
    """
    permission, work = getattr(_MODULES.get(kind), "PAGES", {}).get(page, ("", None))
    if work is None or person is None or not person.may(permission):
        return None
    return await asyncio.to_thread(work, asked)
