"""Machines that track products, and event rings made by hand."""

from dataclasses import dataclass, field, replace
from itertools import count

from app.plant import events, types
from app.plant.definitions import Alarm, Equipment
from app.registers.plc_map import real

BEGIN = 1_773_036_000_000_000
"""2026-03-09T06:00Z."""
SECOND = 1_000_000
READER = object()
NUMBERS = count(1)
NONE = events.Ring(READER, boots=1, newest=2**30)
"""Of events that were not told by a `Ring`."""
CONVEYOR = types.read_type("conveyor", ["en"])[0].type


@dataclass(frozen=True, slots=True)
class Event:
    """As a link hands it over."""

    sequence: int
    time: int
    code: int
    source: int = 0
    value: float = float("nan")
    snapshot: tuple[int, ...] = (0,) * 6
    boot: int = 1
    seen: int = 0
    request: int = 0
    ring: events.Ring = NONE


def snapshot(product: int = 0, second: int = 0, value: float = float("nan")) -> tuple[int, ...]:
    raw = real(value)
    return (product >> 16, product & 0xFFFF, second >> 16, second & 0xFFFF, raw >> 16, raw & 0xFFFF)


def a_ring(boot: int) -> events.Ring:
    """A ring that counts from 1, after all others that were made."""
    return events.Ring(READER, next(NUMBERS), boot)


@dataclass
class Ring:
    """What a device would have told: `ring.tell(3, product=7, source=2, value=0.4)`."""

    time: int = BEGIN
    boot: int = 1
    sequence: int = 0
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.which = a_ring(self.boot)

    def begin_anew(self) -> None:
        """The device loses everything that it retains."""
        self.sequence, self.which = 0, a_ring(self.boot)

    def tell(
        self,
        code: int,
        product: int = 0,
        *,
        source: int = 0,
        value: float = float("nan"),
        second: int = 0,
        other: float = float("nan"),
        after: float = 1.0,
        request: int = 0,
    ) -> Event:
        self.time += round(after * SECOND)
        self.sequence = self.which.newest = self.sequence % (2**32 - 1) + 1
        self.which.boots = self.boot
        value = float(value)
        event = Event(
            self.sequence,
            self.time,
            code,
            source,
            value,
            snapshot(product, second, other),
            self.boot,
            self.time,
            request,
            self.which,
        )
        self.events.append(event)
        return event

    def passage(self, product: int, length: float = 30.5, corrections: tuple[float, ...] = (0.4, -0.2, 1.1)) -> None:
        """A product from its arrival to its unloading."""
        self.tell(1, product, source=1)
        self.tell(2, product, source=1, value=length)
        for sensor, correction in enumerate(corrections, 2):
            self.tell(3, product, source=sensor, value=correction)
            self.tell(4, product, source=sensor, value=correction / 2, after=0.5)
        self.tell(5, product, value=12.0)

    def drain(self) -> list[Event]:
        found, self.events = self.events, []
        return found


def conveyor(*ids: str) -> list[Equipment]:
    """Machines that track products; their alarms are the events 10, 11 and 20."""
    alarms = [
        Alarm("tolerance", "a", "", 3, event=10),
        Alarm("lost", "a", "lost_present == 1", 2, event=11),
        Alarm("gap", "a", "gap_stop == 1", 2, event=20, event_clear=21),
    ]
    return [Equipment(id, replace(CONVEYOR, alarms=alarms), "hall", 1, {"en": id}, "line", {}, alarms) for id in ids]
