"""A recorded ramp becomes three curves over one time, with scales that hold them."""

import re
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from app.blocks.ramp_record import RampState
from app.web.screens.conveyor import RampDrawing, ramp_of

START = {"speed": 0.0, "acceleration": 0.0, "phases": [(0.25, 240.0), (0.25, 0.0), (0.25, -240.0)]}


class Table:
    """Rows by id, as `TableView` gives them."""

    def __init__(self, **rows: dict[str, Any]) -> None:
        self._rows = {int(key[1:]): row for key, row in rows.items()}

    def row(self, id: int) -> Any:
        if id not in self._rows:
            return None
        row = dict(self._rows[id])
        for n, (duration, jerk) in enumerate(row.pop("phases", []), 1):
            row |= {f"duration_{n}": duration, f"jerk_{n}": jerk}
        return SimpleNamespace(number=lambda key: row.get(key))


def drawn(belt: int = 2, *, stop: bool = False, **row: Any) -> RampDrawing:
    table = Table(**{f"r{2 * belt - (not stop)}": {"state": RampState.COMPLETE, **row}})
    found = ramp_of(table, belt, stop=stop)  # type: ignore[arg-type]
    assert found
    return found


def points(path: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r"(-?[\d.]+) (-?[\d.]+)", path)]


def test_a_start_is_told_in_its_numbers() -> None:
    found = drawn(**START)
    assert (found.speed, found.state) == (0.0, RampState.COMPLETE)
    assert (found.duration, found.end, found.peak, found.jerk) == pytest.approx((0.75, 30.0, 60.0, 240.0))
    # the way of a symmetric ramp: half of its speed over its time
    assert found.way(62.83) == pytest.approx(62.83 * 0.15 * 0.75)


def test_every_curve_lies_inside_its_panel_and_goes_from_the_first_to_the_last_moment() -> None:
    for row in (START, {"speed": 30.0, "acceleration": 0.0, "phases": [(0.25, -240.0), (0.25, 0.0), (0.25, 240.0)]}):
        lanes = drawn(**row).lanes
        assert [lane.key for lane in lanes] == ["speed", "acceleration", "jerk"]
        for lane in lanes:
            panel, places = lane.panel, points(lane.path)
            assert (places[0][0], places[-1][0]) == (panel.left, panel.right)
            assert all(panel.top <= y <= panel.bottom for _, y in places)
            assert 0.0 in lane.steps
        for before, after in pairwise(lanes):
            assert before.panel.bottom + 15 < after.panel.top, "its name stands between them"


def test_the_curve_meets_its_values() -> None:
    speed, acceleration, jerk = drawn(**START).lanes
    middle = speed.panel.x(0.375)
    at = {key: dict(points(lane.path)) for key, lane in (("v", speed), ("a", acceleration))}
    assert min(at["v"], key=lambda x: abs(x - middle)) == pytest.approx(middle, abs=5)
    assert at["a"][acceleration.panel.x(0.25)] == acceleration.panel.y(60.0)
    assert at["v"][speed.panel.x(0.25)] == speed.panel.y(7.5)
    assert {y for _, y in points(jerk.path)} == {jerk.panel.y(value) for value in (0.0, 240.0, -240.0)}


@pytest.mark.parametrize("duration", [0.001, 0.11, 0.7399, 1.0, 12.34, 95.0])
def test_the_times_written_below_keep_apart(duration: float) -> None:
    found = drawn(speed=0.0, acceleration=0.0, phases=[(duration, 1.0)])
    panel = found.lanes[2].panel
    places = [panel.x(time) for time in found.times]
    assert (places[0], places[-1]) == (panel.left, panel.right)
    assert all(after - before > 30 for before, after in pairwise(places))


def test_a_stop_without_supply_has_no_curve_and_ends_at_nothing() -> None:
    found = drawn(stop=True, speed=30.0, acceleration=0.0, state=RampState.CUT_OFF)
    assert not found.drawable and found.end == 0.0


def test_what_was_not_recorded_is_not_drawn() -> None:
    table: Any = Table(r3={"state": 2, **START}, r5={"state": 2, "acceleration": 0.0})
    assert ramp_of(table, 1, stop=False) is None and ramp_of(table, 2, stop=True) is None
    assert ramp_of(table, 3, stop=False) is None, "its speed is not known"
    assert ramp_of(table, 2, stop=False)
