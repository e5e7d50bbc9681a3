"""The tests that the thesis recorded, run anew."""

from itertools import pairwise

import pytest

from app.blocks.arc_positioner.following import ArcPhase
from app.blocks.positioner.positioner import MovePhase
from app.sim.crane.register_map import Step
from app.sim.crane.thesis import EXPECTED, SCAN, expected_positioning, run_arc, run_positioner, run_sequence


def test_positioner_runs_as_the_thesis_expects() -> None:
    run = run_positioner()
    found = {one.key: one for one in run.numbers}
    assert found.keys() == EXPECTED.keys()
    scan = 660.4 * SCAN
    assert found["top_speed"].ours == pytest.approx(660.4)
    assert abs(found["accelerated"].difference) <= scan
    assert abs(found["slow_down"].difference) <= scan
    assert abs(found["seconds"].difference) <= 0.1
    assert abs(found["end"].difference) < 5.0
    assert found["overshoot"].ours == 0.0
    assert run.phase is MovePhase.DONE
    assert run.ours[0] == (0.0, 5000.0, 0.0) and run.ours[-1].position == found["end"].ours
    assert all(a.time < b.time and a.position <= b.position for a, b in zip(run.ours, run.ours[1:], strict=False))


def test_curve_of_the_figures_has_the_numbers_of_the_thesis() -> None:
    curve = expected_positioning()
    corners = [moment for moment in curve if moment.speed == pytest.approx(660.4)]
    assert [corners[0].position, corners[-1].position] == pytest.approx(
        [EXPECTED["accelerated"], EXPECTED["slow_down"]], abs=0.05
    )
    assert curve[-1] == pytest.approx((EXPECTED["seconds"], 10000.0, 0.0), abs=0.05)
    positions = [moment.position for moment in curve]
    assert positions == sorted(positions)


@pytest.mark.sweep(8)
def test_circular_lift_stays_on_the_circle_where_the_formulas_of_the_original_do_not() -> None:
    run = run_arc()
    found = {one.key: one.ours for one in run.numbers}
    assert run.phase is ArcPhase.DONE and found["ours"] <= 2.0 < found["original"]
    for name, curve in (("ideal", run.ideal), ("original", run.original), ("ours", run.ours)):
        assert curve[0][0] == pytest.approx(0.0, abs=0.1) and curve[-1][0] == pytest.approx(90.0, abs=2.0)
        assert max(abs(error) for _, error in curve) <= found[name]


@pytest.mark.sweep(8)
def test_a_sequence_brings_the_ladle_over_and_tells_every_step_as_it_was() -> None:
    run = run_sequence()
    assert run.done
    assert [one.step for one in run.steps] == [int(step) for step in Step if step > Step.INIT], (
        "INIT ends in the scan that begins it"
    )
    assert all(a.begun + a.seconds == pytest.approx(b.begun) for a, b in pairwise(run.steps))
    found = {one.key: one for one in run.numbers}
    assert all(one.expected != one.expected for one in run.numbers), "the source has no figures of it"
    assert found["lift"].ours <= 2.0 and found["lowering"].ours <= 2.0
    assert sum(one.seconds for one in run.steps) == pytest.approx(found["cycle"].ours, abs=0.1)
    first, last = run.curve[0], run.curve[-1]
    assert last.time == pytest.approx(run.steps[-1].begun + run.steps[-1].seconds)
    assert (first.bridge, first.hoist) != (last.bridge, last.hoist) and max(one.hoist for one in run.curve) > 12_000
