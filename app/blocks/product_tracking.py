"""Product tracking: where every product on the line is, from the belts' encoders, corrected by the sensors."""

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import fields
from itertools import pairwise
from math import isfinite
from typing import Any, NamedTuple

from .gap_supervision import nearest
from .tracked import (
    BLIND,
    STUCK,
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
    "BLIND",
    "STUCK",
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

_LAST_ID = (1 << 32) - 1
_NEVER = -(1 << 60)
_RECENT_US = 500_000
"""An edge can only come from a product that moved within this time."""
_REVERSAL = 0.2
"""A product has turned round after this way back [mm]: one pulse to and fro is no reversal."""
_TOUCH = 1e-6
"""Overlap that is rounding [mm]."""
_STANDS = 0.05
"""A belt with less distance to stop stands [mm]."""
_COUNTERS = (
    "entered",
    "unloaded",
    "lost",
    "unexpected",
    "corrections",
    "withdrawn",
    "left",
    "deleted",
    "inserted",
    "found",
    "refused",
)

_TRACKED, _ENTERING, _UNCERTAIN = ProductState.TRACKED, ProductState.ENTERING, ProductState.UNCERTAIN
_OUTSIDE, _LOST, _UNLOADING = ProductState.OUTSIDE, ProductState.LOST, ProductState.UNLOADING


class _Held(NamedTuple):
    """Who interrupts a beam."""

    product: Product
    risen: int
    """End that did it: 1 right, −1 left."""
    since: float
    """Its displacement then [mm]."""
    sure: bool = True
    """False: the edge came where it was not expected, the beam may have been late."""


class _Cut(NamedTuple):
    """A beam that became free before the product could be through."""

    held: _Held
    measured: float
    travel: float


class ProductTracking:
    """Tracks the products of one line: first in, first out, none passes another.

    **Identity.** A rising edge at S1 that no record explains is an arrival: a new id (u32, never used twice while it is in the table),
    the head at S1. The length is what the product moves until the falling edge; then head = S1 + length, tail = S1. An arrival that
    goes back out of S1, or that was shorter than the shortest product, is withdrawn; when it comes again it is a new arrival.

    **Movement.** A product moves by the mean of its belts' movements, weighted by the part of its length on each at the beginning of
    the scan. Two products that would overlap are in contact: the one that ran into the other is held (a lost one gives way) and is
    uncertain.

    **Correction.** The leading end makes the rising edge, the trailing end the falling one; which is which follows the direction of
    travel, so backwards the left end leads. An end within the sensor tolerance is set to the sensor, the length stays, the amount
    (actual − expected) is kept. Above the alarm tolerance the product is *outside tolerance* until a smaller correction or a
    confirmation. A correction makes an uncertain or lost product a tracked one (one
    of the trailing end alone only where a sensor measured the length). A measured length that differs by more than the alarm tolerance
    is told. A standing product makes no edges: a hand in the beam does not move it.

    **Unexpected.** A rising edge with no product within the tolerance is told. If a record has not passed the sensor yet and is within
    `lost_after`, or is overdue with its body over the sensor, there is no room for another product: it is that one, set to the sensor,
    uncertain. Otherwise something is there that nobody knows, and an operator wants to see it: a new record with its leading end at the
    sensor, length measured to the falling edge, uncertain until the next sensor or a person confirms it. So it takes part in gap
    supervision and is unloaded. An edge inside a record that no sensor has measured (its own beam is still interrupted, or was for too
    long) is told with that record, which is uncertain then: it covers all that came while the beam did not change.

    **Touching.** A beam that stays interrupted behind a product whose length a sensor has measured, for at least the shortest product's
    way, has another product in it that nobody knows and that touches the known one: length differs and unexpected, and a new record of
    that length behind it, uncertain (whether it is one or two, the space they take is right). So the second one is unloaded too.

    **Lost.** An end that should have made a rising edge and is `lost_after` past the sensor without: event, state lost. The record moves
    on with the belts and stays in the table until a sensor finds it or a person deletes, edits or confirms it; past either end of the
    line it only keeps its slot. Missed by one sensor it may still be there (`Product.may_be_there`): it counts for gaps and areas, and
    the belt brakes for it at the end, where it waits for a person instead of being unloaded. Missed by two it is in nobody's way. Where
    the beam is interrupted (no edge can come) or the sensor is suspected already, a product is only uncertain.

    **Sensors.** One that two products in a row were lost at, or that missed a product which the next one saw, or before which two
    unknown products in a row appear at the next, is suspected blind; one that is interrupted for more than the longest product is
    suspected stuck. The next edge that fits (the beam becoming free) ends the suspicion.

    **Capacity.** `buffer_full` says that no slot is free; an arrival that cannot be stored is counted (`refused`) and told, and nothing
    is overwritten. What it was will be unexpected at the next sensor.

    **Leaving.** In front the product is unloaded: once its head is on the last belt or area and (line length − head) ≤ distance to stop
    of the last belt plus the way of one scan, `brake` is true; when the belt has stood for the dwell time with the head at the end
    (within the sensor tolerance) it is deleted as unloaded. One that is jogged over the end is unloaded when its tail is past it.
    Backwards it is tracked up to position 0, then removed with the event `LEFT_BACKWARDS`; a product that passed S1 backwards and comes
    again keeps its identity.

    At any time entered + found + inserted = in the table + unloaded + deleted + withdrawn + left.

    Source: thesis 003, TRK_PROD (reference/theses-facts.md section 3, decisions 13–15 of section 6). What the thesis does not have (lost,
    unexpected, contact, suspicion, capacity) is ours.
    """

    def __init__(self, line: Line, settings: Settings | None = None) -> None:
        self.line = line
        self.settings = settings or Settings()
        """May be replaced between two scans."""
        self.products: list[Product] = []
        """On the line, front-most (greatest position) first."""
        self.slots: list[Product | None] = [None] * line.slots
        """All records by slot, the lost ones past the end of the line too."""
        self.next_id = 1
        self.entered = 0
        """Arrivals at S1 that got a record."""
        self.unloaded = 0
        self.lost = 0
        """Times a product was declared lost."""
        self.unexpected = 0
        """Edges that no product explained."""
        self.corrections = 0
        self.withdrawn = 0
        self.left = 0
        """Products that left the line backwards."""
        self.deleted = 0
        self.inserted = 0
        self.found = 0
        """Unexpected products that got a record."""
        self.refused = 0
        """Products that could not be stored."""
        self.greatest_correction = 0.0
        """Greatest |correction| [mm]."""
        self.areas = 0
        """Bit n: a product that is not lost has its head on area n + 1."""
        self.sensor_faults = 0
        """Bit n: sensor n + 1 is suspected blind or stuck."""
        self.brake = False
        """The last belt must stop (or stay): a product is being unloaded, or a lost one that may be there waits for a person."""
        self.gap: Gap | None = None
        """Adjacent pair with the least reserve; None with fewer than two products."""
        self.gap_stop = False
        """Latched until `release_gap_stop`: the whole line must stop."""
        count = len(line.sensors)
        self._beams: tuple[bool, ...] | None = None
        self._stops: tuple[float, ...] = ()
        self._odometer = [0.0] * len(line.belt_ends)
        self._way = [0] * len(line.belt_ends)
        self._beside = [
            (bisect_left(line.belt_ends, x), min(bisect_right(line.belt_ends, x), len(line.belt_ends) - 1))
            for x in line.sensors
        ]
        self._risen = [0.0] * count
        self._cut: list[_Cut | None] = [None] * count
        self._in_beam: list[_Held | None] = [None] * count
        self._misses = [0] * count
        self._strangers = [0] * count
        self._stuck = 0
        self._stands_since = _NEVER
        self._braking = 0
        self._now = 0
        self._events: list[TrackingEvent] = []
        self._changed = True
        self._swaps = 0
        self._swapped: Product | None = None

    @property
    def buffer_full(self) -> bool:
        """No slot is free: feed nothing more."""
        return None not in self.slots

    @property
    def uncertain(self) -> bool:
        """The position of a product is uncertain."""
        return self._any(_UNCERTAIN)

    @property
    def outside_present(self) -> bool:
        """A product's last correction was above the alarm tolerance."""
        return self._any(_OUTSIDE)

    @property
    def lost_present(self) -> bool:
        """A lost product is in the table."""
        return self._any(_LOST)

    def scan(
        self, moved: Sequence[float], beams: Sequence[bool], stop_distances: Sequence[float], time_us: int
    ) -> list[TrackingEvent]:
        """One scan; gives what happened, in order. Costs next to nothing while nothing moves.

        `moved`: of every belt since the last scan [mm, signed]. `beams`: of every sensor, True = interrupted. `stop_distances`: of
        every belt [mm, signed: + = it moves forward] (`SRamp`). `time_us`: device time [µs], never falling.

        Raises:
            ValueError: a number is not finite, or there are not as many as belts or sensors; nothing was changed.
        """
        moved, beams, stops = tuple(moved), tuple(beams), tuple(stop_distances)
        self._check(moved, beams, stops)
        events: list[TrackingEvent] = []
        self._events, self._now = events, time_us
        if self._beams is None:
            self._beams = self._predicted()
            self._changed = True
        moving = any(moved)
        if moving:
            self._move(moved)
        if beams != self._beams:
            before, self._beams = self._beams, beams
            for n, interrupted in enumerate(beams):
                if interrupted and not before[n]:
                    self._rising(n)
                elif before[n] and not interrupted:
                    self._falling(n)
        if moving:
            self._look_for_missed()
            if any(self._cut):
                self._look_for_short(beams)
            if True in beams:
                self._look_for_stuck(beams)
            self._leave()
        self._unload(moved[-1], stops[-1])
        if self._changed or moving or events:
            self._occupy()
            self._supervise(stops)
        elif stops != self._stops:
            self._supervise(stops)
        self._stops, self._changed = stops, False
        return events

    def gap_with(self, stop_distances: Sequence[float]) -> Gap | None:
        """The most critical pair if the belts had these distances to stop [mm, signed]; ask before belts are started again."""
        return nearest(self.products, self.line.belt_ends, stop_distances, self.settings.gap_margin)

    def release_gap_stop(self) -> list[TrackingEvent]:
        """Ends a latched gap stop (after the restart delay, or by reset); it comes again if a pair still comes too near."""
        if not self.gap_stop:
            return []
        self.gap_stop = False
        self._changed = True
        pair = self.gap
        return (
            [TrackingEvent(Code.GAP_STOP_ENDED, 0, pair.rear, pair.front, pair.gap, pair.closing)]
            if pair
            else [TrackingEvent(Code.GAP_STOP_ENDED)]
        )

    def delete(self, id: int) -> TrackingEvent:
        """Takes a record out. `value` of the event is its head [mm].

        Raises:
            EditRefused: no such product.
        """
        product = self._by_id(id)
        self._remove(product)
        self.deleted += 1
        return TrackingEvent(Code.DELETED, 0, id, 0, product.head, product.length)

    def edit(self, id: int, head: float, length: float) -> TrackingEvent:
        """Sets head and length [mm] of a record; a person vouches for it, so it is tracked then, also when it was lost. The head stays
        the end that it is. The record may be put anywhere on the line where there is room.

        Raises:
            EditRefused: no such product, outside the line, length outside limits, overlaps another.
        """
        product = self._by_id(id)
        right = self._right_of(head, length, product.swapped)
        self._require_room(right, length, product)
        if product.id == self._braking:
            self._end_unloading()
        self._forget_beams(product)
        product.shifted += right - product.right
        product.right, product.length = right, length
        product.state = product.settled = _TRACKED
        product.open_at, product.length_known, product.lost_at, product.missed = -1, True, 0, 0
        product.measured = False
        self._set_passed(product)
        if product not in self.products:
            self.products.append(product)
        self._changed = True
        self._in_order()
        return TrackingEvent(Code.EDITED, 0, id, 0, head, length)

    def insert(self, head: float, length: float, time_us: int) -> TrackingEvent:
        """A new record with its head (right end) and length [mm], tracked; `id` of the event is its identity.

        Raises:
            EditRefused: buffer full, outside the line, length outside limits, overlaps another.
        """
        right = self._right_of(head, length, False)
        self._require_room(right, length, None)
        slot = self._free_slot()
        if slot is None:
            raise EditRefused(Reason.BUFFER_FULL, f"all {self.line.slots} slots are taken")
        product = self._record(slot, right, length, _TRACKED, time_us)
        product.moved_us = _NEVER
        self._set_passed(product)
        self.inserted += 1
        self._in_order()
        return TrackingEvent(Code.INSERTED, 0, product.id, 0, head, length)

    def confirm(self, id: int = 0) -> TrackingEvent:
        """A person vouches for the position: uncertain or outside tolerance → tracked, a named one also when it is lost. 0 = all but
        the lost; `value` of the event says how many changed.

        Raises:
            EditRefused: no such product, or a lost one past the end of the line.
        """
        if id:
            product = self._by_id(id)
            if product not in self.products:
                raise EditRefused(Reason.OUTSIDE_LINE, f"product {id} is past the end of the line")
            chosen = [product]
        else:
            chosen = [product for product in self.products if product.state is not _LOST]
        changed = 0
        for product in chosen:
            if product.state in (_ENTERING, _UNLOADING):
                changed += product.settled is not _TRACKED
                product.settled = _TRACKED
            elif product.state is not _TRACKED:
                product.state = _TRACKED
                product.lost_at = product.missed = 0
                changed += 1
        self._changed = True
        return TrackingEvent(Code.CONFIRMED, 0, id, 0, float(changed))

    def power_up(self) -> None:
        """After a power cycle: every product is uncertain (lost ones stay lost), the beams are looked at anew, nothing is latched."""
        for product in self.products:
            if product.state in (_ENTERING, _UNLOADING):
                product.settled = _UNCERTAIN
            if product.state is not _LOST:
                product.state = _UNCERTAIN
            product.moving, product.moved_us, product.back = 0, _NEVER, 0.0
        self._beams = None
        self._way = [0] * len(self._way)
        self._in_beam = [None] * len(self._in_beam)
        self._cut = [None] * len(self._cut)
        self._risen = [0.0] * len(self._risen)
        self._odometer = [0.0] * len(self._odometer)
        self.brake = self.gap_stop = False
        self._braking = 0
        self._stands_since = _NEVER
        self._changed = True

    def snapshot(self) -> dict[str, Any]:
        """All that must survive a power cycle, as plain numbers, lists and dicts (JSON can hold it)."""
        return {
            "next_id": self.next_id,
            "counters": {name: getattr(self, name) for name in _COUNTERS},
            "greatest_correction": self.greatest_correction,
            "sensor_faults": self.sensor_faults,
            "misses": list(self._misses),
            "strangers": list(self._strangers),
            "products": [_row(product) for product in self.slots if product],
        }

    def restore(self, retained: Mapping[str, Any]) -> None:
        """Takes a snapshot back, in place of all that is there, and does what `power_up` does.

        Raises:
            ValueError: something is missing, or does not fit this line; says what. Nothing was changed.
        """
        try:
            products = [_product(row) for row in retained["products"]]
            counters = {name: int(retained["counters"][name]) for name in _COUNTERS}
            next_id, faults = int(retained["next_id"]), int(retained["sensor_faults"])
            greatest = float(retained["greatest_correction"])
            misses, strangers = [int(x) for x in retained["misses"]], [int(x) for x in retained["strangers"]]
        except (KeyError, TypeError) as error:
            raise ValueError(f"retained tracking data is not whole: {error}") from None
        count = len(self.line.sensors)
        if len(misses) != count or len(strangers) != count:
            raise ValueError(f"retained data has {len(misses)} sensors, the line {count}")
        slots: list[Product | None] = [None] * self.line.slots
        for product in products:
            if not 0 <= product.slot < self.line.slots or slots[product.slot]:
                raise ValueError(
                    f"product {product.id} has slot {product.slot}, a free one of {self.line.slots} expected"
                )
            if product.open_at >= count or not (isfinite(product.right) and 0 <= product.length < float("inf")):
                raise ValueError(f"product {product.id} does not fit this line")
            slots[product.slot] = product
        if not 1 <= next_id <= _LAST_ID or len({product.id for product in products}) != len(products):
            raise ValueError(f"next_id is {next_id} or an id is there twice")
        for name, value in counters.items():
            setattr(self, name, value)
        self.next_id, self.sensor_faults, self.greatest_correction = next_id, faults, greatest
        self._misses, self._strangers, self._stuck = misses, strangers, 0
        self.slots = slots
        self.products = [product for product in products if not self._past_the_end(product)]
        self.products.sort(key=_place, reverse=True)
        self.power_up()

    # movement

    def _move(self, moved: tuple[float, ...]) -> None:
        first = moved[0]
        uniform = True
        for belt, way in enumerate(moved):
            if way:
                self._odometer[belt] += way
                self._way[belt] = 1 if way > 0 else -1
            if way != first:
                uniform = False
        ends = self.line.belt_ends
        end, now = ends[-1], self._now
        ahead = float("inf")
        contact = False
        for product in self.products:
            right = product.right
            left = right - product.length
            if uniform and right > 0.0 and left < end:
                delta = first
            elif product.open_right and product.length == 0.0:
                delta = share(right, right + _TOUCH, ends, moved)
            else:
                delta = share(left, right, ends, moved)
            if delta:
                product.displacement += delta
                product.moved_us = now
                if product.open_at < 0:
                    product.right = right = right + delta
                else:
                    self._grow(product, delta)
                    right = product.right
                product.moving = 1 if delta > 0 else -1
                if (delta < 0) is not product.swapped:
                    self._turn(product, abs(delta))
                elif product.back:
                    product.back = 0.0
            if right > ahead:
                contact = True
            ahead = right - product.length
        if self._swaps and self._swapped:
            head = self._swapped
            self._tell(Code.REVERSED, int(head.swapped), head.id, 0, float(self._swaps), head.head)
            self._swaps, self._swapped = 0, None
        if contact:
            self._separate(None)

    def _turn(self, product: Product, way: float) -> None:
        product.back += way
        if product.back > _REVERSAL:
            product.swapped = not product.swapped
            product.back = 0.0
            self._swapped = self._swapped or product
            self._swaps += 1

    def _grow(self, product: Product, delta: float) -> None:
        """One end is held by the beam, the other moves; at no length the side turns with the movement."""
        right, length = product.right, product.length
        if product.open_right:
            length -= delta
        else:
            length += delta
            right += delta
        if length < 0.0:
            anchor = self.line.sensors[product.open_at]
            product.open_right = not product.open_right
            length, right = 0.0, anchor
        product.shifted += right - product.right - delta
        product.right, product.length = right, length
        if length > product.furthest:
            product.furthest = length

    def _shift(self, product: Product, by: float) -> None:
        """Another position; the end that a beam holds stays."""
        if product.open_at >= 0 and product.open_right:
            product.length = max(0.0, product.length - by)
            return
        if product.open_at >= 0:
            by = max(by, -product.length)
            product.length += by
        product.right += by
        product.shifted += by

    def _separate(self, fixed: Product | None) -> None:
        """No two products overlap: hold back what ran in, else push what is ahead, else cut; `fixed` was seen by a sensor and stays."""
        products = self.products
        for front, rear in list(pairwise(products)):
            if rear.right - front.left > _TOUCH:
                if front.open_at >= 0 and not front.open_right and rear.open_at < 0:
                    self._end_of_open(front, rear.right)
                elif rear.open_at >= 0 and rear.open_right and front.open_at < 0:
                    self._end_of_open(rear, front.left)
        for front, rear in pairwise(products):
            over = rear.right - front.left
            if over <= _TOUCH or rear is fixed or front.state is _LOST:
                continue
            if front.moving < 0 and rear.moving <= 0 and front is not fixed:
                continue
            if rear.open_at < 0 or not rear.open_right:
                self._shift(rear, -over)
                self._doubt(rear)
        for rear, front in pairwise(reversed(products)):
            over = rear.right - front.left
            if over > _TOUCH and front is not fixed and front.open_at < 0:
                self._shift(front, over)
                self._doubt(front)
        for front, rear in pairwise(products):
            over = rear.right - front.left
            if over > 0.0:
                rear.right -= over
                rear.shifted -= over
                if over > _TOUCH:
                    rear.length = max(0.0, rear.length - over)
                    self._doubt(rear)

    def _end_of_open(self, product: Product, end: float) -> None:
        """A known product is where the unknown end was thought to be: there it ends, whatever the beam says (it may be stuck)."""
        n, limits = product.open_at, self.settings
        if product.open_right:
            left = product.left
            product.shifted += end - product.right
            product.right, product.length = end, max(0.0, end - left)
        else:
            product.length = max(0.0, product.right - end)
        if product.length < limits.shortest:
            self.withdrawn += 1
            self._tell(Code.WITHDRAWN, n + 1, product.id, 0, product.furthest)
            self._remove(product)
            return
        product.open_at, product.length_known, product.measured = -1, False, False
        self._doubt(product)
        if product.state is _ENTERING:
            product.state = _UNCERTAIN
        self._set_passed(product)
        self._tell(Code.IDENTIFIED, n + 1, product.id, 0, product.length, product.head)

    # edges

    def _rising(self, n: int) -> None:
        self._risen[n] = self._travel(n)
        x = self.line.sensors[n]
        near = max(self.settings.sensor_tolerance, self.settings.lost_after)
        best = over = None
        best_by = 0.0
        for product in self.products:
            way = product.moving or 1
            end = product.right if way > 0 else product.left
            by = x - end
            if (
                self._is_expected(product, n, way)
                and product.open_at != n
                and abs(by) <= near
                and (best is None or abs(by) < abs(best_by))
            ):
                best, best_by = product, by
            if way > 0:
                if product.left + _TOUCH < x <= product.right + _TOUCH:
                    over = product
            elif product.left - _TOUCH <= x < product.right - _TOUCH:
                over = product
        if best:
            self._expected_edge(best, n, best_by)
            return
        if over:
            by = x - (over.right if (over.moving or 1) > 0 else over.left)
            if over.state is _LOST and over.lost_at == n + 1:
                self._find(over, n, by)
                return
            cut, self._cut[n] = self._cut[n], None
            if cut and cut.held.product is over:
                self._in_beam[n] = cut.held
            elif over.open_at >= 0 or not over.length_known:
                # how far it reaches is a guess, the sensor that saw it may be stuck: it, or another one behind it
                self.unexpected += 1
                self._tell(Code.UNEXPECTED, n + 1, over.id, 0, by)
                self._doubt(over)
            return
        self._stranger(n)

    def _expected_edge(self, product: Product, n: int, by: float) -> None:
        if self._now - product.moved_us > _RECENT_US:
            self.unexpected += 1
            self._tell(Code.UNEXPECTED, n + 1, product.id, 0, by)
        elif abs(by) <= self.settings.sensor_tolerance:
            self._correct(product, n, by, Code.HEAD_AT_SENSOR, product.moving or 1)
        else:
            self._find(product, n, by)

    def _find(self, product: Product, n: int, by: float) -> None:
        """The edge was not where it was expected, and there is room for no other product: take its position from the sensor, uncertain."""
        self.unexpected += 1
        self._tell(Code.UNEXPECTED, n + 1, product.id, 0, by)
        self._seen(product, n)
        self._pass(product, n, product.moving or 1)
        self._in_beam[n] = _Held(product, product.moving or 1, product.displacement, False)
        self._place_at(product, n, by)
        self._mark(product, _UNCERTAIN)

    def _correct(self, product: Product, n: int, by: float, code: Code, end: int) -> None:
        """Sets an end (1 right, −1 left) of a product to sensor `n`."""
        way = product.moving or 1
        self._seen(product, n)
        if code is Code.HEAD_AT_SENSOR:
            self._in_beam[n] = _Held(product, end, product.displacement)
        self._pass(product, n, way, end)
        self._place_at(product, n, by)
        self.corrections += 1
        self._tell(code, n + 1, product.id, 0, by, product.head)
        if abs(by) > self.settings.alarm_tolerance:
            self._tell(Code.OUTSIDE_TOLERANCE, n + 1, product.id, 0, by)
            self._mark(product, _OUTSIDE)
        elif (
            code is Code.HEAD_AT_SENSOR
            or (product.settled if product.state is _ENTERING else product.state) is not _OUTSIDE
        ):
            self._mark(product, _TRACKED)

    def _place_at(self, product: Product, n: int, by: float) -> None:
        product.corrected_at, product.correction = n + 1, by
        self.greatest_correction = max(self.greatest_correction, abs(by))
        self._shift(product, by)
        self._separate(product)

    def _stranger(self, n: int) -> None:
        """An edge that no record explains: an arrival at S1, elsewhere (or backwards) an unexpected product."""
        way = self._way_at(n)
        arrival = n == 0 and way > 0
        slot = self._free_slot()
        if slot is None:
            self.refused += 1
            if not arrival:
                self.unexpected += 1
                self._tell(Code.UNEXPECTED, n + 1)
            self._tell(Code.BUFFER_FULL, n + 1, 0, 0, float(self.refused))
            return
        x = self.line.sensors[n]
        product = self._record(slot, x, 0.0, _ENTERING if arrival else _UNCERTAIN, self._now)
        product.open_at, product.open_right = n, way < 0
        product.swapped = way < 0
        product.moving = way
        product.passed_left = (1 << n) - 1
        product.passed_right = (1 << n + 1) - 1
        self._in_order()
        if arrival:
            self.entered += 1
            self._tell(Code.ARRIVED, 1, product.id, 0, x)
            self._working(0)
        else:
            product.settled = _UNCERTAIN
            self.found += 1
            self.unexpected += 1
            self._tell(Code.UNEXPECTED, n + 1, product.id, 0, x)
            self._strangers[n] += 1
            before = n - way
            if self._strangers[n] > 1 and 0 <= before < len(self._misses):
                self._suspect(before, BLIND)
        if self.buffer_full:
            self._tell(Code.BUFFER_FULL, n + 1, product.id, 0, float(self.refused))

    def _falling(self, n: int) -> None:
        stuck = bool(self._stuck & 1 << n)
        if stuck:
            self._stuck &= ~(1 << n)
            self._working(n)
        opened = next((product for product in self.products if product.open_at == n), None)
        if opened:
            self._close(opened, n)
            return
        held, self._in_beam[n] = self._in_beam[n], None
        if held:
            self._trailing_edge(n, held)
            return
        x = self.line.sensors[n]
        for product in self.products:
            end = -(product.moving or 1)
            by = x - (product.right if end > 0 else product.left)
            if abs(by) <= self.settings.sensor_tolerance and self._now - product.moved_us <= _RECENT_US:
                doubtful = not product.measured and product.state is _UNCERTAIN
                self._correct(product, n, by, Code.TAIL_AT_SENSOR, end)
                if doubtful:
                    # its head was not seen here, and its length may be wrong
                    self._doubt(product)
                return
        if not stuck:
            self._part(n)

    def _part(self, n: int) -> bool:
        """The beam stayed interrupted behind the last product that it knows, for at least the shortest product's way: another one
        touches it there, and gets a record. True when it was so."""
        limits, x = self.settings, self.line.sensors[n]
        last: Product | None = None
        behind = 0.0
        for product in self.products:
            way = product.moving or 1
            past = ((product.left if way > 0 else product.right) - x) * way
            if past > 0.0 and (last is None or past < behind):
                last, behind = product, past
            elif product.left < x < product.right:
                return False
        if last is None or last.state is _LOST or not last.measured or self._now - last.moved_us > _RECENT_US:
            return False
        interrupted = abs(self._travel(n) - self._risen[n])
        if not limits.shortest <= behind <= limits.longest or interrupted < behind + limits.sensor_tolerance:
            return False
        way = last.moving or 1
        self._tell(Code.LENGTH_DIFFERS, n + 1, last.id, 0, behind, last.length + behind)
        self._doubt(last)
        self.unexpected += 1
        slot = self._free_slot()
        if slot is None:
            self.refused += 1
            self._tell(Code.UNEXPECTED, n + 1)
            self._tell(Code.BUFFER_FULL, n + 1, 0, 0, float(self.refused))
            return True
        right = x + behind if way > 0 else x
        product = self._record(slot, right, behind, _UNCERTAIN, self._now)
        product.settled = _UNCERTAIN
        product.swapped, product.moving = last.swapped, way
        self._set_passed(product)
        self._pass(product, n, way, -way)
        self._in_order()
        self.found += 1
        self._tell(Code.UNEXPECTED, n + 1, product.id, last.id, product.head, behind)
        if self.buffer_full:
            self._tell(Code.BUFFER_FULL, n + 1, product.id, 0, float(self.refused))
        return True

    def _trailing_edge(self, n: int, held: _Held) -> None:
        """The beam is free again, of the product that interrupted it."""
        product, limits = held.product, self.settings
        x = self.line.sensors[n]
        end = -(product.moving or 1)
        by = x - (product.right if end > 0 else product.left)
        if self._now - product.moved_us > _RECENT_US:
            return
        whole = end != held.risen
        measured = abs(product.displacement - held.since)
        near = abs(by) <= max(limits.sensor_tolerance, limits.lost_after)
        if whole and not product.length_known and limits.shortest <= measured <= limits.longest:
            self._take_length(product, n, measured, end)
        elif near or (whole and not held.sure and measured >= limits.shortest):
            self._correct(product, n, by, Code.TAIL_AT_SENSOR, end)
            if whole and abs(measured - product.length) > limits.alarm_tolerance:
                self._tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, measured - product.length, measured)
            elif whole and held.sure and product.length_known:
                product.measured = True
            if not near:
                self._mark(product, _UNCERTAIN)
        elif not whole or measured < limits.shortest:
            return
        elif by * end < 0:
            # the end is not at the sensor yet: shorter than tracked, or a hole in it; the way that the beam stays free will tell
            self._cut[n] = _Cut(held, measured, self._travel(n))
        elif not self._part(n) and measured <= limits.longest and not self._covered(x, product):
            self._take_length(product, n, measured, end)

    def _covered(self, x: float, but: Product) -> bool:
        """Another product is at `x`, so what a beam says there is about that one."""
        return any(other is not but and other.left < x < other.right for other in self.products)

    def _take_length(self, product: Product, n: int, measured: float, end: int) -> None:
        """The trailing end (1 right, −1 left) is at the sensor, the length is what was measured there."""
        x = self.line.sensors[n]
        self._tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, measured - product.length, measured)
        right = x if end > 0 else x + measured
        product.shifted += right - product.right
        product.right, product.length, product.length_known, product.measured = right, measured, True, False
        product.corrected_at = n + 1
        self._pass(product, n, product.moving or 1, end)
        self._mark(product, _UNCERTAIN)
        self._separate(product)

    def _look_for_short(self, beams: tuple[bool, ...]) -> None:
        """The beam has been free for the shortest product's way although a product should be in it: that one is shorter."""
        for n, cut in enumerate(self._cut):
            if cut and not beams[n] and abs(self._travel(n) - cut.travel) >= self.settings.shortest:
                self._cut[n] = None
                self._shorten(cut.held.product, n, cut.measured)

    def _shorten(self, product: Product, n: int, length: float) -> None:
        """Its leading end is right; what was behind the measured length is not there."""
        self._tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, length - product.length, length)
        self._mark(product, _UNCERTAIN)
        if length >= product.length:
            return
        if (product.moving or 1) < 0:
            right = product.left + length
            product.shifted += right - product.right
            product.right = right
        product.length, product.measured = length, False
        self._set_passed(product)

    def _close(self, product: Product, n: int) -> None:
        """The beam is free: the unknown end has passed it, or what came has gone back."""
        limits = self.settings
        back = product.moving == (1 if product.open_right else -1)
        if product.length < limits.shortest or (back and product.length <= limits.lost_after):
            self.withdrawn += 1
            self._tell(Code.WITHDRAWN, n + 1, product.id, 0, product.furthest)
            self._remove(product)
            return
        product.open_at = -1
        if product.state is _ENTERING:
            product.state = _UNCERTAIN if back else product.settled
        product.measured = not back and product.length <= limits.longest
        self._pass(product, n, product.moving or 1, 1 if product.open_right else -1)
        self._tell(Code.IDENTIFIED, n + 1, product.id, 0, product.length, product.head)
        if product.length > limits.longest:
            self._tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, product.length - limits.longest, product.length)
            self._doubt(product)

    # what did not happen

    def _look_for_missed(self) -> None:
        sensors, after = self.line.sensors, self.settings.lost_after
        for product in self.products:
            right = product.right
            left = right - product.length
            if product.moving > 0:
                missed = ((1 << bisect_left(sensors, right - after)) - 1) & ~product.passed_right
                gone = ((1 << bisect_left(sensors, left - after)) - 1) & ~product.passed_left
                if missed:
                    product.passed_right |= missed
                    self._miss(product, missed)
                if gone:
                    product.passed_left |= gone
            elif product.moving < 0:
                missed = product.passed_left & ~((1 << bisect_right(sensors, left + after)) - 1)
                gone = product.passed_right & ~((1 << bisect_right(sensors, right + after)) - 1)
                if missed:
                    product.passed_left &= ~missed
                    self._miss(product, missed)
                if gone:
                    product.passed_right &= ~gone

    def _miss(self, product: Product, bits: int) -> None:
        beams = self._beams or ()
        for n in range(len(self.line.sensors)):
            if not bits & 1 << n:
                continue
            if beams[n] or self.sensor_faults & 1 << n:
                self._doubt(product)
                held = self._in_beam[n]
                if held and held.product is not product:
                    self._in_beam[n] = None
                continue
            product.missed |= 1 << n
            product.lost_at = n + 1
            if product.state is _LOST:
                continue
            product.state = _LOST
            self.lost += 1
            self._tell(Code.LOST, n + 1, product.id, 0, product.head)
            self._misses[n] += 1
            if self._misses[n] > 1:
                self._suspect(n, BLIND)

    def _look_for_stuck(self, beams: tuple[bool, ...]) -> None:
        limit = self.settings.longest + self.settings.lost_after
        for n, interrupted in enumerate(beams):
            if not interrupted or self._stuck & 1 << n or abs(self._travel(n) - self._risen[n]) <= limit:
                continue
            self._stuck |= 1 << n
            self._suspect(n, STUCK)
            self._in_beam[n] = None
            for product in self.products:
                if product.open_at == n:
                    self._give_up_length(product, n)

    def _give_up_length(self, product: Product, n: int) -> None:
        """Its trailing end will not be seen: it has the greatest length that may be, to be measured at the next sensor."""
        length = self.settings.longest
        if product.open_right:
            right = product.left + length
            product.shifted += right - product.right
            product.right = right
        self._tell(Code.LENGTH_DIFFERS, n + 1, product.id, 0, product.length - length, product.length)
        product.length, product.length_known, product.measured, product.open_at = length, False, False, -1
        if product.state is not _LOST:
            product.state = _UNCERTAIN
        self._set_passed(product)
        self._separate(None)

    def _suspect(self, n: int, of: int) -> None:
        if not self.sensor_faults & 1 << n:
            self.sensor_faults |= 1 << n
            self._tell(Code.SENSOR_SUSPECTED, n + 1, 0, 0, float(of))

    def _working(self, n: int) -> None:
        self._misses[n] = 0
        if n + 1 < len(self._strangers):
            self._strangers[n + 1] = 0
        if self.sensor_faults & 1 << n and not self._stuck & 1 << n:
            self.sensor_faults &= ~(1 << n)
            self._tell(Code.SENSOR_OK, n + 1)

    def _seen(self, product: Product, n: int) -> None:
        self._strangers[n] = 0
        self._working(n)
        elsewhere = product.missed & ~(1 << n)
        if product.state is _LOST:
            for other in range(len(self.line.sensors)):
                if elsewhere & 1 << other:
                    self._suspect(other, BLIND)
            arriving = product.open_at == 0 and not product.open_right
            product.state = _ENTERING if arriving else _TRACKED
        product.missed = product.lost_at = 0

    # leaving

    def _leave(self) -> None:
        """Products past either end of the line."""
        end = self.line.length
        products = self.products
        while products and products[0].left >= end:
            product = products[0]
            if product.state is _LOST:
                self._forget_beams(products.pop(0))
            else:
                self._unloaded(product)
        while products and products[-1].right <= 0.0:
            product = products[-1]
            if product.state is _LOST:
                self._forget_beams(products.pop())
            else:
                self.left += 1
                self._tell(Code.LEFT_BACKWARDS, 0, product.id, 0, product.age(self._now))
                self._remove(product)

    def _unload(self, moved: float, stop: float) -> None:
        product = self._front()
        if self.brake and (product is None or product.id != self._braking):
            self._end_unloading()
        if product is None:
            return
        remaining = self.line.length - product.right
        stands = moved == 0.0 and abs(stop) < _STANDS
        if not self.brake:
            due = remaining <= 0.0 if stands else moved >= 0.0 and stop >= 0.0 and remaining <= stop + moved
            if not due or product.right <= self._last_part():
                return
            self.brake, self._braking = True, product.id
            self._stands_since = _NEVER
        elif moved < 0.0 or (stands and remaining > self.settings.sensor_tolerance):
            self._end_unloading()
            return
        if product.state is _LOST:
            self._stands_since = _NEVER
            return
        if product.state is not _UNLOADING:
            product.settled, product.state = product.state, _UNLOADING
            self._changed = True
        if not stands:
            self._stands_since = _NEVER
            return
        if self._stands_since == _NEVER:
            self._stands_since = self._now
        if self._now - self._stands_since >= self.settings.unload_dwell * 1e6:
            self._unloaded(product)

    def _end_unloading(self) -> None:
        self.brake, self._braking = False, 0
        self._changed = True
        for product in self.products:
            if product.state is _UNLOADING:
                product.state = product.settled

    def _unloaded(self, product: Product) -> None:
        self.unloaded += 1
        self._tell(Code.UNLOADED, 0, product.id, 0, product.age(self._now), product.head)
        self._remove(product)

    def _last_part(self) -> float:
        """Where the last belt or the last area begins [mm], what comes first."""
        belts, areas = self.line.belt_ends, self.line.area_ends
        return min(belts[-2] if len(belts) > 1 else 0.0, areas[-2] if len(areas) > 1 else 0.0)

    def _front(self) -> Product | None:
        for product in self.products:
            if product.may_be_there:
                return product
        return None

    # what follows from the positions

    def _occupy(self) -> None:
        ends = self.line.area_ends
        last, count = ends[-1] + self.settings.sensor_tolerance, len(ends)
        areas = 0
        for product in self.products:
            head = product.right - product.length if product.swapped else product.right
            if head < 0.0 or head > last:
                product.area = 0
                continue
            area = bisect_left(ends, head) + 1
            product.area = area = area if area < count else count
            if product.state is not _LOST or product.may_be_there:
                areas |= 1 << area - 1
        self.areas = areas

    def _supervise(self, stops: tuple[float, ...]) -> None:
        self.gap = pair = nearest(self.products, self.line.belt_ends, stops, self.settings.gap_margin)
        if pair and pair.stop and not self.gap_stop:
            self.gap_stop = True
            self._tell(Code.GAP_STOP, 0, pair.rear, pair.front, pair.gap, pair.closing)

    # records

    def _record(self, slot: int, right: float, length: float, state: ProductState, time_us: int) -> Product:
        product = Product(self._take_id(), slot, right, length, state, time_us, moved_us=time_us)
        self.slots[slot] = product
        self.products.append(product)
        self._changed = True
        return product

    def _take_id(self) -> int:
        id = self.next_id
        used = {product.id for product in self.slots if product}
        self.next_id = id % _LAST_ID + 1
        while self.next_id in used:
            self.next_id = self.next_id % _LAST_ID + 1
        return id

    def _free_slot(self) -> int | None:
        return self.slots.index(None) if None in self.slots else None

    def _remove(self, product: Product) -> None:
        if product.id == self._braking:
            self._end_unloading()
        self.slots[product.slot] = None
        if product in self.products:
            self.products.remove(product)
        self._forget_beams(product)
        self._changed = True

    def _forget_beams(self, product: Product) -> None:
        for n, held in enumerate(self._in_beam):
            cut = self._cut[n]
            if held and held.product is product:
                self._in_beam[n] = None
            if cut and cut.held.product is product:
                self._cut[n] = None

    def _by_id(self, id: int) -> Product:
        for product in self.slots:
            if product and product.id == id:
                return product
        raise EditRefused(Reason.NO_SUCH_PRODUCT, f"no product {id} in the table")

    def _right_of(self, head: float, length: float, swapped: bool) -> float:
        limits = self.settings
        if not (isfinite(length) and limits.shortest <= length <= limits.longest):
            raise EditRefused(
                Reason.LENGTH, f"length is {length} mm, {limits.shortest:g} to {limits.longest:g} expected"
            )
        right = head + length if swapped else head
        if not (isfinite(right) and right - length >= 0.0 and right <= self.line.length):
            raise EditRefused(
                Reason.OUTSIDE_LINE, f"head {head} mm with length {length} mm is not on 0 to {self.line.length:g} mm"
            )
        return right

    def _require_room(self, right: float, length: float, but: Product | None) -> None:
        for other in self.products:
            if other is not but and right > other.left + _TOUCH and right - length < other.right - _TOUCH:
                raise EditRefused(Reason.OVERLAP, f"product {other.id} is there, {other.left:g} to {other.right:g} mm")

    def _in_order(self) -> None:
        self.products.sort(key=_place, reverse=True)

    def _set_passed(self, product: Product) -> None:
        """From the position alone; an end within the tolerance of a free beam may still come to it."""
        near = self.settings.sensor_tolerance
        product.passed_right = product.passed_left = 0
        for n, x in enumerate(self.line.sensors):
            interrupted = bool(self._beams and self._beams[n])
            if product.right > (x if interrupted else x + near):
                product.passed_right |= 1 << n
            if product.left > (x if interrupted else x - near):
                product.passed_left |= 1 << n

    def _pass(self, product: Product, n: int, way: int, end: int = 0) -> None:
        """The end (1 right, −1 left; 0 = the leading one) passes sensor `n` in this direction, the trailing one last."""
        if end == -way:
            self._pass(product, n, way)
        if (end or way) > 0:
            product.passed_right = product.passed_right | 1 << n if way > 0 else product.passed_right & ~(1 << n)
        else:
            product.passed_left = product.passed_left | 1 << n if way > 0 else product.passed_left & ~(1 << n)

    def _is_expected(self, product: Product, n: int, way: int) -> bool:
        """Its leading end has not passed sensor `n` yet."""
        return not product.passed_right & 1 << n if way > 0 else bool(product.passed_left & 1 << n)

    def _mark(self, product: Product, state: ProductState) -> None:
        if product.state in (_ENTERING, _UNLOADING):
            product.settled = state
        else:
            product.state = state

    def _doubt(self, product: Product) -> None:
        if product.state is not _LOST:
            self._mark(product, _UNCERTAIN)

    def _past_the_end(self, product: Product) -> bool:
        return product.state is _LOST and (product.left >= self.line.length or product.right <= 0.0)

    def _predicted(self) -> tuple[bool, ...]:
        """What the beams should show."""
        return tuple(
            any(
                product.open_at == n or (product.state is not _LOST and product.left < x < product.right)
                for product in self.products
            )
            for n, x in enumerate(self.line.sensors)
        )

    def _travel(self, n: int) -> float:
        """Way of the belts beside a sensor so far [mm]."""
        before, behind = self._beside[n]
        return (self._odometer[before] + self._odometer[behind]) / 2

    def _way_at(self, n: int) -> int:
        """Which way something comes to a sensor: 1 forward, −1 backwards."""
        before, behind = self._beside[n]
        return -1 if self._way[behind] < 0 and self._way[before] <= 0 else 1

    def _any(self, state: ProductState) -> bool:
        return any(product is not None and product.state is state for product in self.slots)

    def _tell(
        self, code: Code, source: int = 0, id: int = 0, second: int = 0, value: float = 0.0, value2: float = 0.0
    ) -> None:
        self._events.append(TrackingEvent(code, source, id, second, value, value2))

    def _check(self, moved: tuple[float, ...], beams: tuple[bool, ...], stops: tuple[float, ...]) -> None:
        belts, sensors = len(self.line.belt_ends), len(self.line.sensors)
        if len(moved) != belts or len(stops) != belts or len(beams) != sensors:
            raise ValueError(
                f"{len(moved)} movements, {len(stops)} distances to stop, {len(beams)} beams; "
                f"{belts}, {belts} and {sensors} expected"
            )
        # a sum is finite only when all are
        if not isfinite(sum(moved) + sum(stops)):
            raise ValueError(f"moved is {moved}, stop_distances is {stops}, finite numbers expected")


def _place(product: Product) -> float:
    return product.right - product.length / 2


def _row(product: Product) -> dict[str, Any]:
    row = {field.name: getattr(product, field.name) for field in fields(Product)}
    row["state"], row["settled"] = int(product.state), int(product.settled)
    return row


def _product(row: Mapping[str, Any]) -> Product:
    return Product(**{**row, "state": ProductState(row["state"]), "settled": ProductState(row["settled"])})
