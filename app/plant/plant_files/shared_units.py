"""Who has which unit of a line, and `base`: several machines behind one unit, each with its registers from its own base on.

What a machine has besides registers (a map of this house, a mailbox, drive parameters) has fixed addresses: it has its unit for itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from app.plant.definitions import Equipment, EquipmentType, Link, Point
from app.plant.said import said
from app.plant.tables import Table

LAST_ADDRESS = 0xFFFF
Place = tuple[str, int]
"""Table and address."""


def read_base(table: Table, kind: EquipmentType, link: Link | None) -> tuple[int, int]:
    """What is added to every address of the machine of this row; and by how much that grows from one to the next of `repeat`, 0 = each
    has the same on a unit of its own."""
    given = _given(table)
    if given and kind.device.services:
        table.note(given, table.raw(given), said("mistake.base_services", type=kind.name))
        for key in ("base", "base_step"):
            table.raw(key)  # it is told once
        return 0, 0
    base = int(table.whole("base", 0, 0, LAST_ADDRESS))
    step = int(table.whole("base_step", 0, 1, LAST_ADDRESS))
    if table.has("base_step") and not table.has("repeat"):
        table.note("base_step", step, said("mistake.base_step_repeat"))
    if given and link is not None and link.transport == "memory" and kind.simulation is None:
        table.note(given, table.raw(given), said("mistake.base_simulated"))
    return base, step


def _given(table: Table) -> str:
    """The key by which this row lets its machines begin elsewhere; empty = it does not."""
    if table.has("base"):
        return "base"
    return "base_step" if table.has("base_step") and table.has("repeat") else ""


def moved(point: Point, base: int) -> Point:
    """The point of a machine whose registers begin at `base`."""
    if point.register is None or not base:
        return point
    return replace(point, register=replace(point.register, address=point.register.address + base))


@dataclass(slots=True)
class _Unit:
    """Who has a unit so far."""

    first: Equipment
    based: bool = False
    """Whether one of them says `base`."""
    places: dict[Place, str] = field(default_factory=dict)
    """What they have → the name of its point."""


class Units:
    """The machines by line and unit, as far as the file is read."""

    def __init__(self) -> None:
        self._units: dict[tuple[str, int], _Unit] = {}

    def take(self, table: Table, item: Equipment, line: str) -> bool:
        """`item`, with its points, has its unit of `line`: for itself, or beside others where one says `base`. False = it cannot."""
        unit = self._units.setdefault((line, item.unit), _Unit(item))
        unit.based = unit.based or bool(_given(table))
        if unit.first is not item and (fault := _fault(item, unit, line)):
            table.note("unit", item.unit, fault)
            return False
        for place, name in _places(item) if unit.based else ():
            owner = unit.places.setdefault(place, name)
            if place[1] > LAST_ADDRESS or owner != name:
                end = said("mistake.base_end", point=name, last=LAST_ADDRESS)
                where = {"table": place[0], "address": f"0x{place[1]:04X}"}
                shared = said("mistake.base_free", point=name, other=owner, **where)
                table.note(_given(table) or "base", item.base, end if place[1] > LAST_ADDRESS else shared)
                return False
        return True


def _fault(item: Equipment, unit: _Unit, line: str) -> str:
    """Two links to one host and port reach the same units: one device would be two machines, each with its own control."""
    other = unit.first
    if other.link != item.link:
        return said("mistake.unit_taken_at", line=line, other=other.id, link=other.link)
    if not unit.based:
        return said("mistake.unit_taken", link=item.link, other=other.id)
    if _telegrams(item) != _telegrams(other):
        return said("mistake.base_device", other=other.id)
    unit.places = unit.places or dict(_places(other))
    return ""


def _telegrams(item: Equipment) -> object:
    """What of its device is that of the whole unit."""
    return replace(item.type.device, holes=(), write_only=())


def _places(item: Equipment) -> Iterator[tuple[Place, str]]:
    """Every register and bit that it has, with the name of a point there."""
    known = set[Place]()
    for point in item.points.values():
        register = point.register
        for address in range(register.address, register.address + register.words) if register else ():
            place = (register.table if register else "", address)
            if place not in known:  # parts of a word lie on it
                known.add(place)
                yield place, point.name
