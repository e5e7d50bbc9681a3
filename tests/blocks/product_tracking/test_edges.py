"""Edges at sensors correct, find and measure products."""

import pytest

from app.blocks.product_tracking import (
    Code,
    ProductState,
    TrackingEvent,
)
from tests.blocks.product_tracking.stand import Bench, put

from .belt_line import codes


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
