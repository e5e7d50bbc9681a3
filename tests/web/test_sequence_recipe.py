"""Values of a run over HTTP: asked for at Start, refused outside their limits, in the audit, with the run and in its CSV."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from re import search
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import bundled
from tests.web.conftest import _running
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import Staff

START = "/equipment/steps1/command/start"


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    folder: Path = tmp_path_factory.mktemp("recipe")
    shutil.copytree(bundled("plants/drive_steps"), folder / "plant")
    with _running(folder / "data", folder / "plant") as client:
        tags = runtime_of(client).tags
        assert until(
            lambda: tags.sample("steps1.recipe_count").value == 2 and tags.sample("steps1.start_possible").value, 30
        )
        yield client


@pytest.fixture(scope="module")
def ana(plant: TestClient) -> Operator:
    person = Operator(Staff(plant), "ana", ("operator",))
    person.take("steps1")
    return person


def values(client: TestClient) -> tuple[object, object]:
    tags = runtime_of(client).tags
    return tags.sample("steps1.recipe_1").value, tags.sample("steps1.recipe_2").value


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"arg_frequency": "51", "arg_duration": "4"}, "Frequency"),
        ({"arg_frequency": "30", "arg_duration": "1"}, "Time of a run"),
        ({"arg_frequency": "much", "arg_duration": "4"}, "Frequency"),
        ({"arg_frequency": "30"}, "Time of a run"),
    ],
)
def test_what_is_outside_is_refused_by_name(ana: Operator, plant: TestClient, given: dict[str, str], said: str) -> None:
    ana.language, before = "en", values(plant)
    answer = ana.press(START, confirmed="1", **given)
    assert answer.status_code == 422 and said in line_of(answer), answer.text
    assert values(plant) == before


@pytest.mark.sweep(8)
def test_a_run_keeps_them_and_says_them_ever_after(ana: Operator, plant: TestClient) -> None:
    ana.language = "de"
    page = ana.get("/equipment/steps1", fragment=False).text
    assert 'data-arguments="/equipment/steps1/ask/start"' in page
    dialog = ana.get("/equipment/steps1/ask/start").text
    assert 'name="arg_frequency" value="30"' in dialog and 'name="arg_duration" value="10"' in dialog
    assert "Frequenz 5 – 50 Hz" in words(dialog) and "Fahrzeit 2 – 40 s" in words(dialog), words(dialog)
    ana.language = "en"
    answer = ana.press(START, confirmed="1", arg_frequency="22.5", arg_duration="3")
    assert answer.status_code == 202, answer.text
    tags = runtime_of(plant).tags
    assert until(lambda: tags.sample("m1.frequency").value == 22.5, 30)
    assert values(plant) == (22.5, 3.0)
    page = words(ana.get("/equipment/steps1", fragment=False).text)
    assert "Recipe Frequency 22.5 Hz · Time of a run 3 s" in page
    assert until(lambda: tags.sample("steps1.runs_done").value == 1, 90)
    assert 'name="arg_frequency" value="22.5"' in ana.get("/equipment/steps1/ask/start").text, "those of the last run"
    ana.staff.enter("ivana", "engineer", "operator")
    ana.staff.client.cookies.set("pogon_lang", "en")
    assert "Frequency 22.5 Hz" in words(ana.staff.client.get("/audit").text), "in the words of the dialog"
    found = until(lambda: "22.5" in ana.staff.client.get("/records/run/export.csv?locale=en").text, 10)
    csv = ana.staff.client.get("/records/run/export.csv?locale=en").text
    assert found and "Frequency" in csv and "Recipe value 2: name" in csv, csv
    assert "recipe.frequency" in ana.staff.client.get("/records/run/export.csv?locale=machine").text
    run = search(r"data-open=\"(\d+)\"", ana.staff.client.get("/records/run").text)
    assert run
    page = ana.staff.client.get(f"/records/run/detail/{run[1]}").text
    assert "Recipe values" in page and "22.5 Hz" in words(page), words(page)


def test_a_plc_that_knows_none_of_them_is_not_started(ana: Operator, plant: TestClient) -> None:
    """It would run with values of its own, whatever was given."""
    runtime = runtime_of(plant)
    assert runtime.sim is not None
    device: Any = runtime.sim.devices["steps1"]
    assert until(lambda: runtime.tags.sample("steps1.start_possible").value, 120)
    ana.language, known = "en", device.recipe.values
    device.recipe.values = ()
    try:
        assert until(lambda: runtime.tags.sample("steps1.recipe_count").value == 0, 10)
        answer = ana.press(START, confirmed="1", arg_frequency="30", arg_duration="4")
        assert answer.status_code == 409 and "recipe" in line_of(answer).lower(), answer.text
        assert not device.block.running
    finally:
        device.recipe.values = known
    assert until(lambda: runtime.tags.sample("steps1.recipe_count").value == 2, 10)
