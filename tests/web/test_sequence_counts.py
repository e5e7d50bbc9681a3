"""A loop that is passed as often as is given at Start: asked for, refused, counted on the page, kept with the run."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from tests.web.conftest import _running
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import Staff

START = "/equipment/steps1/command/start"
COUNT = """[[recipe]]
key = "count"
label = { hr = "Broj vožnji", en = "Number of runs", de = "Anzahl der Fahrten", cs = "Počet jízd" }
decimals = 0
minimum = 1
maximum = 9
default = 2

[[loops]]
from = "forward"
to = "stop"
times = "recipe.count"

[abort.0]
"""
GIVEN = {"arg_frequency": "20", "arg_duration": "2"}


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    folder: Path = tmp_path_factory.mktemp("counts")
    shutil.copytree(bundled("plants/drive_steps"), folder / "plant")
    steps = folder / "plant" / "sequences" / "automatic_steps.toml"
    steps.write_text(steps.read_text("utf-8").replace("[abort.0]\n", COUNT), "utf-8")
    with _running(folder / "data", folder / "plant") as client:
        tags = runtime_of(client).tags
        assert until(
            lambda: tags.sample("steps1.recipe_count").value == 3 and tags.sample("steps1.start_possible").value, 30
        )
        yield client


@pytest.mark.sweep(8)
def test_the_page_counts_the_passes_of_those_that_were_given(plant: TestClient) -> None:
    ana = Operator(Staff(plant), "ana", ("operator",))
    ana.take("steps1")
    ana.language, tags = "en", runtime_of(plant).tags
    page = words(ana.get("/equipment/steps1", fragment=False).text)
    assert "Back to step 1 until passed as often as given at Start: Number of runs" in page and "Pass 1" not in page
    assert "Number of runs 1 – 9" in words(ana.get("/equipment/steps1/ask/start").text)
    for wrong in ("2.5", "0", "10"):
        answer = ana.press(START, confirmed="1", **GIVEN, arg_count=wrong)
        assert answer.status_code == 422 and "Number of runs" in line_of(answer), answer.text
    assert ana.press(START, confirmed="1", **GIVEN, arg_count="3").status_code == 202
    assert until(lambda: tags.sample("steps1.step_2_passes").value == 1, 60)
    shown = ana.get("/equipment/steps1", fragment=False).text
    assert "Pass 2 of 3 (steps 1–2)" in words(shown) and "until passed 3 times (Number of runs)" in words(shown)
    head = shown[: shown.index("q-where")].rpartition('data-renewed="part"')[2]
    assert "steps1.step_2_passes" in head, "the line is fetched again with each pass"
    assert "Pass 2 of 3" in words(ana.get("/equipment/steps1/part/head").text)
    assert until(lambda: tags.sample("steps1.runs_done").value == 1, 120)
    assert tags.sample("steps1.step_1_runs").value == 3 and tags.sample("steps1.step_3_runs").value == 1
    assert "Pass" not in words(ana.get("/equipment/steps1/part/head").text)
    ana.staff.enter("ivana", "engineer", "operator")
    ana.staff.client.cookies.set("pogon_lang", "en")
    assert until(lambda: "Number of runs" in ana.staff.client.get("/records/run/export.csv?locale=en").text, 10), (
        "the run and its file keep it by its name"
    )
