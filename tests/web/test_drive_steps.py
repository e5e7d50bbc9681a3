"""The automatic steps of a drive are started from its page, and edited from there."""

import asyncio
import shutil
from pathlib import Path

import pytest

from app import bundled
from app.running.sequence_trial import try_out
from app.sim.plant import read_simulated
from tests.web.conftest import Start
from tests.web.people import Staff

PLANT = bundled("plants/drive_steps")


@pytest.mark.sweep(8)
def test_the_shipped_steps_run_the_drive_both_ways_for_ten_seconds() -> None:
    plant, problems = read_simulated(PLANT)
    assert plant is not None, problems
    trial = try_out(plant, "steps1")
    assert (trial.outcome, len(trial.steps)) == ("done", 4)
    lasted = [(one.left or 0) - one.entered for one in trial.steps]
    assert 9.9 < lasted[0] < 11 and 9.9 < lasted[2] < 11


@pytest.mark.sweep(8)
def test_the_page_of_the_drive_starts_its_steps_and_leads_to_their_editor(start: Start, tmp_path: Path) -> None:
    shutil.copytree(PLANT, tmp_path / "plant")
    staff = Staff(start(plant=tmp_path / "plant"))
    staff.enter("ivana", "engineer", "operator")
    staff.client.cookies.set("pogon_lang", "en")
    staff.wait(asyncio.sleep, 3)
    page = staff.client.get("/equipment/m1").text
    assert "Automatic steps 1" in page and 'data-command="steps1.start"' in page
    assert 'href="/equipment/steps1/definition"' in page
    staff.enter("petra", "operator")
    assert "/definition" not in staff.client.get("/equipment/m1").text
    assert 'data-command="steps1.start"' in staff.client.get("/equipment/m1").text
