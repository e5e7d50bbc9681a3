"""What an equipment type brings for its screens is found by name: pages, style sheets, scripts, a symbol."""

import asyncio
import re
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant import types
from app.web import pages, screens, view
from app.web.assets import Assets
from tests.web.people import BOSS, Staff

SECOND = (
    """{% extends "layouts/screen.html" %}{% block picture %}<p>second of {{ equipment.label }}</p>{% endblock %}"""
)


@pytest.fixture(scope="module")
def people(demo: TestClient) -> Staff:
    return Staff(demo)


@pytest.fixture
def client(people: Staff, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestClient]:
    """The demo plant with templates of its own."""
    templates = tmp_path / "templates"
    shutil.copytree(bundled("templates"), templates)
    for where in (pages, view):
        monkeypatch.setattr(where, "bundled", lambda name: templates if name == "templates" else bundled(name))
    shown = people.client.app.state.view  # type: ignore[attr-defined]
    monkeypatch.setattr(shown, "_environments", {})
    people.enter("ivana", "engineer")
    yield people.client


def tabs(html: str) -> list[tuple[str, bool]]:
    found = re.search(r'<span class="tabs-sub">(.*?)</span>', html, re.S)
    links = re.findall(r'<a href="([^"]+)"( aria-current="page")?>', found[1]) if found else []
    return [(url, bool(current)) for url, current in links]


@pytest.mark.sweep(8)
def test_every_page_template_of_a_type_is_a_tab_of_its_machines(client: TestClient, tmp_path: Path) -> None:
    assert tabs(client.get("/equipment/m1").text) == []
    assert client.get("/equipment/m1/page/second").status_code == 404
    for name in ("second", "parts_list"):
        (tmp_path / f"templates/screens/eura_e800/page_{name}.html").write_text(SECOND)
    links = ["/equipment/m1", "/equipment/m1/page/parts_list", "/equipment/m1/page/second"]
    assert tabs(client.get("/equipment/m1").text) == [(link, link == links[0]) for link in links]
    page = client.get("/equipment/m1/page/second")
    assert page.status_code == 200 and "second of " in page.text
    assert tabs(page.text) == [(link, link == links[2]) for link in links]
    assert tabs(client.get("/equipment/m2/page/second").text)[2] == ("/equipment/m2/page/second", True)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", ["none", "", "second.html", "%2e%2e%2fpage", "\u00b2"])
def test_a_page_that_the_type_does_not_have_is_not_there(client: TestClient, name: str) -> None:
    assert client.get(f"/equipment/m1/page/{name}").status_code == 404
    assert client.get(f"/equipment/nobody/page/{name}").status_code == 404


@pytest.mark.parametrize("kind", types.names())
def test_the_sheets_and_scripts_of_a_type_are_on_its_page_and_its_symbol_exists(kind: str) -> None:
    data, _ = types.read_type(kind, ("en",))
    assert f'id="{data.type.symbol}"' in (bundled("static") / "symbols.svg").read_text("utf-8")
    assets = Assets(bundled("static"))
    for ending in (".tile.css", ".css", ".js"):
        there = (bundled("static") / "screens" / f"{kind}{ending}").is_file()
        assert len(assets.of_screen(kind, ending)) == there
    assert Assets(bundled("static")).of_screen("nobody", ".css", ".js") == []


@pytest.mark.sweep(8)
def test_the_demo_shows_every_type_with_what_it_brings(client: TestClient) -> None:
    plant = client.app.state.runtime.plant  # type: ignore[attr-defined]
    assets = Assets(bundled("static"))
    for item in plant.equipment.values():
        page = client.get(f"/equipment/{item.id}").text
        for url in assets.of_screen(item.type.name, ".tile.css", ".css", ".js"):
            assert url in page
        assert f'#{item.type.symbol}"' in client.get(f"/equipment/{item.id}/parameters").text or not item.type.setpoints
    overview = client.get("/").text
    assert overview.count("coil_car.tile.") == 1


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("permission", "done"), [("configure", True), ("administer", False)])
def test_the_work_of_a_page_is_for_those_who_may(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, permission: str, done: bool
) -> None:
    (tmp_path / "templates/screens/eura_e800/page_second.html").write_text(
        """{% extends "layouts/screen.html" %}{% block picture %}<p>worked: {{ worked }}</p>{% endblock %}"""
    )
    work = SimpleNamespace(PAGES={"second": (permission, lambda asked: asked["what"])})
    monkeypatch.setitem(screens._MODULES, "eura_e800", work)
    found = client.get("/equipment/m1/page/second?what=42").text
    assert ("worked: 42" in found) is done and ("worked: None" in found) is not done
    assert client.get("/equipment/m1").status_code == 200, "a page without work"


def test_the_work_of_a_page_is_done_beside_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    work = SimpleNamespace(PAGES={"second": ("configure", lambda asked: threading.get_ident())})
    monkeypatch.setitem(screens._MODULES, "eura_e800", work)
    found = asyncio.run(screens.worked("eura_e800", "second", BOSS, {}))
    assert isinstance(found, int) and found != threading.get_ident()


@pytest.mark.sweep(8)
def test_all_that_a_machine_reports_stands_on_a_page_that_is_no_tab(client: TestClient) -> None:
    """Of the drive the block 0x1000 to 0x1018 as a whole: what its own page does not draw, too."""
    client.cookies.set("pogon_lang", "en")
    page = client.get("/equipment/m1/page/values")
    assert page.status_code == 200 and tabs(page.text) == []
    shown = re.findall(r'<th scope="row">\s*<span class="row">(.*?) <|<dt>(.*?)</dt>', page.text)
    shown = [quantity or other for quantity, other in shown]
    block = {
        "Digital inputs",
        "Digital outputs",
        "Analog input 1",
        "Analog output 2",
        "PID setpoint",
        "Stage speed",
        "Number of poles",
    }
    assert block | {"Speed", "Output current", "External counter", "Control mode"} <= set(shown)
    assert not {"Rated voltage", "Command register", "Frequency setpoint"} & set(shown)
    assert 'href="/equipment/m1/page/values"' in client.get("/equipment/m1/faceplate").text
    for machine in ("c1", "cc1", "seq1", "cr1", "a1"):
        assert client.get(f"/equipment/{machine}/page/values").status_code == 200, machine
    assert client.get("/equipment/nobody/page/values").status_code == 404
