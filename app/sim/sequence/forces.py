"""The rows of forces: which force has which place, who asked for it and for how long."""

from collections.abc import Container

from app.sim.plc import Table


class ForceRows:
    """Places of a table; a force keeps its own as long as it is there. An id is step · 16 + bit + 1."""

    def __init__(self, table: Table) -> None:
        """Over the `table` that the host reads."""
        self._table = table
        self._asked: dict[int, tuple[int, int]] = {}

    @property
    def ids(self) -> list[int]:
        """Ids by place, 0 = free."""
        return self._table.ids

    @property
    def full(self) -> bool:
        """Whether no place is free."""
        return 0 not in self._table.ids

    def asked(self, id: int) -> tuple[int, int]:
        """For how long it was asked [s], and by which owner; zeros when nobody knows any more."""
        return self._asked.get(id, (0, 0))

    def take(self, id: int, seconds: float, owner: int) -> None:
        """A force is there, for so long [s]; a new one gets the first free place."""
        if id not in self._table.ids:
            self._table.take(id)
        self._asked[id] = (round(seconds), owner)

    def keep(self, held: Container[int]) -> None:
        """Free the places of all that are not among `held`."""
        for slot, id in enumerate(self._table.ids):
            if id and id not in held:
                self._table.free(slot)
                self._asked.pop(id, None)

    def clear(self) -> None:
        """Nobody asked for anything."""
        self._asked = {}
