"""A machine whose type draws no screen of its own has a page, a faceplate and a tile all the same, with all that it measures and says."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.running.page_tags import page_tags
from app.web import pages, view
from app.web.plain_screen import PlainScreen
from app.web.points import EquipmentView
from tests.web.people import Staff

KINDS = ("m1", "a1", "c1", "cr1", "seq1", "cc1")


@pytest.fixture(scope="module")
def people(demo: TestClient) -> Staff:
    return Staff(demo)


@pytest.fixture(scope="module")
def templates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All but the screens of types: in one place, so that they are compiled once."""
    folder = tmp_path_factory.mktemp("plain") / "templates"
    shutil.copytree(bundled("templates"), folder, ignore=shutil.ignore_patterns("screens"))
    return folder


@pytest.fixture
def client(people: Staff, templates: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestClient]:
    """The demo plant as if no type had drawn a screen."""
    for where in (pages, view):
        monkeypatch.setattr(where, "bundled", lambda name: templates if name == "templates" else bundled(name))
    shown = people.client.app.state.view  # type: ignore[attr-defined]
    monkeypatch.setattr(shown, "_environments", {})
    people.enter("ivana", "engineer")
    yield people.client


def drawn(client: TestClient, machine: str) -> PlainScreen:
    runtime = client.app.state.runtime  # type: ignore[attr-defined]
    item = runtime.plant.equipment[machine]
    return PlainScreen(EquipmentView(item, runtime, "en", lambda key, **_: key))


@pytest.mark.sweep(8)
@pytest.mark.parametrize("machine", KINDS)
@pytest.mark.parametrize("language", ["hr", "en", "de", "cs"])
def test_every_machine_has_a_page_and_a_faceplate(client: TestClient, machine: str, language: str) -> None:
    client.cookies.set("pogon_lang", language)
    page, face = (client.get(f"/equipment/{machine}{more}") for more in ("", "/faceplate"))
    assert (page.status_code, face.status_code) == (200, 200)
    screen = drawn(client, machine)
    points = [*screen.measured, *screen.others, *filter(None, [screen.state])]
    assert points
    for point in points:
        assert f'data-tag="{point.name}"' in page.text and f'data-tag="{point.name}"' in face.text, point.name
    stop = f"/equipment/{machine}/stop"
    assert stop in page.text and stop in face.text
    assert not re.findall(r"\[[a-z_]+\.[a-z_.0-9]+\]", re.sub(r"<[^>]*>", " ", page.text + face.text))


def test_the_overview_draws_what_its_tiles_are_told_and_nothing_else(client: TestClient) -> None:
    plant = client.app.state.runtime.plant  # type: ignore[attr-defined]
    told = set(page_tags("overview", plant, set(client.app.state.runtime.tags.handles)))  # type: ignore[attr-defined]
    html = client.get("/").text
    for machine in KINDS:
        assert f'href="/equipment/{machine}"' in html
        of = {tag for tag in re.findall(r'data-tag="([^"]*)"', html) if tag.startswith(f"{machine}.")}
        kind = plant.equipment[machine].type
        assert of == {f"{machine}.{key}" for key in kind.tile - kind.setpoints.keys()} & told


@pytest.mark.sweep(8)
def test_what_is_measured_is_sorted_from_what_is_said(client: TestClient) -> None:
    screen = drawn(client, "m1")
    assert screen.state and screen.state.key == "status"
    assert screen.since and screen.since.shown_as == "time"
    assert [point.key for point in screen.measured][:3] == ["frequency", "voltage", "current"]
    keys = {point.key for point in (*screen.measured, *screen.others)}
    elsewhere = {"command", "f111", "frequency_setpoint", "rated_voltage", "speed_min_today", "state_since"}
    assert keys & elsewhere == set()
    assert "digital_inputs" in {point.key for point in screen.others}
    assert 0 < len(screen.curves) <= 4 and all(point.scale_high is not None for point in screen.curves)


def test_a_command_that_stands_aside_is_with_all_values_and_nowhere_else(people: Staff) -> None:
    people.enter("ana", "operator")
    people.client.cookies.set("pogon_lang", "en")
    values, page, face = (people.client.get(f"/equipment/m1{more}").text for more in ("/page/values", "", "/faceplate"))
    for name in ("m1.set_ao1", "m1.output_1_on", "m1.relay_off"):
        assert f'data-part="{name}"' in values, name
        assert f'data-part="{name}"' not in page + face, name
    assert "F431 = 7" not in page + face, "nor is what it needs"
    assert 'data-part="m1.forward"' in values and 'data-part="m1.forward"' in page
    drawn = people.client.get("/equipment/m1/commands")
    assert drawn.status_code == 200 and 'data-part="m1.relay_off"' in drawn.text, "what is drawn anew has it, too"
