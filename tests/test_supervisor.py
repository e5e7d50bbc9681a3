"""Long tasks run on: an error is told and costs a pause, never a neighbour."""

import asyncio

import pytest

from app.supervisor import FIRST_PAUSE, LONGEST_PAUSE, SupervisedTask, Supervisor


class Worker:
    """Fails after `lives` [s] each, then runs for ever; remembers when it was started [s]."""

    def __init__(self, lives: list[float]) -> None:
        self.lives = list(lives)
        self.begun: list[float] = []

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        self.begun.append(loop.time())
        await asyncio.sleep(self.lives.pop(0) if self.lives else 1e6)
        raise RuntimeError("no luck")

    @property
    def gaps(self) -> list[float]:
        """Between two starts [s]."""
        return [round(after - before, 6) for before, after in zip(self.begun, self.begun[1:], strict=False)]


@pytest.mark.parametrize(
    ("lives", "gaps"),
    [
        ([0.0] * 7, [0.5, 1, 2, 4, 8, 10, 10]),
        ([5.0, 5.0], [5.5, 6]),
        ([0.0, 0.0, 61.0, 0.0], [0.5, 1, 61.5, 1]),
        ([60.0, 60.0], [60.5, 61]),
        ([], []),
    ],
)
async def test_a_failed_task_is_started_again_after_a_pause_that_grows_and_is_forgotten_after_a_minute(
    lives: list[float], gaps: list[float]
) -> None:
    assert (FIRST_PAUSE, LONGEST_PAUSE) == (0.5, 10.0)
    supervisor, worker = Supervisor(), Worker(lives)
    supervisor.start("worker", worker.run)
    await asyncio.sleep(500)
    assert worker.gaps == gaps
    assert supervisor.tasks["worker"].failures == len(lives)
    await supervisor.close()


async def test_a_failure_is_told_and_its_end_too_and_neighbours_never_notice() -> None:
    told: list[tuple[str, bool, str]] = []

    def changed(task: SupervisedTask) -> None:
        told.append((task.name, task.alive, task.error))

    supervisor, broken, good = Supervisor(changed), Worker([3.0]), Worker([])
    supervisor.start("broken", broken.run)
    supervisor.start("good", good.run)
    await asyncio.sleep(3.25)
    assert not all(task.alive for task in supervisor.tasks.values())
    await asyncio.sleep(3.25)
    assert all(task.alive for task in supervisor.tasks.values()) and len(good.begun) == 1
    error = "RuntimeError: no luck"
    assert told == [("broken", True, ""), ("good", True, ""), ("broken", False, error), ("broken", True, error)]
    await supervisor.close()


async def test_a_task_that_returns_is_finished_and_one_that_is_ended_is_gone() -> None:
    supervisor, runs = Supervisor(), list[int]()

    async def once() -> None:
        runs.append(1)

    worker = Worker([])
    supervisor.start("once", once)
    supervisor.start("worker", worker.run)
    await asyncio.sleep(100)
    assert runs == [1] and all(task.alive for task in supervisor.tasks.values())
    task = supervisor.tasks["worker"].task
    await supervisor.end("worker")
    await supervisor.end("nobody")
    assert task is not None and task.cancelled()
    assert list(supervisor.tasks) == ["once"]
    await supervisor.close()
    assert supervisor.tasks == {}


async def test_closing_ends_a_task_also_in_its_pause() -> None:
    supervisor, worker = Supervisor(), Worker([0.0] * 9)
    supervisor.start("worker", worker.run)
    await asyncio.sleep(2.0)
    begun = len(worker.begun)
    await supervisor.close()
    await asyncio.sleep(100)
    assert len(worker.begun) == begun
