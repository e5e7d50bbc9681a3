"""The running plant: it starts, also when its files are broken, and is whole again when they are mended."""

import asyncio
from pathlib import Path

import pytest

from tests.reloading import DEMO, M3, running


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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
