"""Plant files taken anew while everything runs: what stays runs on, what is wrong changes nothing, history follows the lasting ids."""

import asyncio
import os
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from app import bundled
from app.plant.texts import Texts
from app.running import next_plant, plant_files
from app.runtime import Runtime
from app.settings import Settings
from app.tags.batch import Batch
from app.tags.quality import is_good
from tests.conftest import ROOT, PogonServer
from tests.virtual import inline, loop_clock

DEMO = (bundled("plants/demo") / "plant.toml").read_text("utf-8")
M3 = """
[equipment.m3]
type = "eura_e800"
link = "hall"
unit = 3
label = { hr = "Pumpa", en = "Pump", de = "Pumpe", cs = "Čerpadlo" }
rated_current = 2.5
"""


class Plant:
    """A plant folder, and the running plant of it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runtime: Runtime

    def write(self, text: str) -> None:
        self.folder.mkdir(exist_ok=True)
        shutil.copytree(bundled("plants/demo"), self.folder, dirs_exist_ok=True)
        (self.folder / "plant.toml").write_text(text, "utf-8")

    async def take(self, text: str) -> Any:
        """Write the file and take it, as a person does who reads the changes first."""
        self.write(text)
        seen = await self.runtime.plant_files.look()
        return await self.runtime.plant_files.reload(None, seen.digest)

    def good(self, name: str) -> bool:
        tags = self.runtime.tags
        return name in tags and is_good(tags.sample(name).quality)

    async def until(self, true: Callable[[], bool], limit: float = 30.0) -> None:
        end = asyncio.get_running_loop().time() + limit
        while not true():
            assert asyncio.get_running_loop().time() < end, "not in time"
            await asyncio.sleep(0.02)


@asynccontextmanager
async def running(tmp_path: Path, text: str = DEMO, **settings: Any) -> AsyncIterator[Plant]:
    plant = Plant(tmp_path / "plant")
    plant.write(text)
    plant.runtime = Runtime(Settings(plant=plant.folder, data=tmp_path / "data", **settings), loop_clock(), inline)
    await plant.runtime.start()
    try:
        yield plant
    finally:
        await plant.runtime.stop()


async def test_a_machine_is_added_and_its_neighbour_on_the_same_link_notices_nothing(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m1.frequency") and plant.good("m1.running_hours"))
        link, device = runtime.links["hall"], runtime.sim.devices["m1"]  # type: ignore[union-attr]
        station, task = link.stations[1], runtime.supervisor.tasks["link.hall"].task
        hours = runtime.tags.sample("m1.running_hours").value
        heard: list[tuple[str, int]] = []

        def note(batch: Batch) -> None:
            for index, handle in enumerate(batch.handles):
                quality = batch.quality if batch.qualities is None else batch.qualities[index]
                heard.append((runtime.tags.tags[handle].name, quality))

        runtime.tags.subscribe(note)
        answer = await plant.take(DEMO + M3)
        assert answer.done and [(c.kind, c.name) for c in answer.changes] == [("added", "m3")]
        assert plant.good("m1.frequency")
        assert runtime.tags.age(runtime.tags.handle("m1.frequency")) < 0.5
        assert float(runtime.tags.sample("m1.running_hours").value or 0) >= float(hours or 0)  # type: ignore[arg-type]
        await plant.until(lambda: plant.good("m3.frequency") and plant.good("m3.state_since"))
        await asyncio.sleep(0.5)
        assert not [(name, quality) for name, quality in heard if name.startswith("m1.") and not is_good(quality)]
        assert (runtime.links["hall"], link.stations[1]) == (link, station)
        assert runtime.supervisor.tasks["link.hall"].task is task and runtime.sim.devices["m1"] is device  # type: ignore[union-attr]
        assert {"m1", "m2", "m3"} <= set(runtime.gate._state.machines)  # type: ignore[union-attr]
        await runtime.links["hall"].write("m3", "f114", 7.0)
        await asyncio.sleep(0.1)  # the drive acts at its next step
        await runtime.links["hall"].refresh("m3", ["f114"])
        assert runtime.tags.sample("m3.f114").value == 7.0


async def test_a_clock_that_was_set_while_a_machine_is_taken_away_keeps_nobody_from_being_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(tmp_path, DEMO + M3) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m3.frequency"))
        await asyncio.sleep(1)
        plant.write(DEMO)
        seen = await runtime.plant_files.look()
        heard: list[int] = []
        runtime.tags.on_standstill(lambda still: heard.append(len(runtime.tags)))
        before, exchange = len(runtime.tags), runtime._exchange_plant

        def late(*given: Any) -> None:
            runtime.clock.step_wall(3600)  # type: ignore[attr-defined]
            exchange(*given)

        runtime._exchange_plant = late  # type: ignore[method-assign]
        assert (await runtime.plant_files.reload(None, seen.digest)).done
        await asyncio.sleep(1)
        assert heard == [before]
    assert "told of a standstill and failed" not in caplog.text


async def test_a_renamed_machine_takes_its_history_and_its_drive_along(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m1.frequency"))
        device = runtime.sim.devices["m1"]  # type: ignore[union-attr]
        text = DEMO.replace("[equipment.m1]", '[equipment.fan_west]\nwas = "m1"')
        answer = await plant.take(text)
        assert answer.done and [(c.kind, c.name) for c in answer.changes] == [("renamed", "fan_west")]
        assert runtime.sim.devices["fan_west"] is device  # type: ignore[union-attr]
        assert plant.good("fan_west.frequency") and "m1.frequency" not in runtime.tags
        assert runtime.tags.tags[runtime.tags.handle("fan_west.frequency")].id == "m1.frequency"
        await plant.until(lambda: runtime.links["hall"].words("fan_west.frequency") is not None)
        await runtime.recorder.flush()

        def numbers(connection: Any) -> list[tuple[Any, ...]]:
            sql = "SELECT lasting_id FROM point WHERE lasting_id LIKE '%.frequency'"
            return [tuple(row) for row in connection.exec_driver_sql(sql)]

        assert sorted(await runtime.history.read(numbers)) == [("m1.frequency",), ("m2.frequency",)]


async def test_a_machine_is_removed_and_comes_back_with_its_counters(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m1.running_hours"))
        runtime.derived.derivation._by_name["m1.starts"].value = 41.0  # type: ignore[union-attr]
        second = DEMO.replace(DEMO[DEMO.index("# Keeps running") : DEMO.index("# Hold-to-run works")], "")
        answer = await plant.take(second)
        assert answer.done and [(c.kind, c.name) for c in answer.changes] == [("removed", "m1")]
        assert "history_kept" in [effect.key for effect in answer.changes[0].effects]
        assert "m1.frequency" not in runtime.tags and 1 not in runtime.links["hall"].stations
        assert plant.good("m2.frequency")
        assert (await plant.take(DEMO)).done
        await plant.until(lambda: plant.good("m1.starts"))
        assert runtime.tags.sample("m1.starts").value == 41


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


async def test_only_the_changes_that_were_read_are_taken(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        plant.write(DEMO + M3)
        seen = await plant.runtime.plant_files.look()
        plant.write(DEMO.replace("rated_current = 2.5", "rated_current = 3.5"))
        answer = await plant.runtime.plant_files.reload(None, seen.digest)
        assert not answer.done and answer.refused == "plant.refused.other"
        assert "m3.frequency" not in plant.runtime.tags


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


async def test_an_error_while_taking_them_brings_the_former_plant_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m1.frequency"))
        gate, broken, before = runtime.gate, 1, set(runtime.plant.equipment)  # type: ignore[union-attr]
        assert gate is not None
        take = gate.take

        def fail(definitions: Any) -> None:
            nonlocal broken
            broken -= 1
            if broken == 0:
                raise RuntimeError("no room")
            take(definitions)

        monkeypatch.setattr(gate, "take", fail)
        answer = await plant.take(DEMO + M3)
        assert not answer.done and answer.refused == "plant.refused.failed" and "no room" in answer.error
        assert set(runtime.plant.equipment) == before  # type: ignore[union-attr]
        assert plant.good("m1.frequency")
        await asyncio.sleep(0.5)
        assert plant.good("m1.frequency") and "m3.frequency" not in runtime.tags
        assert runtime.tags.age(runtime.tags.handle("m1.frequency")) < 0.5
        assert (await plant.take(DEMO + M3)).done
        await plant.until(lambda: plant.good("m3.frequency"))


async def test_a_link_that_changed_is_opened_anew_and_the_others_run_on(tmp_path: Path) -> None:
    two = DEMO.replace("[links.hall]", '[links.yard]\ntransport = "memory"\n\n[links.hall]').replace(
        'link = "hall"\nunit = 2', 'link = "yard"\nunit = 2'
    )
    async with running(tmp_path, two) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m1.frequency") and plant.good("m2.frequency"))
        hall, yard = runtime.links["hall"], runtime.links["yard"]
        answer = await plant.take(
            two.replace('[links.yard]\ntransport = "memory"', '[links.yard]\ntransport = "memory"\nfast = 0.5')
        )
        assert answer.done and [(c.what, c.name) for c in answer.changes] == [("link", "yard")]
        assert runtime.links["hall"] is hall and runtime.links["yard"] is not yard
        assert plant.good("m1.frequency")
        await plant.until(lambda: plant.good("m2.frequency"))
        assert (await plant.take(DEMO)).done
        await plant.until(lambda: plant.good("m2.frequency"))
        assert "link.yard" not in runtime.supervisor.tasks and set(runtime.links) == {"hall", "line", "coil", "crane"}


async def test_a_plant_that_was_broken_at_the_start_is_started_when_it_is_mended(tmp_path: Path) -> None:
    async with running(tmp_path, DEMO.replace("unit = 2\n", "unit = 1\n")) as plant:
        assert plant.runtime.plant is None and plant.runtime.problems
        assert (await plant.take(DEMO)).done
        await plant.until(lambda: plant.good("m1.frequency") and plant.good("m2.speed"))
        assert not plant.runtime.problems and plant.runtime.simulated


async def test_a_drive_that_cannot_be_simulated_is_listed_and_the_server_runs(tmp_path: Path) -> None:
    async with running(tmp_path, DEMO.replace("F113 = 40.0", "F113 = 4000")) as plant:
        assert [problem.key for problem in plant.runtime.problems] == ["equipment.m1.simulation"]
        assert (await plant.take(DEMO)).done
        await plant.until(lambda: plant.good("m1.frequency"))


async def test_a_clash_on_the_served_port_is_told_before_anything_changes(tmp_path: Path, free_port: int) -> None:
    async with running(tmp_path, serve_modbus=f"127.0.0.1:{free_port}") as plant:
        await plant.until(lambda: plant.good("m1.frequency"))
        clash = M3.replace('"hall"', '"yard"').replace("unit = 3", "unit = 1")
        answer = await plant.take(
            DEMO.replace("[links.hall]", '[links.yard]\ntransport = "memory"\n[links.hall]') + clash
        )
        assert not answer.done and "unit 1" in answer.error
        assert plant.good("m1.frequency")
        assert (await plant.take(DEMO + M3)).done
        assert 3 in plant.runtime.modbus._bus.devices  # type: ignore[union-attr]


async def test_a_class_room_of_thirty_starts_and_polls_in_one_process(tmp_path: Path) -> None:
    text = DEMO[: DEMO.index("# Keeps running")] + M3.replace(
        "unit = 3", 'unit = 1\nrepeat = 30\nsimulation = { start = "forward" }'
    ).replace(".m3", ".desk")
    async with running(tmp_path, text) as plant:
        names = [f"desk_{number:02d}.frequency" for number in range(1, 31)]
        await plant.until(lambda: all(plant.good(name) for name in names))
        await asyncio.sleep(4)
        handles = [plant.runtime.tags.handle(name) for name in names]
        assert max(plant.runtime.tags.age(handle) for handle in handles) < 2


@pytest.fixture
def server(pogon_server: Callable[..., PogonServer], tmp_path: Path) -> PogonServer:
    folder = tmp_path / "plant"
    shutil.copytree(bundled("plants/demo"), folder)
    return pogon_server(plant=folder)


def pogon(server: PogonServer, *arguments: str, answer: str = "") -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("POGON_")}
    command = [sys.executable, "-m", "app.cli", "reload", "--data", str(server.data), *arguments]
    return subprocess.run(command, cwd=ROOT, env=clean, input=answer, capture_output=True, text=True, timeout=60)


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
