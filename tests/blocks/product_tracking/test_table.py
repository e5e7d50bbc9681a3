"""The table of products, and what people change in it."""

import math
from dataclasses import replace

import pytest

from app.blocks.product_tracking import (
    Code,
    EditReason,
    EditRefused,
    LineLayout,
    ProductState,
    TrackingEvent,
)
from tests.blocks.product_tracking.stand import Bench, put


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


@pytest.mark.sweep(8)
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
