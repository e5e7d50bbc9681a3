"""The diverting gates of a conveyor as they really are: blades that take their time, and products that follow them into a lane.

| subject | taken here; no source gives it |
| --- | --- |
| blade | goes from one end to the other in 0.4 s, while the line has supply; a product in it holds it |
| way of a product | decided when its head comes to the blade: into the lane when that is open by half or more |
| lane | takes what comes; what is in it moves on with what still lies on the belt, and comes out again backwards |
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple, Protocol, TypeVar

MOST_GATES = 8
TRAVEL_TIME = 0.4
"""From one end to the other [s]."""
GATE_FAULTS = 600
"""The machine fault "gate n stuck" is this code and n."""


class Rule(IntEnum):
    """Which products a gate diverts."""

    HAND = 0
    """None by itself: it stands where an operator put it."""
    CLASS = 1
    """Those of the class."""
    ORDER = 2
    """Those of the order."""
    HEAVIER = 3
    """Those that weigh more [kg]."""
    ALTERNATING = 4
    """Every second one."""


class GatePlan(NamedTuple):
    """A gate as it is built."""

    at: float
    """Place [mm]."""
    rule: int = Rule.ALTERNATING
    value: float = 0.0
    """Class, order or weight of the rule."""
    time: float = 1.0
    """It must arrive within this [s]."""


class Turning(Protocol):
    """A product as the blades see it."""

    head: float
    length: float
    lane: int
    away: float
    asked: int

    @property
    def tail(self) -> float: ...


P = TypeVar("P", bound=Turning)


class Blades:
    """The blades of one line; `open` is a part, 0 = straight on, 1 = into the lane."""

    def __init__(self, places: Sequence[float]) -> None:
        self.places = tuple(places)
        self.open = [0.0] * len(self.places)
        self.diverted = 0
        """Products that have gone into a lane."""
        self.stuck = -1
        """Index of one that does not move; −1 = none."""

    def step(self, wanted: Sequence[bool], products: Sequence[Turning], dt: float) -> None:
        """Towards what is wanted, for `dt` [s]."""
        for n, (x, lane) in enumerate(zip(self.places, wanted, strict=True)):
            goal = 1.0 if lane else 0.0
            if self.open[n] == goal or n == self.stuck:
                continue
            if any(product.lane == n + 1 or product.tail < x < product.head for product in products):
                continue
            way = dt / TRAVEL_TIME
            self.open[n] = min(1.0, self.open[n] + way) if lane else max(0.0, self.open[n] - way)

    def place(self, product: Turning) -> None:
        """It was put on the line by hand: it has passed the gates before its head."""
        product.asked = sum(1 << n for n, x in enumerate(self.places) if x < product.head)

    def turn(self, products: Sequence[P]) -> list[P]:
        """Those that are on the line still, after a movement."""
        stay = []
        for product in products:
            if not product.lane:
                self._ask(product)
            if product.lane and self._gone(product):
                self.diverted += 1
            else:
                stay.append(product)
        return stay

    def _ask(self, product: Turning) -> None:
        for n, x in enumerate(self.places):
            bit = 1 << n
            if product.head <= x:
                product.asked &= ~bit
            elif not product.asked & bit:
                product.asked |= bit
                if self.open[n] >= 0.5:
                    product.lane = n + 1
                    return

    def _gone(self, product: Turning) -> bool:
        x, whole = self.places[product.lane - 1], product.length + product.away
        away = product.away + product.head - x
        if away <= 0.0:
            product.lane, product.away, product.head, product.length = 0, 0.0, x + away, whole
            return False
        product.head, product.length, product.away = x, whole - away, away
        return product.length <= 0.0
