"""Every tag has one source, and is stale when its source has been silent for too long."""

from pathlib import Path

import pytest

from app.plant.definitions import Plant, Scan
from app.plant.loader import read_plant
from app.running.derived import DERIVED
from app.running.tag_list import LEAST_STALE, SCANS, points_of, stale_after, tag_of


@pytest.fixture(scope="module", params=["demo", "crane", "sinamics", "epos"])
def plant(request: pytest.FixtureRequest) -> Plant:
    found, problems = read_plant(Path("plants") / request.param)
    assert found and not problems
    return found


def test_no_tag_is_there_twice_and_only_what_can_be_read_is_one(plant: Plant) -> None:
    points = points_of(plant, plant.links)
    names = [point.name for point in points]
    assert len(names) == len(set(names))
    readable = {name for name, point in plant.points.items() if point.register is None or point.register.readable}
    assert readable <= set(names) and not (set(plant.points) - readable) & set(names)


def test_each_tag_has_the_source_that_publishes_it(plant: Plant) -> None:
    for point in points_of(plant, plant.links):
        source = tag_of(point, plant).source
        if point.equipment == "sys":
            assert source == "sys"
        elif point.derived:
            assert source == DERIVED
        else:
            assert source == f"link.{plant.equipment[point.equipment].link}"


def test_a_value_is_stale_after_three_scans_and_never_when_it_is_read_on_demand(plant: Plant) -> None:
    for point in plant.points.values():
        item = plant.equipment[point.equipment]
        limit = stale_after(point, plant)
        if point.scan in (Scan.ONCE, Scan.PAGE):
            assert limit == 0
        else:
            period = item.type.device.fast if point.scan is Scan.FAST else item.type.device.slow
            own = plant.links[item.link].fast if point.scan is Scan.FAST else plant.links[item.link].slow
            assert limit == max(LEAST_STALE, SCANS * (own or period))


def test_without_a_plant_there_is_the_system_alone() -> None:
    assert {point.equipment for point in points_of(None, [])} == {"sys"}
