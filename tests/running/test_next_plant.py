"""Plant files taken anew while everything runs: what stays runs on, what is wrong changes nothing, history follows the lasting ids."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from app.tags.batch import Batch
from app.tags.quality import is_good
from tests.reloading import DEMO, M3, running


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
async def test_an_error_while_taking_them_brings_the_former_plant_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        await plant.until(lambda: plant.good("m1.frequency"))
        gate, broken, before = runtime.gate, 1, set(runtime.plant.equipment)  # type: ignore[union-attr]
        assert gate is not None
        take = gate.take

        def fail(definitions: Any, timezone: str) -> None:
            nonlocal broken
            broken -= 1
            if broken == 0:
                raise RuntimeError("no room")
            take(definitions, timezone)

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


@pytest.mark.sweep(8)
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
        assert "link.yard" not in runtime.supervisor.tasks and set(runtime.links) == {
            "hall",
            "line",
            "coil",
            "crane",
            "axis",
        }


@pytest.mark.sweep(8)
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
