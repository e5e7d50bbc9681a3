"""Products leave at the end: braked, dwelt, unloaded."""

import pytest

from app.blocks.product_tracking import (
    Code,
    ProductState,
)
from tests.blocks.product_tracking.stand import STANDING, Bench, put

from .belt_line import codes, line_with


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
