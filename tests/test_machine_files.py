"""The machine of docs/machine-files.md is what the page says: a type without a mistake, with all its texts, drawn without a template."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.plant import types
from app.plant.loader import read_plant
from app.plant.texts import read_product
from app.settings import Settings
from tests.conftest import ROOT
from tests.virtual import house
from tests.web.people import Staff

PAGE = (ROOT / "docs" / "machine-files.md").read_text("utf-8")
FOLDER = "equipment/soft_pump/"
PLANT = """
[plant]
name = "Waterworks"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.line]
transport = "tcp"
host = "127.0.0.1"
port = 9
[equipment.p1]
type = "soft_pump"
link = "line"
unit = 1
label = "Pump 1"
tank_height = 6
"""


def files() -> dict[str, str]:
    """File → text, as the page has them: named in the paragraph before, in the order of the blocks."""
    names = re.findall(rf"`{FOLDER}([\w.]+)`", PAGE)
    blocks = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert len(names) == len(blocks)
    return dict(zip(names, blocks, strict=True))


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """A plant folder that brings the type of the page, for a line where nobody answers."""
    kind = tmp_path / "plant" / FOLDER
    kind.mkdir(parents=True)
    for name, text in files().items():
        (kind / name).write_text(text, "utf-8")
    (tmp_path / "plant" / "plant.toml").write_text(PLANT, "utf-8")
    return tmp_path / "plant"


def test_it_has_no_mistake_and_every_text_that_it_needs(plant: Path) -> None:
    assert read_plant(plant)[1] == []
    data, problems = types.read_type("soft_pump", ["en"], plant / "equipment")
    assert problems == []
    known = {**read_product()["en"], **data.type.texts["en"]}
    assert [key for key in types.text_keys(data) if key not in known and f"{key}.other" not in known] == []


@pytest.fixture
def client(plant: Path, tmp_path: Path) -> Iterator[TestClient]:
    """A browser at that plant."""
    with house(Settings(plant=plant, data=tmp_path / "data")) as browser:
        yield browser


def test_a_plant_takes_it_and_its_limits_come_from_its_ratings(client: TestClient) -> None:
    runtime = client.app.state.runtime  # type: ignore[attr-defined]
    item = runtime.plant.equipment["p1"]
    assert item.points["level"].high == 6 and item.points["level"].normal == (1, pytest.approx(4.8))
    assert set(item.type.orders) == {"start", "fill", "set_level", "stop"}


@pytest.mark.sweep(8)
def test_it_is_drawn_without_a_template_and_says_that_it_does_not_answer(client: TestClient) -> None:
    Staff(client).enter("ivana", "engineer")
    for path in ("/equipment/p1", "/equipment/p1/faceplate", "/equipment/p1/parameters", "/"):
        page = client.get(path)
        assert page.status_code == 200 and "Pump 1" in page.text, path
        assert not re.findall(r"\[[a-z_]+\.[a-z_.0-9]+\]", re.sub(r"<[^>]*>", " ", page.text)), path
    page = client.get("/equipment/p1").text
    assert 'data-tag="p1.level"' in page and 'data-tag="p1.dry_run"' in page and "/equipment/p1/stop" in page


def test_the_page_names_files_that_exist() -> None:
    for path in re.findall(r"`((?:app|templates|static)/[\w/.]+)`", PAGE):
        if not path.startswith(FOLDER):
            assert (ROOT / path).exists(), path
    for link in re.findall(r"\]\(([^)#:]+)\)", PAGE):
        assert (ROOT / "docs" / link).is_file(), link
