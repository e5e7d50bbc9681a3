"""A run that a step of another sequence started: it keeps what it was given and by whom; the editor has fields for it."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from tests.web.conftest import _running
from tests.web.operating import Operator, runtime_of, until, words
from tests.web.people import Staff

CALLER = """
[equipment.all1]
type = "sequence"
link = "steps"
unit = 22
definition = "all_steps"
label = "All steps 1"
"""
STEPS = """[sequence]
label = "All steps"

[[recipe]]
key = "speed"
label = "Speed"
unit = "Hz"
minimum = 5
maximum = 40
default = 12

[[steps]]
key = "call"
label = "Call"
minimum = 0.1
maximum = 600
[[steps.orders]]
machine = "steps1"
action = "run"
values = { frequency = "recipe.speed", duration = 3 }
"""
EDITOR = "/equipment/all1/definition"


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    folder: Path = tmp_path_factory.mktemp("called")
    shutil.copytree(bundled("plants/drive_steps"), folder / "plant")
    with (folder / "plant" / "plant.toml").open("a", encoding="utf-8") as file:
        file.write(CALLER)
    (folder / "plant" / "sequences" / "all_steps.toml").write_text(STEPS, "utf-8")
    with _running(folder / "data", folder / "plant") as client:
        tags = runtime_of(client).tags
        assert until(
            lambda: tags.sample("all1.start_possible").value and tags.sample("steps1.start_possible").value, 30
        )
        yield client


@pytest.mark.sweep(8)
def test_the_run_keeps_what_it_was_given_and_by_whom(plant: TestClient) -> None:
    ana, tags = Operator(Staff(plant), "ana", ("operator",)), runtime_of(plant).tags
    ana.take("all1")
    ana.language = "en"
    assert ana.press("/equipment/all1/command/start", confirmed="1", arg_speed="22.1").status_code == 202
    assert until(lambda: tags.sample("m1.frequency").value == 22.1, 60), "no digit is lost or won on the way"
    assert (tags.sample("steps1.recipe_1").value, tags.sample("steps1.recipe_2").value) == (22.1, 3.0)
    page = words(ana.get("/equipment/all1", fragment=False).text)
    assert "Frequency 22.1 Hz" in page and "Time of a run 3 s" in page, page
    assert until(lambda: tags.sample("all1.runs_done").value == 1, 120)
    ana.staff.enter("ivana", "engineer", "operator")
    browser = ana.staff.client
    browser.cookies.set("pogon_lang", "en")
    csv = "/records/run/export.csv?locale=en&equipment=steps1"
    assert until(lambda: "22.1" in browser.get(csv).text, 10), browser.get(csv).text
    assert "All steps" in browser.get(csv).text, "who began it"
    run = re.search(r"data-open=\"(\d+)\"", browser.get("/records/run?equipment=steps1").text)
    assert run
    page = words(browser.get(f"/records/run/detail/{run[1]}").text)
    assert "Started by All steps" in page and "Frequency 22.1" in page and "Time of a run 3" in page, page


@pytest.mark.sweep(8)
def test_the_editor_has_a_field_for_each_value_of_the_other_one(plant: TestClient) -> None:
    staff = Staff(plant)
    staff.enter("iva", "engineer")
    staff.client.cookies.set("pogon_lang", "en")

    def page() -> str:
        return str(staff.client.get(f"{EDITOR}?section=1").text)

    def send(**given: str) -> str:
        window = dict(re.findall(r'name="(tab|seen)"\s+value="(\w+)"', page()))
        fields = {f"orders.0.values.{name}": value for name, value in given.items()}
        return str(staff.post(f"{EDITOR}/fields", {**window, "section": "1", **fields}).text)

    shown = page()
    assert re.search(r'name="orders\.0\.values\.frequency"[^>]*value="recipe\.speed"[^>]*list="ed-recipe"', shown), (
        shown
    )
    assert re.search(r'name="orders\.0\.values\.duration"[^>]*value="3"', shown)
    assert "a number from 2 to 40 for steps1" in send(duration="41")
    assert "in whole numbers, as steps1 takes it" in send(duration="recipe.speed")
    assert "No mistakes." in send(duration="")
    assert 'values = { frequency = "recipe.speed" }' in page().replace("&#34;", '"'), "then it is as in the last run"
    assert 'placeholder="as last time"' in page()
    assert "No mistakes." in send(duration="4", frequency="")
    assert "values = { duration = 4 }" in page()
