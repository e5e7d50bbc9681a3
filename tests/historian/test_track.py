"""What is not worth a row: every analog point that is recorded has a dead-band, and none hides more than 2 % of its scale."""

import pytest

from app import bundled
from app.historian.track import Track
from app.plant.definitions import Kind, Point
from app.plant.system import system_points
from app.sim.plant import read_simulated
from app.tags.quality import GOOD

PLANT, _ = read_simulated(bundled("plants/demo"))
assert PLANT is not None
MACHINES = [point for item in PLANT.equipment.values() for point in item.points.values()]
ANALOG = [point for point in MACHINES if point.history and point.kind is Kind.ANALOG]
OWN = [point for point in system_points(PLANT, ["sys.link.hall.polls", "sys.link.hall.unit1.answer_time"])]


@pytest.mark.parametrize("point", ANALOG, ids=lambda point: point.name)
def test_a_dead_band_is_at_most_2_percent_of_the_scale_or_the_last_digit(point: Point) -> None:
    if point.scale_low is not None and point.scale_high is not None:
        most = max((point.scale_high - point.scale_low) / 50, 10**-point.decimals)
        assert point.dead_band <= most * (1 + 1e-9)


@pytest.mark.parametrize("point", [one for one in OWN if one.history], ids=lambda point: point.name)
def test_what_the_server_says_of_itself_is_stored_when_it_means_something(point: Point) -> None:
    assert point.dead_band >= 5 * 10**-point.decimals
    track, rows = Track(1, point.dead_band, True), []  # type: ignore[var-annotated]
    for i in range(4 * 60):
        track.take(1_000_000 + i * 250_000, 5 + i % 3 * 0.05 * point.dead_band, GOOD, 0, rows)
    assert len(rows) == 1
