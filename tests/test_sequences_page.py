"""The page about sequences of one's own says what is so: its example is a plant without mistakes, and its tests pass."""

import re
from pathlib import Path

from app.plant.loader import read_plant
from app.sim.sequence.tests import run_tests
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "sequences.md").read_text("utf-8")
HEAD = '[plant]\nname = "Hall"\ntimezone = "UTC"\n[links.coil]\ntransport = "memory"\n'


def test_the_example_is_a_plant_and_its_tests_pass(tmp_path: Path) -> None:
    machines, definition, recipe, kind = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert kind.startswith("[actions]") and recipe.startswith("[[recipe]]")
    (tmp_path / "sequences").mkdir()
    (tmp_path / "plant.toml").write_text(HEAD + machines, "utf-8")
    (tmp_path / "sequences" / "fetch.toml").write_text(definition, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert problems == []
    assert plant
    results = run_tests(plant, "seq1")
    assert [(result.name, result.ok, result.happened) for result in results if not result.ok] == []
    shown = [f"seq1, fetch: {result.name}: ok, " for result in results]
    assert [line for line in shown if line not in PAGE] == []
    assert f"Tests: {len(results)}, failed: 0" in PAGE
    without_tests = definition[: definition.index("[[tests]]")]  # whose starts would have to say the values
    (tmp_path / "sequences" / "fetch.toml").write_text(without_tests + recipe, "utf-8")
    plant, problems = read_plant(tmp_path)
    assert problems == []
    assert plant and plant.equipment["seq1"].sequence and list(plant.equipment["seq1"].sequence.recipe)
