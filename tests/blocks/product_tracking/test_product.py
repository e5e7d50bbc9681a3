"""What a product is: identity, length, and how sure one is of it."""

import pytest

from app.blocks.product_tracking import (
    Code,
    LineLayout,
    ProductState,
    TrackingEvent,
)
from tests.blocks.product_tracking.stand import SIMULATION, Bench, put


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


def test_reversing_inside_s1_does_not_spoil_the_length() -> None:
    bench = Bench()
    bench.beam(1, True)
    bench.move(25)
    bench.move(-20)
    bench.move(34)
    events = bench.beam(1, False)
    assert events[-1].code is Code.IDENTIFIED and events[-1].value == 40.0
    assert bench.tracking.products[0].state is ProductState.TRACKED


def test_longer_than_the_longest_is_told_and_uncertain() -> None:
    bench = Bench(longest=50.0, shortest=10.0)
    product = bench.arrive(55)
    assert product.length == 55 and product.state is ProductState.UNCERTAIN


@pytest.mark.parametrize(
    ("head", "area"),
    [(20.0, 1), (215.0, 1), (215.1, 2), (314.6, 2), (445.0, 2), (500.0, 3), (560.0, 3), (561.0, 4), (660.0, 4)],
)
def test_area_follows_the_head(head: float, area: int) -> None:
    bench = Bench()
    product = put(bench, head, 18.6)
    bench.scan()
    assert product.area == area and bench.tracking.areas == 1 << area - 1
