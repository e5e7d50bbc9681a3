"""The machines on one link, by name: unknown ones are an error that names what there is."""

from collections.abc import Iterable, Sequence

from app.errors import LinkError
from app.plant.definitions import Equipment, Point


class Machines:
    """What is read and written over one link."""

    def __init__(self, link: str, equipment: Iterable[Equipment]) -> None:
        self._link = link
        self._items = {item.id: item for item in equipment}

    def take(self, equipment: Iterable[Equipment]) -> None:
        """These are on it from now on."""
        self._items = {item.id: item for item in equipment}

    @property
    def all(self) -> Sequence[Equipment]:
        """In the order of the plant file."""
        return list(self._items.values())

    def get(self, id: str) -> Equipment | None:
        """The machine `id`, None when it is not here."""
        return self._items.get(id)

    def named(self, id: str) -> Equipment:
        """The machine `id`.

        Raises:
            LinkError: it is not on this link.
        """
        try:
            return self._items[id]
        except KeyError:
            raise LinkError(f"link {self._link}: no equipment {id}, expected one of {list(self._items)}") from None

    def point(self, item: Equipment, key: str) -> Point:
        """The point `key` of a machine.

        Raises:
            LinkError: it has no such point.
        """
        try:
            return item.points[key]
        except KeyError:
            raise LinkError(f"{item.id} has no point {key}") from None


def by_unit(equipment: Iterable[Equipment]) -> dict[int, list[Equipment]]:
    """Machines by their unit, in its order; several may share one."""
    found: dict[int, list[Equipment]] = {}
    for item in sorted(equipment, key=lambda item: item.unit):
        found.setdefault(item.unit, []).append(item)
    return found


def wiring(equipment: Iterable[Equipment]) -> list[object]:
    """All of these machines that matters to who reads them."""
    return [(item.id, item.type.name, item.type.device, dict(item.points), dict(item.tables)) for item in equipment]
