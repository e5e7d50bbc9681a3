"""Rows of a table of a Pogon PLC, as they are scanned: an empty row has id 0, state 0 and nothing else.

A row is decoded only when it changed. What the head of the table does not count is empty, whatever stands there.
"""

from collections.abc import Mapping

from app.links.planner import Reading, Rows, span_of
from app.links.scan_block import ScanBlock, beyond, good_range
from app.links.wholeness import generations
from app.plant.definitions import Point
from app.registers.codec import Decoder, decoder
from app.registers.plc_map import ROW_GENERATION, ROW_STATE
from app.tags.batch import Value
from app.tags.quality import NOT_CONNECTED

_Cell = tuple[int, int, int, Decoder, float, float, Value, Point]
"""Offset in the row, words, handle, decoder, least and greatest good value, value in an empty row, point."""


class TableBlock(ScanBlock):
    """Whole rows of a table; the first block begins with the head of the table."""

    def __init__(self, source: str, number: int, unit: int, reading: Reading, period: float, rows: Rows) -> None:
        super().__init__(source, number, unit, reading, period)
        self.rows = rows
        self.used = 0
        """Rows in this block that the head of the table counts."""
        self.touched = 0.0
        """When a block that is not read was last said to be as it is [s]."""
        self.torn_row = ""
        """What is wrong with the first row that was being changed at the last read; empty = none."""
        self.wanted = rows.first == 0
        self._cells: list[list[_Cell]] = []

    def is_beside(self, other: "TableBlock") -> bool:
        """Whether both are of one table of one machine."""
        rows, others = self.rows, other.rows
        return rows.table.key == others.table.key and rows.equipment == others.equipment

    def settle(self, words: list[int]) -> tuple[bool, bool]:
        """Put `words` right: rows that are not counted are emptied, a row that was being changed becomes what it was before.

        Returns whether a row was being changed, and whether one of those was never seen before.
        """
        size, base = self.rows.table.row, self.rows.head
        torn = unknown = False
        self.torn_row = ""
        for row in range(self.rows.rows):
            at = base + row * size
            if row >= self.used:
                words[at : at + size] = [0] * size
                continue
            generation = words[at + ROW_GENERATION]
            if generation % 2 or generation != words[at + size - 1]:
                torn = True
                place = f"generation of the row at {self.block.address + at:#06x}"
                self.torn_row = self.torn_row or generations(generation, words[at + size - 1], place)
                if self.words is None:
                    unknown = True
                else:
                    words[at : at + size] = self.words[at : at + size]
        return torn, unknown

    def bind(self, handles: Mapping[str, int], revision: int) -> None:
        """Look the handles up again when the plant has a new revision."""
        if revision == self._revision:
            return
        self._cells = [[] for _ in range(self.rows.rows)]
        super().bind({}, revision)
        size, start = self.rows.table.row, self.block.address + self.rows.head
        head: list[Point] = []
        for point in self.points:
            register, handle = point.register, handles.get(point.name)
            if register is None or handle is None:
                continue
            first, _ = span_of(register)
            if first < start:
                head.append(point)
                continue
            row, offset = divmod(first - start, size)
            low, high = good_range(point)
            empty = 0 if offset in (0, ROW_STATE) else None
            self._cells[row].append((offset, register.words, handle, decoder(register), low, high, empty, point))
        self._bind(head, handles)

    def _collect(
        self,
        words: list[int],
        before: list[int],
        quality: int,
        handles: list[int],
        values: list[Value],
        uneven: dict[int, int],
    ) -> None:
        super()._collect(words, before, quality, handles, values, uneven)
        size, at = self.rows.table.row, self.rows.head
        for cells in self._cells:
            row, old = words[at : at + size], before[at : at + size]
            at += size
            if row == old:
                continue
            here, was = row[0] | row[1], old[0] | old[1]
            if not here:
                if was:
                    handles += [cell[2] for cell in cells]
                    values += [cell[6] for cell in cells]
                continue
            fresh = was <= 0  # was empty, or was never seen: then it is -1 here
            for offset, width, handle, decode, low, high, _, point in cells:
                raw = row[offset : offset + width]
                if not fresh and raw == old[offset : offset + width]:
                    continue
                value = decode(raw)
                if value is None:
                    uneven[len(handles)] = NOT_CONNECTED | quality & 0xF00
                elif not isinstance(value, str) and not low <= value <= high:
                    uneven[len(handles)] = beyond(point, value) | quality & 0xF00
                handles.append(handle)
                values.append(value)

    def _handles(self) -> list[int]:
        return super()._handles() + [cell[2] for cells in self._cells for cell in cells]
