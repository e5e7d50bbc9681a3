"""What devices did and servers sent, set against what people asked for."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from app.plant.definitions import Command, Equipment
from app.registers import plc_map
from app.sim.eura_e800.drive import VirtualE800
from app.sim.sinamics.drive import VirtualSinamics
from tests.storm.world import World


@dataclass(frozen=True)
class Account:
    """One thing that a machine does when it is asked."""

    machine: str
    what: str
    count: int
    """How often it was done (a PLC) or sent (a drive)."""
    keys: Counter[str]
    """Command or setpoint → how often one order of it may do it."""


def accounts(world: World) -> Iterator[Account]:
    """Everything but Stop, which may be repeated."""
    plant = None if world.down else world.runtime.plant
    if plant is None:
        return
    taken = Counter((one.machine, one.code) for one in world.done if one.taken)
    for (machine, code), count in taken.items():
        item = plant.equipment.get(machine)
        if item is None:
            continue
        keys = Counter(key for key, command in item.type.commands.items() if command.code == code)
        if code == plc_map.COMMIT_SETTINGS:
            keys = Counter(list(item.type.setpoints))
        if keys and not any(item.type.commands[key].stop for key in keys if key in item.type.commands):
            yield Account(machine, f"did code {code}", count, keys)
    sent = Counter((one.machine, one.address, one.words) for one in world.line.sent if one.function == 6)
    for item in plant.equipment.values():
        if isinstance(world.devices.get(item.id), VirtualE800 | VirtualSinamics):
            yield from _of_drive(item, sent)


def _of_drive(item: Equipment, sent: Counter[tuple[str, int, tuple[int, ...]]]) -> Iterator[Account]:
    stops = set(_written(item, [c for c in item.type.commands.values() if c.stop]))
    stops |= {
        (point, value)
        for point, value in _written(item, item.type.commands.values(), release=True)
        if value not in ("previous", "argument")
    }
    fixed: dict[tuple[int, int], Counter[str]] = {}
    free: dict[int, Counter[str]] = {}
    for command in item.type.commands.values():
        for address, value in _written(item, [command]):
            if (address, value) in stops:
                continue
            if value.isdigit():
                fixed.setdefault((address, int(value)), Counter())[command.key] += 1
            else:
                free.setdefault(address, Counter())[command.key] += 1
        for address, value in _written(item, [command], release=True):
            if (address, value) not in stops:
                free.setdefault(address, Counter())[command.key] += 1
    for key in item.type.setpoints:
        register = item.points[key].register
        if register is not None:
            free.setdefault(register.address, Counter())[key] += 1
    for (address, value), keys in fixed.items():
        count = sum(n for (m, at, words), n in sent.items() if (m, at, words) == (item.id, address, (value,)))
        yield Account(item.id, f"was sent {value} to {address:#06x}", count, keys)
    for address, keys in free.items():
        count = sum(n for (m, at, _), n in sent.items() if (m, at) == (item.id, address))
        yield Account(item.id, f"was sent something to {address:#06x}", count, keys)


def _written(item: Equipment, commands: "list[Command] | object", release: bool = False) -> Iterator[tuple[int, str]]:
    for command in commands:  # type: ignore[attr-defined]
        for write in command.release if release else command.writes:
            register = item.points[write.point].register
            if register is not None:
                yield register.address, write.value
