"""The event ring of a virtual PLC: the last events with their time, retained, so that a power cycle loses none."""

from collections.abc import Sequence

from app.registers import plc_map
from app.registers.plc_map import DeviceEvent

EVENT_CAPACITY = (0x0800 - plc_map.EVENT_ROWS) // plc_map.EVENT_WORDS
"""Rows that fit between 0x0410 and the tables at 0x0800."""


class EventRing:
    """Row = sequence % 59."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """As never switched on before."""
        self.newest = 0
        """Sequence of the last event."""
        self.acknowledged = 0
        """Sequence up to which the host has stored them."""
        self.kept = 0
        """How many of the last ones are there."""
        self.rows: list[int] = [0] * (EVENT_CAPACITY * plc_map.EVENT_WORDS)
        """Their words."""

    def add(self, time: int, code: int, source: int, value: float, snapshot: Sequence[int], request: int) -> None:
        """An event at `time` [µs] that the command `request` caused, 0 = none."""
        self.newest = self.newest % 0xFFFFFFFF + 1
        event = DeviceEvent(self.newest, time, code, source, value, tuple(snapshot), request)
        row = self.newest % EVENT_CAPACITY * plc_map.EVENT_WORDS
        self.rows[row : row + plc_map.EVENT_WORDS] = plc_map.event_words(event)
        self.kept = min(self.kept + 1, EVENT_CAPACITY)

    @property
    def head(self) -> Sequence[int]:
        """Capacity, size of a row, oldest, newest and acknowledged sequence, as words."""
        return (
            EVENT_CAPACITY,
            plc_map.EVENT_WORDS,
            *plc_map.long_words(self.newest - self.kept + 1),
            *plc_map.long_words(self.newest),
            *plc_map.long_words(self.acknowledged),
        )
