"""The tasks of a plant: one for its simulation and for each link, those that stay run on, and all end with the plant."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from app.running.plant_tasks import PlantTasks
from app.supervisor import Supervisor


class Running:
    """Something that runs for ever, and how often it was begun."""

    def __init__(self) -> None:
        self.begun = 0

    async def run(self) -> None:
        self.begun += 1
        await asyncio.Event().wait()


@pytest.fixture
async def supervisor() -> AsyncIterator[Supervisor]:
    made = Supervisor()
    made.start("audit", Running().run)
    yield made
    await made.close()


async def test_what_has_a_task_gets_no_second_one(supervisor: Supervisor) -> None:
    tasks, sim, hall, yard = PlantTasks(supervisor), Running(), Running(), Running()
    for links in ({"hall": hall}, {"hall": hall, "yard": yard}):
        tasks.run(sim, links)  # type: ignore[arg-type]
        await asyncio.sleep(0)
    assert [one.begun for one in (sim, hall, yard)] == [1, 1, 1]
    assert set(supervisor.tasks) == {"audit", "simulation", "link.hall", "link.yard"}


async def test_links_that_go_or_change_end_and_the_others_run_on(supervisor: Supervisor) -> None:
    tasks, hall, yard, gone = PlantTasks(supervisor), Running(), Running(), Running()
    former = {"hall": hall, "yard": yard, "gone": gone}
    tasks.run(None, former)  # type: ignore[arg-type]
    await asyncio.sleep(0)
    now = {"hall": hall, "yard": Running()}
    await tasks.end_links(former, now)  # type: ignore[arg-type]
    assert set(supervisor.tasks) == {"audit", "link.hall"}
    tasks.run(None, now)  # type: ignore[arg-type]
    await asyncio.sleep(0)
    assert (hall.begun, yard.begun, now["yard"].begun) == (1, 1, 1)


async def test_without_a_plant_only_what_is_not_its_own_goes_on(supervisor: Supervisor) -> None:
    tasks, sim = PlantTasks(supervisor), Running()
    tasks.run(sim, {"hall": Running()})  # type: ignore[arg-type, dict-item]
    tasks.retain(Running().run, Running().run)
    tasks.follow_commands(Running().run)
    assert len(supervisor.tasks) == 6
    await tasks.end_simulation()
    assert "simulation" not in supervisor.tasks
    await tasks.end()
    assert set(supervisor.tasks) == {"audit"}
