"""The plant's files read anew: compared off the loop, shown before they are taken, and only what was shown is taken."""

import asyncio
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app import bundled
from app.plant.texts import Texts
from app.running import next_plant, plant_files
from tests.conftest import ROOT, PogonServer
from tests.reloading import DEMO, M3, running


@pytest.mark.sweep(8)
async def test_broken_files_leave_the_plant_as_it_is(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m1.frequency"))
        revision = runtime.tags.revision
        answer = await plant.take(DEMO.replace("unit = 2\n", "unit = 1\ncolour = 5\n"))
        assert not answer.done and answer.refused == "plant.refused.problems"
        assert len(answer.problems) == 2
        assert runtime.tags.revision == revision and plant.good("m2.frequency")
        assert not (await plant.take("[")).done
        assert (await plant.take(DEMO)).refused == "plant.refused.nothing"


@pytest.mark.sweep(8)
async def test_only_the_changes_that_were_read_are_taken(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        plant.write(DEMO + M3)
        seen = await plant.runtime.plant_files.look()
        plant.write(DEMO.replace("rated_current = 2.5", "rated_current = 3.5"))
        answer = await plant.runtime.plant_files.reload(None, seen.digest)
        assert not answer.done and answer.refused == "plant.refused.other"
        assert "m3.frequency" not in plant.runtime.tags


@pytest.mark.sweep(8)
async def test_reading_and_comparing_never_hold_the_loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, aside, on_loop = asyncio.get_running_loop(), [0], list[str]()
    in_executor = loop.run_in_executor

    def put_aside(executor: Any, func: Any, *args: Any) -> Any:
        aside[0] += 1
        try:
            return in_executor(executor, func, *args)
        finally:
            aside[0] -= 1

    def watched(name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def do(*args: Any) -> Any:
            if not aside[0]:
                on_loop.append(name)
            return work(*args)

        return do

    async with running(tmp_path) as plant:
        monkeypatch.setattr(loop, "run_in_executor", put_aside)
        for module, name in (
            *((plant_files, name) for name in ("read_simulated", "compare", "digest")),
            (next_plant, "Derivation"),
        ):
            monkeypatch.setattr(module, name, watched(name, getattr(module, name)))
        monkeypatch.setattr(Texts, "read", watched("Texts.read", Texts.read))
        assert (await plant.take(DEMO + M3)).done
        assert not on_loop


@pytest.fixture
def server(pogon_server: Callable[..., PogonServer], tmp_path: Path) -> PogonServer:
    folder = tmp_path / "plant"
    shutil.copytree(bundled("plants/demo"), folder)
    return pogon_server(plant=folder)


def pogon(server: PogonServer, *arguments: str, answer: str = "") -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("POGON_")}
    command = [sys.executable, "-m", "app.cli", "reload", "--data", str(server.data), *arguments]
    return subprocess.run(command, cwd=ROOT, env=clean, input=answer, capture_output=True, text=True, timeout=60)


@pytest.mark.sweep(20)
def test_the_command_line_says_what_changes_asks_and_takes_it(server: PogonServer, tmp_path: Path) -> None:
    file = tmp_path / "plant" / "plant.toml"
    assert pogon(server).stdout.strip() == "The plant files are the plant that runs."
    file.write_text(DEMO + M3, "utf-8")
    no = pogon(server, answer="n\n")
    assert "Equipment m3: new" in no.stdout and "Taken." not in no.stdout
    assert "Equipment m3: new" in pogon(server, "--look").stdout
    yes = pogon(server, "--yes")
    assert (yes.returncode, yes.stdout.splitlines()[-1]) == (0, "Taken."), yes.stderr
    file.write_text(DEMO.replace("unit = 2", "unit = 900"), "utf-8")
    broken = pogon(server, "--yes")
    assert broken.returncode == 2 and "plant.toml" in broken.stderr and "runs on as it is" in broken.stderr
    assert (server.data / "server.socket").stat().st_mode & 0o777 == 0o600
    assert server.stop() in (0, -15)
    gone = pogon(server)
    assert gone.returncode == 2 and "no server runs on it" in gone.stderr


@pytest.mark.sweep(8)
async def test_a_machine_that_runs_is_not_taken_away_without_a_word(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        await plant.until(lambda: runtime.tags.sample("m1.status").value == 1 and plant.good("m1.frequency"))
        await plant.until(lambda: plant.good("m2.status") and plant.good("c1.state"))
        without = DEMO[: DEMO.index("[equipment.m1]")] + DEMO[DEMO.index("[equipment.c1]") :]
        plant.write(without)
        seen = await runtime.plant_files.look()
        warned = {change.name: [effect.key for effect in change.effects] for change in seen.changes}
        assert "machine_runs" in warned["m1"] and "machine_runs" not in warned["m2"]
        taken = await runtime.plant_files.reload(None, seen.digest)
        assert taken.done, "that it ran or not is no other change"
