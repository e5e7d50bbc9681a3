"""Product tracking with the numbers of the thesis: identity, movement, correction, gaps, unloading, and what it does not have."""

import json
import math
from dataclasses import replace

import pytest

from app.blocks.product_tracking import (
    BLIND,
    STUCK,
    Code,
    EditReason,
    EditRefused,
    LineLayout,
    Product,
    ProductState,
    ProductTracking,
    Settings,
    TrackingEvent,
    share,
)

from .belt_line import BeltLine, codes, line_with

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


# identity


@pytest.mark.parametrize("line", [LineLayout(), SIMULATION])
def test_length_is_what_it_moved_between_both_edges_at_s1(line: LineLayout) -> None:
    bench = Bench(line)
    s1 = line.sensors[0]
    assert bench.beam(1, True) == [TrackingEvent(Code.ARRIVED, 1, 1, 0, s1)]
    product = bench.tracking.products[0]
    assert (product.state, product.head, product.tail) == (ProductState.ENTERING, s1, s1)
    bench.move(29)
    assert (product.head, product.length) == (s1 + 29, 29)
    events = bench.beam(1, False)
    assert events == [TrackingEvent(Code.IDENTIFIED, 1, 1, 0, 30.0, s1 + 30)]
    assert (product.head, product.tail, product.length, product.state) == (s1 + 30, s1, 30, ProductState.TRACKED)
    assert bench.tracking.entered == 1


def test_identities_count_from_one_and_do_not_wrap_at_a_hundred() -> None:
    bench = Bench(lost_after=100.0, unload_dwell=0.0)
    tracking = bench.tracking
    for expected in range(1, 131):
        product = bench.arrive(12)
        assert product.id == expected
        tracking.delete(product.id)
        bench.move(3)
    assert (tracking.next_id, tracking.entered, tracking.deleted) == (131, 130, 130)


def test_identity_is_32_bits_and_skips_what_is_in_use() -> None:
    bench = Bench()
    tracking = bench.tracking
    old = put(bench, 600.0, 20.0)
    assert old.id == 1
    tracking.next_id = 2**32 - 1
    assert tracking.insert(400.0, 20.0, 0).id == 2**32 - 1
    assert tracking.insert(300.0, 20.0, 0).id == 2


def test_first_in_first_out() -> None:
    bench = Bench(lost_after=100.0)
    for length in (20, 30, 40):
        bench.arrive(length)
        bench.move(20)
    products = bench.tracking.products
    assert [product.id for product in products] == [1, 2, 3]
    assert [product.length for product in products] == [20, 30, 40]
    assert [product.tail for product in products] == [100 + 20 + 31 + 20 + 41 + 20, 100 + 20 + 41 + 20, 100 + 20]


def test_arrival_that_backs_out_is_withdrawn_and_comes_again_as_a_new_one() -> None:
    bench = Bench()
    bench.beam(1, True)
    bench.move(25)
    bench.move(-24)
    assert bench.tracking.products[0].length == 1
    events = bench.beam(1, False, -1.0)
    assert [(e.code, e.id, e.value) for e in events] == [(Code.WITHDRAWN, 1, 25.0)]
    assert not bench.tracking.products and bench.tracking.withdrawn == 1
    bench.move(-20)
    bench.move(20)
    assert bench.beam(1, True)[0] == TrackingEvent(Code.ARRIVED, 1, 2, 0, 100.0)
    bench.move(39)
    bench.beam(1, False)
    assert bench.tracking.products[0].length == 40


def test_reversing_inside_s1_does_not_spoil_the_length() -> None:
    bench = Bench()
    bench.beam(1, True)
    bench.move(25)
    bench.move(-20)
    bench.move(34)
    events = bench.beam(1, False)
    assert events[-1].code is Code.IDENTIFIED and events[-1].value == 40.0
    assert bench.tracking.products[0].state is ProductState.TRACKED


def test_a_hand_at_s1_is_no_product() -> None:
    bench = Bench()
    bench.beam(1, True, 0.0)
    assert [e.code for e in bench.beam(1, False, 0.0)] == [Code.WITHDRAWN]
    bench.beam(1, True)
    bench.move(4)
    assert [e.code for e in bench.beam(1, False)] == [Code.WITHDRAWN]
    assert not bench.tracking.products and bench.tracking.withdrawn == 2


def test_longer_than_the_longest_is_told_and_uncertain() -> None:
    bench = Bench(longest=50.0, shortest=10.0)
    product = bench.arrive(55)
    assert product.length == 55 and product.state is ProductState.UNCERTAIN


# movement


def test_on_two_belts_the_share_of_its_length_counts() -> None:
    bench = Bench()
    product = put(bench, 225.0, 40.0)  # 30 mm on belt 1, 10 mm on belt 2
    bench.scan(1.0, 2.0, 0.0)
    assert product.head == pytest.approx(225 + 0.75 * 1 + 0.25 * 2)
    assert product.displacement == pytest.approx(1.25)


def test_on_three_belts_too() -> None:
    assert share(90.0, 130.0, (100.0, 120.0, 200.0), (1.0, 2.0, 4.0)) == pytest.approx((10 + 2 * 20 + 4 * 10) / 40)


def test_what_lies_off_the_belts_does_not_count() -> None:
    assert share(-30.0, 10.0, (100.0, 200.0), (1.0, 2.0)) == 1.0
    assert share(195.0, 215.0, (100.0, 200.0), (1.0, 2.0)) == 2.0
    assert share(200.5, 215.0, (100.0, 200.0), (1.0, 2.0)) == 0.0


def test_a_border_belongs_to_the_belt_that_ends_there() -> None:
    assert share(100.0, 100.0, (100.0, 200.0), (1.0, 2.0)) == 1.0


@pytest.mark.parametrize(
    ("head", "area"),
    [(20.0, 1), (215.0, 1), (215.1, 2), (314.6, 2), (445.0, 2), (500.0, 3), (560.0, 3), (561.0, 4), (660.0, 4)],
)
def test_area_follows_the_head(head: float, area: int) -> None:
    bench = Bench()
    product = put(bench, head, 18.6)
    bench.scan()
    assert product.area == area and bench.tracking.areas == 1 << area - 1


# correction


def test_head_is_set_to_the_sensor_and_the_length_stays() -> None:
    bench = Bench()
    product = put(bench, 210.0, 30.0)
    bench.move(2)
    events = bench.beam(2, True)
    assert events[0] == TrackingEvent(Code.HEAD_AT_SENSOR, 2, 1, 0, 2.0, 215.0)
    assert (product.head, product.tail, product.length) == (215.0, 185.0, 30.0)
    assert (product.corrected_at, product.correction, product.state) == (2, 2.0, ProductState.TRACKED)
    assert (bench.tracking.corrections, bench.tracking.greatest_correction) == (1, 2.0)


def test_tail_is_set_to_the_sensor_too() -> None:
    bench = Bench()
    product = put(bench, 214.0, 30.0)
    bench.beam(2, True)
    bench.move(28)
    events = bench.beam(2, False)
    assert events == [TrackingEvent(Code.TAIL_AT_SENSOR, 2, 1, 0, 1.0, 245.0)]
    assert (product.tail, product.head, product.length, product.correction) == (215.0, 245.0, 30.0, 1.0)


@pytest.mark.parametrize(
    ("early", "outside"), [(2.0, False), (2.1, True), (-2.0, False), (-2.1, True), (5.0, True), (-5.0, True)]
)
def test_a_correction_above_the_alarm_tolerance_is_an_alarm(early: float, outside: bool) -> None:
    bench = Bench(sensor_tolerance=5.0, alarm_tolerance=2.0)
    put(bench, 443.0 - 6.0 - early, 30.0)
    product = bench.tracking.products[0]
    bench.move(7)
    events = bench.beam(3, True)
    assert [e.code for e in events[:1]] == [Code.HEAD_AT_SENSOR] and product.head == 445.0
    assert (Code.OUTSIDE_TOLERANCE in codes(events)) is outside
    assert (product.state is ProductState.OUTSIDE) is outside
    assert bench.tracking.outside_present is outside


def test_outside_ends_with_a_good_correction_or_a_confirmation() -> None:
    bench = Bench()
    product = put(bench, 211.0, 30.0)
    bench.beam(2, True)
    assert product.state is ProductState.OUTSIDE
    bench.move(29)
    bench.beam(2, False)
    assert product.state is ProductState.OUTSIDE, "the tail of the same pass does not clear it"
    bench.move(199)
    bench.beam(3, True)
    assert product.state is ProductState.TRACKED
    product.state = ProductState.OUTSIDE
    assert bench.tracking.confirm(product.id).value == 1.0
    assert product.state is ProductState.TRACKED


def test_no_correction_beyond_the_sensor_tolerance_by_a_product_that_is_far() -> None:
    bench = Bench()
    product = put(bench, 190.0, 30.0)
    bench.scan(1.0)
    events = bench.beam(2, True)
    assert codes(events)[0] is Code.UNEXPECTED and events[0].id != product.id
    assert product.head == 192.0 and product.correction == 0.0


def test_measured_length_that_differs_is_told_and_the_tracked_one_kept() -> None:
    bench = Bench()
    product = put(bench, 214.0, 30.0)
    bench.beam(2, True)
    bench.move(33)
    events = bench.beam(2, False)
    assert [(e.code, e.value) for e in events] == [
        (Code.TAIL_AT_SENSOR, -4.0),
        (Code.OUTSIDE_TOLERANCE, -4.0),
        (Code.LENGTH_DIFFERS, 4.0),
    ]
    assert product.length == 30.0 and product.tail == 215.0


def test_a_standing_product_is_not_moved_by_a_hand_in_the_beam() -> None:
    bench = Bench()
    product = put(bench, 212.0, 30.0)
    events = bench.beam(2, True, 0.0)
    assert [(e.code, e.id) for e in events] == [(Code.UNEXPECTED, product.id)]
    assert product.head == 212.0 and product.state is ProductState.TRACKED
    bench.beam(2, False, 0.0)
    bench.move(3)
    assert codes(bench.beam(2, True)) == [Code.HEAD_AT_SENSOR]


# backwards


def test_reversing_swaps_head_and_tail() -> None:
    bench = Bench()
    product = put(bench, 300.0, 30.0)
    bench.move(1)
    assert (product.head, product.tail) == (301.0, 271.0)
    assert [(e.code, e.source, e.id, e.value) for e in bench.move(-1)] == [(Code.REVERSED, 1, product.id, 1.0)]
    assert (product.head, product.tail, product.swapped) == (270.0, 300.0, True)
    assert [(e.code, e.source) for e in bench.move(1)] == [(Code.REVERSED, 0)]
    assert (product.head, product.tail) == (301.0, 271.0)


def test_a_pulse_to_and_fro_is_no_reversal() -> None:
    bench = Bench()
    product = put(bench, 300.0, 30.0)
    bench.move(1)
    for _ in range(20):
        assert not bench.scan(-0.0571) and not bench.scan(0.0571)
    assert not product.swapped


def test_backwards_the_left_end_meets_the_sensor_and_corrects() -> None:
    bench = Bench()
    product = put(bench, 250.0, 30.0)
    bench.move(-3)
    events = bench.beam(2, True, -1.0)
    assert events[0] == TrackingEvent(Code.HEAD_AT_SENSOR, 2, 1, 0, -1.0, 215.0)
    assert (product.left, product.head, product.length) == (215.0, 215.0, 30.0)
    bench.move(-28)
    events = bench.beam(2, False, -1.0)
    assert events[0] == TrackingEvent(Code.TAIL_AT_SENSOR, 2, 1, 0, -1.0, 185.0)
    assert (product.right, product.tail) == (215.0, 215.0)


def test_to_and_fro_over_a_sensor_keeps_it_tracked() -> None:
    bench = Bench()
    product = put(bench, 210.0, 30.0)
    bench.move(4)
    for _ in range(5):
        assert Code.HEAD_AT_SENSOR in codes(bench.beam(2, True))
        bench.move(10)
        bench.move(-10)
        assert Code.TAIL_AT_SENSOR in codes(bench.beam(2, False, -1.0))
        bench.move(-20)
        bench.move(20)
    assert product.state is ProductState.TRACKED and bench.tracking.lost == 0
    assert bench.tracking.unexpected == 0


def test_backwards_past_s1_it_keeps_its_identity_until_position_0() -> None:
    bench = Bench()
    product = bench.arrive(30)
    bench.move(10)
    bench.move(-9)
    assert Code.HEAD_AT_SENSOR in codes(bench.beam(1, True, -1.0))
    bench.move(-29)
    assert Code.TAIL_AT_SENSOR in codes(bench.beam(1, False, -1.0))
    assert product.right == 100.0
    bench.move(-50)
    bench.move(49)
    assert [e.id for e in bench.beam(1, True) if e.code is Code.HEAD_AT_SENSOR] == [product.id]
    assert bench.tracking.entered == 1
    bench.move(-1)
    bench.beam(1, False, -1.0)
    events = bench.move(-120)
    assert [(e.code, e.id) for e in events] == [(Code.LEFT_BACKWARDS, product.id)]
    assert not bench.tracking.products and bench.tracking.left == 1


def test_unknown_product_backwards_is_measured_from_its_other_end() -> None:
    bench = Bench()
    bench.move(-5)
    events = bench.beam(3, True, -1.0)
    assert codes(events) == [Code.UNEXPECTED]
    product = bench.tracking.products[0]
    bench.move(-39)
    assert (product.left, product.right) == (406.0, 445.0)
    bench.beam(3, False, -1.0)
    assert (product.left, product.right, product.head) == (405.0, 445.0, 405.0)
    bench.move(-10)
    assert (product.left, product.right) == (395.0, 435.0)


# lost and unexpected


def test_not_seen_at_a_sensor_is_lost_after_the_way_that_was_set() -> None:
    bench = Bench(lost_after=10.0)
    product = put(bench, 215.0, 30.0)
    assert not bench.move(10)
    events = bench.move(1)
    assert [(e.code, e.source, e.id, e.value) for e in events] == [(Code.LOST, 2, product.id, 226.0)]
    assert product.state is ProductState.LOST and bench.tracking.lost == 1 and bench.tracking.lost_present
    assert product in bench.tracking.products


def test_a_lost_product_is_never_deleted_by_itself() -> None:
    bench = Bench()
    product = put(bench, 400.0, 30.0)
    bench.move(400)
    assert product.state is ProductState.LOST and product in bench.tracking.slots
    assert product not in bench.tracking.products, "past the end it is in nobody's way"
    assert bench.tracking.lost == 1 and bench.tracking.unloaded == 0 and not bench.tracking.brake
    with pytest.raises(EditRefused) as refused:
        bench.tracking.confirm(product.id)
    assert refused.value.reason is EditReason.OUTSIDE_LINE
    assert bench.tracking.delete(product.id).code is Code.DELETED
    assert not any(bench.tracking.slots)


@pytest.mark.parametrize("there", [True, False])
def test_lost_at_the_last_sensor_it_waits_at_the_end_for_a_person(there: bool) -> None:
    bench = Bench(unload_dwell=1.0)
    product = put(bench, 550.0, 30.0)
    bench.stops = (2.0, 2.0, 2.0)
    bench.move(108)
    assert product.state is ProductState.LOST and bench.tracking.brake
    bench.move(2)
    bench.stops = STANDING
    for _ in range(500):
        assert not bench.scan(0.0)
    assert bench.tracking.brake and bench.tracking.areas == 0b1000
    if there:
        bench.tracking.confirm(product.id)
        events = [event for _ in range(102) for event in bench.scan(0.0)]
        assert [(e.code, e.id) for e in events] == [(Code.UNLOADED, product.id)]
    else:
        bench.tracking.delete(product.id)
    assert not bench.tracking.brake


def test_a_sensor_suspected_blind_makes_products_uncertain_not_lost() -> None:
    bench = Bench()
    for _ in range(2):
        put(bench, 214.0, 20.0)
        bench.move(40)
    assert (bench.tracking.sensor_faults, bench.tracking.lost) == (0b0010, 2)
    third = put(bench, 205.0, 20.0)
    bench.move(40)
    assert third.state is ProductState.UNCERTAIN and bench.tracking.lost == 2


def test_a_lost_product_that_the_next_sensor_sees_is_tracked_and_its_sensor_suspected() -> None:
    bench = Bench()
    product = put(bench, 214.0, 30.0)
    bench.move(229)
    assert product.state is ProductState.LOST
    events = bench.beam(3, True)
    assert (Code.SENSOR_SUSPECTED, 2, float(BLIND)) in [(e.code, e.source, e.value) for e in events]
    assert product.state is ProductState.TRACKED and bench.tracking.sensor_faults == 0b0010


def test_two_in_a_row_lost_at_one_sensor_make_it_suspected_until_it_sees_one() -> None:
    bench = Bench()
    put(bench, 214.0, 20.0)
    put(bench, 164.0, 20.0)
    third = put(bench, 120.0, 20.0)
    assert Code.SENSOR_SUSPECTED not in codes(bench.move(40))
    assert (Code.SENSOR_SUSPECTED, 2) in [(e.code, e.source) for e in bench.move(30)]
    bench.move(215 - round(third.head))
    assert Code.SENSOR_OK in codes(bench.beam(2, True))
    assert bench.tracking.sensor_faults == 0


def test_an_unknown_product_gets_a_record_that_is_uncertain_until_a_sensor_agrees() -> None:
    bench = Bench()
    bench.move(1)
    events = bench.beam(2, True)
    assert [(e.code, e.source, e.id) for e in events] == [(Code.UNEXPECTED, 2, 1)]
    bench.move(39)
    assert codes(bench.beam(2, False)) == [Code.IDENTIFIED]
    product = bench.tracking.products[0]
    assert (product.head, product.length, product.state) == (255.0, 40.0, ProductState.UNCERTAIN)
    assert bench.tracking.uncertain and bench.tracking.unexpected == bench.tracking.found == 1
    bench.move(189)
    bench.beam(3, True)
    assert product.state is ProductState.TRACKED


def test_a_product_that_is_off_by_more_than_the_tolerance_is_taken_again_and_uncertain() -> None:
    bench = Bench(sensor_tolerance=5.0, lost_after=10.0)
    product = put(bench, 207.0, 30.0)
    events = bench.beam(2, True)
    assert [(e.code, e.id, e.value) for e in events] == [(Code.UNEXPECTED, product.id, 7.0)]
    assert (product.head, product.state, len(bench.tracking.products)) == (215.0, ProductState.UNCERTAIN, 1)
    bench.move(20)
    assert bench.tracking.lost == 0


def test_an_overdue_product_found_under_the_sensor_is_that_product() -> None:
    bench = Bench()
    product = put(bench, 214.0, 40.0)
    bench.move(21)
    assert product.state is ProductState.LOST
    events = bench.beam(2, True)
    assert [(e.code, e.id, e.value) for e in events] == [(Code.UNEXPECTED, product.id, -21.0)]
    assert (product.head, product.state, len(bench.tracking.products)) == (215.0, ProductState.UNCERTAIN, 1)


def test_a_shorter_one_followed_by_another_is_cut_and_the_other_found() -> None:
    bench = Bench()
    product = put(bench, 214.0, 100.0)
    bench.beam(2, True)
    bench.move(39)
    assert not bench.beam(2, False)
    assert [(e.code, e.value) for e in bench.move(10)] == [(Code.LENGTH_DIFFERS, -60.0)]
    bench.move(9)
    events = bench.beam(2, True)
    assert codes(events) == [Code.UNEXPECTED] and events[0].id != product.id
    assert (product.length, product.tail) == (40.0, 235.0)


def test_a_flicker_inside_a_product_changes_nothing() -> None:
    bench = Bench()
    product = put(bench, 214.0, 60.0)
    bench.beam(2, True)
    bench.move(20)
    assert not bench.beam(2, False) and not bench.beam(2, True)
    bench.move(36)
    assert codes(bench.beam(2, False))[0] is Code.TAIL_AT_SENSOR
    assert product.state is ProductState.TRACKED and len(bench.tracking.products) == 1


def test_a_longer_one_gets_the_length_that_was_measured() -> None:
    bench = Bench()
    product = put(bench, 214.0, 30.0)
    bench.beam(2, True)
    bench.move(79)
    events = bench.beam(2, False)
    assert [(e.code, e.value, e.value2) for e in events] == [(Code.LENGTH_DIFFERS, 50.0, 80.0)]
    assert (product.left, product.right, product.state) == (215.0, 295.0, ProductState.UNCERTAIN)


def test_a_product_that_touches_a_measured_one_from_behind_gets_a_record() -> None:
    bench = Bench()
    product = bench.arrive(40)
    bench.move(74)
    bench.beam(2, True)
    bench.move(59)
    events = bench.beam(2, False)
    assert codes(events) == [Code.LENGTH_DIFFERS, Code.UNEXPECTED]
    assert (events[0].id, events[0].value) == (product.id, 20.0)
    other = bench.tracking.products[1]
    assert (events[1].id, events[1].second, events[1].value2) == (other.id, product.id, 20.0)
    assert (product.left, product.right, product.state) == (235.0, 275.0, ProductState.UNCERTAIN)
    assert (other.left, other.right, other.state) == (215.0, 235.0, ProductState.UNCERTAIN)
    bench.move(170 - 1)
    bench.beam(3, True)
    bench.move(59)
    assert codes(bench.beam(3, False)) == [Code.TAIL_AT_SENSOR], "two in touch, both known: one beam, one tail"
    assert (other.left, product.left) == (445.0, 465.0)


def test_with_no_slot_left_a_product_that_touches_another_is_told_and_counted() -> None:
    bench = Bench(LineLayout(slots=1))
    product = bench.arrive(40)
    bench.move(74)
    bench.beam(2, True)
    bench.move(59)
    assert codes(bench.beam(2, False)) == [Code.LENGTH_DIFFERS, Code.UNEXPECTED, Code.BUFFER_FULL]
    assert bench.tracking.refused == 1 and bench.tracking.products == [product]


def test_what_two_of_a_chain_hide_between_them_gets_a_record() -> None:
    bench = Bench()
    front = bench.arrive(40)
    bench.move(1)
    rear = bench.arrive(30)
    bench.move(44)
    bench.beam(2, True)
    bench.move(89)
    events = bench.beam(2, False)
    assert Code.UNEXPECTED in codes(events), "20 mm more than both"
    assert [p.length for p in bench.tracking.products] == [40.0, 30.0, pytest.approx(18.0, abs=2.0)]
    assert rear.state is ProductState.UNCERTAIN and front in bench.tracking.products


def test_stuck_beam_is_suspected_and_its_ghost_found_out() -> None:
    bench = Bench(longest=150.0, lost_after=10.0)
    bench.beam(1, True)
    events = bench.move(161)
    assert (Code.SENSOR_SUSPECTED, 1, float(STUCK)) in [(e.code, e.source, e.value) for e in events]
    ghost = bench.tracking.products[0]
    assert (ghost.length, ghost.state) == (150.0, ProductState.LOST), "S2 did not see it"
    assert bench.tracking.sensor_faults == 1
    assert Code.SENSOR_OK in codes(bench.beam(1, False))
    assert bench.tracking.sensor_faults == 0


def test_a_stuck_sensor_makes_nobody_lost() -> None:
    bench = Bench()
    bench.beam(2, True, 0.0)
    bench.tracking.delete(bench.tracking.products[0].id)
    product = put(bench, 200.0, 30.0)
    bench.move(100)
    assert product.state is ProductState.UNCERTAIN and bench.tracking.lost == 0


def test_products_inside_a_record_of_a_stuck_beam_are_told() -> None:
    bench = Bench(SIMULATION)
    bench.beam(1, True)
    record = bench.tracking.products[0]
    bench.move(75)
    told = []
    for _ in range(2):
        told += bench.beam(2, True)
        bench.move(19)
        told += bench.beam(2, False)
        bench.move(9)
    unexpected = [(e.source, e.id) for e in told if e.code is Code.UNEXPECTED]
    assert unexpected == [(2, record.id)] * 2, "both came while S1 was stuck, and have no record of their own"
    assert bench.tracking.products == [record]
    bench.beam(1, False)
    assert record.state is ProductState.UNCERTAIN


@pytest.mark.parametrize("state", [ProductState.TRACKED, ProductState.OUTSIDE])
def test_what_passes_a_stuck_sensor_is_uncertain(state: ProductState) -> None:
    bench = Bench()
    bench.beam(2, True, 0.0)
    bench.tracking.delete(bench.tracking.products[0].id)
    product = put(bench, 200.0, 30.0)
    product.state = state
    bench.move(100)
    assert product.state is ProductState.UNCERTAIN


@pytest.mark.parametrize(("length", "seconds"), [(20.0, 1.0), (20.0, 2.0), (30.0, 2.0), (45.0, 1.5)])
def test_an_unknown_product_across_a_border_keeps_its_record_while_the_belt_ahead_stands(
    length: float, seconds: float
) -> None:
    line = line_with()
    line.run(30.0, 0.1)
    thing = line.put(443.0, length)
    for _ in range(round(seconds * 100)):
        line.step([30.0, 30.0, 0.0])
    (product,) = line.tracking.products
    assert product.right == pytest.approx(thing.right, abs=5.0)
    events = line.run(30.0, 9.0)
    assert line.tracking.products == [product] and Code.WITHDRAWN not in codes(line.events)
    (closed,) = [event for event in events if event.code is Code.IDENTIFIED]
    assert closed.value == pytest.approx(length, abs=7.0), "a guess: nobody saw how much of it was on which belt"
    measured = [event for event in events if event.code is Code.LENGTH_DIFFERS]
    assert [(event.source, round(event.value2)) for event in measured] == [(4, length)]
    assert (product.length, product.right) == (pytest.approx(length, abs=0.3), pytest.approx(thing.right, abs=0.5))
    assert product.state is ProductState.UNCERTAIN


def test_backwards_an_unknown_product_across_a_border_keeps_its_record_too() -> None:
    line = line_with()
    line.run(-30.0, 0.1)
    thing = line.put(447.0 + 30.0, 30.0)
    for _ in range(150):
        line.step([0.0, 0.0, -30.0])
    line.run(-30.0, 3.0)
    (product,) = line.tracking.products
    assert (product.left, product.length) == (pytest.approx(thing.left, abs=5.0), pytest.approx(30.0, abs=5.0))
    assert Code.WITHDRAWN not in codes(line.events)


def test_what_may_be_longer_than_it_moved_at_a_border_is_not_withdrawn() -> None:
    bench = Bench()
    bench.beams[2] = True
    bench.scan(0.0, 1.0, 1.0)
    for _ in range(120):
        bench.scan(0.0, 0.0, 0.1)
    for _ in range(2):
        bench.scan(0.0, 1.0, 0.0)
    bench.beams[2] = False
    events = bench.scan(0.0, 1.0, 0.0)
    (product,) = bench.tracking.products
    assert codes(events) == [Code.IDENTIFIED] and not bench.tracking.withdrawn
    assert (product.length, product.length_known, product.state) == (10.0, False, ProductState.UNCERTAIN)


def test_two_unknown_in_a_row_make_the_sensor_before_suspected() -> None:
    bench = Bench()
    bench.move(1)
    for _ in range(2):
        bench.beam(2, True)
        bench.move(29)
        bench.beam(2, False)
        events = bench.move(20)
    assert bench.tracking.sensor_faults == 0b0001
    assert not events


def test_a_ghost_of_a_stuck_beam_ends_where_a_known_product_is() -> None:
    bench = Bench()
    product = put(bench, 190.0, 30.0)
    bench.move(1)
    bench.beam(2, True)
    bench.move(60)
    ghost = bench.tracking.products[0]
    assert (product.head, product.state) == (252.0, ProductState.UNCERTAIN), "nobody held it back"
    assert ghost.left >= product.right and ghost.open_at < 0 and ghost.state is ProductState.UNCERTAIN


def test_a_ghost_that_had_no_room_is_withdrawn() -> None:
    bench = Bench(lost_after=3.0)
    put(bench, 205.0, 30.0)
    bench.move(1)
    bench.beam(2, True)
    ghosts = [e.id for e in bench.move(20) if e.code is Code.WITHDRAWN]
    assert ghosts == [2] and len(bench.tracking.products) == 1


def test_a_beam_that_becomes_free_late_does_not_lengthen_what_is_already_past() -> None:
    bench = Bench()
    first, second = put(bench, 214.0, 30.0), put(bench, 174.0, 30.0)
    bench.beam(2, True)
    bench.move(55)
    bench.beam(2, False)
    assert (first.length, first.left, second.length) == (30.0, 241.0, 30.0)
    assert second.right == 231.0


def test_a_beam_that_came_late_is_put_right_by_its_falling_edge() -> None:
    bench = Bench()
    product = put(bench, 214.0, 40.0)
    bench.move(14)
    assert product.state is ProductState.LOST
    bench.beam(2, True)
    assert product.head == 215.0, "it may have slipped"
    bench.move(25)
    events = bench.beam(2, False)
    assert codes(events)[0] is Code.TAIL_AT_SENSOR
    assert (product.tail, product.head, product.state) == (215.0, 255.0, ProductState.UNCERTAIN)


# capacity


def test_full_is_told_and_nothing_is_overwritten() -> None:
    bench = Bench(replace(LineLayout(), slots=2), lost_after=100.0)
    bench.arrive(20)
    bench.move(10)
    assert not bench.tracking.buffer_full
    events = bench.beam(1, True)
    assert [(e.code, e.id) for e in events] == [(Code.ARRIVED, 2), (Code.BUFFER_FULL, 2)]
    assert bench.tracking.buffer_full
    bench.move(20)
    bench.beam(1, False)
    before = [(product.id, product.right) for product in bench.tracking.products]
    bench.move(10)
    events = bench.beam(1, True)
    assert [(e.code, e.id, e.value) for e in events] == [(Code.BUFFER_FULL, 0, 1.0)]
    bench.move(20)
    bench.beam(1, False)
    assert bench.tracking.refused == 1 and bench.tracking.entered == 2
    assert [id for id, _ in before] == [product.id for product in bench.tracking.products] == [1, 2]


def test_two_hundred_and_fifty_products_fit_when_there_are_slots() -> None:
    line = LineLayout((60_000.0,), (100.0,), (60_000.0,), slots=250)
    bench = Bench(line)
    for _ in range(250):
        bench.arrive(10)
        bench.move(2)
    assert len(bench.tracking.products) == 250 and bench.tracking.buffer_full
    assert [product.slot for product in bench.tracking.products] == list(range(250))


def test_a_product_keeps_its_slot_and_a_new_one_takes_the_lowest_free() -> None:
    bench = Bench()
    first, second, third = put(bench, 600, 20), put(bench, 500, 20), put(bench, 400, 20)
    bench.tracking.delete(second.id)
    assert put(bench, 300, 20).slot == 1 and put(bench, 200, 20).slot == 3
    assert (first.slot, third.slot) == (0, 2)


# gaps


def gap_bench(front: float, rear: float) -> Bench:
    """Two 20 mm products with these heads."""
    bench = Bench(gap_margin=5.0, lost_after=100.0)
    put(bench, front, 20.0)
    put(bench, rear, 20.0)
    return bench


@pytest.mark.parametrize(("gap", "stops"), [(15.1, False), (15.0, True), (14.0, True)])
def test_running_towards_a_standing_product_stops_at_distance_to_stop_and_margin(gap: float, stops: bool) -> None:
    bench = gap_bench(front=500.0, rear=480.0 - gap)
    bench.stops = (10.0, 10.0, 0.0)
    put_on = bench.tracking.products[1]
    put_on.right, put_on.length = 445.0, 20.0
    bench.tracking.products[0].right = 445.0 + gap + 20.0
    events = bench.scan(0.0, 0.0, 0.0)
    assert bench.tracking.gap is not None
    assert bench.tracking.gap.gap == pytest.approx(gap)
    assert (bench.tracking.gap.closing, bench.tracking.gap.limit) == (10.0, 15.0)
    assert bench.tracking.gap_stop is stops
    assert [(e.code, e.id, e.second, e.value2) for e in events] == ([(Code.GAP_STOP, 2, 1, 10.0)] if stops else [])


def test_on_one_running_belt_and_at_rest_nothing_stops() -> None:
    bench = gap_bench(front=300.0, rear=278.0)
    for stops in ((30.0, 30.0, 30.0), STANDING, (-30.0, -30.0, -30.0)):
        bench.stops = stops
        bench.scan(0.0)
        assert bench.tracking.gap is not None and bench.tracking.gap.gap == 2.0
        assert not bench.tracking.gap_stop


def test_two_running_belts_alike_do_not_stop_but_a_slower_one_ahead_does() -> None:
    bench = gap_bench(front=466.0, rear=444.0)
    bench.stops = (10.0, 10.0, 10.0)
    bench.scan(0.0)
    assert not bench.tracking.gap_stop
    bench.stops = (10.0, 10.0, 12.0)
    bench.scan(0.0)
    assert not bench.tracking.gap_stop, "the one ahead runs away"
    bench.stops = (10.0, 10.0, 8.0)
    bench.scan(0.0)
    assert bench.tracking.gap_stop


def test_a_hair_of_difference_takes_the_margin_in_proportion() -> None:
    bench = gap_bench(front=470.0, rear=445.0)
    bench.tracking.products[1].right = 445.0
    bench.stops = (10.0, 10.1, 10.0)
    bench.scan(0.0)
    assert bench.tracking.gap is not None
    assert bench.tracking.gap.limit == pytest.approx(0.1 + 5.0 * 0.2)
    assert not bench.tracking.gap_stop


def test_backwards_the_right_one_is_the_rear() -> None:
    bench = gap_bench(front=480.0, rear=440.0)
    bench.stops = (0.0, 0.0, -30.0)
    events = bench.scan(0.0)
    assert [(e.code, e.id, e.second) for e in events] == [(Code.GAP_STOP, 1, 2)]


def test_belts_against_each_other_add_up() -> None:
    bench = gap_bench(front=490.0, rear=440.0)
    bench.stops = (0.0, 10.0, -8.0)
    bench.scan(0.0)
    assert bench.tracking.gap is not None and bench.tracking.gap.closing == 18.0


def test_gap_stop_stays_until_released_and_comes_again_if_it_must() -> None:
    bench = gap_bench(front=480.0, rear=444.0)
    bench.stops = (0.0, 20.0, 0.0)
    bench.scan(0.0)
    bench.stops = STANDING
    bench.scan(0.0)
    assert bench.tracking.gap_stop
    assert [e.code for e in bench.tracking.release_gap_stop()] == [Code.GAP_STOP_ENDED]
    assert not bench.tracking.release_gap_stop() and not bench.tracking.gap_stop
    ask = bench.tracking.gap_with((0.0, 20.0, 0.0))
    assert ask is not None and ask.stop
    bench.stops = (0.0, 20.0, 0.0)
    assert codes(bench.scan(0.0)) == [Code.GAP_STOP]


def test_what_a_beam_still_holds_reaches_back_over_the_border_for_gaps_too() -> None:
    bench = Bench(gap_margin=5.0, shortest=20.0)
    put(bench, 415.0, 30.0)
    bench.beams[2] = True
    bench.scan(0.0, 1.0, 1.0)
    bench.stops = (0.0, 0.0, 12.0)
    bench.scan(0.0)
    gap = bench.tracking.gap
    assert gap is not None and gap.gap == pytest.approx(445.0 - 20.0 - 416.0)
    assert gap.closing == 0.0, "belt 3 takes it away, or belt 2 keeps both where they are"
    bench.stops = (0.0, 12.0, 0.0)
    bench.scan(0.0)
    assert bench.tracking.gap_stop, "belt 3 may hold it while belt 2 carries what comes behind"


def test_fewer_than_two_products_have_no_gap() -> None:
    bench = Bench()
    put(bench, 300.0, 20.0)
    bench.scan(1.0)
    assert bench.tracking.gap is None


def test_a_real_line_stops_in_time_behind_a_product_that_is_unloaded() -> None:
    line = line_with(unload_dwell=3.0, gap_margin=5.0)
    for head in (600.0, 412.0, 360.0):
        line.put(head, 30.0)
        line.tracking.insert(head, 30.0, 0)
    line.run(100.0, 4.0)
    assert [(e.id, e.second) for e in line.events if e.code is Code.GAP_STOP] == [(3, 2)]
    assert all(ramp.speed == 0.0 for ramp in line.ramps)
    for ahead, behind in zip(line.things, line.things[1:], strict=False):
        assert ahead.left - behind.right >= 4.0
    assert len(line.things) == 3


# unloading


def test_brakes_so_that_the_head_stands_at_the_end_and_unloads_after_the_dwell() -> None:
    line = line_with(unload_dwell=2.0)
    thing = line.put(570.0, 40.0)
    line.tracking.insert(570.0, 40.0, 0)
    events = line.run(30.0, 15.0)
    unloaded = [e for e in events if e.code is Code.UNLOADED]
    assert len(unloaded) == 1 and unloaded[0].id == 1
    assert unloaded[0].value2 == pytest.approx(660.0, abs=1.0)
    assert thing.right == pytest.approx(660.0, abs=1.0)
    assert (line.tracking.unloaded, line.tracking.products, line.tracking.brake) == (1, [], False)


def test_brake_comes_when_the_rest_is_not_more_than_the_distance_to_stop() -> None:
    bench = Bench(lost_after=100.0)
    product = put(bench, 640.0, 20.0)
    bench.stops = (0.0, 0.0, 15.0)
    bench.move(3)
    assert not bench.tracking.brake and product.head == 643.0
    bench.scan(1.0)
    assert bench.tracking.brake and product.state is ProductState.UNLOADING
    for _ in range(15):
        bench.scan(1.0)
    bench.stops = STANDING
    for _ in range(200):
        assert not bench.scan(0.0)
    events = bench.scan(0.0)
    assert [(e.code, e.value) for e in events] == [(Code.UNLOADED, pytest.approx(2.2, abs=0.02))]
    assert not bench.tracking.brake


def test_without_a_dwell_it_is_unloaded_when_it_stands() -> None:
    bench = Bench(unload_dwell=0.0)
    put(bench, 660.0, 20.0)
    assert codes(bench.scan(0.0)) == [Code.UNLOADED]
    assert bench.tracking.areas == 0 and bench.tracking.gap is None


def test_not_unloaded_in_area_3_nor_when_it_stands_short_of_the_end() -> None:
    bench = Bench(unload_dwell=0.0, lost_after=100.0)
    put(bench, 640.0, 20.0)
    bench.scan(1.0)
    for _ in range(10):
        assert not bench.scan(0.0)
    assert not bench.tracking.brake


def test_backing_away_from_the_end_ends_the_unloading() -> None:
    bench = Bench()
    product = put(bench, 659.0, 20.0)
    bench.stops = (0.0, 0.0, 2.0)
    bench.scan(1.0)
    assert bench.tracking.brake
    bench.stops = STANDING
    bench.scan(0.0)
    bench.stops = (-1.0,) * 3
    bench.scan(-1.0)
    assert not bench.tracking.brake and product.state is ProductState.TRACKED


def test_deleting_what_is_being_unloaded_lets_the_belt_go() -> None:
    bench = Bench()
    product = put(bench, 660.0, 20.0)
    bench.scan(0.0)
    assert bench.tracking.brake
    bench.tracking.delete(product.id)
    assert not bench.tracking.brake


def test_jogged_over_the_end_it_is_unloaded_when_its_tail_is_past() -> None:
    bench = Bench()
    product = put(bench, 655.0, 20.0)
    bench.stops = (0.0, 0.0, 1.0)
    events = bench.move(30)
    assert [(e.code, e.id) for e in events] == [(Code.UNLOADED, product.id)]


# people


def test_delete_takes_out_the_record_and_tells_where_it_was() -> None:
    bench = Bench()
    product = put(bench, 300.0, 20.0)
    assert bench.tracking.delete(product.id) == TrackingEvent(Code.DELETED, 0, 1, 0, 300.0, 20.0)
    assert not bench.tracking.products and bench.tracking.deleted == 1
    with pytest.raises(EditRefused) as refused:
        bench.tracking.delete(product.id)
    assert refused.value.reason is EditReason.NO_SUCH_PRODUCT


def test_edit_sets_head_and_length_and_vouches_for_it() -> None:
    bench = Bench()
    product = put(bench, 214.0, 30.0)
    bench.move(20)
    assert product.state is ProductState.LOST
    bench.tracking.edit(product.id, 300.0, 25.0)
    assert (product.head, product.tail, product.state) == (300.0, 275.0, ProductState.TRACKED)
    bench.move(20)
    assert bench.tracking.lost == 1, "S2 is behind it now"


def test_edit_of_a_product_that_goes_backwards_means_its_left_end() -> None:
    bench = Bench()
    product = put(bench, 300.0, 30.0)
    bench.move(-1)
    bench.tracking.edit(product.id, 250.0, 40.0)
    assert (product.left, product.right, product.head) == (250.0, 290.0, 250.0)


def test_edit_may_move_a_product_past_another() -> None:
    bench = Bench()
    first, second = put(bench, 400.0, 20.0), put(bench, 300.0, 20.0)
    bench.tracking.edit(second.id, 500.0, 20.0)
    assert bench.tracking.products == [second, first]


@pytest.mark.parametrize(
    ("head", "length", "reason"),
    [
        (310.0, 20.0, EditReason.OVERLAP),
        (19.0, 20.0, EditReason.OUTSIDE_LINE),
        (661.0, 20.0, EditReason.OUTSIDE_LINE),
        (math.nan, 20.0, EditReason.OUTSIDE_LINE),
        (200.0, 9.0, EditReason.LENGTH),
        (200.0, 151.0, EditReason.LENGTH),
        (200.0, math.nan, EditReason.LENGTH),
        (200.0, math.inf, EditReason.LENGTH),
    ],
)
def test_what_cannot_be_is_refused_with_its_reason(head: float, length: float, reason: EditReason) -> None:
    bench = Bench()
    put(bench, 300.0, 20.0)
    other = put(bench, 500.0, 20.0)
    with pytest.raises(EditRefused) as inserting:
        bench.tracking.insert(head, length, 0)
    with pytest.raises(EditRefused) as editing:
        bench.tracking.edit(other.id, head, length)
    assert inserting.value.reason is editing.value.reason is reason
    assert (other.head, other.length, bench.tracking.inserted) == (500.0, 20.0, 2)


def test_touching_is_not_overlapping_and_edit_does_not_collide_with_itself() -> None:
    bench = Bench()
    product = put(bench, 300.0, 20.0)
    assert bench.tracking.insert(280.0, 20.0, 0).id == 2
    assert bench.tracking.edit(product.id, 301.0, 21.0).code is Code.EDITED


def test_insert_into_a_full_table_is_refused() -> None:
    bench = Bench(replace(LineLayout(), slots=1))
    put(bench, 300.0, 20.0)
    with pytest.raises(EditRefused) as refused:
        bench.tracking.insert(200.0, 20.0, 0)
    assert refused.value.reason is EditReason.BUFFER_FULL


def test_confirm_one_or_all() -> None:
    bench = Bench()
    products = [put(bench, head, 20.0) for head in (500.0, 400.0, 300.0)]
    bench.tracking.power_up()
    assert bench.tracking.confirm(products[0].id) == TrackingEvent(Code.CONFIRMED, 0, products[0].id, 0, 1.0)
    assert [p.state for p in products] == [ProductState.TRACKED, ProductState.UNCERTAIN, ProductState.UNCERTAIN]
    assert bench.tracking.confirm(0).value == 2.0
    assert not bench.tracking.uncertain
    with pytest.raises(EditRefused):
        bench.tracking.confirm(77)


def test_confirming_all_does_not_vouch_for_the_lost_but_naming_one_does() -> None:
    bench = Bench()
    product = put(bench, 214.0, 20.0)
    bench.move(20)
    assert bench.tracking.confirm(0).value == 0.0 and product.state is ProductState.LOST
    bench.tracking.confirm(product.id)
    assert product.state is ProductState.TRACKED


# power cycle


def test_after_a_power_cycle_all_is_there_and_uncertain() -> None:
    bench = Bench()
    bench.arrive(30)
    bench.move(30)
    bench.arrive(20)
    bench.move(3)
    retained = json.loads(json.dumps(bench.tracking.snapshot()))
    fresh = ProductTracking(LineLayout())
    fresh.restore(retained)
    assert [(p.id, p.slot, p.right, p.length, p.entered_us) for p in fresh.products] == [
        (p.id, p.slot, p.right, p.length, p.entered_us) for p in bench.tracking.products
    ]
    assert all(product.state is ProductState.UNCERTAIN for product in fresh.products) and fresh.uncertain
    assert (fresh.next_id, fresh.entered, fresh.corrections) == (3, 2, 0)
    assert not fresh.gap_stop and not fresh.brake


def test_a_sensor_makes_an_uncertain_product_certain() -> None:
    bench = Bench()
    product = put(bench, 210.0, 30.0)
    bench.tracking.power_up()
    bench.move(4)
    bench.beam(2, True)
    assert product.state is ProductState.TRACKED


def test_power_cut_while_entering_goes_on_measuring() -> None:
    bench = Bench()
    bench.beam(1, True)
    bench.move(19)
    bench.tracking.restore(bench.tracking.snapshot())
    assert bench.move(10) == []
    events = bench.beam(1, False)
    assert codes(events) == [Code.IDENTIFIED]
    product = bench.tracking.products[0]
    assert (product.id, product.length, product.state) == (1, 30.0, ProductState.UNCERTAIN)


def test_a_product_under_a_sensor_at_power_up_makes_no_event() -> None:
    bench = Bench()
    put(bench, 230.0, 30.0)
    bench.beams[1] = True
    bench.tracking.power_up()
    assert bench.scan(0.0) == []


def test_a_product_that_nobody_knows_under_s1_at_power_up_has_arrived() -> None:
    bench = Bench()
    bench.beams[0] = True
    assert codes(bench.scan(0.0)) == [Code.ARRIVED]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"products": None}, "not whole"),
        ({"next_id": 0}, "next_id"),
        ({"misses": [0]}, "sensors"),
        ({"counters": {}}, "not whole"),
    ],
)
def test_retained_data_that_does_not_fit_is_refused_whole(change: dict[str, object], what: str) -> None:
    bench = Bench()
    put(bench, 300.0, 20.0)
    retained = {**bench.tracking.snapshot(), **change}
    with pytest.raises(ValueError, match=what):
        bench.tracking.restore(retained)
    assert len(bench.tracking.products) == 1


def test_retained_products_that_have_no_slot_here_are_refused() -> None:
    bench = Bench()
    put(bench, 300.0, 20.0)
    put(bench, 200.0, 20.0)
    with pytest.raises(ValueError, match="slot"):
        ProductTracking(replace(LineLayout(), slots=1)).restore(bench.tracking.snapshot())


# contact, configuration, input


def test_running_into_a_standing_product_is_contact_and_uncertain() -> None:
    bench = Bench(lost_after=100.0)
    front, rear = put(bench, 500.0, 20.0), put(bench, 440.0, 20.0)
    rear.right = 444.0
    front.right, front.length = 470.0, 20.0
    for _ in range(12):
        bench.scan(1.0, 1.0, 0.0)
    assert front.left == 450.0 and rear.right <= 450.0
    assert rear.state is ProductState.UNCERTAIN and front.state is ProductState.TRACKED
    assert rear.right == pytest.approx(444.0 + rear.displacement + rear.shifted)


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("belt_ends", {"belt_ends": ()}),
        ("belt_ends", {"belt_ends": (100.0, 100.0)}),
        ("sensors", {"sensors": (0.0, 100.0)}),
        ("sensors", {"sensors": (200.0, 100.0)}),
        ("sensors", {"sensors": (700.0,)}),
        ("area_ends", {"area_ends": (math.nan,)}),
        ("slots", {"slots": 0}),
    ],
)
def test_a_line_that_cannot_be_built_is_named(what: str, change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=what):
        replace(LineLayout(), **change)


@pytest.mark.parametrize(
    "name", ["sensor_tolerance", "alarm_tolerance", "shortest", "longest", "lost_after", "gap_margin", "unload_dwell"]
)
@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_settings_that_make_no_sense_are_named(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match=name):
        replace(Settings(), **{name: bad})


def test_a_scan_with_bad_numbers_changes_nothing() -> None:
    bench = Bench()
    product = put(bench, 300.0, 20.0)
    for moved, beams, stops in (
        ((math.nan, 0.0, 0.0), [False] * 4, STANDING),
        ((0.0, 0.0, 0.0), [False] * 4, (0.0, math.inf, 0.0)),
        ((1.0, 1.0), [False] * 4, STANDING),
        ((1.0, 1.0, 1.0), [False] * 3, STANDING),
        ((1.0, 1.0, 1.0), [False] * 4, (0.0,)),
    ):
        with pytest.raises(ValueError):
            bench.tracking.scan(moved, beams, stops, 10)
    assert product.right == 300.0


def test_a_line_may_have_one_belt_one_sensor_and_one_area() -> None:
    bench = Bench(LineLayout((500.0,), (50.0,), (500.0,), 4), unload_dwell=0.0)
    product = bench.arrive(30)
    bench.move(419)
    assert product.head == 499.0
    bench.stops = (2.0,)
    bench.move(1)
    assert bench.tracking.brake
    bench.stops = (0.0,)
    assert codes(bench.scan(0.0)) == [Code.UNLOADED]


# a real line with faults


def test_a_product_taken_away_is_lost_and_a_product_put_is_found() -> None:
    line = BeltLine()
    line.put(60.0, 40.0)
    line.run(50.0, 2.5)
    line.things.clear()
    line.put(300.0, 50.0)
    events = line.run(50.0, 8.0)
    assert (Code.LOST, 2) in [(e.code, e.source) for e in events]
    assert (Code.UNEXPECTED, 3) in [(e.code, e.source) for e in events]
    found = line.tracking.products[0]
    assert found.length == pytest.approx(50.0, abs=1.0)
    assert found.right == pytest.approx(line.things[0].right, abs=1.0)


def test_every_position_is_right_with_a_slip_that_the_sensors_take_out() -> None:
    line = BeltLine(slip=0.01)
    thing = line.put(60.0, 40.0)
    line.run(50.0, 5.0)
    line.run(50.0, 9.0)
    product = line.tracking.products[0]
    assert product.right == pytest.approx(thing.right, abs=2.0)
    assert 0.5 < line.tracking.greatest_correction < 3.0


def test_blind_sensor_is_found_out_by_the_next_one() -> None:
    line = BeltLine(blind={1})
    line.put(60.0, 40.0)
    line.run(50.0, 16.0)
    assert [(e.code, e.source) for e in line.events if e.code in (Code.LOST, Code.SENSOR_SUSPECTED)] == [
        (Code.LOST, 2),
        (Code.SENSOR_SUSPECTED, 2),
    ]
    assert line.tracking.products[0].state is ProductState.TRACKED


def across_the_first_border(ways: list[tuple[float, float]]) -> Product:
    """The record of a product that nobody knew at S2, whose beam is free again after these ways of the belts beside it [mm]."""
    tracking = ProductTracking(LineLayout())
    beams = [False, True, False, False]
    for number, (first, second) in enumerate([(0.06, 0.06), *ways]):
        tracking.scan((first, second, 0.0), beams, (0.0, 0.0, 0.0), number * 10_000)
    tracking.scan((0.06, 0.06, 0.0), [False] * 4, (0.0, 0.0, 0.0), (len(ways) + 1) * 10_000)
    assert tracking.withdrawn == 0
    return tracking.products[0]


@pytest.mark.parametrize("pulse", [0.057, 0.092])
def test_belts_whose_pulses_come_by_turns_go_the_same_way(pulse: float) -> None:
    product = across_the_first_border([(pulse, 0.0), (0.0, pulse)] * 300)
    assert product.length_known and product.length == pytest.approx(300 * pulse, abs=0.2)


@pytest.mark.parametrize(("ahead", "turns"), [(9.0, 1), (4.5, 2), (3.0, 3), (-9.0, 1), (-3.0, 3), (0.9, 10)])
def test_belts_that_were_ahead_by_turns_have_not_gone_the_same_way(ahead: float, turns: int) -> None:
    steps = round(abs(ahead) / 0.1)
    one, other = [(0.1, 0.0)] * steps, [(0.0, 0.1)] * steps
    product = across_the_first_border((one + other if ahead > 0 else other + one) * turns)
    assert not product.length_known and product.length >= 10.0
