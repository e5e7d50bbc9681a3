"""A product that its sensor does not see is lost, or the sensor is suspected."""

import pytest

from app.blocks.product_tracking import (
    BLIND,
    Code,
    EditReason,
    EditRefused,
    ProductState,
)
from tests.blocks.product_tracking.stand import STANDING, Bench, put

from .belt_line import codes


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


def test_a_stuck_sensor_makes_nobody_lost() -> None:
    bench = Bench()
    bench.beam(2, True, 0.0)
    bench.tracking.delete(bench.tracking.products[0].id)
    product = put(bench, 200.0, 30.0)
    bench.move(100)
    assert product.state is ProductState.UNCERTAIN and bench.tracking.lost == 0
