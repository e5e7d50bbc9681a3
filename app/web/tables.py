"""Tables of a device (fixed slots, each with an identity of its own) as rows.

A row exists while its `id` is not 0. Which rows there are and in which order is decided when they are drawn; they are fetched again
when an identity appears or goes (`part_at` in templates/macros/frame.html), the cells are live by themselves.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from app.web.points import EquipmentView, PointView

ID = "id"
"""Column that says whose row it is; 0 = nobody's."""


@dataclass(frozen=True, slots=True)
class RowView:
    """One occupied slot."""

    slot: int
    """From 1."""
    id: int
    cells: Mapping[str, PointView]
    """By column."""

    def __getitem__(self, column: str) -> PointView:
        return self.cells[column]

    def has(self, column: str) -> bool:
        """Whether the table has the column."""
        return column in self.cells

    def number(self, column: str) -> float | None:
        """Value of a cell, or None when there is none to rely on."""
        cell = self.cells.get(column)
        return float(cell.value) if cell and cell.usable and isinstance(cell.value, int | float) else None


@dataclass(frozen=True, slots=True)
class RowName:
    """What a row is called."""

    label: str
    where: str
    """Where in the machine that is."""
    number: int
    """Under which the records of its kind have it."""


class TableView:
    """A table of a machine as it stands."""

    def __init__(self, equipment: EquipmentView, key: str) -> None:
        self.equipment = equipment
        self.key = key
        self.slots = range(1, equipment.equipment.tables[key] + 1)
        self.columns = tuple(equipment.equipment.type.tables[key].columns)

    def name(self, slot: int, column: str) -> str:
        """Tag of a cell."""
        return f"{self.equipment.id}.{self.key}_{slot}_{column}"

    def names(self, slot: int, *columns: str) -> str:
        """Tags of some cells of a row, as `data-tags` takes them."""
        return " ".join(self.name(slot, column) for column in columns if column in self.columns)

    @property
    def watched(self) -> str:
        """Tags that say that rows came or went, as `data-tags` takes them."""
        return f"{self.equipment.id}.{self.key}_generation {self.identities}"

    @property
    def identities(self) -> str:
        """Tags that say whose rows they are, as `data-tags` takes them; of a table that does not count its changes these alone."""
        return " ".join(self.names(slot, ID, "state") for slot in self.slots)

    @property
    def rows(self) -> list[RowView]:
        """Occupied slots, in the order of the slots."""
        machine, found = self.equipment, []
        for slot in self.slots:
            key = f"{self.key}_{slot}_{ID}"
            if not machine.has(key):
                continue
            cell = machine.point(key)
            if cell.usable and isinstance(cell.value, int | float) and cell.value > 0:
                cells = {column: machine.point(f"{self.key}_{slot}_{column}") for column in self.columns}
                found.append(RowView(slot, int(cell.value), cells))
        return found

    def by(self, column: str) -> list[RowView]:
        """Occupied slots by the value of a column; a row without one comes last."""
        return sorted(self.rows, key=lambda row: (row.number(column) is None, row.number(column) or 0.0, row.slot))

    def row(self, id: int) -> RowView | None:
        """The row of somebody."""
        return next((row for row in self.rows if row.id == id), None)

    @property
    def known(self) -> bool:
        """Whether the device tells its rows at all."""
        first = f"{self.key}_{self.slots[0]}_{ID}" if self.slots else ""
        return self.equipment.has(first) and self.equipment.point(first).state in ("good", "uncertain", "stale")


def tables_of(equipment: EquipmentView) -> dict[str, TableView]:
    """The tables of a machine by key."""
    return {key: TableView(equipment, key) for key in equipment.equipment.tables}
