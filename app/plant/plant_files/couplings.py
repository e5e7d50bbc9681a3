"""Which machine a sequence uses: its definition asks for what only that machine can give."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from app.plant.definitions import Equipment, Link
from app.plant.plant_files.machines import Machines, NamedMachine
from app.plant.said import said
from app.plant.sequences import FOLDER, SequenceFiles
from app.plant.tables import MISSING, Table, one_of


def couple(machines: Machines, sequences: SequenceFiles, links: Mapping[str, Link], rows: Mapping[str, object]) -> None:
    """Give every sequence its machine, and judge its definition by it. `rows`: `[equipment]` of the plant file."""
    for id, named in machines.named.items():
        if named.table.data.get("machine", "") == named.name:  # else it is told already
            _couple(id, named, machines, sequences, links, rows)


def _broken(found: Mapping[str, Equipment], rows: Mapping[str, object]) -> list[str]:
    """Machines of the plant file that are not built because of mistakes, which are told."""
    return [name for name in rows if name not in found and not _repeated(name, found)]


def _repeated(name: str, found: Mapping[str, Equipment]) -> bool:
    return any(key.startswith(f"{name}_") for key in found)


def _couple(
    id: str,
    named: NamedMachine,
    machines: Machines,
    sequences: SequenceFiles,
    links: Mapping[str, Link],
    rows: Mapping[str, object],
) -> None:
    item, machine = machines.found[id], _machine(id, named, machines.found)
    if named.name and machine is None:
        _note_unknown(id, named, machines.found, rows)
        return
    if machine is not None:
        if machine.type.sequence:
            named.table.note("machine", named.name, said("mistake.no_sequence"))
            return
        if not _fits(item, machine, named, links):
            return
        machines.found[id] = replace(item, machine=machine.id)
    forgotten = machine is None and item.link in links and links[item.link].simulated
    unread = sequences.unread_without_machine(item) if forgotten else []
    if unread and named.number <= 1:
        _note_forgotten(named.table, unread)
    sequences.check(item, machine, forgotten=bool(unread))
    sequences.check_plant(machines.found[id], machines.found, links, _broken(machines.found, rows))


def _machine(id: str, named: NamedMachine, found: Mapping[str, Equipment]) -> Equipment | None:
    """Of repeated ones each has its own."""
    own = found.get(named.name + id.removeprefix(named.table.path[-1])) if named.number else None
    return own or found.get(named.name)


def _note_unknown(id: str, named: NamedMachine, found: Mapping[str, Equipment], rows: Mapping[str, object]) -> None:
    if named.name not in rows:  # else its own mistakes are told
        known = sorted(key for key, other in found.items() if not other.type.sequence)
        named.table.note("machine", named.name, said("mistake.equipment_known", known=one_of(known, named.name)))
    elif _repeated(named.name, found):
        expected = said("mistake.repeated_machine", machine=named.name, id=id)
        named.table.note("machine", named.name, expected)


def _fits(item: Equipment, machine: Equipment, named: NamedMachine, links: Mapping[str, Link]) -> bool:
    """Whether `machine` is of a kind that the sequence can have; else that alone is told, not each condition that it cannot answer."""
    steps = item.sequence.steps if item.sequence else ()
    if not machine.type.actions and any(step.actions for step in steps):
        expected = said("mistake.takes_actions", type=machine.type.name)
        named.table.note("machine", named.name, expected)
        return False
    if {item.link, machine.link} <= set(links) and links[item.link].simulated != links[machine.link].simulated:
        named.table.note("machine", named.name, said("mistake.simulated_like"))
    return True


def _note_forgotten(table: Table, unread: Sequence[str]) -> None:
    """A simulated sequence without a machine asks for what only a machine could answer, at the keys `unread`."""
    more = said("mistake.and_more", number=len(unread) - 1) if len(unread) > 1 else ""
    file = f"{FOLDER}/{table.data['definition']}.toml"
    table.note("machine", MISSING, said("mistake.forgotten", key=unread[0], more=more, file=file))
