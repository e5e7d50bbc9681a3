"""Words of product tracking: the line, its settings, a product, what happens to it, why an edit is refused.

Positions are millimetres along the line, 0 at the beginning of belt 1, forward = left → right. Sensors, belts and areas are numbered from 1
where an operator sees them (events, `Product.area`, `Product.corrected_at`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from itertools import pairwise
from math import isfinite
from typing import NamedTuple


class ProductState(IntEnum):
    """State word of a product row."""

    EMPTY = 0
    TRACKED = 1
    ENTERING = 2
    """Its trailing end is still in the beam that it arrived at; the length grows."""
    UNCERTAIN = 3
    OUTSIDE = 4
    """Its last correction was above the alarm tolerance."""
    LOST = 5
    UNLOADING = 6


class GatePosition(IntEnum):
    """Where a diverting gate stands, by its feedback."""

    STRAIGHT = 0
    LANE = 1
    BETWEEN = 2
    """At neither end: on its way, or stuck."""


class Code(IntEnum):
    """Codes of the event ring that tracking gives; the rest of the ring is the machine's."""

    ARRIVED = 1
    IDENTIFIED = 2
    HEAD_AT_SENSOR = 3
    TAIL_AT_SENSOR = 4
    UNLOADED = 5
    DELETED = 6
    EDITED = 7
    INSERTED = 8
    CONFIRMED = 9
    """`id` 0: all, `value` says how many."""
    OUTSIDE_TOLERANCE = 10
    LOST = 11
    UNEXPECTED = 12
    """`id`: the new record, or the record that must be it (`value` = deviation [mm]); 0: there was no room for a record."""
    BUFFER_FULL = 13
    """`id`: took the last slot; 0: an arrival that could not be stored. `value` = arrivals not stored so far."""
    LENGTH_DIFFERS = 14
    WITHDRAWN = 15
    """An arrival that went back or was no product; `value` = greatest length seen [mm]."""
    LEFT_BACKWARDS = 16
    """Left the line past position 0; `value` = age [s]."""
    DIVERTED = 17
    """Into the lane of gate `source`, whole; `value` = age [s]."""
    MERGED = 18
    """Comes in from the lane of merging gate `source`; `value` = how long it waited there [s], `value2` = its length [mm]."""
    GAP_STOP = 20
    GAP_STOP_ENDED = 21
    SENSOR_SUSPECTED = 28
    """`value` 1 = blind, 2 = stuck."""
    SENSOR_OK = 29
    REVERSED = 37
    """`id` the front-most of the products that swapped, `value` how many, `source` 1 = head is now left, 0 = right."""


BLIND, STUCK = 1, 2
"""What a sensor is suspected of."""


class TrackingEvent(NamedTuple):
    """One happening of a scan, as the event ring wants it; the time is the scan's."""

    code: Code
    source: int = 0
    """Sensor from 1; 0 = none."""
    id: int = 0
    second: int = 0
    value: float = 0.0
    value2: float = 0.0


class EditReason(IntEnum):
    """Why an edit is refused (reason words of the conveyor)."""

    NO_SUCH_PRODUCT = 7
    OVERLAP = 8
    OUTSIDE_LINE = 9
    BUFFER_FULL = 10
    LENGTH = 11


class EditRefused(ValueError):
    """An edit that would make the table wrong. `reason` is the reason word."""

    def __init__(self, reason: EditReason, text: str) -> None:
        super().__init__(text)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class LineLayout:
    """What is built: any number of belts, sensors and areas.

    Raises:
        ValueError: a position is not finite, not rising or not on the line; names the field.
    """

    belt_ends: tuple[float, ...] = (215.0, 445.0, 660.0)
    """[mm] of each belt; belt 1 begins at 0, the last end is the length of the line."""
    sensors: tuple[float, ...] = (100.0, 215.0, 445.0, 560.0)
    """Positions of S1 … Sm [mm]; products are identified at S1."""
    area_ends: tuple[float, ...] = (215.0, 445.0, 560.0, 660.0)
    """[mm]; the last area is for unloading."""
    slots: int = 20
    """Capacity of the product table."""
    gates: tuple[float, ...] = ()
    """Where the diverting gates are [mm]: behind S1 and before the last sensor."""
    merges: tuple[float, ...] = ()
    """Where lanes join the line [mm]: behind S1 and before the last sensor."""

    def __post_init__(self) -> None:
        for name in ("belt_ends", "sensors", "area_ends"):
            ends: tuple[float, ...] = getattr(self, name)
            if not ends:
                raise ValueError(f"{name} is empty, at least one expected")
            if not all(isfinite(x) and x > 0 for x in ends):
                raise ValueError(f"{name} is {ends}, finite positions above 0 mm expected")
            if any(b <= a for a, b in pairwise(ends)):
                raise ValueError(f"{name} is {ends}, rising positions expected")
            if ends[-1] > self.length:
                raise ValueError(f"{name} ends at {ends[-1]} mm, the line at {self.length} mm")
        first, last = self.sensors[0], self.sensors[-1]
        for name in ("gates", "merges"):
            places: tuple[float, ...] = getattr(self, name)
            if any(not first < x < last for x in places) or any(b <= a for a, b in pairwise(places)):
                raise ValueError(f"{name} is {places}, rising positions between {first} and {last} mm expected")
        if self.slots < 1:
            raise ValueError(f"slots is {self.slots}, at least 1 expected")

    @property
    def length(self) -> float:
        """[mm]"""
        return self.belt_ends[-1]


@dataclass(frozen=True, slots=True)
class Settings:
    """What may be adjusted while it runs; defaults and limits are the conveyor's.

    Raises:
        ValueError: a value is not finite or below its least; names the field.
    """

    sensor_tolerance: float = 5.0
    """A product this near to a sensor is set to it by an edge [mm]."""
    alarm_tolerance: float = 2.0
    """A greater correction is an alarm [mm]."""
    gap_margin: float = 5.0
    """Must be left between two products after a stop [mm]."""
    shortest: float = 10.0
    """Shortest product [mm]; what interrupts S1 for less is withdrawn."""
    longest: float = 150.0
    """Longest product [mm]; a beam interrupted for more is suspected stuck."""
    lost_after: float = 10.0
    """A product so far past a sensor that did not see it is lost [mm]."""
    unload_dwell: float = 2.0
    """Stands so long at the end before it is unloaded [s]."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value: float = getattr(self, field.name)
            least = 0.0 if field.name in ("gap_margin", "unload_dwell") else 1e-3
            if not isfinite(value) or value < least:
                raise ValueError(f"{field.name} is {value}, a finite number of at least {least:g} expected")
        if self.longest < self.shortest:
            raise ValueError(f"longest is {self.longest} mm, at least shortest ({self.shortest} mm) expected")


@dataclass(slots=True)
class Product:
    """One record. It lies between `left` and `right`; which of them is the head follows the direction of travel."""

    id: int
    slot: int
    """0 … slots − 1; kept for life."""
    right: float
    """Right end [mm]."""
    length: float
    """[mm]; while entering: so far."""
    state: ProductState
    entered_us: int
    """Time of the scan it entered in [µs]."""
    swapped: bool = False
    """Head is the left end: it travelled backwards last."""
    area: int = 0
    """From 1, by the head; 0 = on none."""
    corrected_at: int = 0
    """Sensor of the last correction, from 1; 0 = none yet."""
    correction: float = 0.0
    """Last correction, actual − expected [mm]."""
    displacement: float = 0.0
    """What its belts moved since it entered [mm], signed; corrections are not in it."""
    shifted: float = 0.0
    """Sum of corrections and contacts [mm]: right end = where it entered + displacement + shifted."""
    length_known: bool = True
    """False: measured anew at the next sensor."""
    measured: bool = False
    """A sensor measured this length whole; a later one that sees more sees two products."""
    settled: ProductState = ProductState.TRACKED
    """State after entering or unloading."""
    open_at: int = -1
    """Index of the sensor whose beam still holds the unknown trailing end; −1 = none."""
    open_right: bool = False
    """The unknown end is the right one (it came backwards)."""
    moving: int = 0
    """Sign of the last movement."""
    moved_us: int = 0
    """Time of the scan that moved it last [µs]."""
    back: float = 0.0
    """Movement against `swapped` not yet taken as a reversal [mm]."""
    passed_right: int = 0
    """Bit n: the right end is right of sensor n + 1, seen or missed."""
    passed_left: int = 0
    """Bit n: the left end is right of sensor n + 1."""
    lost_at: int = 0
    """Sensor that did not see it, from 1; 0 = none."""
    missed: int = 0
    """Bit n: sensor n + 1 did not see it, and none after that did."""
    furthest: float = 0.0
    """Greatest length while entering [mm]."""
    gates: int = 0
    """Bit n: the right end has come to gate n + 1, and it was decided which way it goes."""
    lane: int = 0
    """Gate that it turns off at, from 1; 0 = it is on the line. Its right end is at the gate then."""
    away: float = 0.0
    """What of it is in the lane [mm]; `length` is what is on the line."""
    origin: int = 0
    """Merging gate that it came in by, from 1; 0 = it came from the beginning of the line, or by hand."""
    coming: int = 0
    """The same while a part of it is still in that lane: its left end is at the gate then."""

    @property
    def whole(self) -> float:
        """Its length, what is in a lane included [mm]."""
        return self.length + self.away

    @property
    def left(self) -> float:
        """Left end [mm]."""
        return self.right - self.length

    @property
    def head(self) -> float:
        """Leading end [mm]."""
        return self.right - self.length if self.swapped else self.right

    @property
    def tail(self) -> float:
        """Trailing end [mm]."""
        return self.right if self.swapped else self.right - self.length

    @property
    def may_be_there(self) -> bool:
        """Not lost, or missed by one sensor only (which may be blind)."""
        return self.state is not ProductState.LOST or self.missed.bit_count() < 2

    def age(self, time_us: int) -> float:
        """[s] since it entered."""
        return max(0, time_us - self.entered_us) / 1e6


class Gap(NamedTuple):
    """The pair of adjacent products that comes nearest to a collision."""

    gap: float
    """[mm]"""
    closing: float
    """By so much they come nearer if the line stops now: distance to stop of the rear less that of the front [mm]; 0 = they do not."""
    limit: float
    """`closing` with the margin [mm]; the line must stop when the gap is not greater."""
    rear: int
    """Id of the one behind in the direction of travel."""
    front: int

    @property
    def stop(self) -> bool:
        """The line must stop now."""
        return self.limit > 0.0 and self.gap <= self.limit


def share(left: float, right: float, ends: Sequence[float], values: Sequence[float]) -> float:
    """Mean of a value of the belts, weighted by the length of the product on each.

    What lies before the first or behind the last belt does not count; a product of no length belongs to the belt it is
    on (a border belongs to the belt that ends there). On no belt at all: 0.

    Source: thesis 003, TRK_PROD, "update": delta = Σ share × belt delta.
    """
    begin = 0.0
    total = weight = 0.0
    for end, value in zip(ends, values, strict=True):
        if left >= begin and right <= end:
            return value
        overlap = min(right, end) - max(left, begin)
        if overlap > 0.0:
            total += overlap * value
            weight += overlap
        begin = end
    return total / weight if weight else 0.0
