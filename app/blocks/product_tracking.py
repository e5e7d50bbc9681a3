"""Product tracking: where every product on the line is, from the belts' encoders, corrected by the sensors."""

from collections.abc import Mapping, Sequence
from typing import Any

from .tracked import (
    Code,
    EditRefused,
    Gap,
    Line,
    Product,
    ProductState,
    Reason,
    Settings,
    TrackingEvent,
    share,
)

__all__ = [
    "Code",
    "EditRefused",
    "Gap",
    "Line",
    "Product",
    "ProductState",
    "ProductTracking",
    "Reason",
    "Settings",
    "TrackingEvent",
    "share",
]


class ProductTracking:
    """Tracks the products of one line."""

    line: Line
    settings: Settings
    """May be replaced between two scans."""
    products: list[Product]
    """Front-most (greatest position) first."""
    slots: list[Product | None]
    """The same products by slot."""
    next_id: int
    entered: int
    unloaded: int
    lost: int
    unexpected: int
    corrections: int
    withdrawn: int
    left: int
    """Left the line backwards."""
    deleted: int
    inserted: int
    found: int
    """Unexpected products that got a record."""
    refused: int
    """Arrivals that could not be stored."""
    greatest_correction: float
    """[mm]"""
    areas: int
    """Bit n: a product (not a lost one) has its head on area n + 1."""
    sensor_faults: int
    """Bit n: sensor n + 1 is suspected blind or stuck."""
    brake: bool
    """The last belt must stop, a product is to be unloaded; stays until it is."""
    gap: Gap | None
    """Most critical pair of adjacent products."""
    gap_stop: bool
    """Latched; the line must stop until `release_gap_stop`."""

    def __init__(self, line: Line, settings: Settings | None = None) -> None:
        self.line = line
        self.settings = settings or Settings()
        self.products = []
        self.slots = [None] * line.slots
        self.next_id = 1
        self.entered = self.unloaded = self.lost = self.unexpected = self.corrections = self.withdrawn = self.left = 0
        self.deleted = self.inserted = self.found = self.refused = 0
        self.greatest_correction = 0.0
        self.areas = 0
        self.sensor_faults = 0
        self.brake = False
        self.gap = None
        self.gap_stop = False

    @property
    def buffer_full(self) -> bool:
        """No slot is free: feed nothing more."""
        return None not in self.slots

    @property
    def uncertain(self) -> bool:
        """A product's position is uncertain."""
        return any(product.state is ProductState.UNCERTAIN for product in self.products)

    @property
    def outside_present(self) -> bool:
        """A product outside the alarm tolerance is on the line."""
        return any(product.state is ProductState.OUTSIDE for product in self.products)

    @property
    def lost_present(self) -> bool:
        """A lost product is in the table."""
        return any(product.state is ProductState.LOST for product in self.products)

    def scan(
        self, moved: Sequence[float], beams: Sequence[bool], stop_distances: Sequence[float], time_us: int
    ) -> list[TrackingEvent]:
        """One scan: `moved` [mm, signed] of every belt since the last scan, `beams` (True = interrupted) of every sensor, `stop_distances`
        [mm, signed: + = moves forward] of every belt, `time_us` [µs]. Gives what happened, in order."""
        for product in self.products:
            delta = share(product.left, product.right, self.line.belt_ends, moved)
            product.right += delta
            product.displacement += delta
        return []

    def gap_with(self, stop_distances: Sequence[float]) -> Gap | None:
        """The most critical pair if the belts had these distances to stop [mm, signed]: ask before belts are started again."""
        return None

    def release_gap_stop(self) -> list[TrackingEvent]:
        """Ends a latched gap stop (after the restart delay, or by reset); it comes again if a pair still comes too near."""
        self.gap_stop = False
        return []

    def delete(self, id: int) -> TrackingEvent:
        """Takes a record out. Raises EditRefused: no such product."""
        raise EditRefused(Reason.NO_SUCH_PRODUCT, f"no product {id}")

    def edit(self, id: int, head: float, length: float) -> TrackingEvent:
        """Sets head and length [mm] of a record; the head stays the end it is. Raises EditRefused."""
        raise EditRefused(Reason.NO_SUCH_PRODUCT, f"no product {id}")

    def insert(self, head: float, length: float, time_us: int) -> TrackingEvent:
        """A new record with its right end at `head` [mm]; event `id` is the new identity. Raises EditRefused."""
        raise EditRefused(Reason.BUFFER_FULL, "no free slot")

    def confirm(self, id: int = 0) -> TrackingEvent:
        """Uncertain → tracked, of one record or (0) all. Raises EditRefused: no such product."""
        raise EditRefused(Reason.NO_SUCH_PRODUCT, f"no product {id}")

    def power_up(self) -> None:
        """After a power cycle: every product is uncertain, the beams are looked at anew."""

    def snapshot(self) -> dict[str, Any]:
        """All that must survive a power cycle, as plain numbers, lists and dicts."""
        return {}

    def restore(self, retained: Mapping[str, Any]) -> None:
        """Takes a snapshot back. Raises ValueError naming what does not fit this line."""
