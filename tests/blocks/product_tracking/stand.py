"""A tracked line on the table."""

import math

from app.blocks.product_tracking import (
    LineLayout,
    Product,
    ProductTracking,
    Settings,
    TrackingEvent,
)

SIMULATION = LineLayout(sensors=(150.0, 215.0, 445.0, 560.0))


STANDING = (0.0, 0.0, 0.0)


class Bench:
    """Moves a tracker by hand: millimetres and beams, 1 mm a scan of 10 ms."""

    def __init__(self, line: LineLayout | None = None, **settings: float) -> None:
        self.tracking = ProductTracking(line or LineLayout(), Settings(**settings))
        self.beams = [False] * len(self.tracking.line.sensors)
        self.time_us = 0
        self.stops: tuple[float, ...] = tuple(0.0 for _ in self.tracking.line.belt_ends)

    def scan(self, *moved: float) -> list[TrackingEvent]:
        belts = len(self.tracking.line.belt_ends)
        self.time_us += 10_000
        way = moved if len(moved) == belts else (moved[0] if moved else 0.0,) * belts
        return self.tracking.scan(way, self.beams, self.stops, self.time_us)

    def move(self, way: float) -> list[TrackingEvent]:
        """All belts by `way` mm."""
        events = []
        for _ in range(round(abs(way))):
            events += self.scan(math.copysign(1.0, way))
        return events

    def beam(self, sensor: int, on: bool, moved: float = 1.0) -> list[TrackingEvent]:
        """Sensor S`sensor` changes in a scan with movement."""
        self.beams[sensor - 1] = on
        return self.scan(moved)

    def arrive(self, length: int) -> Product:
        """One product through S1, its tail at S1 afterwards."""
        self.beam(1, True)
        self.move(length - 1)
        self.beam(1, False)
        return self.tracking.products[-1]


def put(bench: Bench, head: float, length: float) -> Product:
    """A record that has moved lately."""
    id = bench.tracking.insert(head, length, bench.time_us).id
    return next(product for product in bench.tracking.products if product.id == id)
