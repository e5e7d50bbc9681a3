"""The geometry of what is drawn: bands, pointers, gauges, axes."""

import pytest

from app.web.drawing import Dial, Knots, indicator, round_steps, tenth


def test_every_normal_band_stands_at_the_same_place() -> None:
    for low, high, band in ((0, 50, (30, 45)), (0, 3, (0.75, 2.4)), (-1500, 1500, (900, 1250)), (0, 100, (10, 70))):
        knots = indicator(low, high, band).knots.scaled(6, 208)
        assert [knots.at(value) for value in (low, *band, high)] == [6, 78.8, 141.2, 214]


def test_alarm_limits_stand_at_12_and_88_percent_and_push_the_scale_out() -> None:
    scale = indicator(0, 100, (10, 70), (5, 80, 120))
    assert [scale.knots.at(value) for value in (5, 80)] == [0.1, 0.9]
    assert (scale.low, scale.high) == (0, 120)
    assert scale.knots.scaled(0, 100).at(80) == 88


def test_a_pointer_stays_at_the_ends_of_its_scale() -> None:
    knots = Knots(((0.0, 10.0), (1.0, 20.0)))
    assert [knots.at(value) for value in (-5, 0, 0.25, 1, 9)] == [10, 10, 12.5, 20, 20]
    assert str(knots.scaled(0, 2)) == "0:20 1:40"


def test_the_gauge_has_zero_at_twelve_o_clock_and_its_ends_below_the_horizon() -> None:
    dial = Dial(-1500, 1500)
    assert [dial.angle(value) for value in (-1500, 0, 1500, 1180)] == [-98, 0, 98, 77.1]
    assert dial.arc(-1500, 1500) == "M35.1 154.1A116 116 0 1 1 264.9 154.1"
    assert dial.ticks == (-1000, -500, 0, 500, 1000)


@pytest.mark.parametrize(("low", "high"), [(0, 50), (-1500, 1500), (0, 3), (0, 0.8), (0, 450), (-0.001, 0.002)])
def test_axis_steps_are_round_few_and_inside(low: float, high: float) -> None:
    steps = round_steps(low, high, 7)
    assert steps[0] == low
    assert steps[-1] == high
    assert 3 <= len(steps) <= 9
    assert list(steps) == sorted(set(steps))


def test_tenths_round_halves_upward_like_the_live_script() -> None:
    assert [tenth(value) for value in (0.25, 0.35, -0.25, -0.04)] == [0.3, 0.4, -0.2, 0.0]
