"""The coil-car line as it really is: recoiler with mandrel, a coil that grows, a car with two axes, saddles, hydraulics, switches."""

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class Geometry:
    """Measures of a line [mm]; these are the options of the type `coil_car`."""

    mandrel_position: float = 1000.0
    """Middle of the coil on the mandrel."""
    mandrel_reach: float = 1600.0
    """End of the mandrel."""
    mandrel_height: float = 1200.0
    """Its axis over the lowered table."""
    out_position: float = 2700.0
    """In the free zone, where the car lifts."""
    saddle_1_position: float = 9000.0
    saddle_2_position: float = 6600.0
    saddle_3_position: float = 4200.0
    saddle_height: float = 700.0
    """Lowest point of a coil that lies there."""
    saddle_length: float = 800.0
    clearance: float = 150.0
    """Between a coil and the seat when the car drives over the saddles."""
    travel: float = 10000.0
    """Horizontal way, from 0."""
    lift: float = 1400.0
    """Vertical way, from 0."""
    coil_width: float = 1200.0
    coil_smallest: float = 600.0
    """Diameter that a coil begins with."""
    coil_largest: float = 1900.0
    eye_diameter: float = 508.0
    """Of the expanded mandrel, too."""
    collapsed_diameter: float = 460.0
    table_width: float = 600.0
    position_tolerance: float = 20.0
    """Within which the car is at a place."""


MEASURES = tuple(field.name for field in fields(Geometry))
"""In the order of the configuration image."""
