"""The scanner of a line: what it read of which product. It looks when a product comes into the beam of the sensor that it stands at."""

from collections.abc import Collection
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from app.blocks.product_tracking import Code, TrackingEvent
from app.sim.conveyor.machine import NO_LABEL, Label

SEEN = (Code.ARRIVED, Code.HEAD_AT_SENSOR, Code.UNEXPECTED)
"""Events that say which product has come into a beam."""


class ReadingState(IntEnum):
    """State word of a reading."""

    NONE = 0
    """The product has not come to the scanner."""
    READ = 1
    NOT_READ = 2


class Reading(NamedTuple):
    """What is known of a product's label."""

    state: ReadingState
    label: Label
    time: int
    """When it was read, device time [µs]."""


NO_READING = Reading(ReadingState.NONE, NO_LABEL, 0)


@dataclass(slots=True)
class Scanner:
    """Retained over a power cycle, as the products are."""

    sensor: int
    """From 1; 0 = the line has none."""
    readings: dict[int, Reading] = field(default_factory=dict)
    """By product."""

    def sees(self, event: TrackingEvent) -> bool:
        """Whether a product has come to it with this event."""
        return bool(self.sensor and event.source == self.sensor and event.id and event.code in SEEN)

    def take(self, id: int, label: Label | None, time: int) -> bool:
        """`label` of the product that is before it, None = it cannot read any; whether that is news. What was read once stays: nothing
        read the next time takes nothing back."""
        known = self.readings.get(id, NO_READING)
        if label is None:
            if known.state is not ReadingState.NONE:
                return False
            self.readings[id] = Reading(ReadingState.NOT_READ, NO_LABEL, time)
            return True
        if known.state is ReadingState.READ and known.label == label:
            return False
        self.readings[id] = Reading(ReadingState.READ, label, time)
        return True

    def of(self, id: int) -> Reading:
        """What is known of a product."""
        return self.readings.get(id, NO_READING)

    def keep(self, ids: Collection[int]) -> None:
        """Only these products have records any more."""
        for id in [one for one in self.readings if one not in ids]:
            del self.readings[id]
