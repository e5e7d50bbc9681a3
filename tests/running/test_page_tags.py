"""Which tags a kind of page is sent: what it draws, the frame's, and no others."""

import re
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.plant.definitions import Plant
from app.plant.loader import read_plant
from app.running.page_tags import MOST_NAMED, page_tags
from app.settings import Settings
from tests.virtual import house

PLANTS = ("demo", "crane", "sinamics", "epos")
FRAME = set(page_tags("frame", None, []))


def read(name: str) -> Plant:
    plant, problems = read_plant(Path("plants") / name)
    assert plant and not problems
    return plant


@pytest.fixture(scope="module", params=PLANTS)
def overview(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Plant, str]:
    """A plant and the page of its overview."""
    folder = Path("plants") / request.param
    with house(Settings(data=tmp_path_factory.mktemp(request.param) / "data", plant=folder)) as client:
        assert isinstance(client, TestClient)
        return read(request.param), client.get("/").text


@pytest.mark.sweep(8)
def test_tiles_draw_what_their_type_declares_and_nothing_else(overview: tuple[Plant, str]) -> None:
    plant, page = overview
    drawn = set(re.findall(r'data-tag="([^"]+)"', page)) & set(plant.points)
    sent = set(page_tags("overview", plant, []))
    assert drawn - sent == set(), "a tile draws what it is never told"
    assert sent - drawn - FRAME - set(page_tags("frame", plant, [])) == set(), "it is told what no tile draws"


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_of_machines_is_not_told_all_of_them_on_its_overview(name: str) -> None:
    plant = read(name)
    machines = [each for each in page_tags("overview", plant, []) if each in plant.points]
    assert 0 < len(machines) < len(plant.points) / 2


@pytest.mark.parametrize("head", ["equipment", "faceplate", "parameters"])
@pytest.mark.parametrize("name", PLANTS)
def test_a_page_of_a_machine_has_its_points_and_only_its_own_page_the_cells(name: str, head: str) -> None:
    plant = read(name)
    for item in plant.equipment.values():
        sent = set(page_tags(f"{head}/{item.id}", plant, []))
        cells = {point.name for point in item.points.values() if point.table}
        assert {point.name for point in item.points.values()} - cells <= sent
        assert cells <= sent if head == "equipment" else not cells & sent
        assert f"sys.commands.{item.id}" in sent
        others = {point.name for other in plant.equipment.values() for point in other.points.values()} - sent
        assert len(plant.equipment) == 1 or others


def test_tags_are_those_that_are_named_and_known_and_not_too_many() -> None:
    known = [f"m1.p{n}" for n in range(500)]
    assert set(page_tags("tags/m1.p1,m1.p2,m9.x", read("demo"), known)) - FRAME >= {"m1.p1", "m1.p2"}
    assert "m9.x" not in page_tags("tags/m1.p1,m9.x", read("demo"), known)
    many = page_tags("tags/" + ",".join(known), read("demo"), known)
    assert sum(name.startswith("m1.p") for name in many) == MOST_NAMED


@pytest.mark.parametrize("kind", ["", "nothing", "equipment/nobody", "faceplate"])
def test_a_kind_that_is_none_is_told_as_such(kind: str) -> None:
    with pytest.raises(KeyError):
        page_tags(kind, read("demo"), [])


def test_every_page_has_the_frame_also_without_a_plant() -> None:
    for kind in ("overview", "frame", "nothing"):
        assert set(page_tags(kind, None, [])) == FRAME
