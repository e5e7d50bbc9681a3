"""Gaps between products, and the stop that keeps them."""

import pytest

from app.blocks.product_tracking import (
    Code,
)
from tests.blocks.product_tracking.stand import STANDING, Bench, put

from .belt_line import codes


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
