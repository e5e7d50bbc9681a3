"""Products move with the belts that they lie on."""

import pytest

from app.blocks.product_tracking import (
    Code,
    LineLayout,
    Product,
    ProductTracking,
    share,
)
from tests.blocks.product_tracking.stand import Bench, put


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
