"""What outlives a power cycle of the tracking."""

import json
from dataclasses import replace

import pytest

from app.blocks.product_tracking import (
    Code,
    LineLayout,
    ProductState,
    ProductTracking,
)
from tests.blocks.product_tracking.stand import Bench, put

from .belt_line import codes


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
