"""Product tracking: where every product on the line is, from the belts' encoders, corrected by the sensors."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from app.blocks.product_tracking.absence import look_for_missed, look_for_stuck
from app.blocks.product_tracking.diverting import divert, stay_in_lanes
from app.blocks.product_tracking.edges import falling, look_for_short, rising
from app.blocks.product_tracking.gaps import nearest
from app.blocks.product_tracking.leaving import leave, unload
from app.blocks.product_tracking.merging import come_in
from app.blocks.product_tracking.movement import move
from app.blocks.product_tracking.product import (
    Code,
    EditReason,
    EditRefused,
    Gap,
    LineLayout,
    Product,
    Settings,
    TrackingEvent,
)
from app.blocks.product_tracking.retention import retain, take_back
from app.blocks.product_tracking.table import ENTERING, LOST, NEVER, TOUCH, TRACKED, UNCERTAIN, UNLOADING, ProductTable


class ProductTracking(ProductTable):
    """Tracks the products of one line: first in, first out, none passes another.

    **Identity.** A rising edge at S1 that no record explains is an arrival: a new id (u32, never used twice while it is in the table),
    the head at S1. The length is what the product moves until the falling edge; then head = S1 + length, tail = S1. An arrival that
    goes back out of S1, or that was shorter than the shortest product, is withdrawn; when it comes again it is a new arrival.

    **Movement.** A product moves by the mean of its belts' movements, weighted by the part of its length on each at the beginning of the
    scan; one whose other end is still in a beam reaches as far behind the sensor as the shortest product is long. When the belts beside
    that sensor went different ways meanwhile, its length is a guess, measured anew at the next sensor, and it is uncertain; it is withdrawn
    only if what was the faster belt at every moment did not carry it as far as the shortest product is long. Two products that would
    overlap are in contact: the one that ran into the other is held (a lost one gives way) and is uncertain.

    **Correction.** The leading end makes the rising edge, the trailing end the falling one; which is which follows the direction of
    travel, so backwards the left end leads. An end within the sensor tolerance is set to the sensor, the length stays, the amount
    (actual − expected) is kept. Above the alarm tolerance the product is *outside tolerance* until a smaller correction or a
    confirmation. A correction makes an uncertain or lost product a tracked one (one of the trailing end alone only where a sensor
    measured the length). A measured length that differs by more than the alarm tolerance is told. A standing product makes no edges: a
    hand in the beam does not move it.

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

    At any time entered + found + inserted + merged = in the table + unloaded + deleted + withdrawn + left + diverted.

    **Diverting.** A product whose head comes to a gate goes where the gate stands (`gates`), straight on or into its lane (`diverting`).

    **Merging.** A product that its lane lets go comes in at its gate, between those that are on the line (`merging`).

    Source: thesis 003, TRK_PROD (reference/theses-facts.md section 3, decisions 13–15 of section 6). What the thesis does not have (lost,
    unexpected, contact, suspicion, capacity) is ours.
    """

    def __init__(self, line: LineLayout, settings: Settings | None = None) -> None:
        super().__init__(line, settings)
        self._stops: tuple[float, ...] = ()

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
        _check(self.line, moved, beams, stops)
        events: list[TrackingEvent] = []
        self.events, self.now = events, time_us
        if self.beams is None:
            self.beams = self.predicted()
            self.changed = True
        moving = any(moved)
        if moving:
            move(self, moved)
            come_in(self)
            divert(self)
        if beams != self.beams:
            before, self.beams = self.beams, beams
            for n, interrupted in enumerate(beams):
                if interrupted and not before[n]:
                    rising(self, self.sensors[n])
                elif before[n] and not interrupted:
                    falling(self, self.sensors[n])
            stay_in_lanes(self)
            come_in(self)
        if moving:
            look_for_missed(self)
            if self.cuts:
                look_for_short(self, beams)
            if True in beams:
                look_for_stuck(self, beams)
            leave(self)
        unload(self, moved[-1], stops[-1])
        if self.changed or moving or events:
            self._occupy()
            self._supervise(stops)
        elif stops != self._stops:
            self._supervise(stops)
        self._stops, self.changed = stops, False
        return events

    def gap_with(self, stop_distances: Sequence[float]) -> Gap | None:
        """The most critical pair if the belts had these distances to stop [mm, signed]; ask before belts are started again."""
        limits = self.settings
        return nearest(self.products, self.line.belt_ends, stop_distances, limits.gap_margin, limits.shortest)

    def release_gap_stop(self) -> list[TrackingEvent]:
        """Ends a latched gap stop (after the restart delay, or by reset); it comes again if a pair still comes too near."""
        if not self.gap_stop:
            return []
        self.gap_stop = False
        self.changed = True
        pair = self.gap
        return (
            [TrackingEvent(Code.GAP_STOP_ENDED, 0, pair.rear, pair.front, pair.gap, pair.closing)]
            if pair
            else [TrackingEvent(Code.GAP_STOP_ENDED)]
        )

    # what people do

    def delete(self, id: int) -> TrackingEvent:
        """Takes a record out. `value` of the event is its head [mm].

        Raises:
            EditRefused: no such product.
        """
        product = self._by_id(id)
        self.remove(product)
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
        if product.id == self.braking:
            self.end_unloading()
        self.forget_beams(product)
        product.shifted += right - product.right
        product.right, product.length = right, length
        self.put_on_line(product)
        product.state = product.settled = TRACKED
        product.open_at, product.length_known, product.lost_at, product.missed = -1, True, 0, 0
        product.measured = False
        self.set_passed(product)
        if product not in self.products:
            self.products.append(product)
        self.changed = True
        self.put_in_order()
        return TrackingEvent(Code.EDITED, 0, id, 0, head, length)

    def insert(self, head: float, length: float, time_us: int) -> TrackingEvent:
        """A new record with its head (right end) and length [mm], tracked; `id` of the event is its identity.

        Raises:
            EditRefused: buffer full, outside the line, length outside limits, overlaps another.
        """
        right = self._right_of(head, length, False)
        self._require_room(right, length, None)
        slot = self.free_slot()
        if slot is None:
            raise EditRefused(EditReason.BUFFER_FULL, f"all {self.line.slots} slots are taken")
        product = self.record(slot, right, length, TRACKED, time_us)
        product.moved_us = NEVER
        self.set_passed(product)
        self.inserted += 1
        self.put_in_order()
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
                raise EditRefused(EditReason.OUTSIDE_LINE, f"product {id} is past the end of the line")
            chosen = [product]
        else:
            chosen = [product for product in self.products if product.state is not LOST]
        changed = 0
        for product in chosen:
            if product.state in (ENTERING, UNLOADING):
                changed += product.settled is not TRACKED
                product.settled = TRACKED
            elif product.state is not TRACKED:
                product.state = TRACKED
                product.lost_at = product.missed = 0
                changed += 1
        self.changed = True
        return TrackingEvent(Code.CONFIRMED, 0, id, 0, float(changed))

    # power

    def power_up(self) -> None:
        """After a power cycle: every product is uncertain (lost ones stay lost), the beams are looked at anew, nothing is latched."""
        for product in self.products:
            if product.state in (ENTERING, UNLOADING):
                product.settled = UNCERTAIN
            if product.state is not LOST:
                product.state = UNCERTAIN
            product.moving, product.moved_us, product.back = 0, NEVER, 0.0
        self.beams = None
        self.cuts.clear()
        self.ways = [0] * len(self.ways)
        self.odometers = [0.0] * len(self.odometers)
        for sensor in self.sensors:
            sensor.held = None
            self.begin(sensor)
        self.brake = self.gap_stop = False
        self.braking = 0
        self.stands_since = NEVER
        self.changed = True

    def snapshot(self) -> dict[str, Any]:
        """All that must survive a power cycle, as plain numbers, lists and dicts (JSON can hold it)."""
        return retain(self)

    def restore(self, retained: Mapping[str, Any]) -> None:
        """Takes a snapshot back, in place of all that is there, and does what `power_up` does.

        Raises:
            ValueError: something is missing, or does not fit this line; says what. Nothing was changed.
        """
        take_back(self, retained)
        self.power_up()

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
            if product.state is not LOST or product.may_be_there:
                areas |= 1 << area - 1
        self.areas = areas

    def _supervise(self, stops: tuple[float, ...]) -> None:
        self.gap = pair = self.gap_with(stops)
        if pair and pair.stop and not self.gap_stop:
            self.gap_stop = True
            self.tell(Code.GAP_STOP, 0, pair.rear, pair.front, pair.gap, pair.closing)

    # what is accepted

    def _by_id(self, id: int) -> Product:
        for product in self.slots:
            if product and product.id == id:
                return product
        raise EditRefused(EditReason.NO_SUCH_PRODUCT, f"no product {id} in the table")

    def _right_of(self, head: float, length: float, swapped: bool) -> float:
        limits = self.settings
        if not (isfinite(length) and limits.shortest <= length <= limits.longest):
            raise EditRefused(
                EditReason.LENGTH, f"length is {length} mm, {limits.shortest:g} to {limits.longest:g} expected"
            )
        right = head + length if swapped else head
        if not (isfinite(right) and right - length >= 0.0 and right <= self.line.length):
            raise EditRefused(
                EditReason.OUTSIDE_LINE, f"head {head} mm, length {length} mm: not on 0 to {self.line.length:g} mm"
            )
        return right

    def _require_room(self, right: float, length: float, but: Product | None) -> None:
        for other in self.products:
            if other is not but and right > other.left + TOUCH and right - length < other.right - TOUCH:
                raise EditRefused(
                    EditReason.OVERLAP, f"product {other.id} is there, {other.left:g} to {other.right:g} mm"
                )


def _check(line: LineLayout, moved: tuple[float, ...], beams: tuple[bool, ...], stops: tuple[float, ...]) -> None:
    belts, sensors = len(line.belt_ends), len(line.sensors)
    if len(moved) != belts or len(stops) != belts or len(beams) != sensors:
        raise ValueError(
            f"{len(moved)} movements, {len(stops)} distances to stop, {len(beams)} beams; "
            f"{belts}, {belts} and {sensors} expected"
        )
    # a sum is finite only when all are
    if not isfinite(sum(moved) + sum(stops)):
        raise ValueError(f"moved is {moved}, stop_distances is {stops}, finite numbers expected")
